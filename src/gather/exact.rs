//! Exact hits, by rays on the CPU: the oracle of every integral that is a pass over hits.

use std::rc::Rc;

use glam::{Vec2, Vec4};
use rayon::prelude::*;

use super::hits::{Begun, Find, Hits, KeptHits};
use crate::direction::Direction;
use crate::error::{Error, Result};
use crate::geometry::{Geometry, triangle_order};
use crate::gpu::{Format, Gpu, Texture};
use crate::points::{GatherPoint, Points};
use crate::scene::{Bvh, RAY_OFFSET, Scene};

/// Casts a ray for each point and direction, towards the end on the point's side of its surface.
pub struct ExactFind {
    gpu: Gpu,
    bvh: Rc<Bvh>,
    /// Of each triangle, its place in the shaders' table.
    slots: Vec<u32>,
    direction: [Vec4; 1],
    hits: Option<Rc<Texture>>,
}

impl ExactFind {
    /// `scene` is in unit space, and `bvh` of its mesh.
    pub fn new(gpu: &Gpu, scene: &Scene, bvh: Rc<Bvh>) -> Self {
        let mut slots = vec![0; scene.mesh.triangles.len()];
        for (slot, triangle) in (0..).zip(triangle_order(scene)) {
            slots[triangle] = slot;
        }
        Self { gpu: gpu.clone(), bvh, slots, direction: [Vec4::ZERO], hits: None }
    }
}

impl Find for ExactFind {
    fn batch(&self) -> usize {
        1
    }

    fn begin(&mut self, _: &Geometry, directions: &[Direction]) -> Result<Begun> {
        self.direction = [directions[0].vector.extend(0.0)];
        Ok(Begun { directions: 1, layers: 0 })
    }

    fn find(&mut self, _: &Geometry, points: Points) -> Result<Hits<'_>> {
        let (position, normal) = (points.position.read::<Vec4>(), points.normal.read::<Vec4>());
        let (bvh, slots, direction) = (&*self.bvh, &self.slots, self.direction[0].truncate());
        let cast = |(&position, &normal): (&Vec4, &Vec4)| {
            let Some(point) = GatherPoint::decode(position, normal) else { return Vec2::ZERO };
            let direction = if point.surface_normal.dot(direction) < 0.0 { -direction } else { direction };
            let hit = bvh.nearest(point.position + RAY_OFFSET * point.surface_normal, direction, None);
            hit.map_or(Vec2::ZERO, |hit| Vec2::new(hit.distance, (slots[hit.triangle] + 1) as f32))
        };
        let hits: Vec<Vec2> = position.par_iter().zip(&normal).map(cast).collect();
        let size = [points.position.width(), points.position.height()];
        let texture = self.hits.insert(Rc::new(Texture::array_of_one(&self.gpu, Format::Rg32F, size, &hits)?));
        Ok(Hits::new(texture, &self.direction, true))
    }

    fn keep(&mut self) -> Result<KeptHits> {
        let texture = self.hits.clone().ok_or_else(|| Error::gl("no hits were found to keep", "report this"))?;
        Ok(KeptHits::new(texture, &self.direction, true))
    }
}
