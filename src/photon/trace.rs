//! Photon tracing on the CPU, in parallel, with the same result for any number of threads.
//!
//! A photon starts at a point of the lights chosen by power, with a cosine distribution about the emitting normal; or it comes from the environment,
//! along a direction chosen by radiance, through any point of the disc across it that the scene's sphere fills. At every surface
//! it is stored; then Russian roulette reflects it with the share that its strongest channel keeps, so that the survivors
//! carry about as much flux as was emitted with each.

use std::f32::consts::{PI, TAU};
use std::ops::{AddAssign, Range};

use glam::{Vec3, vec3};
use rayon::prelude::*;
use serde::Serialize;

use super::grid::PhotonGrid;
use crate::environment::Environment;
use crate::math::{cosine_direction, frame};
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
    /// The environment's part in all power.
    from_beyond: f32,
    starts: Recurrence<5>,
    seed: u64,
    bounces: u32,
}

/// A photon that has met nothing yet.
struct Start {
    position: Vec3,
    direction: Vec3,
    flux: Vec3,
    /// That it starts on.
    triangle: Option<usize>,
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
    /// `bounces` is the most surfaces that one photon is stored at. `scene` is in unit space.
    pub fn new(scene: &'a Scene, bvh: &'a Bvh, lights: &'a Lights, seed: u64, bounces: u32) -> Self {
        // Radiance L from a solid angle Ω brings LΩ to each unit of area across it.
        let beyond = f64::from(PI) * scene.environment.as_ref().map_or(0.0, Environment::power);
        let from_beyond = (beyond / (beyond + lights.power())) as f32;
        Self { scene, bvh, lights, from_beyond, starts: Recurrence::new(seed), seed, bounces }
    }

    /// Emits the photons with these numbers, which share the whole power of lights and environment, and adds what they leave at surfaces to `grid`.
    /// Other numbers give other photons, and together they cover what shines evenly.
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
        let mut random = Random::new(self.seed, photon);
        let Start { position: mut origin, mut direction, mut flux, triangle: mut left } = self.start(self.starts.point(photon));
        flux *= share;
        for _ in 0..self.bounces {
            let Some(hit) = self.bvh.nearest(origin, direction, left) else { return End::Escaped };
            let triangle = hit.triangle;
            (origin, left) = (origin + hit.distance * direction, Some(triangle));
            hits.push((grid.index_of_hit(&self.scene.mesh, triangle, origin, direction), flux));

            let reflected = flux * self.scene.albedo(triangle, self.scene.mesh.barycentric(triangle, origin));
            let survival = reflected.max_element() / flux.max_element();
            // What comes from beside a bright texel of the environment may carry nothing, and ends here too.
            if flux == Vec3::ZERO || random.uniform() >= survival {
                return End::Absorbed;
            }
            flux = reflected / survival;
            let side = self.scene.mesh.side_met(triangle, direction);
            origin += RAY_OFFSET * side;
            direction = cosine_direction(side, random.uniform(), random.uniform());
        }
        End::Cut
    }

    /// Of the whole flux, as the mean over many photons.
    fn start(&self, [pick, u, v, s, t]: [f32; 5]) -> Start {
        match &self.scene.environment {
            Some(environment) if pick < self.from_beyond => {
                let (to_light, density) = environment.sample([u, v]);
                let (sin, cos) = (TAU * s).sin_cos();
                // The scene lies in the unit sphere, and the disc before it.
                let disc = frame(to_light) * (t.sqrt() * vec3(cos, sin, 0.0));
                let flux = environment.radiance(to_light) * (PI / (density * self.from_beyond));
                Start { position: disc + 1.1 * to_light, direction: -to_light, flux, triangle: None }
            }
            _ => {
                let pick = (pick - self.from_beyond) / (1.0 - self.from_beyond);
                let light = self.lights.point(pick, [u, v]);
                Start {
                    position: light.position + RAY_OFFSET * light.normal,
                    direction: cosine_direction(light.normal, s, t),
                    // A diffuse emitter of radiance L sends out πL per unit of area.
                    flux: light.radiance_area * (PI / (1.0 - self.from_beyond)),
                    triangle: Some(light.triangle),
                }
            }
        }
    }
}
