//! How long each way to gather takes to 1 % of error: errors with more and more directions at some of the points, times at all of them.
//!
//! The truth is that of exact rays on the same photon grid, so that the error is that of directions and layers alone.

use finalgather::Settings;
use finalgather::bench::{Bench, Contestant, Deviation, Plan, Where};
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::contestants::{self, color, crossing};
use crate::cornell::Cornell;
use crate::figure::{Figure, Result, Task};
use crate::machine::gpu;
use crate::plot::{self, Axis, Bar, Curve};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Relative RMSE that is to be reached.
    goal: f64,
    /// Side of the picture at whose points times are taken, along so many directions in so many rounds.
    size: u32,
    directions: u32,
    rounds: u32,
    /// Side of the one at whose points errors are.
    error_size: u32,
    /// Sequences of directions that an error is the mean of.
    seeds: u64,
    most_directions: u32,
    oracle_directions: u32,
}

#[derive(Serialize, Deserialize)]
pub struct TimeToError {
    goal: f64,
    /// Of the picture whose points times are of.
    size: u32,
    layer_size: u32,
    seeds: u64,
    error_points: usize,
    /// Both ends of each.
    oracle_directions: u32,
    runs: Vec<Run>,
}

#[derive(Serialize, Deserialize)]
struct Run {
    name: String,
    ms_per_direction: f64,
    /// Null where the most directions do not reach the goal.
    directions_to_goal: Option<f64>,
    seconds_to_goal: Option<f64>,
    errors: Vec<At>,
}

#[derive(Serialize, Deserialize)]
struct At {
    directions: u32,
    seconds: f64,
    relative_rmse: f64,
}

impl Figure for TimeToError {
    const KIND: &'static str = "time_to_error";
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let scale = task.scale;
        let gpu = gpu()?;
        let cornell = Cornell::load()?;
        let size = scale.of(parameters.size, 64);
        let settings = Settings { size: [size; 2], ..Settings::default() };
        let contestants = contestants::all();
        let bench = Bench::new(&gpu, cornell.scene.clone(), &settings, Where::Camera)?;
        let plan =
            Plan { directions: scale.of(parameters.directions, 4), rounds: parameters.rounds, stages: false, converged: 0 };
        let times: Vec<_> = bench.measure(&contestants, plan)?.into_iter().map(|row| row.ms_per_direction).collect();
        drop(bench);

        let points = cornell.camera_points(scale.of(parameters.error_size, 16))?;
        let error_points = points.len();
        let bench = Bench::new(&gpu, cornell.scene, &settings, Where::Points(points))?;
        let oracle_directions = scale.of(parameters.oracle_directions, 1 << 12);
        let truth = bench.converged(oracle_directions);
        let most = scale.of(parameters.most_directions, 256);
        let run = |(contestant, ms): (&&Contestant, f64)| run(&bench, contestant, &truth, ms, (parameters, most));
        let runs = contestants.iter().zip(times).map(run).collect::<Result<_>>()?;
        let layer_size = settings.layers();
        Ok(Self { goal: parameters.goal, size, layer_size, seeds: parameters.seeds, error_points, oracle_directions, runs })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let curve = |run: &Run| Curve {
            name: run.name.clone(),
            color: color(&run.name),
            faint: false,
            points: run.errors.iter().map(|at| (at.seconds, at.relative_rmse)).collect(),
        };
        let curves: Vec<_> = self.runs.iter().map(curve).collect();
        let bar = |run: &Run| {
            let note = |seconds: f64| format!("{seconds:.2} s, {:.0} directions", run.directions_to_goal.unwrap_or_default());
            let value = run.seconds_to_goal.map_or((0.0, "not reached".into()), |seconds| (seconds, note(seconds)));
            Bar { name: run.name.clone(), values: vec![value] }
        };
        let bars: Vec<_> = self.runs.iter().map(bar).collect();
        let points = format!("{0} x {0}", self.size);
        plot::svg((900, 560 + 44 * bars.len() as u32), |area| {
            let (above, below) = area.split_vertically(420);
            let [x, y] = plot::values(&curves);
            let seconds = Axis::log("seconds of gathering", x.into_iter(), plot::short);
            let error = Axis::log("relative RMSE", y.into_iter().chain([self.goal]), plot::percent);
            plot::lines(
                &above,
                &format!("Error of irradiance against time, Cornell box, {points}"),
                [&seconds, &error],
                &curves,
            )?;
            let x = Axis::linear("seconds", bars.iter().map(|bar| 1.6 * bar.values[0].0), plot::short);
            let title = format!("Time to {} of error", plot::percent(self.goal));
            plot::bars(&below, &title, &x, &[("seconds", plot::BLUE)], &bars)
        })
    }
}

/// Doubles the directions until the goal is reached.
fn run(
    bench: &Bench,
    contestant: &Contestant,
    truth: &[DVec3],
    ms_per_direction: f64,
    (parameters, most): (&Parameters, u32),
) -> Result<Run> {
    let Parameters { goal, seeds, .. } = *parameters;
    let mut gathers = (0..seeds).map(|seed| bench.converging(contestant, seed)).collect::<Result<Vec<_>, _>>()?;
    let mut errors = Vec::new();
    let mut directions = 32;
    while directions <= most && errors.last().is_none_or(|at: &At| at.relative_rmse > goal) {
        let mut squares = 0.0;
        for gather in &mut gathers {
            squares += Deviation::between(&gather.after(directions)?, truth).rmse.powi(2);
        }
        let seconds = 1e-3 * ms_per_direction * f64::from(directions);
        errors.push(At { directions, seconds, relative_rmse: (squares / seeds as f64).sqrt() });
        directions *= 2;
    }
    let curve: Vec<_> = errors.iter().map(|at| (f64::from(at.directions), at.relative_rmse)).collect();
    let directions_to_goal = crossing(&curve, goal);
    let seconds_to_goal = directions_to_goal.map(|directions| 1e-3 * ms_per_direction * directions);
    eprintln!("  {}: {seconds_to_goal:.2?} s", contestant.name);
    Ok(Run { name: contestant.name.to_owned(), ms_per_direction, directions_to_goal, seconds_to_goal, errors })
}
