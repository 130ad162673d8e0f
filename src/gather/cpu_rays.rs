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
use crate::scene::{Bvh, RAY_OFFSET, Scene};

/// Casts a ray for each point and direction, towards the end of the direction on the point's side of its surface.
pub struct CpuRayFinder {
    gpu: Gpu,
    bvh: Rc<Bvh>,
    /// The place of each triangle in the shaders' table.
    slots: Vec<u32>,
    direction: [Vec4; 1],
    hits: Option<Texture>,
}

impl CpuRayFinder {
    /// `scene` is in unit space; `bvh` belongs to its mesh.
    pub fn new(gpu: &Gpu, scene: &Scene, bvh: Rc<Bvh>) -> Self {
        let mut slots = vec![0; scene.mesh.triangles.len()];
        for (slot, triangle) in (0..).zip(triangle_order(scene)) {
            slots[triangle] = slot;
        }
        Self { gpu: gpu.clone(), bvh, slots, direction: [Vec4::ZERO], hits: None }
    }
}

impl HitFinder for CpuRayFinder {
    fn batch(&self) -> usize {
        1
    }

    fn begin(&mut self, _: &Geometry, directions: &[Direction]) -> Result<usize> {
        self.direction = [directions[0].vector.extend(0.0)];
        Ok(1)
    }

    fn find(&mut self, _: &Geometry, points: Points) -> Result<Found<'_>> {
        let (bvh, slots, direction) = (&*self.bvh, &self.slots, self.direction[0].truncate());
        // Distance and triangle, as `glsl/finder/stored.glsl` reads them.
        let hit = |point: &GatherPoint| {
            let direction = if point.surface_normal.dot(direction) < 0.0 { -direction } else { direction };
            let hit = bvh.nearest(point.position + RAY_OFFSET * point.surface_normal, direction, None)?;
            Some(Vec2::new(hit.distance, (slots[hit.triangle] + 1) as f32))
        };
        let hits: Vec<Vec2> = points.read().par_iter().map(|point| point.as_ref().and_then(hit).unwrap_or_default()).collect();
        let size = [points.position.width(), points.position.height()];
        let texture = self.hits.insert(Texture::array_of_one(&self.gpu, Format::Rg32F, size, &hits)?);
        Ok(Found::stored(texture, &self.direction, true, 0))
    }
}
