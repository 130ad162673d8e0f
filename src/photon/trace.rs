//! Photon tracing on the CPU, in parallel, with the same result for any number of threads.
//!
//! A photon starts at a point of the lights chosen by power, with a cosine distribution about the emitting normal. At every surface
//! it is stored; then Russian roulette reflects it with the share that its strongest channel keeps, so that the survivors
//! carry about as much flux as was emitted with each.

use std::f32::consts::PI;
use std::ops::{AddAssign, Range};

use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

use super::grid::PhotonGrid;
use crate::math::cosine_direction;
use crate::random::{Random, Recurrence};
use crate::scene::{Bvh, Lights, RAY_OFFSET, Scene};

/// Photons traced between two sums: bounds the memory that their hits take.
const ROUND: u64 = 1 << 18;
/// Photons that one task traces.
const CHUNK: u64 = 1 << 12;

/// Traces photons through one scene.
pub struct PhotonTracer<'a> {
    scene: &'a Scene,
    bvh: &'a Bvh,
    lights: &'a Lights,
    starts: Recurrence<5>,
    seed: u64,
    bounces: u32,
}

/// How a photon's flight ends.
enum End {
    Absorbed,
    Escaped,
    Cut,
}

/// How many photons there were: each one emitted was absorbed, escaped or was cut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PhotonCounts {
    pub emitted: u64,
    /// A photon counts once for every surface that it was stored at.
    pub stored: u64,
    /// Ended at a surface, by Russian roulette.
    pub absorbed: u64,
    /// Met no surface any more.
    pub escaped: u64,
    /// Would have flown on from the last surface that the limit on bounces allows.
    pub cut: u64,
}

impl AddAssign for PhotonCounts {
    fn add_assign(&mut self, other: Self) {
        self.emitted += other.emitted;
        self.stored += other.stored;
        self.absorbed += other.absorbed;
        self.escaped += other.escaped;
        self.cut += other.cut;
    }
}

impl<'a> PhotonTracer<'a> {
    /// `bounces` is the most surfaces that one photon is stored at.
    pub fn new(scene: &'a Scene, bvh: &'a Bvh, lights: &'a Lights, seed: u64, bounces: u32) -> Self {
        Self { scene, bvh, lights, starts: Recurrence::new(seed), seed, bounces }
    }

    /// Emits the photons with these numbers, which share the lights' whole power, and adds what they leave at surfaces to `grid`.
    /// Other numbers give other photons, and together they cover the lights evenly.
    pub fn trace(&self, photons: Range<u64>, grid: &mut PhotonGrid) -> PhotonCounts {
        let emitted = photons.end - photons.start;
        let mut counts = PhotonCounts::default();
        for round in photons.clone().step_by(ROUND as usize) {
            let end = (round + ROUND).min(photons.end);
            let chunks: Vec<u64> = (round..end).step_by(CHUNK as usize).collect();
            // Traced in parallel, summed in the order of photons.
            let traced: Vec<(PhotonCounts, Vec<(usize, Vec3)>)> = chunks
                .into_par_iter()
                .map(|chunk| {
                    let (mut counts, mut hits) = (PhotonCounts::default(), Vec::new());
                    for photon in chunk..(chunk + CHUNK).min(end) {
                        match self.trace_one(photon, 1.0 / emitted as f32, grid, &mut hits) {
                            End::Absorbed => counts.absorbed += 1,
                            End::Escaped => counts.escaped += 1,
                            End::Cut => counts.cut += 1,
                        }
                        counts.emitted += 1;
                    }
                    counts.stored = hits.len() as u64;
                    (counts, hits)
                })
                .collect();
            for (of_chunk, hits) in traced {
                counts += of_chunk;
                for (index, flux) in hits {
                    grid.add_flux(index, flux);
                }
            }
        }
        counts
    }

    fn trace_one(&self, photon: u64, share: f32, grid: &PhotonGrid, hits: &mut Vec<(usize, Vec3)>) -> End {
        let [pick, u, v, s, t] = self.starts.point(photon);
        let mut random = Random::new(self.seed, photon);
        let start = self.lights.point(pick, [u, v]);
        let (mut origin, mut triangle) = (start.position + RAY_OFFSET * start.normal, start.triangle);
        let mut direction = cosine_direction(start.normal, s, t);
        // A diffuse emitter of radiance L sends out πL per unit of area.
        let mut flux = PI * share * start.radiance_area;
        for _ in 0..self.bounces {
            let Some(hit) = self.bvh.nearest(origin, direction, Some(triangle)) else { return End::Escaped };
            (origin, triangle) = (origin + hit.distance * direction, hit.triangle);
            hits.push((grid.index_of_hit(&self.scene.mesh, triangle, origin, direction), flux));

            let reflected = flux * self.scene.albedo(triangle, self.scene.mesh.barycentric(triangle, origin));
            let survival = reflected.max_element() / flux.max_element();
            if random.uniform() >= survival {
                return End::Absorbed;
            }
            flux = reflected / survival;
            let side = self.scene.mesh.side_met(triangle, direction);
            origin += RAY_OFFSET * side;
            direction = cosine_direction(side, random.uniform(), random.uniform());
        }
        End::Cut
    }
}
