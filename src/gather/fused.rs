//! All layers of a direction sampled in one pass over the points, at both ends. Mirrors `glsl/fused.frag`.

use super::bundle::Bundle;
use super::peel::Peel;
use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::{Gpu, Program, Uniform};
use crate::photon::PhotonTexture;
use crate::points::{Points, Sums};
use crate::shaders;

/// Samples layers and adds what is seen to sums.
pub struct Fused {
    program: Program,
}

impl Fused {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { program: Program::new(gpu, &shaders::FUSED)? })
    }

    /// Adds what the points see in the first `count` layers of `peel` to `sums`: rgb radiance × weight, a weight.
    #[expect(clippy::too_many_arguments, reason = "what a gather is made of")]
    pub fn add(
        &self,
        geometry: &Geometry,
        photons: &PhotonTexture,
        points: Points,
        bundle: &Bundle,
        peel: &Peel,
        count: u32,
        sums: &Sums,
    ) {
        let own = [("layer_count", Uniform::Int(count as i32))];
        let uniforms = [&own[..], &peel.uniforms(), &bundle.uniforms(), &geometry.uniforms(), &photons.uniforms()].concat();
        sums.add(points, &self.program, &uniforms);
    }
}
