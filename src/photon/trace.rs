//! Photon tracing on the CPU, in parallel. Any number of threads gives the same result.
//!
//! A photon starts at a light, chosen by power ([`Lights::emit`]).
//! Every diffuse surface stores it. Then Russian roulette reflects it with the probability that its strongest channel keeps, so survivors
//! carry about the flux that was emitted with each. Mirrors and glass send it on in one direction and do not store it. One exception: a mirror
//! stores photons that come from a diffuse surface, because gather rays treat mirrors as Lambertian. [`PhotonTracer::caustics`] returns photons
//! that reach a diffuse surface from a light by mirrors and glass alone.
//!
//! A glossy surface stores photons as a diffuse one, and reflects them by its base or by its lobe. A narrow lobe is a mirror in what has been said; then
//! the surface stores only what its base reflects of light that comes from a lamp.

use std::ops::{AddAssign, Range};

use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

use super::caustics::CausticPhoton;
use super::guide::Guide;
use super::store::PhotonStore;
use crate::math::cosine_direction;
use crate::random::{Random, Recurrence};
use crate::scene::{Brdf, Bvh, Chance, Focus, Lights, LobeShares, MOST_SPECULAR, Path, Rays, Scene, Surface};

/// Number of photons between two sums. It limits the memory of their hits.
const ROUND: u64 = 1 << 18;
/// Number of photons of one task.
const CHUNK: u64 = 1 << 12;
/// Number of photons that [`PhotonTracer::arrivals`] traces at most.
const PILOTS: u64 = 1 << 16;

/// Traces photons through one scene.
pub struct PhotonTracer<'a> {
    scene: &'a Scene,
    rays: Rays<'a>,
    lights: &'a Lights,
    starts: Recurrence<5>,
    seed: u64,
    depth: u32,
    guide: Option<&'a Guide>,
}

/// The place of a stored hit: of the triangle that a path has just met.
type HitIndex<'a> = dyn Fn(usize, &Path) -> usize + Sync + 'a;

/// How a photon's path ends.
enum PhotonEnd {
    Absorbed,
    Escaped,
    Cut,
}

/// Numbers of photons. Each emitted photon was absorbed, escaped or was cut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PhotonCounts {
    pub emitted: u64,
    /// A photon counts once for each surface that stores it.
    pub stored: u64,
    /// Photons that Russian roulette ended at a surface.
    pub absorbed: u64,
    /// Photons that left the scene.
    pub escaped: u64,
    /// Photons that reached the limit of stored hits, or of mirrors and glass in a row.
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
    /// `depth` is the most surfaces that store one photon. `scene` is in unit space.
    pub fn new(scene: &'a Scene, bvh: &'a Bvh, lights: &'a Lights, seed: u64, depth: u32) -> Self {
        Self { scene, rays: Rays::new(scene, bvh), lights, starts: Recurrence::new(seed), seed, depth, guide: None }
    }

    /// The same photons' numbers, with starts by `guide`.
    pub fn guided(self, guide: Option<&'a Guide>) -> Self {
        Self { guide, ..self }
    }

    /// The numbers of a photon's start, without a guide.
    pub(super) fn start(&self, photon: u64) -> [f32; 5] {
        self.starts.point(photon)
    }

    pub(super) fn side_met(&self, triangle: usize, direction: Vec3) -> Vec3 {
        self.scene.mesh.side_met(triangle, direction)
    }

    /// The flux that a photon with this start brings to surfaces, each counted by its `score`: of a triangle, met at a position along a direction.
    pub(super) fn brought(
        &self,
        photon: u64,
        start: [f32; 5],
        focus: &Focus,
        score: &(dyn Fn(usize, Vec3, Vec3) -> f32 + Sync),
    ) -> f32 {
        let (path, flux) = self.lights.emit_at(start, focus);
        let mut hits = Vec::new();
        let index = |triangle: usize, path: &Path| score(triangle, path.origin, path.direction).to_bits() as usize;
        self.follow(photon, (path, flux, Random::new(self.seed, photon)), &index, &mut hits);
        hits.into_iter().map(|(score, flux)| f32::from_bits(score as u32) * flux.element_sum()).sum()
    }

    /// Emits the photons with these numbers, which share the whole power of lights and environment, and adds their flux at surfaces to `store`.
    /// Other numbers give other photons. All together they sample the lights evenly.
    pub fn trace(&self, photons: Range<u64>, store: &mut dyn PhotonStore) -> PhotonCounts {
        let mut counts = PhotonCounts::default();
        let share = 1.0 / (photons.end - photons.start) as f32;
        for round in photons.clone().step_by(ROUND as usize) {
            let (of_round, hits) = {
                let mesh = &self.scene.mesh;
                let index = |triangle, path: &Path| store.index_of_hit(mesh, triangle, path.origin, path.direction);
                self.hits(round..(round + ROUND).min(photons.end), share, &index)
            };
            counts += of_round;
            hits.into_iter().for_each(|(index, flux)| store.add_flux(index, flux));
        }
        store.settle();
        counts
    }

    /// How many of `photons` photons each group of triangles stores, estimated from a few of them. `groups`: the group of each triangle.
    pub fn arrivals(&self, photons: u64, groups: &[u32], count: usize) -> Vec<f32> {
        let pilots = photons.min(PILOTS);
        let (_, hits) = self.hits(0..pilots, 1.0, &|triangle, _| groups[triangle] as usize);
        let mut arrivals = vec![0.0; count];
        hits.into_iter().for_each(|(group, _)| arrivals[group] += photons as f32 / pilots as f32);
        arrivals
    }

    /// Traces photons, each with this share of the power. Returns the `index` and flux of all stored hits, in the order of photons.
    fn hits(&self, photons: Range<u64>, share: f32, index: &HitIndex) -> (PhotonCounts, Vec<(usize, Vec3)>) {
        let trace = |chunk: u64| {
            let (mut counts, mut hits) = (PhotonCounts::default(), Vec::new());
            for photon in chunk..(chunk + CHUNK).min(photons.end) {
                match self.trace_one(photon, share, index, &mut hits) {
                    PhotonEnd::Absorbed => counts.absorbed += 1,
                    PhotonEnd::Escaped => counts.escaped += 1,
                    PhotonEnd::Cut => counts.cut += 1,
                }
                counts.emitted += 1;
            }
            counts.stored = hits.len() as u64;
            (counts, hits)
        };
        let chunks: Vec<u64> = photons.clone().step_by(CHUNK as usize).collect();
        let traced: Vec<_> = chunks.into_par_iter().map(trace).collect();
        let (mut counts, mut all) = (PhotonCounts::default(), Vec::new());
        for (of_chunk, hits) in traced {
            counts += of_chunk;
            all.extend(hits);
        }
        (counts, all)
    }

    /// Traces photons as [`Self::trace`] does, and returns those that reach a diffuse surface by mirrors and glass alone.
    pub fn caustics(&self, photons: Range<u64>) -> Vec<CausticPhoton> {
        let share = 1.0 / (photons.end - photons.start) as f32;
        let chunks: Vec<u64> = photons.clone().step_by(CHUNK as usize).collect();
        let trace = |photon: u64, found: &mut Vec<CausticPhoton>| {
            let (mut path, mut flux, mut random) = self.emit(photon, share);
            for specular in 0..=MOST_SPECULAR {
                let Some(triangle) = path.advance(&self.rays, Chance::of_photon(photon, specular)) else { break };
                let Some(kept) = path.scatter(self.scene, &mut random.uniform()) else {
                    if specular > 0 {
                        let side = self.scene.mesh.side_met(triangle, path.direction);
                        found.push(CausticPhoton { position: path.origin, side, direction: path.direction, flux });
                    }
                    // What it stores counts for its base. Its lobe may send on the rest.
                    match self.follow_narrow_lobe(&mut path, flux, &mut random) {
                        Some(reflected) => flux = reflected,
                        None => break,
                    }
                    continue;
                };
                flux *= kept;
            }
        };
        let of_chunk = |chunk: u64| {
            let mut found = Vec::new();
            (chunk..(chunk + CHUNK).min(photons.end)).for_each(|photon| trace(photon, &mut found));
            found
        };
        chunks.into_par_iter().flat_map_iter(of_chunk).collect()
    }

    /// Sends a path on by the narrow lobe of the surface that it has met. Returns its flux after Russian roulette; `None` if it ends.
    fn follow_narrow_lobe(&self, path: &mut Path, flux: Vec3, random: &mut Random) -> Option<Vec3> {
        let (brdf, normal) = path.gloss(self.scene).filter(|(brdf, _)| !brdf.is_rough())?;
        let weight = path.leave_by_lobe(self.scene, (&brdf, normal), [random.uniform(), random.uniform()])?;
        let reflected = flux * weight;
        let survival = (reflected.max_element() / flux.max_element()).min(1.0);
        (random.uniform() < survival).then(|| reflected / survival)
    }

    /// The start of a photon's path, its flux, and its random numbers.
    fn emit(&self, photon: u64, share: f32) -> (Path, Vec3, Random) {
        let (path, flux) = match self.guide {
            None => self.lights.emit(self.starts.point(photon)),
            Some(guide) => {
                let (start, density) = guide.start(self.starts.point(photon));
                let (path, flux) = self.lights.emit_at(start, &guide.focus);
                (path, flux / density)
            }
        };
        (path, share * flux, Random::new(self.seed, photon))
    }

    fn trace_one(&self, photon: u64, share: f32, index: &HitIndex, hits: &mut Vec<(usize, Vec3)>) -> PhotonEnd {
        self.follow(photon, self.emit(photon, share), index, hits)
    }

    /// Follows a photon from its start, with its flux and random numbers.
    fn follow(
        &self,
        photon: u64,
        (mut path, mut flux, mut random): (Path, Vec3, Random),
        index: &HitIndex,
        hits: &mut Vec<(usize, Vec3)>,
    ) -> PhotonEnd {
        let mesh = &self.scene.mesh;
        // Numbers of diffuse surfaces so far, and of mirrors and glass since the last of them.
        let (mut diffuse, mut specular) = (0, 0);
        let mut surfaces = 0;
        loop {
            let chance = Chance::of_photon(photon, surfaces);
            let Some(triangle) = path.advance(&self.rays, chance) else { return PhotonEnd::Escaped };
            surfaces += 1;
            let surface = self.scene.material(triangle).surface;
            // Light of a lamp that mirrors reflect is a caustic. Gather rays must not count it again.
            let gloss = path.gloss(self.scene);
            if surface == Surface::Diffuse || surface == Surface::Mirror && diffuse > 0 {
                let stored =
                    gloss.map_or(flux, |(brdf, normal)| flux * self.stored_share(triangle, &path, (&brdf, normal), diffuse > 0));
                hits.push((index(triangle, &path), stored));
            }
            if let Some((brdf, normal)) = gloss {
                let Some((reflected, by_lobe)) = self.reflect(&mut path, flux, (&brdf, normal), &mut random) else {
                    return PhotonEnd::Absorbed;
                };
                flux = reflected;
                (diffuse, specular) = if by_lobe && !brdf.is_rough() { (diffuse, specular + 1) } else { (diffuse + 1, 0) };
                if diffuse == self.depth || specular > MOST_SPECULAR {
                    return PhotonEnd::Cut;
                }
                continue;
            }
            let side = mesh.side_met(triangle, path.direction);
            let kept = match surface {
                Surface::Diffuse => None,
                _ => path.scatter(self.scene, &mut random.uniform()),
            };
            let reflected = flux * kept.unwrap_or_else(|| self.scene.albedo(triangle, mesh.barycentric(triangle, path.origin)));
            let survival = reflected.max_element() / flux.max_element();
            // A photon from a dark place beside a bright texel of the environment may carry no flux. It ends here too.
            if flux == Vec3::ZERO || random.uniform() >= survival {
                return PhotonEnd::Absorbed;
            }
            flux = reflected / survival;
            (diffuse, specular) = if kept.is_some() { (diffuse, specular + 1) } else { (diffuse + 1, 0) };
            if diffuse == self.depth || specular > MOST_SPECULAR {
                return PhotonEnd::Cut;
            }
            if kept.is_none() {
                path.leave(side, cosine_direction(side, random.uniform(), random.uniform()));
            }
        }
    }

    /// What a glossy surface stores of a photon. Gather rays take it for Lambertian, with what it reflects of even light. This photon has it reflect another
    /// share. Of light from a lamp, not yet `scattered`, the narrow lobe's part belongs to caustics.
    fn stored_share(&self, triangle: usize, path: &Path, (brdf, normal): (&Brdf, Vec3), scattered: bool) -> Vec3 {
        let LobeShares { base, lobe, .. } = brdf.shares(-normal.dot(path.direction));
        let counted = if scattered || brdf.is_rough() { base + lobe } else { base };
        // With a texture of gloss its mean reflects, not this place.
        let albedo = self.scene.albedo(triangle, self.scene.mesh.barycentric(triangle, path.origin));
        counted / albedo.max(Vec3::splat(f32::MIN_POSITIVE))
    }

    /// Reflects a photon by the lobe or the base of a glossy surface, with Russian roulette. Returns its flux and whether it took the lobe; `None` if it ends.
    fn reflect(&self, path: &mut Path, flux: Vec3, (brdf, normal): (&Brdf, Vec3), random: &mut Random) -> Option<(Vec3, bool)> {
        if flux == Vec3::ZERO {
            return None;
        }
        let (side, eye) = (self.side_met(path.triangle?, path.direction), -path.direction);
        let LobeShares { base, lobe, .. } = brdf.shares(normal.dot(eye));
        let probability = (flux * lobe).element_sum() / (flux * (base + lobe)).element_sum();
        let by_lobe = random.uniform() < probability;
        let square = [random.uniform(), random.uniform()];
        let reflected = if by_lobe {
            flux * path.leave_by_lobe(self.scene, (brdf, normal), square)? / probability
        } else {
            let direction = cosine_direction(side, square[0], square[1]);
            path.leave(side, direction);
            flux * brdf.base_weight(eye, direction) / (1.0 - probability)
        };
        let survival = (reflected.max_element() / flux.max_element()).min(1.0);
        (random.uniform() < survival).then(|| (reflected / survival, by_lobe))
    }
}
