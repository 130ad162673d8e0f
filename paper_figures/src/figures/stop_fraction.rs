//! The poster's stop criterion: error against path tracing and cost of the gather for each threshold.

use finalgather::{Pipeline, Settings};
use serde::{Deserialize, Serialize};

use crate::figure::{Figure, Result, Task};
use crate::picture::Pictures;
use crate::plot::{self, Axis, Curve};

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
    /// Of a machine that may be shared.
    gather_seconds: f64,
    bias: f64,
    pub relative_rmse: f64,
}

impl Figure for StopFraction {
    const KIND: &'static str = "stop_fraction";
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let scale = task.scale;
        let pictures = Pictures::new()?;
        let mut settings = Settings { pipeline: parameters.pipeline, ..pictures.settings(scale.of(parameters.directions, 8)) };
        let mut run = |stop_fraction| {
            settings.stop_fraction = stop_fraction;
            let (picture, statistics) = pictures.render(&settings)?;
            let error = pictures.against_path_tracing(&picture)?;
            Ok(Run {
                stop_fraction: stop_fraction.into(),
                layers_mean: statistics.gather.layers_mean,
                gather_seconds: statistics.seconds.gather,
                bias: error.bias,
                relative_rmse: error.relative_rmse,
            })
        };
        let runs = parameters.stop_fractions.iter().copied().map(&mut run).collect::<Result<_>>()?;
        Ok(Self { directions: settings.directions, runs })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let curve = |name: &str, color, of: fn(&Run) -> f64, text: fn(f64) -> String| {
            let (at_zero, others): (Vec<&Run>, Vec<&Run>) = self.runs.iter().partition(|run| run.stop_fraction == 0.0);
            let at_zero: String = at_zero.into_iter().map(|run| format!(" ({} at 0)", text(of(run)))).collect();
            let points = others.into_iter().map(|run| (run.stop_fraction, of(run))).collect();
            Curve { name: format!("{name}{at_zero}"), color, faint: false, points }
        };
        let errors = vec![
            curve("relative RMSE", plot::BLUE, |run| run.relative_rmse, |error| format!("{:.2} %", 100.0 * error)),
            curve("bias, absolute", plot::ORANGE, |run| run.bias.abs(), |error| format!("{:.2} %", 100.0 * error)),
        ];
        let layers = vec![curve("layers", plot::GREEN, |run| run.layers_mean, |layers| format!("{layers:.2}"))];
        let times = vec![curve("gather", plot::BLUE, |run| run.gather_seconds, |seconds| format!("{seconds:.1} s"))];
        plot::svg((900, 1100), |area| {
            let fractions: Vec<_> = self.runs.iter().map(|run| run.stop_fraction).filter(|&fraction| fraction > 0.0).collect();
            let x = Axis::log_at("stop fraction", &fractions, plot::percent);
            let of = |curves: &[Curve]| plot::values(curves)[1].clone().into_iter();
            let error = Axis::log("against path tracing", of(&errors), plot::percent);
            let (above, below) = area.split_vertically(420);
            let title = format!("Error of the Cornell box, 256 x 256, {} directions", self.directions);
            plot::lines(&above, &title, [&x, &error], &errors)?;
            let count = Axis::linear("layers a direction", of(&layers), plot::whole);
            let (middle, below) = below.split_vertically(340);
            plot::lines(&middle, "Layers peeled", [&x, &count], &layers)?;
            let seconds = Axis::linear("seconds", of(&times), plot::whole);
            plot::lines(&below, "Time of the gather", [&x, &seconds], &times)
        })
    }
}
