//! Gathers measured side by side: time, where it goes, and the error that it buys, on the same points, directions and photons.
//!
//! All contestants take turns, round after round, so that what else the machine does meets them alike; a time is the median of its rounds.
//! Speed alone says little, for a gather is fast that leaves out what is hard: each [`Row`] has its error against exact rays.
//!
//! A *sample* is one ray that counts at one point. With both ends a direction brings every point one; with one end only the points that face
//! along it, half of them. Costs are compared by [`Row::ms_per_sample`], the time in which every point gets one sample.
//!
//! [`Bench::new`] takes a scene in unit space; [`Bench::measure`] runs the contestants.

mod contestant;
mod deviation;

use std::rc::Rc;
use std::time::Instant;

use glam::{DVec3, Vec2, Vec3, Vec4};
use serde::{Deserialize, Serialize};

pub use contestant::{CONTESTANTS, Contestant, FUSED};
pub use deviation::{Deviation, irradiance, median};

use crate::direction::{Direction, Directions};
use crate::error::{Error, Result};
use crate::geometry::Geometry;
use crate::gpu::{Gpu, StageClock};
use crate::photon::{PhotonGrid, PhotonTexture, PhotonTracer};
use crate::points::{CameraPoints, GBuffer, GatherPoint, PointList, Points};
use crate::reference::Reference;
use crate::scene::{Bvh, Lights, Scene};
use crate::settings::Settings;
use contestant::Entrant;

/// A scene with its photons and points, ready to be gathered at.
pub struct Bench {
    gpu: Gpu,
    settings: Settings,
    /// In unit space.
    scene: Scene,
    bvh: Rc<Bvh>,
    grid: PhotonGrid,
    photons: PhotonTexture,
    geometry: Geometry,
    source: PointOrigin,
    /// The points in the order of their textures' texels; some texels have none.
    pixels: Vec<Option<GatherPoint>>,
}

enum PointOrigin {
    Camera(CameraPoints, GBuffer),
    List(PointList),
}

/// Where to gather.
pub enum Where {
    /// At what the scene's camera sees in a picture of [`FilmSettings::size`](crate::settings::FilmSettings::size).
    Camera,
    /// In unit space.
    Points(Vec<GatherPoint>),
}

/// How much to measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BenchPlan {
    /// Of each contestant in a round.
    pub directions: u32,
    pub rounds: u32,
    /// Whether the device's stages are timed, in a round of their own.
    pub stages: bool,
    /// Directions, both their ends, of the irradiance that [`Row::converged`] is held against; 0: none.
    pub converged: u32,
}

/// What was measured of one contestant.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    pub name: String,
    /// How many ends of a direction count; null where each point has rays of its own, as many as there are directions.
    pub ends: Option<u32>,
    /// Of a round, the median.
    pub seconds: f64,
    /// Of the fastest and the slowest round.
    pub seconds_range: [f64; 2],
    pub ms_per_direction: f64,
    /// In which every point gets one sample.
    pub ms_per_sample: f64,
    pub samples_per_second: f64,
    /// The most layers of a direction; 0 where nothing is peeled.
    pub layers_max: u32,
    /// Null on the CPU, and where not asked for.
    pub device: Option<DeviceTimes>,
    /// Against exact rays along the same directions; null where each point has rays of its own.
    pub same_rays: Option<Deviation>,
    /// Against many directions; the part of it that is no [`Row::same_rays`] is that of few directions or rays. Null where not asked for.
    pub converged: Option<Deviation>,
}

/// Of a round apart, in which the stages were timed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceTimes {
    pub stages: Vec<StageTime>,
    /// Share of the wall-clock time that the CPU spent in waits for the device. Software drivers work meanwhile, on the same cores.
    pub waits: f64,
    /// Share of the wall-clock time that no stage accounts for; null where the driver tells no time.
    pub idle: Option<f64>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageTime {
    pub name: String,
    /// Null where the driver tells no time.
    pub ms_per_direction: Option<f64>,
}

/// Points at which errors are taken, at most.
const ORACLE_POINTS: usize = 16384;
/// Rays that each part of the oracle casts, at most; but never at fewer than 64 points.
const ORACLE_RAYS: usize = 1 << 24;

impl Bench {
    /// Traces the photons and finds the points. `scene` is in unit space.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] when a setting is out of range or beyond the device's limits, or there is no light or no point;
    /// [`crate::Error::Gl`] when the device fails.
    pub fn new(gpu: &Gpu, scene: Scene, settings: &Settings, at: Where) -> Result<Self> {
        settings.validate()?;
        // Gather rays pass straight through it.
        let scene = scene.without_glass().unwrap_or(scene);
        let geometry = Geometry::upload(gpu, &scene)?;
        let (source, pixels) = match at {
            Where::Camera => {
                let camera = CameraPoints::new(gpu, settings.film.size)?;
                let visible = camera.see(&geometry, &scene.camera(settings.film.size), Vec2::splat(0.5));
                let pixels = visible.pixels();
                // Of what was read back, the count is enough from now on.
                let (count, cut) = (visible.count, visible.cut);
                let [position, normal, albedo, emission] = Default::default();
                (PointOrigin::Camera(camera, GBuffer { position, normal, albedo, emission, count, cut }), pixels)
            }
            Where::Points(points) => {
                (PointOrigin::List(PointList::upload(gpu, &points)?), points.into_iter().map(Some).collect())
            }
        };
        if pixels.iter().flatten().next().is_none() {
            return Err(Error::usage("there is no point to gather at: the camera sees no surface", "turn the camera"));
        }
        let lights = Lights::new(&scene);
        if lights.is_dark() {
            return Err(Error::usage("the scene has no light that is large enough beside it", "enlarge the lights"));
        }
        let bvh = Rc::new(Bvh::new(&scene.mesh));
        let mut grid = PhotonGrid::new(&scene.mesh, settings.photons.grid_cells);
        PhotonTracer::new(&scene, &bvh, &lights, settings.seed, settings.photons.depth)
            .trace(settings.photons.numbers(0), &mut grid);
        grid.add_area(&scene.mesh, &bvh, settings.seed);
        let photons = PhotonTexture::upload(gpu, &grid)?;
        gpu.finish();
        gpu.check("preparing a bench")?;
        Ok(Self { gpu: gpu.clone(), settings: *settings, scene, bvh, grid, photons, geometry, source, pixels })
    }

    /// How many points there are.
    pub fn point_count(&self) -> u32 {
        self.points().count
    }

    pub fn triangle_count(&self) -> usize {
        self.scene.mesh.triangles.len()
    }

    fn points(&self) -> Points<'_> {
        match &self.source {
            PointOrigin::Camera(camera, visible) => camera.points(visible),
            PointOrigin::List(list) => list.points(),
        }
    }

    /// Runs `contestants` in turns, a row each in their order.
    ///
    /// # Errors
    /// As [`crate::gather::IrradianceGather::add`], and [`crate::Error::Gl`] when the device fails.
    pub fn measure(&self, contestants: &[&Contestant], plan: BenchPlan) -> Result<Vec<Row>> {
        if plan.rounds == 0 || plan.directions == 0 {
            return Err(Error::usage("nothing is measured in 0 rounds or along 0 directions", "give 1 or more"));
        }
        let directions = Directions::new(self.settings.directions.sequence, self.settings.seed);
        let directions: Vec<_> = (0..plan.directions).map(|index| directions.get(index)).collect();
        let mut entrants =
            contestants.iter().map(|contestant| contestant.enter(self, self.settings.seed)).collect::<Result<Vec<_>>>()?;
        // Drivers compile and allocate when they first draw.
        for entrant in &mut entrants {
            let first = entrant.batch().min(directions.len());
            self.timed(entrant, &directions[..first])?;
        }

        let oracle = Oracle::new(self, &directions, plan.converged);
        let mut seconds = vec![Vec::new(); entrants.len()];
        let (mut layers, mut deviations) = (Vec::new(), Vec::new());
        for round in 0..plan.rounds {
            for (entrant, seconds) in entrants.iter_mut().zip(&mut seconds) {
                let (time, most) = self.timed(entrant, &directions)?;
                seconds.push(time);
                if round == 0 {
                    layers.push(most);
                    deviations.push(oracle.judge(entrant.ends(), &entrant.sums()));
                }
            }
        }
        if deviations.iter().flatten().flatten().any(|deviation| !deviation.mean_difference.is_finite()) {
            return Err(Error::usage(
                "what the points see is all dark, so that errors have nothing to be a share of",
                "measure a scene whose camera looks at what light reaches",
            ));
        }
        let mut rows = Vec::new();
        for (i, entrant) in entrants.iter_mut().enumerate() {
            let [same_rays, converged] = deviations[i];
            let timed = contestants[i].is_gl() && plan.stages;
            rows.push(Row {
                name: contestants[i].name.to_owned(),
                layers_max: layers[i],
                device: timed.then(|| self.device_times(entrant, &directions)).transpose()?,
                same_rays,
                converged,
                ..Row::of(&seconds[i], plan.directions, self.point_count(), entrant.ends())
            });
        }
        Ok(rows)
    }

    /// A gather in progress, of one contestant along the directions of one seed.
    ///
    /// # Errors
    /// As [`Self::measure`].
    pub fn converging(&self, contestant: &Contestant, seed: u64) -> Result<Converging<'_>> {
        let mut entrant = contestant.enter(self, seed)?;
        entrant.begin(self);
        Ok(Converging { bench: self, entrant, sequence: Directions::new(self.settings.directions.sequence, seed), done: 0 })
    }

    /// Irradiance at every point by exact rays along both ends of this many directions, none of which a contestant uses.
    pub fn converged(&self, directions: u32) -> Vec<DVec3> {
        self.by_rays(&self.spread(usize::MAX), &self.other_directions(directions))
    }

    fn other_directions(&self, count: u32) -> Vec<Vec3> {
        let others = Directions::new(self.settings.directions.sequence, !self.settings.seed);
        both_ends(&(0..count).map(|index| others.get(index).vector).collect::<Vec<_>>())
    }

    fn by_rays(&self, places: &[usize], directions: &[Vec3]) -> Vec<DVec3> {
        let points: Vec<_> = places.iter().filter_map(|&place| self.pixels[place]).collect();
        let sums = Reference::new(&self.scene, &self.bvh, &self.grid).gather(&points, directions);
        sums.into_iter().map(irradiance).collect()
    }

    /// At most `most` of the points, evenly spread, as places in [`Bench::pixels`].
    fn spread(&self, most: usize) -> Vec<usize> {
        // An odd step does not run down a few columns of a picture.
        let step = (self.point_count() as usize).div_ceil(most.max(1));
        let places = (0..self.pixels.len()).filter(|&place| self.pixels[place].is_some());
        places.step_by(if step > 1 { step | 1 } else { 1 }).take(most).collect()
    }

    /// Seconds of a round and the most layers of its directions.
    fn timed(&self, entrant: &mut Entrant, directions: &[Direction]) -> Result<(f64, u32)> {
        entrant.begin(self);
        self.gpu.finish();
        let start = Instant::now();
        let layers = entrant.gather(self, directions)?;
        self.gpu.finish();
        let seconds = start.elapsed().as_secs_f64();
        self.gpu.check("measuring")?;
        Ok((seconds, layers))
    }

    fn device_times(&self, entrant: &mut Entrant, directions: &[Direction]) -> Result<DeviceTimes> {
        entrant.begin(self);
        self.gpu.finish();
        let clock = StageClock::start(&self.gpu);
        let start = Instant::now();
        entrant.gather(self, directions)?;
        self.gpu.finish();
        let wall = start.elapsed().as_secs_f64();
        let times = clock.take();
        let busy: Option<f64> = times.stages.iter().map(|&(_, seconds)| seconds).sum();
        let stage = |(name, seconds): (&str, Option<f64>)| StageTime {
            name: name.to_owned(),
            ms_per_direction: seconds.map(|seconds| 1e3 * seconds / directions.len() as f64),
        };
        Ok(DeviceTimes {
            waits: times.waits / wall,
            // A gather that names no stages has told nothing.
            idle: busy.filter(|_| !times.stages.is_empty()).map(|busy| 1.0 - busy / wall),
            stages: times.stages.into_iter().map(stage).collect(),
        })
    }
}

/// What a contestant finds with more and more directions.
pub struct Converging<'a> {
    bench: &'a Bench,
    entrant: Entrant,
    sequence: Directions,
    done: u32,
}

impl Converging<'_> {
    /// Irradiance at every point once `directions` directions in all have been gathered.
    ///
    /// # Errors
    /// As [`Bench::measure`].
    pub fn after(&mut self, directions: u32) -> Result<Vec<DVec3>> {
        let next: Vec<_> = (self.done..directions).map(|index| self.sequence.get(index)).collect();
        self.entrant.gather(self.bench, &next)?;
        self.bench.gpu.check("converging")?;
        self.done = directions;
        let sums = self.entrant.sums();
        Ok(self.bench.spread(usize::MAX).into_iter().map(|place| irradiance(sums[place])).collect())
    }
}

impl Row {
    /// What the times of rounds tell, in units that compare.
    fn of(rounds: &[f64], directions: u32, points: u32, ends: Option<u32>) -> Self {
        let seconds = median(rounds);
        // Where one end counts, half of the points face along it.
        let samples_a_point = f64::from(directions) * if ends == Some(1) { 0.5 } else { 1.0 };
        Self {
            ends,
            seconds,
            seconds_range: [rounds.iter().copied().fold(f64::INFINITY, f64::min), rounds.iter().copied().fold(0.0, f64::max)],
            ms_per_direction: 1e3 * seconds / f64::from(directions),
            ms_per_sample: 1e3 * seconds / samples_a_point,
            samples_per_second: f64::from(points) * samples_a_point / seconds,
            ..Self::default()
        }
    }
}

/// What exact rays find at some of the points.
struct Oracle {
    /// Into [`Bench::pixels`].
    places: Vec<usize>,
    /// With one end of each direction, and with both.
    same_rays: [Vec<DVec3>; 2],
    /// Fewer places, for more directions.
    few_places: Vec<usize>,
    converged: Vec<DVec3>,
}

impl Oracle {
    fn new(bench: &Bench, directions: &[Direction], converged: u32) -> Self {
        let forward: Vec<_> = directions.iter().map(|direction| direction.vector).collect();
        let places = bench.spread((ORACLE_RAYS / forward.len()).clamp(64, ORACLE_POINTS));
        let few_places = bench.spread(ORACLE_RAYS.checked_div(converged as usize).map_or(0, |points| points.max(64)));
        Self {
            same_rays: [&forward, &both_ends(&forward)].map(|directions| bench.by_rays(&places, directions)),
            converged: bench.by_rays(&few_places, &bench.other_directions(converged)),
            places,
            few_places,
        }
    }

    /// How far a gather is from exact rays along the same directions, and from many.
    fn judge(&self, ends: Option<u32>, sums: &[Vec4]) -> [Option<Deviation>; 2] {
        let at = |places: &[usize]| -> Vec<_> { places.iter().map(|&place| irradiance(sums[place])).collect() };
        let same_rays = ends.map(|ends| Deviation::between(&at(&self.places), &self.same_rays[ends as usize - 1]));
        let asked = !self.converged.is_empty();
        [same_rays, asked.then(|| Deviation::between(&at(&self.few_places), &self.converged))]
    }
}

/// Each direction and its opposite.
fn both_ends(directions: &[Vec3]) -> Vec<Vec3> {
    directions.iter().flat_map(|&direction| [direction, -direction]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_end_of_a_direction_is_half_a_sample() {
        // The middle round took 2 s.
        let row = |ends| Row::of(&[9.0, 2.0, 1.0], 4, 1000, ends);
        let both = row(Some(2));
        assert_eq!((both.seconds, both.seconds_range), (2.0, [1.0, 9.0]));
        assert_eq!([both.ms_per_direction, both.ms_per_sample, both.samples_per_second], [500.0, 500.0, 2000.0]);
        assert_eq!(row(None), Row { ends: None, ..both.clone() });
        assert_eq!(row(Some(1)), Row { ends: Some(1), ms_per_sample: 1000.0, samples_per_second: 1000.0, ..both });
    }
}
