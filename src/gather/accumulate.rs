//! The end of a direction: the radiance of each hit is looked up in the photon map and added, cosine-weighted, to the sums.
//! Mirrors `glsl/accumulate.frag`.

use super::bundle::Bundle;
use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::{DepthTest, Gpu, Program, Texture, Uniform};
use crate::photon::PhotonTexture;
use crate::points::{Points, Sums};
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

    /// Adds what the points see at `hits` to `sums`: rgb radiance × weight, a weight.
    pub fn add(
        &self,
        geometry: &Geometry,
        photons: &PhotonTexture,
        points: Points,
        bundle: &Bundle,
        hits: &Texture,
        sums: &Sums,
    ) {
        let own = [("hits", Uniform::Texture(hits)), ("direction", Uniform::Vec3(bundle.direction))];
        let uniforms = [&own[..], &geometry.uniforms(), &photons.uniforms()].concat();
        sums.add(points, &self.programs[usize::from(geometry.is_textured())], DepthTest::Off, &uniforms);
    }
}
