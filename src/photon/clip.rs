//! Convex polygons, cut along the cells of a grid.

use crate::random::Recurrence;
use glam::{UVec3, Vec3};

use crate::math::Aabb;

/// Cuts a convex polygon into slabs of unit thickness along `axis`. Each slab gets `cell` with its own coordinate along the axis.
pub fn slice(cell: UVec3, polygon: Vec<Vec3>, axis: usize) -> Vec<(UVec3, Vec<Vec3>)> {
    let bounds = Aabb::from_points(polygon.iter().copied());
    let [first, last] = [bounds.min, bounds.max].map(|corner| corner[axis].max(0.0) as u32);
    let mut slabs = Vec::new();
    let mut rest = polygon;
    for slab in first..=last {
        let mut cell = cell;
        cell[axis] = slab;
        let (below, above) =
            if slab == last { (std::mem::take(&mut rest), Vec::new()) } else { split(&rest, axis, (slab + 1) as f32) };
        rest = above;
        if below.len() >= 3 {
            slabs.push((cell, below));
        }
    }
    slabs
}

/// The parts of a convex polygon below and above a plane across `axis`.
fn split(polygon: &[Vec3], axis: usize, plane: f32) -> (Vec<Vec3>, Vec<Vec3>) {
    let (mut below, mut above) = (Vec::new(), Vec::new());
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (to_a, to_b) = (a[axis] - plane, b[axis] - plane);
        if to_a <= 0.0 {
            below.push(a);
        }
        if to_a >= 0.0 {
            above.push(a);
        }
        if to_a * to_b < 0.0 {
            let crossing = a + (b - a) * (to_a / (to_a - to_b));
            below.push(crossing);
            above.push(crossing);
        }
    }
    (below, above)
}

/// The area of a polygon.
pub fn area(polygon: &[Vec3]) -> f32 {
    let fan = polygon[1..].windows(2).map(|pair| (pair[0] - polygon[0]).cross(pair[1] - polygon[0]));
    0.5 * fan.sum::<Vec3>().length()
}

/// Points that tell the mean opacity of a part of a triangle.
pub const OPACITY_POINTS: u32 = 256;

/// This many points of a convex polygon, spread evenly.
pub fn even_points(polygon: &[Vec3], count: u32) -> impl Iterator<Item = Vec3> {
    let places = Recurrence::<2>::new(0);
    let whole = area(polygon);
    (0..count).map(move |index| {
        // As in `AreaLight`: the first number selects a triangle of the fan, its remainder the point.
        let [mut rest, v] = places.point(index.into());
        let mut corners = [polygon[0]; 3];
        for pair in polygon[1..].windows(2) {
            corners = [polygon[0], pair[0], pair[1]];
            let share = if whole > 0.0 { area(&corners) / whole } else { 1.0 };
            if rest < share {
                rest /= share;
                break;
            }
            rest -= share;
        }
        let ([a, b, c], along) = (corners, rest.clamp(0.0, 1.0).sqrt());
        a + (1.0 - along) * (b - a) + v * along * (c - a)
    })
}
