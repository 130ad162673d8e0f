//! The methods that a bench measures: every pipeline, and cosine-sampled rays, the usual method without bundles.

use glam::Vec4;
use rayon::prelude::*;

use super::Bench;
use crate::direction::Direction;
use crate::error::Result;
use crate::gather::{GatherInputs, IrradianceGather};
use crate::math::cosine_direction;
use crate::points::{GatherPoint, Interleave};
use crate::prepared::Prepared;
use crate::random::{Random, Recurrence};
use crate::settings::Pipeline;

/// A named way to gather.
pub struct Contestant {
    pub name: &'static str,
    /// A one-line description.
    pub about: &'static str,
    /// `None`: rays on the CPU, point by point, cosine-distributed about each point's normal. Each point shifts one low-discrepancy set by its own
    /// random offset. This is the usual method without bundles.
    pipeline: Option<Pipeline>,
}

/// The contestant that the others are compared with.
pub const FUSED: &str = "fused";

/// All contestants, in the order of their turns.
pub const CONTESTANTS: &[Contestant] = &[
    Contestant::new("kill", "the method of 2004", Some(Pipeline::Kill)),
    Contestant::new("early-kill", "the same with an early KILL", Some(Pipeline::EarlyKill)),
    Contestant::new(FUSED, "all layers of a direction in one pass, both its ends", Some(Pipeline::Fused)),
    Contestant::new("raycast-gl", "rays on the GL side, both ends of each direction", Some(Pipeline::RaycastGl)),
    Contestant::new("raycast", "rays on the CPU along the shared directions", Some(Pipeline::Raycast)),
    Contestant::new("raycast-cosine", "rays on the CPU, cosine-sampled at each point", None),
];

impl Contestant {
    const fn new(name: &'static str, about: &'static str, pipeline: Option<Pipeline>) -> Self {
        Self { name, about, pipeline }
    }

    pub fn named(name: &str) -> Option<&'static Self> {
        CONTESTANTS.iter().find(|contestant| contestant.name == name)
    }

    /// Whether it finds hits on the GL side.
    pub fn is_gl(&self) -> bool {
        self.pipeline.is_some_and(|pipeline| pipeline != Pipeline::Raycast)
    }

    /// Prepares the contestant. `seed` is the seed of its rays when each point has its own rays.
    pub(super) fn enter(&self, bench: &Bench, seed: u64) -> Result<Entrant> {
        let Some(pipeline) = self.pipeline else {
            return Ok(Entrant::CosineRays { sums: vec![Vec4::ZERO; bench.pixels.len()], seed, taken: 0 });
        };
        let settings = bench.settings.with(|s| s.gather.pipeline = pipeline);
        let Prepared { scene, bvh, .. } = &bench.prepared;
        let all = Interleave::new(1, bench.points().size(), 0);
        Ok(Entrant::Shared(IrradianceGather::new(&bench.gpu, &settings, scene, bvh, all)?))
    }
}

/// A contestant with its sums.
pub(super) enum Entrant {
    /// Along directions that all points share.
    Shared(IrradianceGather),
    /// Each point has its own rays. `sums` is row by row from the bottom, as on the GL side.
    CosineRays { sums: Vec<Vec4>, seed: u64, taken: u64 },
}

impl Entrant {
    /// As [`super::Row::ends`].
    pub fn ends(&self) -> Option<u32> {
        match self {
            Self::Shared(gather) => Some(if gather.both_ends() { 2 } else { 1 }),
            Self::CosineRays { .. } => None,
        }
    }

    /// The most directions in a batch.
    pub fn batch(&self) -> usize {
        match self {
            Self::Shared(gather) => gather.batch(),
            Self::CosineRays { .. } => 1,
        }
    }

    /// Clears the sums.
    pub fn begin(&mut self, bench: &Bench) {
        match self {
            Self::Shared(gather) => gather.begin(&bench.pixels),
            Self::CosineRays { sums, taken, .. } => {
                sums.fill(Vec4::ZERO);
                *taken = 0;
            }
        }
    }

    /// Gathers along `directions`. Returns the most layers of a direction; 0 when the contestant peels none.
    pub fn gather(&mut self, bench: &Bench, directions: &[Direction]) -> Result<u32> {
        let (scene, photons) = (&bench.prepared.scene, &bench.photons.texture);
        let (geometry, oracle) = (&bench.geometry, bench.oracle());
        match self {
            Self::Shared(gather) => {
                gather.add(GatherInputs { scene, geometry, photons, oracle, points: bench.points() }, directions)
            }
            Self::CosineRays { sums, seed, taken } => {
                let (set, seed) = (Recurrence::<2>::new(*seed), *seed);
                let numbers = *taken..*taken + directions.len() as u64;
                let cast = |(i, (point, sum)): (usize, (&Option<GatherPoint>, &mut Vec4))| {
                    let Some(point) = point else { return };
                    let mut random = Random::new(seed, i as u64);
                    let shift = [random.uniform(), random.uniform()];
                    for number in numbers.clone() {
                        let [u, v] = set.point(number);
                        let direction = cosine_direction(point.normal, (u + shift[0]).fract(), (v + shift[1]).fract());
                        let sample = oracle.sample(point, direction, number as u32).as_vec4();
                        // The density of the ray is proportional to its weight. Both are zero under the surface.
                        *sum += if sample.w > 0.0 { sample / sample.w } else { Vec4::ZERO };
                    }
                };
                bench.pixels.par_iter().zip(sums.par_iter_mut()).enumerate().for_each(cast);
                *taken += directions.len() as u64;
                Ok(0)
            }
        }
    }

    /// The sums in the order of [`Bench::pixels`]. rgb: Σ radiance × weight; a: Σ weight.
    pub fn sums(&self) -> Vec<Vec4> {
        match self {
            Self::Shared(gather) => gather.read(),
            Self::CosineRays { sums, .. } => sums.clone(),
        }
    }
}
