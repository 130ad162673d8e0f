//! The poster's stop criterion: error against path tracing and cost of the gather for each threshold.

use finalgather::{Pipeline, Settings};
use serde::{Deserialize, Serialize};

use crate::figure::{Figure, Result, Scale};
use crate::picture::Pictures;
use crate::plot::{self, Axis, Curve};

#[derive(Serialize, Deserialize)]
pub struct StopFraction {
    directions: u32,
    runs: Vec<Run>,
}

#[derive(Serialize, Deserialize)]
struct Run {
    stop_fraction: f64,
    layers_mean: f64,
    /// Of a machine that may be shared.
    gather_seconds: f64,
    bias: f64,
    relative_rmse: f64,
}

const STOP_FRACTIONS: [f32; 7] = [0.0, 0.0003, 0.001, 0.003, 0.01, 0.03, 0.1];

impl Figure for StopFraction {
    const NAME: &'static str = "stop_fraction";
    const ABOUT: &'static str = "error and cost of a picture against the stop threshold";

    fn measure(scale: Scale) -> Result<Self> {
        let pictures = Pictures::new()?;
        let mut settings = Settings { pipeline: Pipeline::Kill, ..pictures.settings(scale) };
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
        let runs = STOP_FRACTIONS.into_iter().map(&mut run).collect::<Result<_>>()?;
        Ok(Self { directions: settings.directions, runs })
    }

    fn draw(&self) -> Result<String> {
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
        plot::svg((900, 760), |area| {
            let fractions: Vec<_> = self.runs.iter().map(|run| run.stop_fraction).filter(|&fraction| fraction > 0.0).collect();
            let x = Axis::log_at("stop fraction", &fractions, plot::percent);
            let of = |curves: &[Curve]| plot::values(curves)[1].clone().into_iter();
            let error = Axis::log("against path tracing", of(&errors), plot::percent);
            let (above, below) = area.split_vertically(420);
            let title = format!("Error of the Cornell box, 256 x 256, {} directions", self.directions);
            plot::lines(&above, &title, [&x, &error], &errors)?;
            let count = Axis::linear("layers a direction", of(&layers), plot::whole);
            plot::lines(&below, "Layers peeled", [&x, &count], &layers)
        })
    }
}
