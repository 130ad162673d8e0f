//! The end of a direction: the radiance of each hit is looked up in the photon map and added, cosine-weighted, to the sums.
//! Mirrors `glsl/accumulate.frag`.

use super::bundle::Bundle;
use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::{Gpu, Program, Texture, Uniform};
use crate::photon::PhotonTexture;
use crate::points::{Points, Sums};
use crate::shaders;

/// Adds hits to sums.
pub struct Accumulate {
    program: Program,
}

impl Accumulate {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { program: Program::new(gpu, &shaders::ACCUMULATE)? })
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
        for (triangles, surfaces) in geometry.batches() {
            let own = [
                ("hits", Uniform::Texture(hits)),
                ("direction", Uniform::Vec3(bundle.direction)),
                ("last_triangle", Uniform::Int(triangles.end as i32 - 1)),
            ];
            let uniforms = [&own[..], &surfaces, &photons.uniforms()].concat();
            sums.add(points, &self.program, &uniforms);
        }
    }
}
