//! A pass over points that finds their hits and consumes them. Mirrors `glsl/gather.frag`.

use super::Found;
use crate::error::Result;
use crate::gpu::{Blend, Gpu, Program, Target, Uniform};
use crate::points::{Accumulator, Points};
use crate::shaders::{self, Consumer, Finder};

/// The program of one finder and one consumer.
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

    /// Adds what the consumer makes of the hits to `sums`; `uniforms` are those that the consumer reads.
    ///
    /// # Panics
    /// When the hits are found by another finder.
    pub fn add(&self, found: &Found, points: Points, sums: &Accumulator, uniforms: &[(&'static str, Uniform)]) {
        self.draw(found, points, (sums.target(), Blend::Add), uniforms);
    }

    /// Writes it in the place of what is in `target`.
    pub(super) fn write(&self, found: &Found, points: Points, target: &Target) {
        self.draw(found, points, (target, Blend::Replace), &[]);
    }

    fn draw(&self, found: &Found, points: Points, to: (&Target, Blend), uniforms: &[(&'static str, Uniform)]) {
        assert_eq!(found.finder, self.finder, "the finder of a pass");
        let uniforms = [uniforms, &found.uniforms()].concat();
        let draw = || points.draw(to, &self.program, &uniforms);
        match self.finder {
            // No stage: llvmpipe's timer takes a scene of one long draw for a twentieth of what it was.
            Finder::Rays => draw(),
            Finder::Layers | Finder::Stored => self.gpu.stage("gather", draw),
        }
    }
}
