//! Sums at every point, in 32-bit floats: what passes over points add to.

use glam::Vec4;

use crate::error::Result;
use crate::gpu::{Blend, DepthTest, Draw, Format, Geometry, Gpu, Program, Target, Uniform};

/// An RGBA sum for each point.
pub struct Sums {
    target: Target,
}

impl Sums {
    /// # Errors
    /// When the size is beyond the device's limits.
    pub fn new(gpu: &Gpu, points: [u32; 2]) -> Result<Self> {
        Ok(Self { target: Target::new(gpu, points, &[Format::Rgba32F], false)? })
    }

    pub fn clear(&self) {
        self.target.clear([0.0; 4], 0.0);
    }

    /// The sums, row by row from the bottom.
    pub fn read(&self) -> Vec<Vec4> {
        self.target.color(0).read()
    }

    /// Adds a full-screen pass of `program` to the sums.
    pub(crate) fn add(&self, program: &Program, uniforms: &[(&'static str, Uniform)]) {
        Draw {
            target: &self.target,
            region: None,
            program,
            uniforms,
            depth: DepthTest::Off,
            blend: Blend::Add,
            geometry: Geometry::FullScreen,
        }
        .run();
    }
}
