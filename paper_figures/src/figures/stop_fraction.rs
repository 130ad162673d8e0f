//! The poster's stop criterion: error against path tracing and cost of the gather for each threshold.

use serde::{Deserialize, Serialize};

use crate::draw::{Axis, Curve, Panel, Unit, percent, plot, seconds};
use crate::figure::{Figure, Result, Task};
use crate::lab::{Measured, Pictures, Pipeline};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    pipeline: Pipeline,
    directions: u32,
    stop_fractions: Vec<f32>,
}

#[derive(Serialize, Deserialize)]
pub struct StopFraction {
    directions: u32,
    pub runs: Vec<Run>,
}

#[derive(Serialize, Deserialize)]
pub struct Run {
    pub stop_fraction: f64,
    pub layers_mean: f64,
    #[serde(flatten)]
    pub measured: Measured,
}

impl Figure for StopFraction {
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let pictures = Pictures::new()?;
        let directions = task.scale.of(parameters.directions, 8);
        let run = |&stop_fraction: &f32| {
            let mut settings = pictures.settings(directions);
            (settings.gather.pipeline, settings.gather.stop_fraction) = (parameters.pipeline, stop_fraction);
            let found = pictures.measure(&settings)?;
            let layers_mean = found.statistics.gather.layers_mean;
            Ok(Run { stop_fraction: stop_fraction.into(), layers_mean, measured: found.measured() })
        };
        Ok(Self { directions, runs: parameters.stop_fractions.iter().map(run).collect::<Result<_>>()? })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let curve = |name: &str, color, text: fn(f64) -> String, of: fn(&Run) -> f64| {
            let (at_zero, others): (Vec<&Run>, Vec<&Run>) = self.runs.iter().partition(|run| run.stop_fraction == 0.0);
            let at_zero: String = at_zero.into_iter().map(|run| format!(" ({} at 0)", text(of(run)))).collect();
            Curve::new(format!("{name}{at_zero}"), color, others.into_iter().map(|run| (run.stop_fraction, of(run))))
        };
        let errors = vec![
            curve("relative RMSE", plot::BLUE, percent, |run| run.measured.relative_rmse),
            curve("bias, absolute", plot::ORANGE, percent, |run| run.measured.bias.abs()),
        ];
        let layers = vec![curve("layers", plot::GREEN, |layers| format!("{layers:.2}"), |run| run.layers_mean)];
        let times = vec![curve("gather", plot::BLUE, seconds, |run| run.measured.gather_seconds)];
        let fractions = self.runs.iter().map(|run| run.stop_fraction).filter(|&fraction| fraction > 0.0);
        let x = Axis::log_at("stop fraction", Unit::Percent, fractions);
        let title = format!("Error of the Cornell box, 256 x 256, {} directions", self.directions);
        let axes = |y| [x.clone(), y];
        plot::svg([
            Panel::lines(420, title, axes(Axis::log("against path tracing", Unit::Percent)), errors),
            Panel::lines(340, "Layers peeled", axes(Axis::linear("layers a direction", Unit::Number)), layers),
            Panel::lines(340, "Time of the gather", axes(Axis::linear("seconds", Unit::Number)), times),
        ])
    }
}
