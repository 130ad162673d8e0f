//! Error of whole pictures against the time from the scene to the picture, beside path tracing on the CPU.

use std::time::Instant;

use finalgather::Pipeline;
use serde::{Deserialize, Serialize};

use crate::contestants::color;
use crate::figure::{Figure, Result, Task};
use crate::path_tracer::PathTracer;
use crate::picture::Pictures;
use crate::plot::{self, Axis, Curve};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    scene: String,
    /// Path of the path-traced picture, without its ending; its size is that of the pictures.
    reference: String,
    pipelines: Vec<Pipeline>,
    directions: Vec<u32>,
    /// To a pixel.
    paths: Vec<u32>,
}

#[derive(Serialize, Deserialize)]
pub struct PathTracing {
    size: usize,
    pub runs: Vec<Run>,
}

#[derive(Serialize, Deserialize)]
pub struct Run {
    pub name: String,
    pub pictures: Vec<At>,
}

#[derive(Serialize, Deserialize)]
pub struct At {
    /// Directions, or paths a pixel.
    samples: u32,
    /// From the scene to the picture, of a machine that may be shared.
    pub seconds: f64,
    bias: f64,
    pub relative_rmse: f64,
}

/// The name of path tracing.
pub const PATHS: &str = "path tracing";

impl Figure for PathTracing {
    const KIND: &'static str = "path_tracing";
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let pictures = Pictures::of(&parameters.scene, &parameters.reference)?;
        let size = pictures.path_traced().width;
        let mut runs = Vec::new();
        for &pipeline in &parameters.pipelines {
            let name = pipeline.name().to_owned();
            let at = |&directions: &u32| {
                let directions = task.scale.of(directions, 8);
                let start = Instant::now();
                let picture = pictures.render(&finalgather::Settings { pipeline, ..pictures.settings(directions) })?.0;
                let seconds = start.elapsed().as_secs_f64();
                let error = pictures.against_path_tracing(&picture)?;
                Ok(At { samples: directions, seconds, bias: error.bias, relative_rmse: error.relative_rmse })
            };
            runs.push(Run { name, pictures: parameters.directions.iter().map(at).collect::<Result<_>>()? });
        }

        let scene = pictures.loaded().world.flatten();
        let start = Instant::now();
        let mut tracer = PathTracer::new(&scene, size);
        let mut seconds = start.elapsed().as_secs_f64();
        let at = |&paths: &u32| {
            let paths = task.scale.of(paths, 1);
            let start = Instant::now();
            tracer.trace(paths);
            seconds += start.elapsed().as_secs_f64();
            let error = pictures.against_path_tracing(&tracer.picture())?;
            Ok(At { samples: paths, seconds, bias: error.bias, relative_rmse: error.relative_rmse })
        };
        runs.push(Run { name: PATHS.into(), pictures: parameters.paths.iter().map(at).collect::<Result<_>>()? });
        Ok(Self { size, runs })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let curve = |run: &Run| Curve {
            name: run.name.clone(),
            color: color(&run.name),
            faint: false,
            points: run.pictures.iter().map(|at| (at.seconds, at.relative_rmse)).collect(),
        };
        let curves: Vec<_> = self.runs.iter().map(curve).collect();
        let [x, y] = plot::values(&curves);
        plot::svg((900, 480), |area| {
            let seconds = Axis::log("seconds from the scene to the picture", x.into_iter(), plot::short);
            let error = Axis::log("relative RMSE", y.into_iter(), plot::percent);
            plot::lines(area, &format!("Error of the picture against time, {0} x {0}", self.size), [&seconds, &error], &curves)
        })
    }
}
