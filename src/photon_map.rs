//! The photon map's irradiance at the points themselves. A render writes it beside the gathered one, to compare. Mirrors `glsl/photon_map.frag`.

use glam::Vec4;
use rayon::prelude::*;

use crate::error::Result;
use crate::gpu::{Gpu, Program};
use crate::points::{Accumulator, GBuffer, Points};
use crate::prepared::{FluxMap, Photons};
use crate::scene::Scene;
use crate::settings::PhotonMapKind;
use crate::shaders;

/// Looks up the photon map at points.
pub enum PhotonMap {
    /// On the CPU, which knows the triangles of the points.
    Atlas,
    Grid {
        program: Program,
        irradiance: Accumulator,
    },
}

impl PhotonMap {
    /// For point textures of one size.
    ///
    /// # Errors
    /// When the size is beyond the device's limits.
    pub fn new(gpu: &Gpu, kind: PhotonMapKind, points: [u32; 2]) -> Result<Self> {
        Ok(match kind {
            PhotonMapKind::Surface => Self::Atlas,
            PhotonMapKind::Grid => {
                Self::Grid { program: Program::new(gpu, &shaders::PHOTON_MAP)?, irradiance: Accumulator::new(gpu, points)? }
            }
        })
    }

    /// Irradiance at each point (rgb), row by row from the bottom. The value of a texel without a point has no meaning. `scene` is the one that photons
    /// were traced in; `points` are those of `g_buffer`.
    pub fn see(&self, photons: &Photons, scene: &Scene, points: Points, g_buffer: &GBuffer) -> Vec<Vec4> {
        match (self, &photons.map) {
            (Self::Grid { program, irradiance }, _) => {
                irradiance.clear();
                irradiance.add(points, program, &photons.texture.uniforms());
                irradiance.read()
            }
            (Self::Atlas, FluxMap::Atlas(atlas)) => {
                let texels = g_buffer.albedo.par_iter().zip(&g_buffer.position).zip(&g_buffer.normal);
                let see = |((albedo, position), normal): ((&Vec4, &Vec4), &Vec4)| {
                    // The ground has a point and no triangle.
                    if albedo.w == 0.0 {
                        return Vec4::ZERO;
                    }
                    atlas.irradiance(&scene.mesh, albedo.w as usize - 1, position.truncate(), normal.truncate()).extend(0.0)
                };
                texels.map(see).collect()
            }
            (Self::Atlas, FluxMap::Grid(_)) => unreachable!("both follow the same setting"),
        }
    }
}
