//! Who can be measured: every pipeline of the GL side, and rays on the CPU in two ways.

use glam::Vec4;
use rayon::prelude::*;

use super::Bench;
use crate::direction::Direction;
use crate::error::Result;
use crate::gather::{FusedGather, Gather, KillGather, RayGather, Work};
use crate::math::cosine_direction;
use crate::points::{GatherPoint, Sums};
use crate::random::{Random, Recurrence};
use crate::reference::Reference;

/// A way to gather, by name.
pub struct Contestant {
    pub name: &'static str,
    /// In a line for a person.
    pub about: &'static str,
    kind: Kind,
}

enum Kind {
    /// A [`Gather`] made for a bench's points and settings.
    Gl(fn(&Bench) -> Result<Box<dyn Gather>>),
    /// Along the shared directions, direction by direction as `Pipeline::Raycast` does: neighbouring rays are parallel.
    SharedRays,
    /// Cosine-distributed about each point's normal, point by point, each with a shift of its own of one low-discrepancy set: what one does
    /// without bundles.
    CosineRays,
}

/// The one that others are set against.
pub const FUSED: &str = "fused";

/// All of them, in the order in which they take turns.
pub const CONTESTANTS: &[Contestant] = &[
    Contestant {
        name: "kill",
        about: "the method of 2004",
        kind: Kind::Gl(|bench| {
            let settings = &bench.settings;
            Ok(Box::new(KillGather::new(&bench.gpu, settings.layers(), bench.points().size(), settings.stop_fraction)?))
        }),
    },
    Contestant {
        name: "early-kill",
        about: "the same with an early KILL",
        kind: Kind::Gl(|bench| {
            let settings = &bench.settings;
            Ok(Box::new(KillGather::early(&bench.gpu, settings.layers(), bench.points().size(), settings.stop_fraction)?))
        }),
    },
    Contestant {
        name: FUSED,
        about: "all layers of a direction in one pass, both its ends",
        kind: Kind::Gl(|bench| Ok(Box::new(FusedGather::new(&bench.gpu, bench.settings.layers())?))),
    },
    Contestant {
        name: "raycast-gl",
        about: "rays on the GL side, both ends of each direction",
        kind: Kind::Gl(|bench| Ok(Box::new(RayGather::new(&bench.gpu, &bench.scene)?))),
    },
    Contestant { name: "raycast", about: "rays on the CPU along the shared directions", kind: Kind::SharedRays },
    Contestant { name: "raycast-cosine", about: "rays on the CPU, cosine-sampled at each point", kind: Kind::CosineRays },
];

impl Contestant {
    pub fn named(name: &str) -> Option<&'static Self> {
        CONTESTANTS.iter().find(|contestant| contestant.name == name)
    }

    /// Whether it runs on the GL side.
    pub fn is_gl(&self) -> bool {
        matches!(self.kind, Kind::Gl(_))
    }

    /// `seed` is that of its own rays, where it has such.
    pub(super) fn enter(&self, bench: &Bench, seed: u64) -> Result<Entrant> {
        let rays = || vec![Vec4::ZERO; bench.pixels.len()];
        Ok(match self.kind {
            Kind::Gl(make) => Entrant::Gl { gather: make(bench)?, sums: Sums::new(&bench.gpu, bench.points().size())? },
            Kind::SharedRays => Entrant::SharedRays { sums: rays() },
            Kind::CosineRays => Entrant::CosineRays { sums: rays(), seed, taken: 0 },
        })
    }
}

/// Which rays count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rays {
    /// Those along the directions, at the points that face along them.
    OneEnd,
    /// Those to either side, at every point.
    BothEnds,
    /// As many rays at each point as there are directions, of its own.
    Own,
}

impl Rays {
    /// Expected number of rays that count at a point for each direction.
    pub fn per_direction(self) -> f64 {
        match self {
            Self::OneEnd => 0.5,
            Self::BothEnds | Self::Own => 1.0,
        }
    }
}

/// A contestant with its sums.
pub(super) enum Entrant {
    Gl { gather: Box<dyn Gather>, sums: Sums },
    SharedRays { sums: Vec<Vec4> },
    CosineRays { sums: Vec<Vec4>, seed: u64, taken: u64 },
}

impl Entrant {
    pub fn rays(&self) -> Rays {
        match self {
            Self::Gl { gather, .. } if gather.both_ends() => Rays::BothEnds,
            Self::Gl { .. } | Self::SharedRays { .. } => Rays::OneEnd,
            Self::CosineRays { .. } => Rays::Own,
        }
    }

    /// How many directions it takes at once.
    pub fn batch(&self) -> usize {
        match self {
            Self::Gl { gather, .. } => gather.batch(),
            _ => 1,
        }
    }

    /// Begins anew.
    pub fn clear(&mut self) {
        match self {
            Self::Gl { sums, .. } => sums.clear(),
            Self::SharedRays { sums } => sums.fill(Vec4::ZERO),
            Self::CosineRays { sums, taken, .. } => {
                sums.fill(Vec4::ZERO);
                *taken = 0;
            }
        }
    }

    /// Gathers and returns the most layers of a direction, 0 where nothing is peeled.
    pub fn gather(&mut self, bench: &Bench, directions: &[Direction]) -> Result<u32> {
        let rays = Reference::new(&bench.scene, &bench.bvh, &bench.grid);
        match self {
            Self::Gl { gather, sums } => {
                let work = Work {
                    scene: &bench.scene,
                    geometry: &bench.geometry,
                    photons: &bench.photons,
                    points: bench.points(),
                    sums,
                };
                directions.chunks(gather.batch()).try_fold(0, |most, batch| Ok(most.max(gather.add(work, batch)?)))
            }
            Self::SharedRays { sums } => {
                for direction in directions {
                    let cast = |(point, sum): (&Option<GatherPoint>, &mut Vec4)| {
                        *sum += point.map_or(Vec4::ZERO, |point| rays.sample(&point, direction.vector).as_vec4());
                    };
                    bench.pixels.par_iter().zip(sums.par_iter_mut()).for_each(cast);
                }
                Ok(0)
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
                        let sample = rays.sample(point, direction).as_vec4();
                        // Its density is the weight; under the surface there is neither.
                        *sum += if sample.w > 0.0 { sample / sample.w } else { Vec4::ZERO };
                    }
                };
                bench.pixels.par_iter().zip(sums.par_iter_mut()).enumerate().for_each(cast);
                *taken += directions.len() as u64;
                Ok(0)
            }
        }
    }

    /// rgb Σ radiance × weight, a Σ weight, in the order of [`Bench::pixels`].
    pub fn sums(&self) -> Vec<Vec4> {
        match self {
            Self::Gl { sums, .. } => sums.read(),
            Self::SharedRays { sums } | Self::CosineRays { sums, .. } => sums.clone(),
        }
    }
}
