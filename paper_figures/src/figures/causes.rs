//! What a picture's error is made of: from the default settings, one thing at a time is made worse or better.
//!
//! Each picture is held against the path-traced one, which has noise of its own, and against the default's: where two errors are
//! independent, the squares of their sizes add up, and a cause whose cure changes little has a small share.

use finalgather::settings::LayerSize;
use finalgather::{Image, Pipeline, Settings};
use serde::{Deserialize, Serialize};

use crate::figure::{Figure, Result, Task};
use crate::picture::Pictures;
use crate::plot::{self, Axis, Bar};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    pipeline: Pipeline,
    directions: u32,
    /// What is changed, one at a time; beside layers of these sizes, exact rays.
    layer_sizes: Vec<u32>,
    /// As many times the directions.
    direction_factors: Vec<f64>,
    photons: Vec<u32>,
    grid_cells: Vec<u32>,
    light_samples: Vec<u32>,
    /// Which tell how far two pictures are apart that differ in every random number.
    seeds: Vec<u64>,
}

#[derive(Serialize, Deserialize)]
pub struct Causes {
    directions: u32,
    runs: Vec<Run>,
}

#[derive(Serialize, Deserialize)]
struct Run {
    /// What is not as by default, and how it is; empty for the default run.
    cause: String,
    value: String,
    /// Against path tracing.
    bias: f64,
    relative_rmse: f64,
    /// Against the default run; of the two pictures' means and of their pixels.
    mean_from_default: f64,
    relative_rmse_from_default: f64,
    gather_seconds: f64,
}

/// Settings that differ from the default in one thing.
struct Change {
    cause: &'static str,
    value: String,
    settings: Settings,
}

/// All runs but the default.
fn changes(default: &Settings, parameters: &Parameters) -> Vec<Change> {
    let mut changes = Vec::new();
    let mut change = |cause, value: String, of: &dyn Fn(&mut Settings)| {
        let mut settings = default.clone();
        of(&mut settings);
        changes.push(Change { cause, value, settings });
    };
    for &size in &parameters.layer_sizes {
        change("layers", format!("{size}²"), &|settings| settings.layer_size = LayerSize::Texels(size));
    }
    change("layers", "exact rays".into(), &|settings| settings.pipeline = Pipeline::Raycast);
    for factor in &parameters.direction_factors {
        let directions = (f64::from(default.directions) * factor).round() as u32;
        change("directions", directions.to_string(), &|settings| settings.directions = directions);
    }
    for &photons in &parameters.photons {
        change("photons", plot::count(photons), &|settings| settings.photons = photons.into());
    }
    for &cells in &parameters.grid_cells {
        change("grid cells", cells.to_string(), &|settings| settings.grid_cells = cells);
    }
    for &samples in &parameters.light_samples {
        change("light samples", samples.to_string(), &|settings| settings.light_samples = samples);
    }
    for &seed in &parameters.seeds {
        change("seed", seed.to_string(), &|settings| settings.seed = seed);
    }
    changes
}

impl Figure for Causes {
    const KIND: &'static str = "causes";
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let scale = task.scale;
        let pictures = Pictures::new()?;
        // Of both ends, rays on the CPU have one only.
        let mut default = Settings { pipeline: parameters.pipeline, ..pictures.settings(scale.of(parameters.directions, 8)) };
        // For more directions would have finer ones.
        default.layer_size = LayerSize::Texels(default.layers());
        let changes = changes(&default, parameters);
        let mut first: Option<Image> = None;
        let mut run = |Change { cause, value, settings }| {
            let (picture, statistics) = pictures.render(&settings)?;
            let default = first.get_or_insert_with(|| picture.clone());
            let (error, change) = (pictures.against_path_tracing(&picture)?, pictures.compare(&picture, default)?);
            eprintln!(
                "  {cause} {value}: {:.2} %, {:.2} % off the default",
                100.0 * error.relative_rmse,
                100.0 * change.relative_rmse
            );
            Ok(Run {
                cause: cause.to_owned(),
                value,
                bias: error.bias,
                relative_rmse: error.relative_rmse,
                mean_from_default: change.bias,
                relative_rmse_from_default: change.relative_rmse,
                gather_seconds: statistics.seconds.gather,
            })
        };
        let by_default = Change { cause: "", value: String::new(), settings: default.clone() };
        let runs = [by_default].into_iter().chain(changes).map(&mut run).collect::<Result<_>>()?;
        Ok(Self { directions: default.directions, runs })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let bar = |run: &Run| Bar {
            name: if run.cause.is_empty() { "default".into() } else { format!("{}: {}", run.cause, run.value) },
            values: vec![
                (run.relative_rmse, format!("{:.2} %, bias {:+.2} %", 100.0 * run.relative_rmse, 100.0 * run.bias)),
                (run.relative_rmse_from_default, format!("{:.2} %", 100.0 * run.relative_rmse_from_default)),
            ],
        };
        let bars: Vec<_> = self.runs.iter().map(bar).collect();
        let title = format!("Error of the Cornell box, 256 x 256, {} directions, one thing changed at a time", self.directions);
        plot::svg((900, 120 + 44 * bars.len() as u32), |area| {
            let x = Axis::linear("relative RMSE", bars.iter().flat_map(|bar| &bar.values).map(|value| value.0), plot::percent);
            plot::bars(area, &title, &x, &[("from path tracing", plot::BLUE), ("from the default run", plot::ORANGE)], &bars)
        })
    }
}
