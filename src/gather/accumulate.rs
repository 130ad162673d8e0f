//! The end of a direction: the radiance of each hit is looked up in the photon map and added, cosine-weighted, to the sums.
//! Mirrors `glsl/accumulate.frag`.

use super::{Bundle, Work};
use crate::error::Result;
use crate::gpu::{Gpu, Program, Texture, Uniform};
use crate::shaders;

/// Adds hits to sums.
pub struct Accumulate {
    /// Without and with albedo textures.
    programs: [Program; 2],
}

impl Accumulate {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let program = |source| Program::new(gpu, source);
        Ok(Self { programs: [program(&shaders::ACCUMULATE)?, program(&shaders::ACCUMULATE_TEXTURED)?] })
    }

    /// Adds what the points see at `hits` to the sums.
    pub fn add(&self, work: Work, bundle: &Bundle, hits: &Texture) {
        let own = [("hits", Uniform::Texture(hits)), ("direction", Uniform::Vec3(bundle.direction))];
        let uniforms = [&own[..], &work.geometry.uniforms(), &work.photons.uniforms()].concat();
        work.sums.add(work.points, &self.programs[usize::from(work.geometry.is_textured())], &uniforms);
    }
}
