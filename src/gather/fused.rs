//! All layers of a direction sampled in one pass over the points, at both ends. Mirrors `glsl/fused.frag`.

use super::{Bundle, Peel, Work};
use crate::error::Result;
use crate::gpu::{DepthTest, Gpu, Program, Uniform};
use crate::shaders;

/// Samples layers and adds what is seen to sums.
pub struct Fused {
    /// Without and with albedo textures.
    programs: [Program; 2],
    outline: Program,
    /// Directions so far.
    count: u32,
}

impl Fused {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let program = |source| Program::new(gpu, source);
        Ok(Self {
            programs: [program(&shaders::FUSED)?, program(&shaders::FUSED_TEXTURED)?],
            outline: program(&shaders::FUSED_OUTLINE)?,
            count: 0,
        })
    }

    /// Adds what the points see in the first layers of `peel` to the sums.
    pub fn add(&mut self, work: Work, bundle: &Bundle, (peel, layers): (&Peel, u32)) {
        let own = [("layer_count", Uniform::Int(layers as i32))];
        let uniforms =
            [&own[..], &peel.uniforms(), &bundle.uniforms(), &work.geometry.uniforms(), &work.photons.uniforms()].concat();
        // What the first pass discards, it does not mark. A mark of its own for each direction needs no clearing.
        self.count += 1;
        let mark = (self.count & 0xffff) as f32 / 65536.0;
        work.sums.add(work.points, &self.programs[usize::from(work.geometry.is_textured())], DepthTest::Mark(mark), &uniforms);
        work.sums.add(work.points, &self.outline, DepthTest::Unmarked(mark), &uniforms);
    }
}
