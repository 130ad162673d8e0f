//! The photon map's irradiance at the points themselves. A render writes it beside the gathered one, to compare. Mirrors `glsl/photon_map.frag`.

use glam::Vec4;

use crate::error::Result;
use crate::gpu::{Gpu, Program};
use crate::photon::PhotonTexture;
use crate::points::{Accumulator, Points};
use crate::shaders;

/// Looks up the photon map at points.
pub struct PhotonMap {
    program: Program,
    irradiance: Accumulator,
}

impl PhotonMap {
    /// For point textures of one size.
    ///
    /// # Errors
    /// When the size is beyond the device's limits.
    pub fn new(gpu: &Gpu, points: [u32; 2]) -> Result<Self> {
        Ok(Self { program: Program::new(gpu, &shaders::PHOTON_MAP)?, irradiance: Accumulator::new(gpu, points)? })
    }

    /// Irradiance at each point (rgb), row by row from the bottom. The value of a texel without a point has no meaning.
    pub fn see(&self, photons: &PhotonTexture, points: Points) -> Vec<Vec4> {
        self.irradiance.clear();
        self.irradiance.add(points, &self.program, &photons.uniforms());
        self.irradiance.read()
    }
}
