//! The end of a direction: its samples, cosine-weighted, and the weights themselves are added to the sums. Mirrors `glsl/accumulate.frag`.

use super::bundle::Bundle;
use crate::error::Result;
use crate::gpu::{Gpu, Program, Texture, Uniform};
use crate::points::{Points, Sums};
use crate::shaders;

/// Adds samples to sums.
pub struct Accumulate {
    program: Program,
}

impl Accumulate {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { program: Program::new(gpu, &shaders::ACCUMULATE)? })
    }

    /// Adds one direction's `samples`, cosine-weighted.
    pub fn add(&self, gpu: &Gpu, points: Points, bundle: &Bundle, samples: &Texture, sums: &Sums) {
        let mut uniforms = vec![("samples", Uniform::Texture(samples)), ("direction", Uniform::Vec3(bundle.direction))];
        uniforms.extend(points.uniforms());
        sums.add(gpu, &self.program, &uniforms);
    }
}
