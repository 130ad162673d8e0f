//! The poster's times beside ours, stage by stage, and how they grow with directions.

use std::time::Instant;

use finalgather::Pipeline;
use serde::{Deserialize, Serialize};

use crate::contestants::color;
use crate::figure::{Figure, Format, Result, Task};
use crate::html::{seconds, table};
use crate::machine::Machine;
use crate::picture::Pictures;
use crate::plot::{self, Axis, Curve};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// What the poster was measured on.
    poster_hardware: String,
    pipelines: Vec<Pipeline>,
    size: u32,
    pictures: Vec<Picture>,
}

/// A picture of the poster.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Picture {
    pub name: String,
    scene: String,
    reference: String,
    pub directions: u32,
    /// The poster's seconds for all and for the gather; it does not say all.
    pub poster_total: Option<f64>,
    pub poster_gather: f64,
}

#[derive(Serialize, Deserialize)]
pub struct Times {
    /// What it was measured on.
    hardware: String,
    size: u32,
    /// In the order of the declaration.
    pub pictures: Vec<OfPicture>,
}

#[derive(Serialize, Deserialize)]
pub struct OfPicture {
    pub declared: Picture,
    /// As many as were gathered along.
    pub directions: u32,
    points: u32,
    pub runs: Vec<Run>,
}

/// Seconds of a machine that may be shared.
#[derive(Serialize, Deserialize)]
pub struct Run {
    pub pipeline: String,
    pub photons: f64,
    pub visible_points: f64,
    pub direct: f64,
    pub gather: f64,
    /// Reading back and averaging too.
    pub total: f64,
    pub ms_per_direction: f64,
    /// A sample is one ray that counts at one point: with one end of a direction, at every other point.
    pub ns_per_sample: f64,
    pub layers_mean: f64,
    /// Share of the gather's device time that is peeling, of a shorter run; null where the driver tells no time.
    peel_share: Option<f64>,
    /// Directions, and the seconds of gathering until then.
    pub progress: Vec<(u32, f64)>,
    pub relative_rmse: f64,
}

/// Parts of a render after which the time is taken.
const PARTS: u32 = 8;

impl Figure for Times {
    const KIND: &'static str = "times";
    const FORMAT: Format = Format::Html;
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let size = task.scale.of(parameters.size, 32).next_power_of_two();
        let of_picture = |declared: &Picture| {
            let pictures = Pictures::of(&declared.scene, &declared.reference)?;
            let directions = task.scale.of(declared.directions, 2 * PARTS);
            let mut points = 0;
            let run = |&pipeline: &Pipeline| -> Result<Run> {
                let mut settings = pictures.settings(directions);
                (settings.size, settings.pipeline) = ([size; 2], pipeline);
                let start = Instant::now();
                let mut render = pictures.start(&settings)?;
                let mut progress = Vec::new();
                while !render.is_done() {
                    render.step()?;
                    let done = render.directions_done();
                    if done >= (progress.len() as u32 + 1) * directions / PARTS {
                        progress.push((done, render.statistics().seconds.gather));
                    }
                }
                let picture = render.picture();
                let total = start.elapsed().as_secs_f64();
                let statistics = render.statistics().clone();
                points = statistics.gather.points;
                let ends = if pipeline == Pipeline::Fused { 1.0 } else { 0.5 };
                let samples = ends * f64::from(points) * f64::from(directions);
                let pipeline = pipeline.name().to_owned();
                let of = statistics.seconds;
                eprintln!("  {} by {pipeline}: {:.1} s, gather {:.1} s", declared.name, total, of.gather);
                settings.directions = directions.div_ceil(PARTS);
                Ok(Run {
                    pipeline,
                    photons: of.photons,
                    visible_points: of.visible_points,
                    direct: of.direct,
                    gather: of.gather,
                    total,
                    ms_per_direction: statistics.gather.ms_per_direction,
                    ns_per_sample: 1e9 * of.gather / samples,
                    layers_mean: statistics.gather.layers_mean,
                    peel_share: pictures.share_of_stage("peel", &settings)?,
                    progress,
                    relative_rmse: pictures.against_path_tracing(&picture)?.relative_rmse,
                })
            };
            let runs = parameters.pipelines.iter().map(run).collect::<Result<_>>()?;
            Ok(OfPicture { declared: declared.clone(), directions, points, runs })
        };
        Ok(Self {
            hardware: Machine::here()?.described(),
            size,
            pictures: parameters.pictures.iter().map(of_picture).collect::<Result<_>>()?,
        })
    }

    fn draw(&self, parameters: &Parameters) -> Result<String> {
        let tables: String = self.pictures.iter().map(|picture| picture.table(self, parameters)).collect();
        Ok(format!("{tables}<div class=\"plot\">\n{}</div>\n", self.plot()?))
    }
}

impl OfPicture {
    fn table(&self, Times { hardware, size, .. }: &Times, parameters: &Parameters) -> String {
        let Self { declared, runs, points, directions } = self;
        let row = |name: &str, poster: Option<String>, of: &dyn Fn(&Run) -> String| {
            [name.to_owned(), poster.unwrap_or_default()].into_iter().chain(runs.iter().map(of)).collect::<Vec<_>>()
        };
        let of_share =
            |run: &Run, of: fn(f64) -> f64| run.peel_share.map_or(String::new(), |share| seconds(of(share) * run.gather));
        let per_direction = 1e3 * declared.poster_gather / f64::from(declared.directions);
        // At as many of its pixels as here.
        let poster_points = f64::from(*points) * (f64::from(parameters.size) / f64::from(*size)).powi(2);
        let per_sample = 1e6 * per_direction / (0.5 * poster_points);
        let rows = [
            row("Photons", None, &|run| seconds(run.photons)),
            row("Visible points", None, &|run| seconds(run.visible_points)),
            row("Direct light", None, &|run| seconds(run.direct)),
            row("<strong>Final gathering</strong>", Some(seconds(declared.poster_gather)), &|run| seconds(run.gather)),
            row("– of it peeling", None, &|run| of_share(run, |share| share)),
            row("– of it at the points", None, &|run| of_share(run, |share| 1.0 - share)),
            row("<strong>All</strong>", declared.poster_total.map(seconds), &|run| seconds(run.total)),
            row("Gather, a direction", Some(format!("{per_direction:.1} ms")), &|run| format!("{:.1} ms", run.ms_per_direction)),
            row("Gather, a sample", Some(format!("≈ {per_sample:.0} ns")), &|run| format!("{:.0} ns", run.ns_per_sample)),
            row("Layers, a direction", None, &|run| format!("{:.2}", run.layers_mean)),
            row("Relative RMSE", None, &|run| format!("{:.2} %", 100.0 * run.relative_rmse)),
        ];
        let head: Vec<_> = ["", "poster"].into_iter().chain(runs.iter().map(|run| run.pipeline.as_str())).collect();
        format!(
            "<p><strong>{}</strong>, {size} × {size} pixels, {points} visible points, {directions} directions, on {hardware}. The poster: \
             {1} directions on {2}; it does not say how many points, which are taken to be as many of its pixels as here.</p>\n{3}",
            declared.name,
            declared.directions,
            parameters.poster_hardware,
            table(&head, rows)
        )
    }
}

impl Times {
    fn plot(&self) -> Result<String> {
        let mut curves = Vec::new();
        for (i, OfPicture { declared, runs, .. }) in self.pictures.iter().enumerate() {
            curves.extend(runs.iter().map(|run| Curve {
                name: format!("{}, {}", run.pipeline, declared.name.to_lowercase()),
                color: color(&run.pipeline),
                faint: i == 0,
                points: run.progress.iter().map(|&(directions, seconds)| (directions.into(), seconds)).collect(),
            }));
        }
        let poster = self.pictures.iter().map(|OfPicture { declared, .. }| (declared.directions.into(), declared.poster_gather));
        let origin = [(0.0, 0.0)].into_iter();
        curves.push(Curve { name: "the poster".into(), color: plot::GREY, faint: true, points: origin.chain(poster).collect() });
        let [x, y] = plot::values(&curves);
        plot::svg((900, 520), |area| {
            let directions = Axis::linear("directions", x.into_iter(), plot::whole);
            let seconds = Axis::linear("seconds of gathering", y.into_iter(), plot::whole);
            plot::lines(area, &format!("Time against directions, {0} x {0}", self.size), [&directions, &seconds], &curves)
        })
    }
}
