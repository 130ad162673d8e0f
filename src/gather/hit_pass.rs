//! Passes over points that look up the radiance of hits and add it to the sums: what they read, and their variants.

use super::Work;
use crate::error::Result;
use crate::gpu::{Gpu, Program, ShaderSource, Uniform};

/// A program that reads `glsl/include/radiance.glsl`.
pub struct HitPass {
    /// Without and with albedo textures.
    programs: [Program; 2],
}

impl HitPass {
    /// Of the same source without and with albedo textures.
    pub fn new(gpu: &Gpu, plain: &ShaderSource, textured: &ShaderSource) -> Result<Self> {
        Ok(Self { programs: [Program::new(gpu, plain)?, Program::new(gpu, textured)?] })
    }

    /// Runs it over the points with `own` uniforms beside those of surfaces, photons and points.
    pub fn run(&self, work: Work, own: &[(&'static str, Uniform)]) {
        let program = &self.programs[usize::from(work.geometry.is_textured())];
        let uniforms = [own, &work.geometry.uniforms(), &work.photons.uniforms()].concat();
        work.sums.add(work.points, program, &uniforms);
    }
}
