//! Sums at every point, in 32-bit floats. Passes over points add to them.

use glam::Vec4;

use super::Points;
use crate::error::Result;
use crate::gpu::{Blend, Format, Gpu, Program, Target, Uniform};

/// RGBA sums for each point, one or several.
pub struct Accumulator {
    target: Target,
}

impl Accumulator {
    /// # Errors
    /// When the size is beyond the device's limits.
    pub fn new(gpu: &Gpu, points: [u32; 2]) -> Result<Self> {
        Self::several(gpu, points, 1)
    }

    /// So many for each point; of one pass no more than 8.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn several(gpu: &Gpu, points: [u32; 2], count: usize) -> Result<Self> {
        Ok(Self { target: Target::new(gpu, points, &vec![Format::Rgba32F; count], false)? })
    }

    /// Bytes that [`Self::several`] takes.
    pub fn bytes(points: [u32; 2], count: usize) -> usize {
        count * Target::bytes(points, &[Format::Rgba32F], false)
    }

    pub fn clear(&self) {
        self.target.clear([0.0; 4], 0.0);
    }

    /// The first of them, row by row from the bottom.
    pub fn read(&self) -> Vec<Vec4> {
        self.target.color(0).read()
    }

    /// One after the other, as [`Self::read`].
    pub fn read_all(&self) -> impl Iterator<Item = Vec<Vec4>> {
        (0..self.target.colors()).map(|index| self.target.color(index).read())
    }

    /// Adds a pass of `program` over `points` to the sums.
    pub(crate) fn add(&self, points: Points, program: &Program, uniforms: &[(&'static str, Uniform)]) {
        points.draw((&self.target, Blend::Add), program, uniforms);
    }

    pub(crate) fn target(&self) -> &Target {
        &self.target
    }
}
