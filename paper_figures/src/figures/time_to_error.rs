//! How long each way to gather takes to 1 % of error: errors with more and more directions at some of the points, times at all of them.
//!
//! The truth comes from exact rays on the same photon grid, so that only directions and layers make the error.

use serde::{Deserialize, Serialize};

use crate::draw::{Axis, Bar, Curve, Panel, Unit, plot, short_percent};
use crate::figure::{Figure, Result, Task};
use crate::lab::{Bench, BenchPlan, CONTESTANTS, Contestant, Cornell, Deviation, Settings, Where, crossing, gpu};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Relative RMSE that is to be reached.
    goal: f64,
    /// Side of the picture at whose points times are taken, along so many directions in so many rounds.
    size: u32,
    directions: u32,
    rounds: u32,
    /// Side of the picture at whose points errors are taken.
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
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let scale = task.scale;
        let &Parameters { goal, rounds, seeds, .. } = parameters;
        let (gpu, cornell) = (gpu()?, Cornell::load()?);
        let size = scale.of(parameters.size, 64);
        let settings = Settings::default().with(|s| s.film.size = [size; 2]);
        let contestants: Vec<_> = CONTESTANTS.iter().collect();
        let plan = BenchPlan { directions: scale.of(parameters.directions, 4), rounds, stages: false, converged: 0 };
        let times = Bench::new(&gpu, cornell.scene.clone(), &settings, Where::Camera)?.measure(&contestants, plan)?;

        let points = cornell.camera_points(scale.of(parameters.error_size, 16))?;
        let error_points = points.len();
        let bench = Bench::new(&gpu, cornell.scene, &settings, Where::Points(points))?;
        let oracle_directions = scale.of(parameters.oracle_directions, 1 << 12);
        let truth = bench.converged(oracle_directions);
        let most = scale.of(parameters.most_directions, 256);
        // Doubles the directions until the goal is reached.
        let run = |contestant: &Contestant, ms_per_direction: f64| {
            let mut gathers = (0..seeds).map(|seed| bench.converging(contestant, seed)).collect::<Result<Vec<_>, _>>()?;
            let mut errors = Vec::new();
            let mut directions = 32;
            while directions <= most && errors.last().is_none_or(|at: &At| at.relative_rmse > goal) {
                let mut squares = 0.0;
                for gather in &mut gathers {
                    squares += Deviation::between(&gather.after(directions)?, &truth).rmse.powi(2);
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
        };
        let runs = CONTESTANTS.iter().zip(times).map(|(contestant, row)| run(contestant, row.ms_per_direction));
        let runs = runs.collect::<Result<_>>()?;
        Ok(Self { goal, size, layer_size: settings.layers(), seeds, error_points, oracle_directions, runs })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let points = |run: &Run| run.errors.iter().map(|at| (at.seconds, at.relative_rmse)).collect::<Vec<_>>();
        let curves = self.runs.iter().map(|run| Curve::new(&run.name, plot::color(&run.name), points(run)));
        let bar = |run: &Run| {
            let note = |seconds: f64| format!("{seconds:.2} s, {:.0} directions", run.directions_to_goal.unwrap_or_default());
            let value = run.seconds_to_goal.map_or((0.0, "not reached".into()), |seconds| (seconds, note(seconds)));
            Bar { name: run.name.clone(), values: vec![value] }
        };
        let bars = self.runs.iter().map(bar).collect();
        let title = format!("Error of irradiance against time, Cornell box, {0} x {0}", self.size);
        let title_of_bars = format!("Time to {} of error", short_percent(self.goal));
        let axes = [Axis::log("seconds of gathering", Unit::Number), Axis::log("relative RMSE", Unit::Percent).over([self.goal])];
        plot::svg([
            Panel::lines(420, title, axes, curves.collect()),
            Panel::bars(140, title_of_bars, Axis::linear("seconds", Unit::Number), 1.6, &[("seconds", plot::BLUE)], bars),
        ])
    }
}
