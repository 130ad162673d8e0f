//! A hit finder that casts exact rays on the CPU. The hits of other finders can be compared with its hits.

use std::rc::Rc;

use glam::{Vec2, Vec4};
use rayon::prelude::*;

use super::{Found, HitFinder};
use crate::direction::Direction;
use crate::error::Result;
use crate::geometry::{Geometry, triangle_order};
use crate::gpu::{Format, Gpu, Texture};
use crate::points::{GatherPoint, Points};
use crate::scene::{Bvh, Chance, RAY_OFFSET, Rays, Scene};

/// Casts a ray for each point and direction, towards the end of the direction on the point's side of its surface.
pub struct CpuRayFinder {
    gpu: Gpu,
    bvh: Rc<Bvh>,
    /// A copy of the scene, if rays pass through parts of it.
    cut_outs: Option<Scene>,
    /// The place of each triangle in the shaders' table.
    slots: Vec<u32>,
    direction: [Vec4; 1],
    chance: Chance,
    hits: Option<Texture>,
}

impl CpuRayFinder {
    /// `scene` is in unit space; `bvh` belongs to its mesh.
    pub fn new(gpu: &Gpu, scene: &Scene, bvh: Rc<Bvh>) -> Self {
        let mut slots = vec![0; scene.mesh.triangles.len()];
        for (slot, triangle) in (0..).zip(triangle_order(scene)) {
            slots[triangle] = slot;
        }
        let cut_outs = scene.has_cut_outs().then(|| scene.clone());
        Self { gpu: gpu.clone(), bvh, cut_outs, slots, direction: [Vec4::ZERO], chance: Chance::of_direction(0), hits: None }
    }

    /// The hits of the last search, as `glsl/finder/stored.glsl` reads them.
    pub fn hits(&self) -> Option<&Texture> {
        self.hits.as_ref()
    }
}

impl HitFinder for CpuRayFinder {
    fn batch(&self) -> usize {
        1
    }

    fn begin(&mut self, _: &Geometry, directions: &[Direction]) -> Result<usize> {
        self.direction = [directions[0].vector.extend(0.0)];
        self.chance = Chance::of_direction(directions[0].number);
        Ok(1)
    }

    fn find(&mut self, _: &Geometry, points: Points) -> Result<Found<'_>> {
        let (bvh, slots, direction, chance) = (&*self.bvh, &self.slots, self.direction[0].truncate(), self.chance);
        let rays = self.cut_outs.as_ref().map(|scene| Rays::new(scene, bvh));
        // Distance and triangle, as `glsl/finder/stored.glsl` reads them.
        let hit = |point: &GatherPoint| {
            let direction = if point.surface_normal.dot(direction) < 0.0 { -direction } else { direction };
            let origin = point.position + RAY_OFFSET * point.surface_normal;
            let hit = match &rays {
                Some(rays) => rays.nearest(origin, direction, None, chance),
                None => bvh.nearest(origin, direction, None),
            }?;
            Some(Vec2::new(hit.distance, (slots[hit.triangle] + 1) as f32))
        };
        let hits: Vec<Vec2> = points.read().par_iter().map(|point| point.as_ref().and_then(hit).unwrap_or_default()).collect();
        let size = [points.position.width(), points.position.height()];
        let texture = self.hits.insert(Texture::array_of_one(&self.gpu, Format::Rg32F, size, &hits)?);
        Ok(Found::stored(texture, &self.direction, true, 0))
    }
}
