//! Sums at every point, in 32-bit floats. Passes over points add to them.

use glam::Vec4;

use super::Points;
use crate::error::Result;
use crate::gpu::{Blend, DepthTest, Draw, Format, Gpu, Program, Shape, Target, Uniform};

/// One or several RGBA sums for each point.
pub struct Sums {
    target: Target,
}

impl Sums {
    /// # Errors
    /// If the size exceeds the device's limits.
    pub fn new(gpu: &Gpu, points: [u32; 2]) -> Result<Self> {
        Self::several(gpu, points, 1)
    }

    /// Makes `count` sums for each point. A pass can add to 8 of them at most. Fails as [`Self::new`].
    pub fn several(gpu: &Gpu, points: [u32; 2], count: usize) -> Result<Self> {
        Ok(Self { target: Target::new(gpu, points, &vec![Format::Rgba32F; count], false)? })
    }

    pub fn clear(&self) {
        self.target.clear([0.0; 4], 0.0);
    }

    /// Returns the first sums, row by row from the bottom.
    pub fn read(&self) -> Vec<Vec4> {
        self.read_one(0)
    }

    /// Returns sums `index`, row by row from the bottom.
    pub fn read_one(&self, index: usize) -> Vec<Vec4> {
        self.target.color(index).read()
    }

    /// Adds a full-screen pass of `program` over `points` to the sums. Each subset of points has its own tile.
    pub(crate) fn add(&self, points: Points, program: &Program, uniforms: &[(&'static str, Uniform)]) {
        let size = points.size().map(|side| side as i32);
        let [x, y] = [0, 1].map(|axis| points.subset.offset[axis] as i32 * size[axis]);
        let uniforms = &[uniforms, &points.uniforms(), &[("first_texel", Uniform::IVec2([x, y]))]].concat();
        Draw {
            target: &self.target,
            region: Some([x, y, size[0], size[1]]),
            program,
            uniforms,
            depth: DepthTest::Off,
            blend: Blend::Add,
            geometry: Shape::FullScreen,
        }
        .run();
    }
}
