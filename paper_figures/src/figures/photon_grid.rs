//! How wrong the photon grid is where a ray looks at it, and how much of that final gathering forgives.
//!
//! Several independent maps tell bias, what their mean is off by, from noise, how much they differ. Directly looked at, the map's
//! irradiance is held against direct light by very many shadow rays and indirect light by very many gather rays that look at a finer
//! map with more photons. After the gather, camera points see a map along the directions of a render, and the truth is what they
//! would have from the finer map along the same directions. Part of the noise is not the photons' but of the probes that find the area which
//! light reaches; it is measured alone, too.

use finalgather::math::dominant_axis;
use finalgather::photon::PhotonGrid;
use finalgather::points::GatherPoint;
use finalgather::random::{Random, sobol};
use finalgather::reference::Reference;
use finalgather::scene::RAY_OFFSET;
use finalgather::{Directions, Sequence, Settings};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::cornell::{Cornell, directions, irradiance, mean};
use crate::figure::{Figure, Result, Task};
use crate::plot::{self, Axis, Curve};

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
    truth: Truth,
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

#[derive(Serialize, Deserialize)]
struct Truth {
    light_samples: u32,
    directions: u32,
    grid_cells: u32,
    photons: u32,
    /// At surface points, over channels.
    mean_irradiance: f64,
    /// At camera points, over channels.
    mean_indirect: f64,
}

/// Maps that differ in nothing but their photons.
#[derive(Serialize, Deserialize)]
pub struct Kind {
    pub photons: u32,
    pub grid_cells: u32,
    /// At surface points.
    pub seen: Errors,
    /// At surface points within half a cell of where surfaces meet or end, and how many these are.
    near_edges: Errors,
    points_near_edges: usize,
    elsewhere: Errors,
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
    pub bias: Option<f64>,
    /// Standard deviation of one map, root mean square over points and channels.
    pub noise: f64,
}

/// Points darker than this share of the mean are shut in: under the blocks, or above the lamp. No ray looks at them.
const SHUT_IN: f64 = 0.01;

impl Figure for PhotonGridErrors {
    const KIND: &'static str = "photon_grid";
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let scale = task.scale;
        let cornell = Cornell::load()?;
        let mut truth = Truth {
            light_samples: scale.of(parameters.truth_light_samples, 256),
            directions: scale.of(parameters.truth_directions, 256),
            grid_cells: parameters.truth_grid_cells,
            photons: scale.of(parameters.truth_photons, 1),
            mean_irradiance: 0.0,
            mean_indirect: 0.0,
        };
        let settings = Settings { seed: u64::MAX, grid_cells: truth.grid_cells, ..Settings::default() };
        let finest = cornell.photon_grid(&settings, 0..truth.photons.into());
        let gather = |grid: &PhotonGrid, points: &[GatherPoint], vectors: &[Vec3]| {
            irradiance(&Reference::new(&cornell.scene, &cornell.bvh, grid).gather(points, vectors))
        };

        let mut surface = surface_points(&cornell, scale.of(parameters.surface_points, 64));
        let all_around = directions(&Directions::new(Sequence::Sobol, u64::MAX), truth.directions);
        let indirect = gather(&finest, &surface, &all_around);
        let direct: Vec<_> =
            surface.par_iter().enumerate().map(|(i, point)| direct(&cornell, point, truth.light_samples, i)).collect();
        let mut seen: Vec<_> = direct.into_iter().zip(indirect).map(|(direct, indirect)| direct + indirect).collect();
        let dark = SHUT_IN * mean(&seen);
        let lit: Vec<_> = seen.iter().map(|irradiance| irradiance.element_sum() / 3.0 > dark).collect();
        keep(&mut surface, &lit);
        keep(&mut seen, &lit);
        truth.mean_irradiance = mean(&seen);

        let camera = cornell.camera_points(scale.of(parameters.size, 4))?;
        let vectors = directions(&Directions::new(Sequence::R2, 0), scale.of(parameters.directions, 64));
        let gathered = gather(&finest, &camera, &vectors);
        truth.mean_indirect = mean(&gathered);

        let edges = edges(&cornell);
        let to_edge: Vec<_> = surface.par_iter().map(|point| distance(point.position, &edges)).collect();
        let maps = scale.of(parameters.maps, 2);
        let measure = |photons: u32, grid_cells: u32| {
            let (mut of_seen, mut of_gathered) = (Moments::new(surface.len()), Moments::new(camera.len()));
            let mut near = Vec::new();
            for seed in 0..maps {
                let settings = Settings { seed: seed.into(), grid_cells, ..Settings::default() };
                let grid = cornell.photon_grid(&settings, 0..photons.into());
                of_seen.add(&look_up_all(&grid, &surface));
                of_gathered.add(&gather(&grid, &camera, &vectors));
                near = to_edge.iter().map(|&distance| distance < 0.5 * grid.cell_size).collect();
            }
            let far: Vec<_> = near.iter().map(|near| !near).collect();
            Kind {
                photons,
                grid_cells,
                seen: of_seen.errors(&seen, &vec![true; surface.len()]),
                near_edges: of_seen.errors(&seen, &near),
                points_near_edges: near.iter().filter(|&&near| near).count(),
                elsewhere: of_seen.errors(&seen, &far),
                gathered: of_gathered.errors(&gathered, &vec![true; camera.len()]),
            }
        };
        let of_photons = |&photons: &u32| parameters.grid_cells.iter().map(move |&cells| (scale.of(photons, 1), cells));
        let kinds = parameters.photons.iter().flat_map(of_photons).map(|(photons, cells)| measure(photons, cells)).collect();
        let probe = |&grid_cells: &u32| {
            let photons = scale.of(parameters.probed_photons, 1);
            let (mut of_seen, mut of_gathered) = (Moments::new(surface.len()), Moments::new(camera.len()));
            let traced = cornell.traced(&Settings { grid_cells, ..Settings::default() }, 0..photons.into());
            for seed in 0..maps {
                let mut grid = PhotonGrid { sums: traced.sums.clone(), ..traced };
                grid.add_area(&cornell.scene.mesh, &cornell.bvh, seed.into());
                of_seen.add(&look_up_all(&grid, &surface));
                of_gathered.add(&gather(&grid, &camera, &vectors));
            }
            let noise = |moments: &Moments, truth: &[DVec3]| moments.errors(truth, &vec![true; truth.len()]).noise;
            Probes { photons, grid_cells, seen: noise(&of_seen, &seen), gathered: noise(&of_gathered, &gathered) }
        };
        let probes = parameters.grid_cells.iter().map(probe).collect();
        let (surface_points, camera_points, directions) = (surface.len(), camera.len(), vectors.len() as u32);
        Ok(Self { truth, surface_points, camera_points, directions, maps, kinds, probes })
    }

    fn draw(&self, parameters: &Parameters) -> Result<String> {
        let bias_and_noise = |of: fn(&Kind) -> &Errors, of_probes: fn(&Probes) -> f64| {
            let most = self.by_photons().last();
            let bias = most.map(|kinds| curve("bias", plot::GREY, true, kinds, &|kind| of(kind).bias.unwrap_or(f64::NAN)));
            let noise = self.by_photons().zip([plot::ORANGE, plot::BLUE, plot::GREEN]).map(move |(kinds, color)| {
                curve(&format!("noise, {} photons", plot::count(kinds[0].photons)), color, false, kinds, &|kind| of(kind).noise)
            });
            let points = self.probes.iter().map(|probes| (f64::from(probes.grid_cells), of_probes(probes))).collect();
            let probes = Curve { name: "noise of area probes alone".into(), color: plot::PURPLE, faint: true, points };
            bias.into_iter().chain(noise).chain([probes]).collect::<Vec<_>>()
        };
        let most = self.by_photons().last().unwrap_or_default();
        let at_edges = vec![
            curve("within half a cell of an edge", plot::PURPLE, false, most, &|kind| kind.near_edges.mean_bias),
            curve("elsewhere", plot::SKY, false, most, &|kind| kind.elsewhere.mean_bias),
        ];
        let cells: Vec<_> = parameters.grid_cells.iter().map(|&cells| f64::from(cells)).collect();
        let panels = [
            ("The map, looked at directly", "RMS over points", bias_and_noise(|kind| &kind.seen, |probes| probes.seen)),
            ("After the gather", "RMS over points", bias_and_noise(|kind| &kind.gathered, |probes| probes.gathered)),
            ("Do edges darken? Mean irradiance of the map against the truth", "mean difference", at_edges),
        ];
        plot::svg((900, 1200), |area| {
            for (area, (title, name, curves)) in area.split_evenly((3, 1)).iter().zip(panels) {
                let x = Axis::log_at("grid cells along the longest side", &cells, plot::whole);
                let values = plot::values(&curves)[1].clone().into_iter();
                let y = if name == "mean difference" { Axis::linear } else { Axis::log }(name, values, plot::percent);
                plot::lines(area, title, [&x, &y], &curves)?;
            }
            Ok(())
        })
    }
}

impl PhotonGridErrors {
    fn by_photons(&self) -> impl Iterator<Item = &[Kind]> {
        self.kinds.chunk_by(|a, b| a.photons == b.photons)
    }
}

fn curve(name: &str, color: plot::RGBColor, faint: bool, kinds: &[Kind], of: &dyn Fn(&Kind) -> f64) -> Curve {
    let points = kinds.iter().map(|kind| (f64::from(kind.grid_cells), of(kind))).collect();
    Curve { name: name.into(), color, faint, points }
}

/// Spread evenly over the fronts of all triangles but the lamp's.
fn surface_points(cornell: &Cornell, count: u32) -> Vec<GatherPoint> {
    let Cornell { scene, .. } = cornell;
    let mesh = &scene.mesh;
    let reflecting = || (0..mesh.triangles.len()).filter(|&triangle| !scene.material(triangle).is_emissive());
    let density = count as f32 / reflecting().map(|triangle| mesh.area(triangle)).sum::<f32>();
    let mut random = Random::new(1, 0);
    let (mut points, mut wanted) = (Vec::new(), 0.0);
    for triangle in reflecting() {
        wanted += density * mesh.area(triangle);
        let [a, b, c] = mesh.corners(triangle);
        while (points.len() as f32) < wanted {
            let (u, v) = (random.uniform(), random.uniform());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            points.push(GatherPoint::flat(a + u * (b - a) + v * (c - a), mesh.geometric_normal(triangle)));
        }
    }
    points
}

/// Irradiance from the lamp by shadow rays to `samples` points of it.
fn direct(cornell: &Cornell, point: &GatherPoint, samples: u32, index: usize) -> DVec3 {
    let origin = point.position + RAY_OFFSET * point.normal;
    let sample = |i| {
        let light = cornell.lights.point_of_square(sobol(i, index as u64));
        let distance = origin.distance(light.position);
        let direction = (light.position - origin) / distance;
        let geometry = point.cosine(direction) * light.normal.dot(-direction).max(0.0) / (distance * distance);
        let reaches =
            || cornell.bvh.nearest(origin, direction, None).is_none_or(|hit| hit.distance > distance - 10.0 * RAY_OFFSET);
        if geometry > 0.0 && reaches() { (geometry * light.radiance_area).as_dvec3() } else { DVec3::ZERO }
    };
    (0..samples).map(sample).sum::<DVec3>() / f64::from(samples)
}

fn look_up_all(grid: &PhotonGrid, points: &[GatherPoint]) -> Vec<DVec3> {
    let look_up = |point: &GatherPoint| {
        let axis = dominant_axis(point.normal);
        grid.irradiance(point.position, axis, point.normal[axis] > 0.0).as_dvec3()
    };
    points.iter().map(look_up).collect()
}

/// Where reflecting surfaces meet or end: the edges of triangles, but for those between two in one plane.
fn edges(cornell: &Cornell) -> Vec<[Vec3; 2]> {
    let Cornell { scene, .. } = cornell;
    let mesh = &scene.mesh;
    let all: Vec<_> = (0..mesh.triangles.len())
        .filter(|&triangle| !scene.material(triangle).is_emissive())
        .flat_map(|triangle| {
            let [a, b, c] = mesh.corners(triangle);
            [[a, b], [b, c], [c, a]].map(|edge| (edge, mesh.geometric_normal(triangle)))
        })
        .collect();
    // The neighbour in the plane, wound alike, has the edge the other way round.
    let goes_on = |[a, b]: [Vec3; 2], normal: Vec3| all.iter().any(|&(other, n)| other == [b, a] && n.dot(normal) > 0.9999);
    all.iter().filter(|(edge, normal)| !goes_on(*edge, *normal)).map(|(edge, _)| *edge).collect()
}

fn distance(position: Vec3, edges: &[[Vec3; 2]]) -> f32 {
    let to = |&[a, b]: &[Vec3; 2]| {
        let share = ((position - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        position.distance(a.lerp(b, share))
    };
    edges.iter().map(to).fold(f32::INFINITY, f32::min)
}

fn keep<T>(values: &mut Vec<T>, kept: &[bool]) {
    let mut kept = kept.iter();
    values.retain(|_| kept.next() == Some(&true));
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

    /// Over the points that `counted` tells.
    fn errors(&self, truth: &[DVec3], counted: &[bool]) -> Errors {
        let [mut off, mut squares_off, mut variances, mut true_values] = [const { Vec::new() }; 4];
        for i in (0..truth.len()).filter(|&i| counted[i]) {
            let average = self.sum[i] / self.maps;
            off.push(average - truth[i]);
            squares_off.push((average - truth[i]).powf(2.0));
            variances.push((self.squares[i] / self.maps - average * average).max(DVec3::ZERO) * self.maps / (self.maps - 1.0));
            true_values.push(truth[i]);
        }
        let (level, variance) = (mean(&true_values), mean(&variances));
        let left = variance / self.maps;
        let bias = (mean(&squares_off) - left).max(0.0).sqrt();
        Errors {
            mean_bias: mean(&off) / level,
            bias: (bias >= 0.5 * left.sqrt()).then_some(bias / level),
            noise: variance.sqrt() / level,
        }
    }
}
