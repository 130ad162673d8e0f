//! The oracle: the sums of a gather, computed with exact rays on the CPU.
//!
//! The GL side finds hits in rasterised layers, the oracle with rays. [`Reference::gather`] takes the same points, directions and photon map
//! and shares no other code with the GL side, so the difference between the two is the error of the layers alone.
//! It sums L(x, d) w and w over the directions d, with w = max(n·d, 0). L is albedo × E_photons / π at the nearest surface along d, or the
//! gathered radiance of the environment. It casts one ray for each point and direction of positive weight, in parallel over points.

use std::f64::consts::PI;

use glam::{DVec3, DVec4, Vec3, Vec4};
use rayon::prelude::*;

use crate::photon::PhotonStore;
use crate::points::{GatherPoint, PointGloss};
use crate::scene::{Bvh, Chance, Hit, Lanes, LobeWeights, PacketHits, RAY_OFFSET, Rays, Scene};

/// Casts gather rays through one scene.
#[derive(Clone, Copy)]
pub struct Reference<'a> {
    scene: &'a Scene,
    rays: Rays<'a>,
    photons: &'a dyn PhotonStore,
}

impl<'a> Reference<'a> {
    /// `scene` is in unit space; `bvh` and `photons` belong to its mesh.
    pub fn new(scene: &'a Scene, bvh: &'a Bvh, photons: &'a dyn PhotonStore) -> Self {
        Self { scene, rays: Rays::new(scene, bvh), photons }
    }

    /// The sums over unit `directions`, numbered from 0, at each point. rgb: Σ radiance × weight; a: Σ weight.
    pub fn gather(&self, points: &[GatherPoint], directions: &[Vec3]) -> Vec<Vec4> {
        let gather_point = |point: &GatherPoint| {
            let samples = (0..).zip(directions).map(|(number, &direction)| self.sample(point, direction, number));
            samples.sum::<DVec4>().as_vec4()
        };
        points.par_iter().map(gather_point).collect()
    }

    /// One term of the sums, of a direction with this number in its sequence. rgb: radiance × weight; a: weight.
    pub fn sample(&self, point: &GatherPoint, direction: Vec3, number: u32) -> DVec4 {
        let weight = f64::from(point.cosine(direction));
        if weight == 0.0 { DVec4::ZERO } else { weight * self.radiance(point, direction, number).extend(1.0) }
    }

    /// The terms of a point with gloss: that of its base, and of its lobe radiance × weight and weight. The twin of `glsl/consumer/irradiance.glsl`.
    pub fn sample_glossy(&self, point: &GatherPoint, gloss: &PointGloss, direction: Vec3, number: u32) -> [DVec4; 3] {
        let cosine = point.cosine(direction);
        if cosine == 0.0 {
            return [DVec4::ZERO; 3];
        }
        let LobeWeights { base, lobe } = gloss.weights(point.normal, direction);
        let (radiance, lobe) = (self.radiance(point, direction, number), (cosine * lobe).as_dvec3());
        [f64::from(cosine * base) * radiance.extend(1.0), (radiance * lobe).extend(0.0), lobe.extend(0.0)]
    }

    /// Radiance that comes to a point along a unit `direction` with this number, without the surfaces' own emission.
    fn radiance(&self, point: &GatherPoint, direction: Vec3, number: u32) -> DVec3 {
        match self.hit(point, direction, number) {
            Some(hit) => {
                let front = self.scene.mesh.meets_front(hit.triangle, direction);
                self.radiosity(hit.triangle, point.position + hit.distance * direction, front).as_dvec3() / PI
            }
            None => self.scene.gathered_radiance(direction).as_dvec3(),
        }
    }

    /// The hit of each point along a unit `direction` with this number; `None` for a miss or a weight of zero.
    pub fn hits(&self, points: &[GatherPoint], direction: Vec3, number: u32) -> Vec<Option<Hit>> {
        let sees = |point: &GatherPoint| if point.cosine(direction) > 0.0 { self.hit(point, direction, number) } else { None };
        points.par_iter().map(sees).collect()
    }

    fn hit(&self, point: &GatherPoint, direction: Vec3, number: u32) -> Option<Hit> {
        let origin = point.position + RAY_OFFSET * point.surface_normal;
        self.rays.nearest(origin, direction, None, Chance::of_direction(number))
    }

    /// Radiosity (π times the radiance) of a place on a triangle, on its front or its back, without the surface's own emission.
    fn radiosity(&self, triangle: usize, position: Vec3, front: bool) -> Vec3 {
        self.scene.albedo_at(triangle, position) * self.photons.irradiance_of_hit(&self.scene.mesh, triangle, position, front)
    }

    /// The same of all hits of a packet, at these positions: red, green and blue. Without meaning where there is no hit.
    #[inline(always)]
    pub fn radiosities(&self, hits: &PacketHits, positions: &[Lanes; 3]) -> [Lanes; 3] {
        let mut radiosities = self.photons.irradiance_of_packet(&self.scene.mesh, hits, positions);
        self.scene.reflect(hits, positions, &mut radiosities);
        radiosities
    }

    /// The rays that it casts.
    pub fn rays(&self) -> Rays<'a> {
        self.rays
    }
}
