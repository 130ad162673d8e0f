//! Error of the irradiance against the number of shared directions, for each sequence and two estimators.
//!
//! Exact rays look at one photon grid, so that neither layers nor photons have a share in it. The plain estimator is
//! E = 4π/N Σ L w over directions d uniform on the sphere, with w = max(n·d, 0); the self-normalised one, which renders use, is
//! E = π Σ L w / Σ w. The truth is that of very many directions.

use std::f64::consts::PI;

use finalgather::points::GatherPoint;
use finalgather::reference::Reference;
use finalgather::{Directions, Estimator, Sequence, Settings};
use glam::{DVec3, DVec4};
use serde::{Deserialize, Serialize};

use crate::cornell::{Cornell, relative_rmse};
use crate::figure::{Figure, Result, Task};
use crate::plot::{self, Axis, Curve};

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
    winners: Vec<Winner>,
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

/// Which sequence has the smallest error.
#[derive(Serialize, Deserialize)]
struct Winner {
    directions: u32,
    estimator: Estimator,
    sequence: Sequence,
    /// The error of the second best over its own.
    lead: f64,
}

const ESTIMATORS: [Estimator; 2] = [Estimator::Plain, Estimator::SelfNormalised];

impl Figure for Convergence {
    const KIND: &'static str = "convergence";
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let scale = task.scale;
        let cornell = Cornell::load()?;
        let settings = Settings::default();
        let photons = u64::from(scale.of(settings.photons as u32, 1));
        let grid = cornell.photon_grid(&settings, 0..photons);
        let points = cornell.camera_points(scale.of(parameters.size, 4))?;
        let gather = Gather { oracle: Reference::new(&cornell.scene, &cornell.bvh, &grid), points: &points };

        let directions: Vec<u32> =
            (4..).map(|power| 1 << power).take_while(|&n| n <= scale.of(parameters.most_directions, 256)).collect();
        let truth_directions = parameters.truth_factor * directions[directions.len() - 1];
        let truth = gather.sums(Sequence::Sobol, u64::MAX, &[truth_directions]).remove(0);
        let truth = estimate(Estimator::SelfNormalised, &truth, truth_directions);
        let ones = vec![DVec3::splat(PI); points.len()];

        let fitted = [64, directions[directions.len() - 1]];
        let seeds = scale.of(parameters.seeds, 2);
        let (mut irradiance, mut constant) = (Vec::new(), Vec::new());
        for &sequence in &parameters.sequences {
            // By seed, then by number of directions.
            let sums: Vec<_> = (0..seeds).map(|seed| gather.sums(sequence, seed.into(), &directions)).collect();
            let errors = |estimator: Estimator, truth: &[DVec3], of: fn(DVec4) -> DVec4| {
                let error = |seed: usize, i: usize| {
                    let sums: Vec<_> = sums[seed][i].iter().map(|&sum| of(sum)).collect();
                    relative_rmse(&estimate(estimator, &sums, directions[i]), truth)
                };
                let by_seed = |i| (0..sums.len()).map(|seed| error(seed, i)).collect::<Vec<_>>();
                Errors::new(sequence, estimator, &directions, fitted, (0..directions.len()).map(by_seed))
            };
            irradiance.extend(ESTIMATORS.map(|estimator| errors(estimator, &truth, |sum| sum)));
            constant.push(errors(Estimator::Plain, &ones, |sum| DVec4::splat(sum.w)));
        }
        Ok(Self {
            points: points.len(),
            seeds,
            photons,
            grid_cells: settings.grid_cells,
            truth_directions,
            fitted,
            winners: winners(&directions, &irradiance),
            directions,
            irradiance,
            constant,
        })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let curve = |errors: &Errors| self.curve(errors);
        let irradiance: Vec<_> = self.irradiance.iter().map(curve).collect();
        let mut constant: Vec<_> = self.constant.iter().map(curve).collect();
        let closed_form = |&n: &u32| (f64::from(n), (5.0 / 3.0 / f64::from(n)).sqrt());
        constant.push(Curve {
            name: "√(5/3)/√N".into(),
            color: plot::GREY,
            faint: true,
            points: self.directions.iter().map(closed_form).collect(),
        });
        plot::svg((900, 920), |area| {
            let (above, below) = area.split_vertically(500);
            let title = format!("Irradiance in the Cornell box, slopes fitted from N = {} to {}", self.fitted[0], self.fitted[1]);
            for (area, title, curves) in [
                (above, title.as_str(), irradiance),
                (below, "The same where radiance is 1: self-normalised sums have no error", constant),
            ] {
                let ticks: Vec<_> = self.directions.iter().map(|&n| f64::from(n)).collect();
                let x = Axis::log_at("shared directions N", &ticks, plot::whole);
                let y = Axis::log("relative RMSE", plot::values(&curves)[1].iter().copied(), plot::percent);
                plot::lines(&area, title, [&x, &y], &curves)?;
            }
            Ok(())
        })
    }
}

impl Convergence {
    fn curve(&self, errors: &Errors) -> Curve {
        let (name, color) = match errors.sequence {
            Sequence::Random => ("random", plot::ORANGE),
            Sequence::R2 => ("R2", plot::BLUE),
            Sequence::Sobol => ("Sobol", plot::GREEN),
        };
        let (estimator, faint) = match errors.estimator {
            Estimator::Plain => ("plain", true),
            Estimator::SelfNormalised => ("self-normalised", false),
        };
        let points = self.directions.iter().zip(&errors.relative_rmse).map(|(&n, &error)| (f64::from(n), error));
        Curve { name: format!("{name}, {estimator}: {:.2}", errors.slope), color, faint, points: points.collect() }
    }
}

/// Points and the oracle that gathers for them.
struct Gather<'a> {
    oracle: Reference<'a>,
    points: &'a [GatherPoint],
}

impl Gather<'_> {
    /// The sums at each point over the first directions of a sequence, once for each of the growing `counts`.
    fn sums(&self, sequence: Sequence, seed: u64, counts: &[u32]) -> Vec<Vec<DVec4>> {
        /// The oracle's own sums are of 32 bits: longer ones are put together here.
        const CHUNK: usize = 1 << 12;
        let directions = Directions::new(sequence, seed);
        let mut sums = vec![DVec4::ZERO; self.points.len()];
        let mut done = 0;
        let mut up_to = |count: u32| {
            let vectors: Vec<_> = (done..count).map(|index| directions.get(index).vector).collect();
            for chunk in vectors.chunks(CHUNK) {
                for (sum, more) in sums.iter_mut().zip(self.oracle.gather(self.points, chunk)) {
                    *sum += more.as_dvec4();
                }
            }
            done = count;
            sums.clone()
        };
        counts.iter().map(|&count| up_to(count)).collect()
    }
}

/// What the sums over this many directions make.
fn estimate(estimator: Estimator, sums: &[DVec4], directions: u32) -> Vec<DVec3> {
    let of = |sum: &DVec4| match estimator {
        Estimator::Plain => 4.0 * PI / f64::from(directions) * sum.truncate(),
        Estimator::SelfNormalised if sum.w > 0.0 => PI * sum.truncate() / sum.w,
        Estimator::SelfNormalised => DVec3::ZERO,
    };
    sums.iter().map(of).collect()
}

impl Errors {
    /// From the errors of each seed, for each number of directions.
    fn new(
        sequence: Sequence,
        estimator: Estimator,
        directions: &[u32],
        fitted: [u32; 2],
        by_seed: impl Iterator<Item = Vec<f64>>,
    ) -> Self {
        let (mut relative_rmse, mut spread) = (Vec::new(), Vec::new());
        for errors in by_seed {
            let mean = |of: &dyn Fn(f64) -> f64| errors.iter().map(|&error| of(error)).sum::<f64>() / errors.len() as f64;
            let average = mean(&|error| error);
            relative_rmse.push(mean(&|error| error * error).sqrt());
            spread.push(mean(&|error| (error - average).powi(2)).sqrt());
        }
        let within = directions.iter().zip(&relative_rmse).filter(|(n, _)| (fitted[0]..=fitted[1]).contains(n));
        let (slope, intercept) = fit(&within.map(|(&n, error)| (f64::from(n).ln(), error.ln())).collect::<Vec<_>>());
        Self { sequence, estimator, slope, at_1: intercept.exp(), relative_rmse, spread }
    }
}

/// Slope and intercept of the line with the least squares of differences in y.
fn fit(points: &[(f64, f64)]) -> (f64, f64) {
    let mean = |of: &dyn Fn(f64, f64) -> f64| points.iter().map(|&(x, y)| of(x, y)).sum::<f64>() / points.len() as f64;
    let (x_mean, y_mean) = (mean(&|x, _| x), mean(&|_, y| y));
    let slope = mean(&|x, y| (x - x_mean) * (y - y_mean)) / mean(&|x, _| (x - x_mean).powi(2));
    (slope, y_mean - slope * x_mean)
}

fn winners(directions: &[u32], errors: &[Errors]) -> Vec<Winner> {
    let winner = |estimator: Estimator, i: usize| {
        let mut ranked: Vec<_> = errors.iter().filter(|errors| errors.estimator == estimator).collect();
        ranked.sort_by(|a, b| a.relative_rmse[i].total_cmp(&b.relative_rmse[i]));
        let lead = ranked[1].relative_rmse[i] / ranked[0].relative_rmse[i];
        Winner { directions: directions[i], estimator, sequence: ranked[0].sequence, lead }
    };
    ESTIMATORS.into_iter().flat_map(|estimator| (0..directions.len()).map(move |i| winner(estimator, i))).collect()
}
