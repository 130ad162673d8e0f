//! Photon tracing on the CPU, in parallel, with the same result for any number of threads.
//!
//! A photon starts at a light chosen by power ([`Lights::emit`]). At every surface
//! it is stored; then Russian roulette reflects it with the share that its strongest channel keeps, so that the survivors
//! carry about as much flux as was emitted with each. Mirrors and glass send it on in one direction and store nothing; but a mirror that photons
//! reach from a diffuse surface stores them, for gather rays take it for a Lambertian one. What goes from a light by mirrors and glass
//! alone to a diffuse surface is what [`PhotonTracer::caustics`] returns.

use std::ops::{AddAssign, Range};

use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

use super::caustics::CausticPhoton;
use super::grid::PhotonGrid;
use crate::math::cosine_direction;
use crate::random::{Random, Recurrence};
use crate::scene::{Bvh, Lights, MOST_SPECULAR, Path, Scene, Surface};

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
    /// Would have flown on from the last surface that a limit allows: of surfaces that store it, or of mirrors and glass in a row.
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
        Self { scene, bvh, lights, starts: Recurrence::new(seed), seed, bounces }
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
        grid.settle();
        counts
    }

    /// What the photons with these numbers, which share the lights' whole power, bring to diffuse surfaces by way of mirrors and glass alone.
    pub fn caustics(&self, photons: Range<u64>) -> Vec<CausticPhoton> {
        let share = 1.0 / (photons.end - photons.start) as f32;
        let chunks: Vec<u64> = photons.clone().step_by(CHUNK as usize).collect();
        let trace = |photon| {
            let (mut path, mut flux, mut random) = self.emit(photon, share);
            for specular in 0..=MOST_SPECULAR {
                let side = self.scene.mesh.side_met(path.advance(self.bvh)?, path.direction);
                let Some(kept) = path.scatter(self.scene, &mut random.uniform()) else {
                    return (specular > 0).then_some(CausticPhoton { position: path.origin, side, flux });
                };
                flux *= kept;
            }
            None
        };
        chunks.into_par_iter().flat_map_iter(|chunk| (chunk..(chunk + CHUNK).min(photons.end)).filter_map(trace)).collect()
    }

    /// Where a photon starts, and what it carries.
    fn emit(&self, photon: u64, share: f32) -> (Path, Vec3, Random) {
        let (path, flux) = self.lights.emit(self.starts.point(photon));
        (path, share * flux, Random::new(self.seed, photon))
    }

    fn trace_one(&self, photon: u64, share: f32, grid: &PhotonGrid, hits: &mut Vec<(usize, Vec3)>) -> End {
        let (mut path, mut flux, mut random) = self.emit(photon, share);
        let mesh = &self.scene.mesh;
        // Diffuse surfaces so far, and mirrors and glass since the last of them.
        let (mut diffuse, mut specular) = (0, 0);
        loop {
            let Some(triangle) = path.advance(self.bvh) else { return End::Escaped };
            let surface = self.scene.material(triangle).surface;
            // The light that a mirror throws straight from a lamp is a caustic, and gather rays are not to see it again.
            if surface == Surface::Diffuse || surface == Surface::Mirror && diffuse > 0 {
                hits.push((grid.index_of_hit(mesh, triangle, path.origin, path.direction), flux));
            }
            let side = mesh.side_met(triangle, path.direction);
            let kept = match surface {
                Surface::Diffuse => None,
                _ => path.scatter(self.scene, &mut random.uniform()),
            };
            let reflected = flux * kept.unwrap_or_else(|| self.scene.albedo(triangle, mesh.barycentric(triangle, path.origin)));
            let survival = reflected.max_element() / flux.max_element();
            // What comes from beside a bright texel of the environment may carry nothing, and ends here too.
            if flux == Vec3::ZERO || random.uniform() >= survival {
                return End::Absorbed;
            }
            flux = reflected / survival;
            (diffuse, specular) = if kept.is_some() { (diffuse, specular + 1) } else { (diffuse + 1, 0) };
            if diffuse == self.bounces || specular > MOST_SPECULAR {
                return End::Cut;
            }
            if kept.is_none() {
                path.leave(side, cosine_direction(side, random.uniform(), random.uniform()));
            }
        }
    }
}
