//! Geometry that glam does not have: axis-aligned boxes.

use glam::Vec3;

/// An axis-aligned box. [`Aabb::EMPTY`] holds no point, and any box joined with it stays as it is.
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

    /// Length from corner to corner: the diameter of the sphere around the box.
    pub fn diagonal(&self) -> f32 {
        self.extent().length()
    }
}
