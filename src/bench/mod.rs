//! Measures gathers side by side: total time, time per stage, and error, for the same points, directions and photons.
//!
//! All contestants take turns, round after round, so that other load on the machine affects all of them alike. A time is the median of its rounds.
//! A gather that skips hard cases is fast, so speed alone says little: each [`Row`] also has the error against exact rays.
//!
//! A *sample* is one ray that counts at one point. A direction with both ends gives every point one sample; with one end it gives one only to the
//! points that face along it, half of them. [`Row::ms_per_sample`] compares costs: the time in which every point gets one sample.
//!
//! [`Bench::new`] takes a scene in unit space; [`Bench::measure`] runs the contestants.

mod contestant;
mod deviation;

use std::time::Instant;

use glam::{DVec3, Vec2, Vec3, Vec4};
use serde::{Deserialize, Serialize};

pub use contestant::{CONTESTANTS, Contestant, FUSED};
pub use deviation::{Deviation, irradiance, median};

use crate::direction::{Direction, Directions};
use crate::error::{Error, Result};
use crate::geometry::Geometry;
use crate::gpu::{Gpu, StageClock};
use crate::points::{CameraPoints, GBuffer, GatherPoint, PointList, Points, sides};
use crate::prepared::{Photons, Prepared};
use crate::reference::Reference;
use crate::scene::Scene;
use crate::settings::Settings;
use contestant::Entrant;

/// A scene with its photons and gather points.
pub struct Bench {
    gpu: Gpu,
    settings: Settings,
    prepared: Prepared,
    photons: Photons,
    geometry: Geometry,
    source: PointOrigin,
    /// The points in texel order; `None`: a texel without a point.
    pixels: Vec<Option<GatherPoint>>,
}

enum PointOrigin {
    Camera(CameraPoints, GBuffer),
    List(PointList),
}

/// The points to gather at.
pub enum Where {
    /// The points that the scene's camera sees in a picture of [`FilmSettings::size`](crate::settings::FilmSettings::size).
    Camera,
    /// Given points, in unit space.
    Points(Vec<GatherPoint>),
}

/// How much to measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BenchPlan {
    /// Directions of each contestant in a round.
    pub directions: u32,
    pub rounds: u32,
    /// Whether to time the device's stages, in an extra round.
    pub stages: bool,
    /// Directions, with both ends, of the irradiance that [`Row::converged`] compares with; 0: no comparison.
    pub converged: u32,
}

/// The measurements of one contestant.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    pub name: String,
    /// How many ends of a direction count; null when each point has its own rays, as many as there are directions.
    pub ends: Option<u32>,
    /// Median over the rounds.
    pub seconds: f64,
    /// Seconds of the fastest and of the slowest round.
    pub seconds_range: [f64; 2],
    pub ms_per_direction: f64,
    /// Time in which every point gets one sample.
    pub ms_per_sample: f64,
    pub samples_per_second: f64,
    /// The most layers of a direction; 0 when the contestant peels none.
    pub layers_max: u32,
    /// Null for contestants on the CPU, and when not asked for.
    pub device: Option<DeviceTimes>,
    /// Against exact rays along the same directions; null when each point has its own rays.
    pub same_rays: Option<Deviation>,
    /// Against many directions. The excess over [`Row::same_rays`] comes from the small number of directions or rays. Null when not asked for.
    pub converged: Option<Deviation>,
}

/// Times of the extra round that times the stages.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceTimes {
    pub stages: Vec<StageTime>,
    /// Share of the wall-clock time that the CPU waited for the device. Software drivers work on the same cores meanwhile.
    pub waits: f64,
    /// Share of the wall-clock time that is in no stage; null when the driver gives no times.
    pub idle: Option<f64>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageTime {
    pub name: String,
    /// Null when the driver gives no times.
    pub ms_per_direction: Option<f64>,
}

/// Most points at which errors are measured.
const ORACLE_POINTS: usize = 16384;
/// Most rays of each part of the oracle; but it always takes at least 64 points.
const ORACLE_RAYS: usize = 1 << 24;

impl Bench {
    /// Traces the photons and finds the points. `scene` is in unit space.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] when a setting is out of range or beyond the device's limits, or there is no light or no point;
    /// [`crate::Error::Gl`] when the device fails.
    pub fn new(gpu: &Gpu, scene: Scene, settings: &Settings, at: Where) -> Result<Self> {
        settings.validate()?;
        // Gather rays pass straight through glass.
        let scene = scene.without_glass().unwrap_or(scene);
        let geometry = Geometry::upload(gpu, &scene)?;
        let (source, pixels) = match at {
            Where::Camera => {
                let camera = CameraPoints::new(gpu, settings.film.size)?;
                let visible = camera.see(&geometry, &scene.camera(settings.film.size), Vec2::splat(0.5));
                let pixels = visible.pixels();
                // Only the counts are needed from now on.
                let (count, cut) = (visible.count, visible.cut);
                let [position, normal, albedo, emission] = Default::default();
                let counts = GBuffer { position, normal, albedo, emission, gloss: Vec::new(), count, cut };
                (PointOrigin::Camera(camera, counts), pixels)
            }
            Where::Points(points) => {
                (PointOrigin::List(PointList::upload(gpu, &points)?), points.into_iter().map(Some).collect())
            }
        };
        if pixels.iter().flatten().next().is_none() {
            return Err(Error::usage("there is no point to gather at: the camera sees no surface", "turn the camera"));
        }
        let prepared = Prepared::of(scene);
        if prepared.lights.is_dark() {
            return Err(Error::usage("the scene has no light that is large enough beside it", "enlarge the lights"));
        }
        let seen: Vec<GatherPoint> = pixels.iter().flatten().copied().collect();
        let of = (&settings.photons, settings.seed);
        let photons = Photons::new(gpu, [&prepared, &prepared], of, &sides(&seen), || false)?;
        gpu.finish();
        gpu.check("preparing a bench")?;
        Ok(Self { gpu: gpu.clone(), settings: *settings, prepared, photons, geometry, source, pixels })
    }

    /// Number of gather points.
    pub fn point_count(&self) -> u32 {
        self.points().count
    }

    pub fn triangle_count(&self) -> usize {
        self.prepared.scene.mesh.triangles.len()
    }

    fn points(&self) -> Points<'_> {
        match &self.source {
            PointOrigin::Camera(camera, visible) => camera.points(visible),
            PointOrigin::List(list) => list.points(),
        }
    }

    /// Measures `contestants` in turns. Returns one row for each, in their order.
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
        // A first run without timing: drivers compile and allocate at the first draw.
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

    /// Begins a gather by one contestant along the directions of one seed.
    ///
    /// # Errors
    /// As [`Self::measure`].
    pub fn converging(&self, contestant: &Contestant, seed: u64) -> Result<Converging<'_>> {
        let mut entrant = contestant.enter(self, seed)?;
        entrant.begin(self);
        Ok(Converging { bench: self, entrant, sequence: Directions::new(self.settings.directions.sequence, seed), done: 0 })
    }

    /// Irradiance at every point by exact rays along both ends of this many directions. No contestant uses these directions.
    pub fn converged(&self, directions: u32) -> Vec<DVec3> {
        self.by_rays(&self.spread(usize::MAX), &self.other_directions(directions))
    }

    /// Exact rays in the scene, which see its photon map.
    fn oracle(&self) -> Reference<'_> {
        Reference::new(&self.prepared.scene, &self.prepared.bvh, self.photons.map.store())
    }

    fn other_directions(&self, count: u32) -> Vec<Vec3> {
        let others = Directions::new(self.settings.directions.sequence, !self.settings.seed);
        both_ends(&(0..count).map(|index| others.get(index).vector).collect::<Vec<_>>())
    }

    fn by_rays(&self, places: &[usize], directions: &[Vec3]) -> Vec<DVec3> {
        let points: Vec<_> = places.iter().filter_map(|&place| self.pixels[place]).collect();
        let sums = self.oracle().gather(&points, directions);
        sums.into_iter().map(irradiance).collect()
    }

    /// At most `most` of the points, evenly spread, as places in [`Bench::pixels`].
    fn spread(&self, most: usize) -> Vec<usize> {
        // An even step could visit only a few columns of a picture.
        let step = (self.point_count() as usize).div_ceil(most.max(1));
        let places = (0..self.pixels.len()).filter(|&place| self.pixels[place].is_some());
        places.step_by(if step > 1 { step | 1 } else { 1 }).take(most).collect()
    }

    /// Runs one round. Returns its seconds and the most layers of a direction.
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
            // A gather without stages gives no idle time.
            idle: busy.filter(|_| !times.stages.is_empty()).map(|busy| 1.0 - busy / wall),
            stages: times.stages.into_iter().map(stage).collect(),
        })
    }
}

/// A contestant's gather with a growing number of directions.
pub struct Converging<'a> {
    bench: &'a Bench,
    entrant: Entrant,
    sequence: Directions,
    done: u32,
}

impl Converging<'_> {
    /// Irradiance at every point after `directions` directions in total.
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
    /// The times of rounds, in comparable units.
    fn of(rounds: &[f64], directions: u32, points: u32, ends: Option<u32>) -> Self {
        let seconds = median(rounds);
        // With one end, half of the points face along a direction.
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

/// Irradiance by exact rays at some of the points.
struct Oracle {
    /// Indices into [`Bench::pixels`].
    places: Vec<usize>,
    /// With one end of each direction, and with both ends.
    same_rays: [Vec<DVec3>; 2],
    /// Fewer indices, because `converged` takes more directions.
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

    /// The deviations of a gather from exact rays along the same directions, and along many directions.
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
        // The median round took 2 s.
        let row = |ends| Row::of(&[9.0, 2.0, 1.0], 4, 1000, ends);
        let both = row(Some(2));
        assert_eq!((both.seconds, both.seconds_range), (2.0, [1.0, 9.0]));
        assert_eq!([both.ms_per_direction, both.ms_per_sample, both.samples_per_second], [500.0, 500.0, 2000.0]);
        assert_eq!(row(None), Row { ends: None, ..both.clone() });
        assert_eq!(row(Some(1)), Row { ends: Some(1), ms_per_sample: 1000.0, samples_per_second: 1000.0, ..both });
    }
}
