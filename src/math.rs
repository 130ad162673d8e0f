//! Small geometry that several stages share.

use glam::{Mat3, Vec3};

/// An axis-aligned bounding box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    pub min: Vec3,
    pub max: Vec3,
}

impl Aabb {
    /// The smallest box around `points`; of no points, an empty one with min above max.
    pub fn from_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        let empty = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };
        points.into_iter().fold(empty, |b, p| Self { min: b.min.min(p), max: b.max.max(p) })
    }

    pub fn center(&self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    pub fn extent(&self) -> Vec3 {
        self.max - self.min
    }
}

/// A right-handed orthonormal frame whose third axis is the unit vector `z`.
pub fn frame(z: Vec3) -> Mat3 {
    let (x, y) = z.any_orthonormal_pair();
    Mat3::from_cols(x, y, z)
}

/// The axis of a vector's largest component by magnitude; the first of equals.
pub fn dominant_axis(v: Vec3) -> usize {
    v.abs().max_position()
}
