//! A hit finder that casts exact rays on the GL device: the baseline for the bundles. Mirrors `glsl/finder/rays.glsl`.
//!
//! Each point casts one ray along each direction, towards the end on its side of its surface. A bounding volume hierarchy gives the first surface
//! on the ray. The cost of a direction grows with the number of points times the logarithm of the number of triangles.

use std::rc::Rc;

use glam::Vec4;

use super::{Found, HitFinder};
use crate::direction::Direction;
use crate::error::Result;
use crate::geometry::{Geometry, RayTables};
use crate::gpu::Uniform;
use crate::points::Points;
use crate::shaders::{BATCH, Finder};

/// Casts rays through [`Geometry::ray_tables`].
#[derive(Default)]
pub struct RayFinder {
    /// `None` before the first batch.
    tables: Option<Rc<RayTables>>,
    directions: Vec<Vec4>,
    /// With their bits reversed.
    numbers: Vec<u32>,
}

impl HitFinder for RayFinder {
    fn batch(&self) -> usize {
        BATCH
    }

    fn begin(&mut self, geometry: &Geometry, directions: &[Direction]) -> Result<usize> {
        self.tables = Some(geometry.ray_tables()?);
        self.directions = directions.iter().map(|direction| direction.vector.extend(0.0)).collect();
        self.numbers = directions.iter().map(|direction| direction.number.reverse_bits()).collect();
        Ok(self.directions.len())
    }

    fn find(&mut self, geometry: &Geometry, _: Points) -> Result<Found<'_>> {
        let finder = if geometry.cut_outs().is_some() { Finder::CutRays } else { Finder::Rays };
        let numbers = ("numbers", Uniform::UInts(&self.numbers));
        let uniforms = self.tables.iter().flat_map(|tables| tables.uniforms()).chain([numbers]).collect();
        Ok(Found { finder, layers: 0, directions: &self.directions, both_ends: true, uniforms })
    }
}
