//! Error of the irradiance against the number of shared directions, for each sequence and two estimators.
//!
//! Exact rays look at one photon grid, so that layers and photons make no difference. The plain estimator is
//! E = 4π/N Σ L w over directions d uniform on the sphere, with w = max(n·d, 0). The self-normalised one, which renders use, is
//! E = π Σ L w / Σ w. Very many directions give the truth.

use std::f64::consts::PI;

use glam::{DVec3, DVec4};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::draw::{Axis, Curve, Panel, Unit, plot};
use crate::figure::{Figure, Result, Task};
use crate::lab::{Cornell, Estimator, Sequence, Settings, fit, relative_rmse};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    sequences: Vec<Sequence>,
    seeds: u32,
    /// Side of the picture whose points gather.
    size: u32,
    most_directions: u32,
    /// As many times the most directions make the truth.
    truth_factor: u32,
}

#[derive(Serialize, Deserialize)]
pub struct Convergence {
    points: usize,
    seeds: u32,
    photons: u64,
    grid_cells: u32,
    /// Sobol directions of the truth.
    truth_directions: u32,
    /// Lines are fitted to the errors at these numbers of directions.
    fitted: [u32; 2],
    directions: Vec<u32>,
    /// Of the Cornell box's irradiance.
    irradiance: Vec<Errors>,
    /// Of the plain estimator where radiance is 1 everywhere; the other has none. √(5/3)/√N is that of independent directions.
    constant: Vec<Errors>,
    /// Which sequence has the smallest error; its lead is the error of the second best over its own.
    winners: Vec<Value>,
}

/// Relative errors at each number of directions.
#[derive(Serialize, Deserialize)]
struct Errors {
    sequence: Sequence,
    estimator: Estimator,
    /// Least squares over logarithms: the error is about `at_1` × N^`slope`.
    slope: f64,
    at_1: f64,
    /// Root mean square over points, channels and seeds, as a share of the mean.
    relative_rmse: Vec<f64>,
    /// Standard deviation over seeds of the same for one seed.
    spread: Vec<f64>,
}

const ESTIMATORS: [Estimator; 2] = [Estimator::Plain, Estimator::SelfNormalised];

impl Figure for Convergence {
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let scale = task.scale;
        let cornell = Cornell::load()?;
        let settings = Settings::default();
        let photons = u64::from(scale.of(settings.photons.count as u32, 1));
        let grid = cornell.photon_grid(&settings, 0..photons);
        let points = cornell.camera_points(scale.of(parameters.size, 4))?;

        let most = scale.of(parameters.most_directions, 256);
        let directions: Vec<u32> = (4..).map(|power| 1 << power).take_while(|&n| n <= most).collect();
        let fitted = [64, directions[directions.len() - 1]];
        let truth_directions = parameters.truth_factor * fitted[1];
        let truth = cornell.sums(&grid, &points, (Sequence::Sobol, u64::MAX), &[truth_directions]).remove(0);
        let truth = estimate(Estimator::SelfNormalised, truth, truth_directions);
        let ones = vec![DVec3::splat(PI); points.len()];

        let seeds = scale.of(parameters.seeds, 2);
        let (mut irradiance, mut constant) = (Vec::new(), Vec::new());
        for &sequence in &parameters.sequences {
            // By seed, then by number of directions.
            let sums = |seed: u32| cornell.sums(&grid, &points, (sequence, seed.into()), &directions);
            let sums: Vec<_> = (0..seeds).map(sums).collect();
            let errors = |estimator: Estimator, truth: &[DVec3], of: fn(DVec4) -> DVec4| {
                let error = |sums: &Vec<DVec4>, n| relative_rmse(&estimate(estimator, sums.iter().map(|&sum| of(sum)), n), truth);
                let of_seeds = |(i, &n)| sums.iter().map(|sums| error(&sums[i], n)).collect::<Vec<_>>();
                let by_seed: Vec<_> = directions.iter().enumerate().map(of_seeds).collect();
                Errors::new((sequence, estimator), &directions, fitted, &by_seed)
            };
            irradiance.extend(ESTIMATORS.map(|estimator| errors(estimator, &truth, |sum| sum)));
            constant.push(errors(Estimator::Plain, &ones, |sum| DVec4::splat(sum.w)));
        }
        let (points, grid_cells, winners) = (points.len(), settings.photons.grid_cells, winners(&directions, &irradiance));
        Ok(Self { points, seeds, photons, grid_cells, truth_directions, fitted, directions, irradiance, constant, winners })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let curves = |errors: &[Errors]| errors.iter().map(|errors| self.curve(errors)).collect::<Vec<_>>();
        let closed_form = self.directions.iter().map(|&n| (n, (5.0 / 3.0 / f64::from(n)).sqrt()));
        let mut constant = curves(&self.constant);
        constant.push(Curve::new("√(5/3)/√N", plot::GREY, closed_form).faint(true));
        let x = Axis::log_at("shared directions N", Unit::Number, self.directions.iter().copied());
        let axes = [x, Axis::log("relative RMSE", Unit::Percent)];
        let title = format!("Irradiance in the Cornell box, slopes fitted from N = {} to {}", self.fitted[0], self.fitted[1]);
        let title_of_constant = "The same where radiance is 1: self-normalised sums have no error";
        plot::svg([
            Panel::lines(500, title, axes.clone(), curves(&self.irradiance)),
            Panel::lines(420, title_of_constant, axes, constant),
        ])
    }
}

impl Convergence {
    fn curve(&self, errors: &Errors) -> Curve {
        let (name, color) = match errors.sequence {
            Sequence::Random => ("random", plot::ORANGE),
            Sequence::R2 => ("R2", plot::BLUE),
            Sequence::Sobol => ("Sobol", plot::GREEN),
        };
        let is_plain = errors.estimator == Estimator::Plain;
        let estimator = if is_plain { "plain" } else { "self-normalised" };
        let points = self.directions.iter().copied().zip(errors.relative_rmse.iter().copied());
        Curve::new(format!("{name}, {estimator}: {:.2}", errors.slope), color, points).faint(is_plain)
    }
}

/// Irradiance from the sums over this many directions.
fn estimate(estimator: Estimator, sums: impl IntoIterator<Item = DVec4>, directions: u32) -> Vec<DVec3> {
    let of = |sum: DVec4| match estimator {
        Estimator::Plain => 4.0 * PI / f64::from(directions) * sum.truncate(),
        Estimator::SelfNormalised if sum.w > 0.0 => PI * sum.truncate() / sum.w,
        Estimator::SelfNormalised => DVec3::ZERO,
    };
    sums.into_iter().map(of).collect()
}

impl Errors {
    /// From the errors of each seed, for each number of directions.
    fn new((sequence, estimator): (Sequence, Estimator), directions: &[u32], fitted: [u32; 2], by_seed: &[Vec<f64>]) -> Self {
        let mean = |of: &[f64], term: &dyn Fn(f64) -> f64| of.iter().map(|&error| term(error)).sum::<f64>() / of.len() as f64;
        let relative_rmse: Vec<_> = by_seed.iter().map(|errors| mean(errors, &|error| error * error).sqrt()).collect();
        let spread = |errors: &Vec<f64>| {
            let average = mean(errors, &|error| error);
            mean(errors, &|error| (error - average).powi(2)).sqrt()
        };
        let within = directions.iter().zip(&relative_rmse).filter(|(n, _)| (fitted[0]..=fitted[1]).contains(n));
        let (slope, intercept) = fit(&within.map(|(&n, error)| (f64::from(n).ln(), error.ln())).collect::<Vec<_>>());
        let spread = by_seed.iter().map(spread).collect();
        Self { sequence, estimator, slope, at_1: intercept.exp(), relative_rmse, spread }
    }
}

fn winners(directions: &[u32], errors: &[Errors]) -> Vec<Value> {
    let winner = |estimator: Estimator, i: usize| {
        let mut ranked: Vec<_> = errors.iter().filter(|errors| errors.estimator == estimator).collect();
        ranked.sort_by(|a, b| a.relative_rmse[i].total_cmp(&b.relative_rmse[i]));
        let lead = ranked[1].relative_rmse[i] / ranked[0].relative_rmse[i];
        json!({ "directions": directions[i], "estimator": estimator, "sequence": ranked[0].sequence, "lead": lead })
    };
    ESTIMATORS.into_iter().flat_map(|estimator| (0..directions.len()).map(move |i| winner(estimator, i))).collect()
}
