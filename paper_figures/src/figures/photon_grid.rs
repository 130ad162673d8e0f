//! How wrong the photon grid is where a ray looks at it, and how much of that final gathering averages out.
//!
//! Several independent maps separate bias, the error of their mean, from noise, their spread. At surface points, the map's irradiance is
//! compared with direct light by very many shadow rays plus indirect light by very many gather rays that look at a finer map with more
//! photons. After the gather, camera points gather from a map along the directions of a render; the truth is a gather from the finer map
//! along the same directions. A part of the noise comes from the probes that find the area which light reaches. It is measured alone too.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::draw::{Axis, Curve, Panel, Unit, count, plot};
use crate::figure::{Figure, Result, Task};
use crate::lab::{Cornell, PhotonGrid, Sequence, Settings, directions, look_up, mean};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    grid_cells: Vec<u32>,
    photons: Vec<u32>,
    /// Of the maps whose area is probed anew.
    probed_photons: u32,
    surface_points: u32,
    /// Side of the picture whose points gather, and along how many directions.
    size: u32,
    directions: u32,
    /// Independent ones of each kind.
    maps: u32,
    /// Of the truth.
    truth_light_samples: u32,
    truth_directions: u32,
    truth_grid_cells: u32,
    truth_photons: u32,
}

#[derive(Serialize, Deserialize)]
pub struct PhotonGridErrors {
    /// How it was found, and the mean irradiance at surface points and indirect irradiance at camera points, over channels.
    truth: Value,
    /// Spread evenly over the surfaces that light reaches.
    surface_points: usize,
    camera_points: usize,
    /// That camera points gather along.
    directions: u32,
    /// Independent maps of each kind.
    maps: u32,
    /// By photons, then by grid cells.
    pub kinds: Vec<Kind>,
    probes: Vec<Probes>,
}

/// Maps that differ in nothing but their photons.
#[derive(Serialize, Deserialize)]
pub struct Kind {
    pub photons: u32,
    pub grid_cells: u32,
    /// At surface points.
    pub seen: Errors,
    /// At surface points within half a cell of where surfaces meet or end, and how many these are. Null without such points.
    near_edges: Option<Errors>,
    points_near_edges: usize,
    elsewhere: Option<Errors>,
    /// Of the indirect light of camera points.
    pub gathered: Errors,
}

/// Noise of maps of the same photons whose area is probed anew; as in [`Errors`].
#[derive(Serialize, Deserialize)]
struct Probes {
    photons: u32,
    grid_cells: u32,
    seen: f64,
    gathered: f64,
}

/// As shares of the true mean.
#[derive(Serialize, Deserialize)]
pub struct Errors {
    /// Of the mean over points.
    mean_bias: f64,
    /// Root mean square over points and channels; the noise left in a mean of so few maps is taken off. Null where it is below half of that.
    bias: Option<f64>,
    /// Standard deviation of one map, root mean square over points and channels.
    pub noise: f64,
}

/// Points darker than this share of the mean are enclosed: under the blocks, or above the lamp. No ray looks at them.
const ENCLOSED: f64 = 0.01;

impl Figure for PhotonGridErrors {
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let scale = task.scale;
        let cornell = Cornell::load()?;
        let light_samples = scale.of(parameters.truth_light_samples, 256);
        let truth_directions = scale.of(parameters.truth_directions, 256);
        let photons = scale.of(parameters.truth_photons, 1);
        let settings = |seed, cells| Settings::default().with(|s| (s.seed, s.photons.grid_cells) = (seed, cells));
        // Probes of the area take as long as cells are many, however few the photons.
        let truth_cells = scale.of(parameters.truth_grid_cells, 32);
        let grid_cells = &parameters.grid_cells[..scale.of(parameters.grid_cells.len() as u32, 3) as usize];
        let finest = cornell.photon_grid(&settings(u64::MAX, truth_cells), 0..photons.into());

        let points = cornell.surface_points(scale.of(parameters.surface_points, 64));
        let indirect = cornell.gather(&finest, &points, &directions(Sequence::Sobol, u64::MAX, 0..truth_directions));
        let direct = cornell.direct(&points, light_samples);
        let seen: Vec<_> = direct.into_iter().zip(indirect).map(|(direct, indirect)| direct + indirect).collect();
        let dark = ENCLOSED * mean(&seen);
        let lit = points.into_iter().zip(seen).filter(|(_, irradiance)| irradiance.element_sum() / 3.0 > dark);
        let (surface, seen): (Vec<_>, Vec<_>) = lit.unzip();

        let camera = cornell.camera_points(scale.of(parameters.size, 4))?;
        let vectors = directions(Sequence::R2, 0, 0..scale.of(parameters.directions, 64));
        let gathered = cornell.gather(&finest, &camera, &vectors);
        let truth = json!({
            "light_samples": light_samples,
            "directions": truth_directions,
            "grid_cells": truth_cells,
            "photons": photons,
            "mean_irradiance": mean(&seen),
            "mean_indirect": mean(&gathered),
        });

        let maps = scale.of(parameters.maps, 2);
        // Of the maps of all seeds: at surface points, and at camera points after the gather.
        let moments = |grid: &dyn Fn(u64) -> PhotonGrid| {
            let mut moments = [surface.len(), camera.len()].map(Moments::new);
            for grid in (0..maps).map(|seed| grid(seed.into())) {
                moments[0].add(&look_up(&grid, &surface));
                moments[1].add(&cornell.gather(&grid, &camera, &vectors));
            }
            moments
        };
        let to_edges = cornell.to_edges(&surface);
        let of_all = |of: &Moments, truth: &[DVec3]| of.errors(truth, |_| true).ok_or("no point receives light");
        let kind = |(photons, grid_cells): (u32, u32)| -> Result<Kind> {
            let grid = |seed| cornell.photon_grid(&settings(seed, grid_cells), 0..photons.into());
            let [of_seen, of_gathered] = moments(&grid);
            let half_cell = 0.5 * cornell.empty_grid(grid_cells).cell_size;
            let is_near = |i: usize| to_edges[i] < half_cell;
            Ok(Kind {
                photons,
                grid_cells,
                seen: of_all(&of_seen, &seen)?,
                near_edges: of_seen.errors(&seen, is_near),
                points_near_edges: (0..surface.len()).filter(|&i| is_near(i)).count(),
                elsewhere: of_seen.errors(&seen, |i| !is_near(i)),
                gathered: of_all(&of_gathered, &gathered)?,
            })
        };
        let probe = |&grid_cells: &u32| -> Result<Probes> {
            let photons = scale.of(parameters.probed_photons, 1);
            let traced = cornell.traced(&settings(Settings::default().seed, grid_cells), 0..photons.into());
            let again = |seed| cornell.probed(PhotonGrid { sums: traced.sums.clone(), ..traced }, seed);
            let [of_seen, of_gathered] = moments(&again);
            let (seen, gathered) = (of_all(&of_seen, &seen)?.noise, of_all(&of_gathered, &gathered)?.noise);
            Ok(Probes { photons, grid_cells, seen, gathered })
        };
        let of_photons = |&photons: &u32| grid_cells.iter().map(move |&cells| (scale.of(photons, 1), cells));
        let kinds = parameters.photons.iter().flat_map(of_photons).map(kind).collect::<Result<_>>()?;
        let probes = grid_cells.iter().map(probe).collect::<Result<_>>()?;
        let (surface_points, camera_points, directions) = (surface.len(), camera.len(), vectors.len() as u32);
        Ok(Self { truth, surface_points, camera_points, directions, maps, kinds, probes })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let by_photons = || self.kinds.chunk_by(|a, b| a.photons == b.photons);
        let most = by_photons().last().unwrap_or_default();
        let bias_and_noise = |of: fn(&Kind) -> &Errors, of_probes: fn(&Probes) -> f64| {
            let bias = curve("bias", plot::GREY, most, &|kind| of(kind).bias.unwrap_or(f64::NAN)).faint(true);
            let noise = by_photons().zip([plot::ORANGE, plot::BLUE, plot::GREEN]).map(move |(kinds, color)| {
                curve(&format!("noise, {} photons", count(kinds[0].photons)), color, kinds, &|kind| of(kind).noise)
            });
            let points = self.probes.iter().map(|probes| (probes.grid_cells, of_probes(probes)));
            let probes = Curve::new("noise of area probes alone", plot::PURPLE, points).faint(true);
            [bias].into_iter().chain(noise).chain([probes]).collect::<Vec<_>>()
        };
        let mean_bias = |errors: Option<&Errors>| errors.map_or(f64::NAN, |errors| errors.mean_bias);
        let at_edges = vec![
            curve("within half a cell of an edge", plot::PURPLE, most, &|kind| mean_bias(kind.near_edges.as_ref())),
            curve("elsewhere", plot::SKY, most, &|kind| mean_bias(kind.elsewhere.as_ref())),
        ];
        let x = Axis::log_at("grid cells along the longest side", Unit::Number, most.iter().map(|kind| kind.grid_cells));
        let rms = [x.clone(), Axis::log("RMS over points", Unit::Percent)];
        let seen = bias_and_noise(|kind| &kind.seen, |probes| probes.seen);
        let gathered = bias_and_noise(|kind| &kind.gathered, |probes| probes.gathered);
        let difference = [x, Axis::linear("mean difference", Unit::Percent)];
        plot::svg([
            Panel::lines(400, "The map, looked at directly", rms.clone(), seen),
            Panel::lines(400, "After the gather", rms, gathered),
            Panel::lines(400, "Do edges darken? Mean irradiance of the map against the truth", difference, at_edges),
        ])
    }
}

fn curve(name: &str, color: plot::RGBColor, kinds: &[Kind], of: &dyn Fn(&Kind) -> f64) -> Curve {
    Curve::new(name, color, kinds.iter().map(|kind| (kind.grid_cells, of(kind))))
}

/// Sums over maps at each point.
struct Moments {
    maps: f64,
    sum: Vec<DVec3>,
    squares: Vec<DVec3>,
}

impl Moments {
    fn new(points: usize) -> Self {
        Self { maps: 0.0, sum: vec![DVec3::ZERO; points], squares: vec![DVec3::ZERO; points] }
    }

    fn add(&mut self, values: &[DVec3]) {
        self.maps += 1.0;
        for ((sum, squares), &value) in self.sum.iter_mut().zip(&mut self.squares).zip(values) {
            *sum += value;
            *squares += value * value;
        }
    }

    /// Over the points that `counted` tells by their numbers; `None` where it tells none, or none that light reaches.
    fn errors(&self, truth: &[DVec3], counted: impl Fn(usize) -> bool) -> Option<Errors> {
        let [mut off, mut squares_off, mut variances, mut true_values] = [const { Vec::new() }; 4];
        for i in (0..truth.len()).filter(|&i| counted(i)) {
            let average = self.sum[i] / self.maps;
            off.push(average - truth[i]);
            squares_off.push((average - truth[i]).powf(2.0));
            variances.push((self.squares[i] / self.maps - average * average).max(DVec3::ZERO) * self.maps / (self.maps - 1.0));
            true_values.push(truth[i]);
        }
        let (level, variance) = (mean(&true_values), mean(&variances));
        let left = variance / self.maps;
        let bias = (mean(&squares_off) - left).max(0.0).sqrt();
        (level > 0.0).then(|| Errors {
            mean_bias: mean(&off) / level,
            bias: (bias >= 0.5 * left.sqrt()).then_some(bias / level),
            noise: variance.sqrt() / level,
        })
    }
}
