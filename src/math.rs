//! Geometry helpers of several stages.

use std::f32::consts::TAU;

use glam::{Mat3, Vec3};

/// An axis-aligned box. [`Aabb::EMPTY`] contains no point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    pub min: Vec3,
    pub max: Vec3,
}

impl Aabb {
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    pub fn from_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        let grow = |bounds: Self, point| Self { min: bounds.min.min(point), max: bounds.max.max(point) };
        points.into_iter().fold(Self::EMPTY, grow)
    }

    pub fn center(&self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Lengths of the sides.
    pub fn extent(&self) -> Vec3 {
        self.max - self.min
    }

    /// Length of the diagonal, the diameter of the sphere around the box.
    pub fn diagonal(&self) -> f32 {
        self.extent().length()
    }
}

/// A right-handed orthonormal frame whose third axis is the unit vector `z`.
pub fn frame(z: Vec3) -> Mat3 {
    let (x, y) = z.any_orthonormal_pair();
    Mat3::from_cols(x, y, z)
}

/// The sRGB curve: linear to encoded values.
pub fn encode_srgb(x: f32) -> f32 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// The inverse of [`encode_srgb`].
pub fn decode_srgb(x: f32) -> f32 {
    if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

/// The axis of a vector's largest component by magnitude. Of equal components, the first.
pub fn dominant_axis(v: Vec3) -> usize {
    v.abs().max_position()
}

/// Maps a uniform point (u, v) of the unit square to a direction with density cos θ / π about the unit vector `normal` (Malley's method).
pub fn cosine_direction(normal: Vec3, u: f32, v: f32) -> Vec3 {
    let radius = u.sqrt();
    let (sin, cos) = (TAU * v).sin_cos();
    frame(normal) * Vec3::new(radius * cos, radius * sin, (1.0 - u).sqrt())
}

/// Returns the two texels on either side of a coordinate, and the weight of the second. Texel centres lie at (i + 0.5) / `size`, repeated.
pub fn neighbours(coordinate: f32, size: usize) -> (usize, usize, f32) {
    let position = (coordinate - coordinate.floor()) * size as f32 - 0.5;
    let first = position.floor();
    let wrap = |index: i64| index.rem_euclid(size as i64) as usize;
    (wrap(first as i64), wrap(first as i64 + 1), position - first)
}
