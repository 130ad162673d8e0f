//! Finds exact hits by rays on the CPU, which every other finder can be held against.

use std::rc::Rc;

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::{Found, HitFinder, vectors};
use crate::direction::Direction;
use crate::error::Result;
use crate::geometry::{Geometry, triangle_order};
use crate::gpu::{Format, Gpu, Texture};
use crate::points::{GatherPoint, Points};
use crate::scene::{Bvh, RAY_OFFSET, Scene};
use crate::shaders::BATCH;

/// Casts a ray for each point and direction.
pub struct CpuRayFinder {
    gpu: Gpu,
    bvh: Rc<Bvh>,
    /// Of each triangle, its place in the shaders' table.
    slots: Vec<u32>,
    both_ends: bool,
    directions: Vec<Vec4>,
    hits: Option<Texture>,
}

impl CpuRayFinder {
    /// `scene` is in unit space, and `bvh` of its mesh. With `both_ends` a point looks along the end of each direction on its side of its surface.
    pub fn new(gpu: &Gpu, scene: &Scene, bvh: Rc<Bvh>, both_ends: bool) -> Self {
        let mut slots = vec![0; scene.mesh.triangles.len()];
        for (slot, triangle) in (0..).zip(triangle_order(scene)) {
            slots[triangle] = slot;
        }
        Self { gpu: gpu.clone(), bvh, slots, both_ends, directions: Vec::new(), hits: None }
    }
}

impl HitFinder for CpuRayFinder {
    fn batch(&self) -> usize {
        BATCH
    }

    fn both_ends(&self) -> bool {
        self.both_ends
    }

    fn begin(&mut self, _: &Geometry, directions: &[Direction]) -> Result<usize> {
        self.directions = vectors(&directions[..directions.len().min(BATCH)]);
        Ok(self.directions.len())
    }

    fn find(&mut self, _: &Geometry, points: Points) -> Result<Found<'_>> {
        let (bvh, slots, both_ends) = (&*self.bvh, &self.slots, self.both_ends);
        // Distance and triangle, as `glsl/finder/stored.glsl` reads them.
        let hit = |point: &GatherPoint, direction: Vec3| {
            let against = point.surface_normal.dot(direction) < 0.0;
            if against && !both_ends {
                return None;
            }
            let direction = if against { -direction } else { direction };
            let hit = bvh.nearest(point.position + RAY_OFFSET * point.surface_normal, direction, None)?;
            Some(Vec2::new(hit.distance, (slots[hit.triangle] + 1) as f32))
        };
        let places = points.read();
        let element = |pair: &[Vec4]| -> Vec<[Vec2; 2]> {
            let hit_of = |point: &Option<GatherPoint>, i: usize| hit(point.as_ref()?, pair.get(i).copied()?.truncate());
            places.par_iter().map(|point| [0, 1].map(|i| hit_of(point, i).unwrap_or_default())).collect()
        };
        let texels: Vec<[Vec2; 2]> = self.directions.chunks(2).flat_map(element).collect();
        let count = self.directions.len().div_ceil(2) as u32;
        let hits = self.hits.insert(Texture::array(&self.gpu, Format::Rgba32F, points.size(), count, &texels)?);
        Ok(Found::stored(hits, &self.directions, self.both_ends, 0))
    }
}
