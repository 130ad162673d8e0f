//! A pass over points: finds their hits and gives them to a consumer. Mirrors `glsl/gather.frag`.

use super::Found;
use crate::error::Result;
use crate::gpu::{Blend, Gpu, Program, Target, Uniform};
use crate::points::{Accumulator, Points};
use crate::shaders::{self, Consumer, Finder};

/// The program of one hit finder and one consumer.
pub struct GatherPass {
    gpu: Gpu,
    finder: Finder,
    program: Program,
}

impl GatherPass {
    /// # Errors
    /// When the program does not compile.
    pub fn new(gpu: &Gpu, finder: Finder, consumer: Consumer) -> Result<Self> {
        Ok(Self { gpu: gpu.clone(), finder, program: Program::new(gpu, &shaders::gather(finder, consumer))? })
    }

    /// Adds the consumer's output for the hits to `sums`. The consumer reads `uniforms`.
    ///
    /// # Panics
    /// When the hits come from another finder than the program's.
    pub fn add(&self, found: &Found, points: Points, sums: &Accumulator, uniforms: &[(&'static str, Uniform)]) {
        self.draw(found, points, (sums.target(), Blend::Add), uniforms);
    }

    /// Replaces the content of `target` by the consumer's output.
    pub(super) fn write(&self, found: &Found, points: Points, target: &Target) {
        self.draw(found, points, (target, Blend::Replace), &[]);
    }

    fn draw(&self, found: &Found, points: Points, to: (&Target, Blend), uniforms: &[(&'static str, Uniform)]) {
        assert_eq!(found.finder, self.finder, "the finder of a pass");
        let uniforms = [uniforms, &found.uniforms()].concat();
        let draw = || points.draw(to, &self.program, &uniforms);
        match self.finder {
            // No stage: for one long draw, llvmpipe's timer shows a twentieth of the true time.
            Finder::Rays | Finder::CutRays => draw(),
            Finder::Layers | Finder::Stored => self.gpu.stage("gather", draw),
        }
    }
}
