//! The end of a direction: the radiance of each hit is looked up in the photon map and added, cosine-weighted, to the sums.
//! Mirrors `glsl/accumulate.frag`.

use super::hit_pass::HitPass;
use super::{Bundle, Work};
use crate::error::Result;
use crate::gpu::{Gpu, Texture, Uniform};
use crate::shaders;

/// Adds hits to sums.
pub struct Accumulate {
    pass: HitPass,
}

impl Accumulate {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pass: HitPass::new(gpu, &shaders::ACCUMULATE, &shaders::ACCUMULATE_TEXTURED)? })
    }

    /// Adds what the points see at `hits` to the sums.
    pub fn add(&self, work: Work, bundle: &Bundle, hits: &Texture) {
        let own = [
            ("hits", Uniform::Texture(hits)),
            ("direction", Uniform::Vec3(bundle.direction)),
            ("beyond", Uniform::Vec3(work.scene.beyond(bundle.direction))),
        ];
        self.pass.run(work, &own);
    }
}
