//! The parts of a picture's error: one setting at a time is made worse or better than the default.
//!
//! Each picture is compared with the path-traced one, which has noise too, and with the default's picture. The squares of two independent
//! errors add up. So where a better setting changes the picture little, that cause has a small share in the error.

use serde::{Deserialize, Serialize};

use crate::draw::{Axis, Bar, Panel, Unit, count, percent, plot};
use crate::figure::{Figure, Result, Task};
use crate::lab::{Image, LayerSize, Measured, Pictures, Pipeline, Settings};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    pipeline: Pipeline,
    directions: u32,
    /// The changes, one at a time. Exact rays are one more, in place of layers.
    layer_sizes: Vec<u32>,
    /// Of the default's number of directions.
    direction_factors: Vec<f64>,
    photons: Vec<u32>,
    grid_cells: Vec<u32>,
    light_samples: Vec<u32>,
    /// Another seed changes every random number. Its picture shows the size of all random errors.
    seeds: Vec<u64>,
}

#[derive(Serialize, Deserialize)]
pub struct Causes {
    directions: u32,
    runs: Vec<Run>,
}

#[derive(Serialize, Deserialize)]
struct Run {
    /// The setting that is changed, and its value; empty for the default run.
    cause: String,
    value: String,
    #[serde(flatten)]
    measured: Measured,
    /// Against the default run; of the two pictures' means and of their pixels.
    mean_from_default: f64,
    relative_rmse_from_default: f64,
}

/// Cause, value and settings of all runs, the default first.
fn changes(default: &Settings, parameters: &Parameters) -> Vec<(&'static str, String, Settings)> {
    let mut changes = vec![("", String::new(), *default)];
    let mut change = |cause, value: String, of: &dyn Fn(&mut Settings)| changes.push((cause, value, default.with(of)));
    for &size in &parameters.layer_sizes {
        change("layers", format!("{size}²"), &|s| s.gather.layer_size = LayerSize::Texels(size));
    }
    change("layers", "exact rays".into(), &|s| s.gather.pipeline = Pipeline::Raycast);
    for factor in &parameters.direction_factors {
        let directions = (f64::from(default.directions.count) * factor).round() as u32;
        change("directions", directions.to_string(), &|s| s.directions.count = directions);
    }
    for &photons in &parameters.photons {
        change("photons", count(photons), &|s| s.photons.count = photons.into());
    }
    for &cells in &parameters.grid_cells {
        change("grid cells", cells.to_string(), &|s| s.photons.grid_cells = cells);
    }
    for &samples in &parameters.light_samples {
        change("light samples", samples.to_string(), &|s| s.direct.light_samples = samples);
    }
    for &seed in &parameters.seeds {
        change("seed", seed.to_string(), &|s| s.seed = seed);
    }
    changes
}

impl Figure for Causes {
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let pictures = Pictures::new()?;
        let directions = task.scale.of(parameters.directions, 8);
        let mut default = pictures.settings(directions).with(|s| s.gather.pipeline = parameters.pipeline);
        // The default layer size depends on the number of directions, which some runs change.
        default.gather.layer_size = LayerSize::Texels(default.layers());
        let mut first: Option<Image> = None;
        let run = |(cause, value, settings): (&str, String, Settings)| {
            let found = pictures.measure(&settings)?;
            let (picture, measured) = (&found.picture, found.measured());
            let change = pictures.compare(picture, first.get_or_insert_with(|| picture.clone()))?;
            let [error, off] = [measured.relative_rmse, change.relative_rmse].map(percent);
            eprintln!("  {cause} {value}: {error}, {off} off the default");
            let (mean_from_default, relative_rmse_from_default) = (change.bias, change.relative_rmse);
            Ok(Run { cause: cause.to_owned(), value, measured, mean_from_default, relative_rmse_from_default })
        };
        Ok(Self { directions, runs: changes(&default, parameters).into_iter().map(run).collect::<Result<_>>()? })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let bar = |run: &Run| {
            let Measured { bias, relative_rmse, .. } = run.measured;
            let note = format!("{}, bias {:+.2} %", percent(relative_rmse), 100.0 * bias);
            let off = run.relative_rmse_from_default;
            let name = if run.cause.is_empty() { "default".into() } else { format!("{}: {}", run.cause, run.value) };
            Bar { name, values: vec![(relative_rmse, note), (off, percent(off))] }
        };
        let bars = self.runs.iter().map(bar).collect();
        let title = format!("Error of the Cornell box, 256 x 256, {} directions, one thing changed at a time", self.directions);
        let series = [("from path tracing", plot::BLUE), ("from the default run", plot::ORANGE)];
        plot::svg([Panel::bars(120, title, Axis::linear("relative RMSE", Unit::Percent), 1.0, &series, bars)])
    }
}
