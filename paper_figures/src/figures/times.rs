//! The poster's times beside ours, stage by stage, and how they grow with directions.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::draw::{Axis, Curve, Panel, Unit, percent, plot, plot_in_page, seconds, table};
use crate::figure::{Figure, Format, Result, Task};
use crate::lab::{Machine, Pictures, Pipeline, Stages};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Of the poster's measurements.
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
    /// Of this measurement.
    hardware: String,
    size: u32,
    /// In the order of the declaration.
    pub pictures: Vec<OfPicture>,
}

#[derive(Serialize, Deserialize)]
pub struct OfPicture {
    pub declared: Picture,
    /// Of this run; fewer than declared at a small scale.
    pub directions: u32,
    points: u32,
    pub runs: Vec<Run>,
}

/// Seconds of a machine that may be shared.
#[derive(Serialize, Deserialize)]
pub struct Run {
    pub pipeline: String,
    #[serde(flatten)]
    pub stages: Stages,
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
                (settings.film.size, settings.gather.pipeline) = ([size; 2], pipeline);
                let mut progress: Vec<(u32, f64)> = Vec::new();
                let start = Instant::now();
                let (picture, statistics) = pictures.render_in_steps(&settings, |done, seconds| {
                    if done >= (progress.len() as u32 + 1) * directions / PARTS {
                        progress.push((done, seconds));
                    }
                })?;
                let total = start.elapsed().as_secs_f64();
                points = statistics.gather.points;
                let ends = if pipeline == Pipeline::Fused { 1.0 } else { 0.5 };
                let samples = ends * f64::from(points) * f64::from(directions);
                let pipeline = pipeline.to_string();
                let stages = Stages::of(&statistics);
                eprintln!("  {} by {pipeline}: {total:.1} s, gather {:.1} s", declared.name, stages.gather);
                settings.directions.count = directions.div_ceil(PARTS);
                Ok(Run {
                    pipeline,
                    stages,
                    total,
                    ms_per_direction: statistics.gather.ms_per_direction,
                    ns_per_sample: 1e9 * stages.gather / samples,
                    layers_mean: statistics.gather.layers_mean,
                    peel_share: pictures.share_of_stage("peel", &settings)?,
                    progress,
                    relative_rmse: pictures.against_path_tracing(&picture)?.relative_rmse,
                })
            };
            let runs = parameters.pipelines.iter().map(run).collect::<Result<_>>()?;
            Ok(OfPicture { declared: declared.clone(), directions, points, runs })
        };
        let pictures = parameters.pictures.iter().map(of_picture).collect::<Result<_>>()?;
        Ok(Self { hardware: Machine::here()?.described(), size, pictures })
    }

    fn draw(&self, parameters: &Parameters) -> Result<String> {
        let tables: String = self.pictures.iter().map(|picture| picture.table(self, parameters)).collect();
        Ok(tables + &plot_in_page(&self.plot()?))
    }
}

impl OfPicture {
    fn table(&self, Times { hardware, size, .. }: &Times, parameters: &Parameters) -> String {
        let Self { declared, runs, points, directions } = self;
        let row = |name: &str, poster: Option<String>, of: &dyn Fn(&Run) -> String| {
            [name.to_owned(), poster.unwrap_or_default()].into_iter().chain(runs.iter().map(of)).collect::<Vec<_>>()
        };
        let of_share =
            |run: &Run, of: fn(f64) -> f64| run.peel_share.map_or(String::new(), |share| seconds(of(share) * run.stages.gather));
        let per_direction = 1e3 * declared.poster_gather / f64::from(declared.directions);
        // Assumes the same share of pixels with points as here.
        let poster_points = f64::from(*points) * (f64::from(parameters.size) / f64::from(*size)).powi(2);
        let per_sample = 1e6 * per_direction / (0.5 * poster_points);
        let rows = [
            row("Photons", None, &|run| seconds(run.stages.photons)),
            row("Visible points", None, &|run| seconds(run.stages.visible_points)),
            row("Direct light", None, &|run| seconds(run.stages.direct)),
            row("<strong>Final gathering</strong>", Some(seconds(declared.poster_gather)), &|run| seconds(run.stages.gather)),
            row("– of it peeling", None, &|run| of_share(run, |share| share)),
            row("– of it at the points", None, &|run| of_share(run, |share| 1.0 - share)),
            row("<strong>All</strong>", declared.poster_total.map(seconds), &|run| seconds(run.total)),
            row("Gather, a direction", Some(format!("{per_direction:.1} ms")), &|run| format!("{:.1} ms", run.ms_per_direction)),
            row("Gather, a sample", Some(format!("≈ {per_sample:.0} ns")), &|run| format!("{:.0} ns", run.ns_per_sample)),
            row("Layers, a direction", None, &|run| format!("{:.2}", run.layers_mean)),
            row("Relative RMSE", None, &|run| percent(run.relative_rmse)),
        ];
        let head: Vec<_> = ["", "poster"].into_iter().chain(runs.iter().map(|run| run.pipeline.as_str())).collect();
        format!(
            "<p><strong>{}</strong>, {size} × {size} pixels, {points} visible points, {directions} directions, on {hardware}. The poster: \
             {1} directions on {2}; it does not state the number of points. The table assumes the same share of pixels as here.</p>\n{3}",
            declared.name,
            declared.directions,
            parameters.poster_hardware,
            table(&head, rows)
        )
    }
}

impl Times {
    fn plot(&self) -> Result<String> {
        let curve = |run: &Run, of: &str, faint| {
            let name = format!("{}, {}", run.pipeline, of.to_lowercase());
            Curve::new(name, plot::color(&run.pipeline), run.progress.iter().copied()).faint(faint)
        };
        let of_picture = |(i, OfPicture { declared, runs, .. }): (usize, &OfPicture)| {
            runs.iter().map(|run| curve(run, &declared.name, i == 0)).collect::<Vec<_>>()
        };
        let mut curves: Vec<_> = self.pictures.iter().enumerate().flat_map(of_picture).collect();
        let poster = self.pictures.iter().map(|OfPicture { declared, .. }| (declared.directions, declared.poster_gather));
        curves.push(Curve::new("the poster", plot::GREY, [(0, 0.0)].into_iter().chain(poster)).faint(true));
        let axes = [Axis::linear("directions", Unit::Number), Axis::linear("seconds of gathering", Unit::Number)];
        plot::svg([Panel::lines(520, format!("Time against directions, {0} x {0}", self.size), axes, curves)])
    }
}
