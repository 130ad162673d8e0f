//! How long each way to gather takes to 1 % of error: errors with more and more directions at some of the points, times at all of them.
//!
//! The truth is that of exact rays on the same photon grid, so that the error is that of directions and layers alone.

use finalgather::Settings;
use finalgather::bench::{Bench, Contestant, Deviation, Plan, Where};
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::contestants::{self, color, crossing};
use crate::cornell::Cornell;
use crate::figure::{Figure, Result, Scale};
use crate::machine::gpu;
use crate::plot::{self, Axis, Bar, Curve};

/// Relative RMSE that is to be reached.
const GOAL: f64 = 0.01;
/// Sequences of directions that an error is the mean of.
const SEEDS: u64 = 2;
const MOST_DIRECTIONS: u32 = 8192;

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
    const NAME: &'static str = "time_to_error";
    const ABOUT: &'static str = "time until irradiance is 1 % off, for all pipelines and rays";

    fn measure(scale: Scale) -> Result<Self> {
        let gpu = gpu()?;
        let cornell = Cornell::load()?;
        let size = scale.of(512, 64);
        let settings = Settings { size: [size; 2], ..Settings::default() };
        let contestants = contestants::all();
        let bench = Bench::new(&gpu, cornell.scene.clone(), &settings, Where::Camera)?;
        let plan = Plan { directions: scale.of(32, 4), rounds: 3, stages: false, converged: 0 };
        let times: Vec<_> = bench.measure(&contestants, plan)?.into_iter().map(|row| row.ms_per_direction).collect();
        drop(bench);

        let points = cornell.camera_points(scale.of(48, 16))?;
        let error_points = points.len();
        let bench = Bench::new(&gpu, cornell.scene, &settings, Where::Points(points))?;
        let oracle_directions = scale.of(1 << 16, 1 << 12);
        let truth = bench.converged(oracle_directions);
        let most = scale.of(MOST_DIRECTIONS, 256);
        let run = |(contestant, ms): (&&Contestant, f64)| run(&bench, contestant, &truth, ms, most);
        let runs = contestants.iter().zip(times).map(run).collect::<Result<_>>()?;
        let layer_size = settings.layer_size;
        Ok(Self { goal: GOAL, size, layer_size, seeds: SEEDS, error_points, oracle_directions, runs })
    }

    fn draw(&self) -> Result<String> {
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
fn run(bench: &Bench, contestant: &Contestant, truth: &[DVec3], ms_per_direction: f64, most: u32) -> Result<Run> {
    let mut gathers = (0..SEEDS).map(|seed| bench.converging(contestant, seed)).collect::<Result<Vec<_>, _>>()?;
    let mut errors = Vec::new();
    let mut directions = 32;
    while directions <= most && errors.last().is_none_or(|at: &At| at.relative_rmse > GOAL) {
        let mut squares = 0.0;
        for gather in &mut gathers {
            squares += Deviation::between(&gather.after(directions)?, truth).rmse.powi(2);
        }
        let seconds = 1e-3 * ms_per_direction * f64::from(directions);
        errors.push(At { directions, seconds, relative_rmse: (squares / SEEDS as f64).sqrt() });
        directions *= 2;
    }
    let curve: Vec<_> = errors.iter().map(|at| (f64::from(at.directions), at.relative_rmse)).collect();
    let directions_to_goal = crossing(&curve, GOAL);
    let seconds_to_goal = directions_to_goal.map(|directions| 1e-3 * ms_per_direction * directions);
    eprintln!("  {}: {seconds_to_goal:.2?} s", contestant.name);
    Ok(Run { name: contestant.name.to_owned(), ms_per_direction, directions_to_goal, seconds_to_goal, errors })
}
