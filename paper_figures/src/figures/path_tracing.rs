//! Error of whole pictures against the time from the scene to the picture, beside path tracing on the CPU.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::draw::{Axis, Curve, Panel, Unit, plot};
use crate::figure::{Figure, Result, Task};
use crate::lab::{PathTracer, Pictures, Pipeline};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    scene: String,
    /// Path of the path-traced picture, without its ending. Its size is that of the pictures.
    reference: String,
    pipelines: Vec<Pipeline>,
    directions: Vec<u32>,
    /// To a pixel.
    paths: Vec<u32>,
}

#[derive(Serialize, Deserialize)]
pub struct PathTracing {
    size: usize,
    runs: Vec<Run>,
}

#[derive(Serialize, Deserialize)]
struct Run {
    name: String,
    pictures: Vec<At>,
}

#[derive(Serialize, Deserialize)]
struct At {
    /// Directions, or paths a pixel.
    samples: u32,
    /// From the scene to the picture, on a machine that may be shared.
    seconds: f64,
    bias: f64,
    relative_rmse: f64,
}

impl Figure for PathTracing {
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let pictures = Pictures::of(&parameters.scene, &parameters.reference)?;
        let size = pictures.path_traced.width;
        let at = |samples, seconds, picture| {
            let error = pictures.against_path_tracing(&picture)?;
            Ok(At { samples, seconds, bias: error.bias, relative_rmse: error.relative_rmse })
        };
        let mut runs = Vec::new();
        for &pipeline in &parameters.pipelines {
            let gathered = |&directions: &u32| {
                let directions = task.scale.of(directions, 8);
                let start = Instant::now();
                let picture = pictures.render(&pictures.settings(directions).with(|s| s.gather.pipeline = pipeline))?.0;
                at(directions, start.elapsed().as_secs_f64(), picture)
            };
            let pictures = parameters.directions.iter().map(gathered).collect::<Result<_>>()?;
            runs.push(Run { name: pipeline.to_string(), pictures });
        }

        let scene = pictures.scene_in_unit_space();
        let start = Instant::now();
        let mut tracer = PathTracer::new(&scene, size);
        let mut seconds = start.elapsed().as_secs_f64();
        let traced = |&paths: &u32| {
            let paths = task.scale.of(paths, 1);
            let start = Instant::now();
            tracer.trace(paths);
            seconds += start.elapsed().as_secs_f64();
            at(paths, seconds, tracer.picture())
        };
        runs.push(Run { name: plot::PATH_TRACING.into(), pictures: parameters.paths.iter().map(traced).collect::<Result<_>>()? });
        Ok(Self { size, runs })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let points = |run: &Run| run.pictures.iter().map(|at| (at.seconds, at.relative_rmse)).collect::<Vec<_>>();
        let curves = self.runs.iter().map(|run| Curve::new(&run.name, plot::color(&run.name), points(run)));
        let title = format!("Error of the picture against time, {0} x {0}", self.size);
        let axes = [Axis::log("seconds from the scene to the picture", Unit::Number), Axis::log("relative RMSE", Unit::Percent)];
        plot::svg([Panel::lines(480, title, axes, curves.collect())])
    }
}
