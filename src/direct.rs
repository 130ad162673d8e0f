//! Direct light: irradiance from samples on the area lights. Each sample has a shadow map. Mirrors `glsl/shadow.frag` and `glsl/direct.frag`.
//!
//! E(x) = 1/S Σ L A/p cos θ cos θ' / r² V over S samples. A sample emits into the hemisphere about its normal, so its map is a hemicube: one
//! whole face and the upper halves of four. A random turn about the normal makes aliasing average out.

use std::f32::consts::TAU;

use glam::camera::rh::proj::opengl::frustum;
use glam::{Mat3, Mat4, Vec3};

use crate::error::Result;
use crate::geometry::{Geometry, SurfacePass};
use crate::gpu::{DepthTest, Format, Gpu, Program, Target, Uniform};
use crate::math::frame;
use crate::points::{Accumulator, Points};
use crate::random::{Random, shuffled, sobol};
use crate::scene::{LightPoint, Lights};
use crate::shaders;

/// Nearest and farthest distance at which a shadow map sees an occluder, in unit space. The farthest covers the scene's diameter, 2.
const NEAR: f32 = 1e-4;
const FAR: f32 = 2.1;

/// Adds the irradiance from light samples at gather points.
pub struct Direct {
    shadow: Program,
    direct: Program,
    map: Target,
    seed: u64,
}

impl Direct {
    /// Shadow maps have faces of `shadow_size` texels on a side, rounded up to an even number.
    ///
    /// # Errors
    /// When a size is beyond the device's limits.
    pub fn new(gpu: &Gpu, shadow_size: u32, seed: u64) -> Result<Self> {
        Ok(Self {
            shadow: Program::new(gpu, &shaders::SHADOW)?,
            direct: Program::new(gpu, &shaders::DIRECT)?,
            map: Target::new(gpu, Self::map_size(shadow_size), &[Format::Rgba32F], true)?,
            seed: seed ^ 0xd1ec7,
        })
    }

    /// Bytes that [`Self::new`] takes.
    pub fn bytes(shadow_size: u32) -> usize {
        Target::bytes(Self::map_size(shadow_size), &[Format::Rgba32F], true)
    }

    /// Width and height of a hemicube's map: the whole face, then the four half faces above it in the texture.
    fn map_size(shadow_size: u32) -> [u32; 2] {
        let size = shadow_size.next_multiple_of(2);
        [size, 3 * size]
    }

    /// Adds the irradiance from light sample `index` to `sums` (rgb).
    pub fn add(&self, geometry: &Geometry, lights: &Lights, index: u64, points: Points, sums: &Accumulator) {
        // The sub-pixel offsets of blocks use the same sequence. Without the shuffle, blocks of one light sample each would always pair the same part
        // of the pixel with the same part of the light.
        let light = lights.point_of_square(sobol(shuffled(index as u32, self.seed), self.seed));
        let turn = Random::new(self.seed, index).uniform();
        let to_light = self.shadow_map(geometry, &light, TAU * turn);
        // A texel of the map is 2/size wide at a distance of 1. `Bundle::new` explains the two terms.
        let depth_bias = 2.0 / self.map.size()[0] as f32 / 256.0 + 4e-6;
        let uniforms = [
            ("shadow_map", Uniform::Texture(self.map.color(0))),
            ("to_light", Uniform::Mat4(to_light)),
            ("intensity", Uniform::Vec3(light.radiance_area)),
            ("depth_bias", Uniform::Float(depth_bias)),
        ];
        sums.add(points, &self.direct, &uniforms);
    }

    /// Draws the hemicube of `light` and returns the transform from unit space to the light's frame.
    fn shadow_map(&self, geometry: &Geometry, light: &LightPoint, turn: f32) -> Mat4 {
        let axes = frame(light.normal) * Mat3::from_rotation_z(turn);
        let to_light = Mat4::from_mat3(axes.transpose()) * Mat4::from_translation(-light.position);
        let size = self.map.size()[0] as i32;
        self.map.clear([0.0; 4], 1.0);
        let face = |right: Vec3, up: Vec3, outward: Vec3, region: [i32; 4]| {
            let lowest = if outward == Vec3::Z { -1.0 } else { 0.0 };
            // The frustum of glam looks along -z.
            let project = frustum(-NEAR, NEAR, lowest * NEAR, NEAR, NEAR, FAR);
            let turn = Mat4::from_mat3(Mat3::from_cols(right, up, -outward).transpose());
            geometry.draw(SurfacePass {
                target: &self.map,
                region: Some(region),
                program: &self.shadow,
                to_clip: project * turn * to_light,
                depth: DepthTest::Less,
                uniforms: &[],
            });
        };
        let half = size / 2;
        face(Vec3::X, Vec3::Y, Vec3::Z, [0, 0, size, size]);
        face(Vec3::Y, Vec3::Z, Vec3::X, [0, size, size, half]);
        face(Vec3::NEG_Y, Vec3::Z, Vec3::NEG_X, [0, size + half, size, half]);
        face(Vec3::NEG_X, Vec3::Z, Vec3::Y, [0, 2 * size, size, half]);
        face(Vec3::X, Vec3::Z, Vec3::NEG_Y, [0, 2 * size + half, size, half]);
        to_light
    }
}
