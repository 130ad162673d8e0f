//! Cut-outs and partial opacity: how much of the light a surface stops at a place, and whether it stops one ray. Mirrors `glsl/include/opacity.glsl`.
//!
//! A surface of opacity o stops the share o of all rays, and the rest pass straight through. So each ray takes it or leaves it by a number t uniform in
//! [0, 1): it is cut if o <= t. The numbers of one triangle are even over the directions of a gather, the blocks of a picture and the photons, and those
//! of two triangles are independent: two panes let (1 - o)² pass.
//!
//! Shadow rays need no choice. What they bring is multiplied by 1 - o of each surface on their way ([`Rays::transmittance`]).

use glam::Vec3;

use super::{Bvh, Hit, LANES, Lanes, Material, PacketHits, RayPacket, Scene, ShadowPacket, SharedDirection, of_lane};
use crate::random::{hash, stratified};

/// Which choice surfaces make.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Chance {
    /// Choices of different streams are independent.
    stream: u32,
    /// Those of a stream are even over consecutive numbers.
    number: u32,
}

impl Chance {
    /// That of a global direction. All points share it, as they share the bundle.
    pub fn of_direction(number: u32) -> Self {
        Self { stream: 0, number }
    }

    /// That of an eye ray, which has met so many mirrors and glass faces. Pixels are counted row by row from the bottom.
    pub fn of_pixel(pixel: u32, block: u32, surfaces: u32) -> Self {
        Self { stream: pixel.wrapping_add(hash(surfaces)), number: block }
    }

    /// That of a photon, which has left so many surfaces. So one that passes a pane twice is chosen twice.
    pub fn of_photon(photon: u64, surfaces: u32) -> Self {
        Self { stream: hash(!surfaces) ^ (photon >> 32) as u32, number: photon as u32 }
    }

    /// In [0, 1): a triangle of at most this opacity is cut.
    fn threshold(self, triangle: usize) -> f32 {
        stratified(self.number, hash(triangle as u32 ^ hash(self.stream)))
    }
}

impl Scene {
    /// Whether any surface is cut out or lets light pass. Glass is not concerned.
    pub fn has_cut_outs(&self) -> bool {
        // Most scenes have no such material, and are not searched.
        self.materials.iter().any(is_cut_out) && (0..self.mesh.triangles.len()).any(|triangle| self.is_cut_out(triangle))
    }

    /// Whether a triangle may be cut somewhere.
    pub fn is_cut_out(&self, triangle: usize) -> bool {
        is_cut_out(self.material(triangle))
    }

    /// The share of the light, from 0 to 1, that a triangle stops at a position on it.
    pub fn opacity(&self, triangle: usize, position: Vec3) -> f32 {
        let material = self.material(triangle);
        if !is_cut_out(material) {
            return 1.0;
        }
        let alpha = material.opacity.texture.map_or(1.0, |texture| {
            self.textures[texture].sample_alpha(self.mesh.uv(triangle, self.mesh.barycentric(triangle, position)))
        });
        material.opacity.at(alpha)
    }

    /// The mean opacity at positions on a triangle.
    pub fn mean_opacity(&self, triangle: usize, positions: impl Iterator<Item = Vec3>) -> f32 {
        let own = self.material(triangle).opacity;
        if own.texture.is_none() {
            return own.at(1.0);
        }
        let (sum, count) = positions
            .map(|position| self.opacity(triangle, position))
            .fold((0.0, 0), |(sum, count): (f64, u32), opacity| (sum + f64::from(opacity), count + 1));
        (sum / f64::from(count.max(1))) as f32
    }

    /// Whether a ray passes through a triangle at a position on it.
    pub fn is_cut(&self, triangle: usize, position: Vec3, chance: Chance) -> bool {
        self.is_cut_out(triangle) && self.opacity(triangle, position) <= chance.threshold(triangle)
    }
}

fn is_cut_out(material: &Material) -> bool {
    material.opacity.is_partial() && !material.is_glass()
}

/// Casts rays through a scene and its cut-outs.
#[derive(Clone, Copy)]
pub struct Rays<'a> {
    bvh: &'a Bvh,
    /// The scene, if rays pass through parts of it.
    cut_outs: Option<&'a Scene>,
}

impl<'a> Rays<'a> {
    /// `bvh` belongs to the scene's mesh.
    pub fn new(scene: &'a Scene, bvh: &'a Bvh) -> Self {
        Self::through(scene.has_cut_outs().then_some(scene), bvh)
    }

    /// The same, if the scene with cut-outs is known, or that there is none.
    pub fn through(cut_outs: Option<&'a Scene>, bvh: &'a Bvh) -> Self {
        Self { bvh, cut_outs }
    }

    /// Whether a ray may pass through a surface.
    pub fn meet_cut_outs(&self) -> bool {
        self.cut_outs.is_some()
    }

    /// As [`Bvh::nearest_of_packet`], of the surfaces that do not let these rays pass. `CUT_OUTS`: [`Self::meet_cut_outs`].
    #[inline(always)]
    pub fn nearest_of_packet<const CUT_OUTS: bool>(
        &self,
        packet: &RayPacket,
        direction: &SharedDirection,
        active: u32,
        chance: Chance,
        hits: &mut PacketHits,
    ) {
        let stops = |lane: usize, hit: Hit| {
            let position = packet.origin(lane) + hit.distance * direction.vector;
            !self.cut_outs.is_some_and(|scene| scene.is_cut(hit.triangle, position, chance))
        };
        if CUT_OUTS {
            self.bvh.nearest_of_packet::<true>(packet, direction, active, hits, stops);
        } else {
            self.bvh.nearest_of_packet::<false>(packet, direction, active, hits, |_, _| true);
        }
    }

    /// The share of the light that all surfaces together let pass along each ray; 0 where there is no ray. `CUT_OUTS`: [`Self::meet_cut_outs`].
    #[inline(always)]
    pub fn transmittance_of_packet<const CUT_OUTS: bool>(&self, rays: &ShadowPacket) -> Lanes {
        let mut passed = [1.0; LANES];
        let reached = if CUT_OUTS {
            self.bvh.reach_of_packet::<true>(rays, |lane, hit| {
                let direction = Vec3::from(of_lane(&rays.directions, lane));
                let position = rays.origins.origin(lane) + hit.distance * direction;
                passed[lane] *= 1.0 - self.cut_outs.map_or(1.0, |scene| scene.opacity(hit.triangle, position));
                passed[lane] == 0.0
            })
        } else {
            self.bvh.reach_of_packet::<false>(rays, |_, _| true)
        };
        for (lane, passed) in passed.iter_mut().enumerate() {
            *passed = if reached >> lane & 1 == 1 { *passed } else { 0.0 };
        }
        passed
    }

    /// As [`Bvh::nearest`], of the surfaces that do not let this ray pass.
    pub fn nearest(&self, origin: Vec3, direction: Vec3, except: Option<usize>, chance: Chance) -> Option<Hit> {
        let Some(scene) = self.cut_outs else { return self.bvh.nearest(origin, direction, except) };
        let stops = |hit: Hit| !scene.is_cut(hit.triangle, origin + hit.distance * direction, chance);
        self.bvh.nearest_of(origin, direction, except, stops)
    }

    /// The share of the light that all surfaces together let pass along a ray, up to this distance in lengths of the direction.
    pub fn transmittance(&self, origin: Vec3, direction: Vec3, reach: f32) -> f32 {
        let passed = std::cell::Cell::new(1.0);
        let position = |hit: Hit| origin + hit.distance * direction;
        let opacity = |hit: Hit| self.cut_outs.map_or(1.0, |scene| scene.opacity(hit.triangle, position(hit)));
        self.bvh.nearest_of(origin, direction, None, |hit| {
            if hit.distance >= reach {
                return true;
            }
            passed.set(passed.get() * (1.0 - opacity(hit)));
            passed.get() == 0.0
        });
        passed.get()
    }
}
