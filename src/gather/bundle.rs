//! A bundle: the orthographic projection of the scene along one direction that all points share.
//!
//! Layer space has x and y in texels, and window depth as z. Depth grows along the direction, so the farthest surface has the greatest depth.

use glam::{Mat3, Mat4, Vec2, Vec3};

use crate::direction::Direction;
use crate::gpu::Uniform;
use crate::math::{Aabb, frame};

/// Margin at either end of the depth range, as a share of it, so that rounding clips no surface.
const DEPTH_MARGIN: f32 = 0.01;

/// Least side of a texel in unit space. Positions there have a rounding error of 6e-8, and a layer's own precision is 1/256 of a texel.
const LEAST_TEXEL: f32 = 2e-5;

/// The projection of one direction.
#[derive(Clone, Copy, Debug)]
pub struct Bundle {
    pub direction: Vec3,
    /// As [`Direction::number`].
    pub number: u32,
    /// Unit space to layer space.
    pub to_layer: Mat4,
    /// Unit space to clip space.
    pub to_clip: Mat4,
    /// Depth bias in unit space: a surface higher than this above a point's tangent plane is another surface than the point's own.
    pub depth_bias: f32,
}

impl Bundle {
    /// Fits a projection of `size` texels on a side to `positions`, in unit space. A border of one texel stays empty, so that readers need not
    /// check whether a neighbour is inside the layer.
    pub fn new(direction: &Direction, positions: &[Vec3], size: u32) -> Self {
        Self::fitted(direction, positions, positions, size)
    }

    /// As [`Self::new`], but in x and y it fits the receivers alone, for the ray of a receiver stays in one texel. Hits lie anywhere on that ray, so the
    /// depth range fits the whole scene. Surfaces may reach beyond the layer, also into the border.
    pub fn fitted(direction: &Direction, receivers: &[Vec3], positions: &[Vec3], size: u32) -> Self {
        let axes = frame(direction.vector) * Mat3::from_rotation_z(direction.turn);
        let to_axes = axes.transpose();
        let along = |points: &[Vec3]| Aabb::from_points(points.iter().map(|&position| to_axes * position));
        let (bounds, mut seen) = (along(positions), along(receivers));
        // Receivers beside the scene have no hits. If all are beside it, any fit will do.
        let both = Aabb { min: seen.min.max(bounds.min), max: seen.max.min(bounds.max) };
        if both.extent().truncate().min_element() >= 0.0 {
            seen = both;
        }
        // Two texels are the border, and one leaves room for the shift.
        let texel = (seen.extent().truncate() / (size as f32 - 3.0).max(1.0)).max(Vec2::splat(LEAST_TEXEL));
        let corner = seen.min.truncate() - (1.0 + direction.shift) * texel;
        let depth = (bounds.extent().z * (1.0 + 2.0 * DEPTH_MARGIN)).max(1e-6);
        let origin = corner.extend(bounds.min.z - 0.5 * (depth - bounds.extent().z));
        let unit = texel.extend(depth);
        let to_layer = Mat4::from_scale(unit.recip()) * Mat4::from_translation(-origin) * Mat4::from_mat3(to_axes);
        let from_window =
            Mat4::from_translation(Vec3::splat(-1.0)) * Mat4::from_scale(Vec3::new(2.0 / size as f32, 2.0 / size as f32, 2.0));
        Self {
            direction: direction.vector,
            number: direction.number,
            to_layer,
            to_clip: from_window * to_layer,
            // OpenGL lets rasterisers round vertices to 1/16 of a texel; in practice it is 1/256. The second term is float precision at 1.
            depth_bias: texel.max_element() / 256.0 + 2e-6,
        }
    }

    /// Unit space to clip space of a row of `tiles` layers side by side, for each of `bundles`: the first goes into the first tile, and so on.
    pub fn to_clip_of_tiles(bundles: &[Self], tiles: u32) -> Vec<Mat4> {
        let narrow = Mat4::from_scale(Vec3::new(1.0 / tiles as f32, 1.0, 1.0));
        let middle = |tile: u32| (2 * tile + 1) as f32 / tiles as f32 - 1.0;
        let to_clip = |(tile, bundle): (u32, &Self)| Mat4::from_translation(Vec3::X * middle(tile)) * narrow * bundle.to_clip;
        (0..).zip(bundles).map(to_clip).collect()
    }

    /// The numbers of these directions as `glsl/surface.vert` reads them.
    pub fn numbers(bundles: &[Self]) -> Vec<u32> {
        bundles.iter().map(|bundle| bundle.number.reverse_bits()).collect()
    }

    /// The squared lengths of layer space's unit covectors. Its axes are at right angles, so three numbers are the whole metric.
    pub fn metric(&self) -> Vec3 {
        let from_layer = Mat3::from_mat4(self.to_layer).inverse();
        Vec3::from_array([0, 1, 2].map(|axis| from_layer.col(axis).length_squared())).recip()
    }

    /// The uniforms of `glsl/kill.frag`.
    pub fn uniforms(&self) -> [(&'static str, Uniform<'static>); 4] {
        [
            ("direction", Uniform::Vec3(self.direction)),
            ("to_layer", Uniform::Mat4(self.to_layer)),
            ("depth_bias", Uniform::Float(self.depth_bias)),
            ("metric", Uniform::Vec3(self.metric())),
        ]
    }
}
