//! The outline of many points: a few positions whose bounding box, along any axes, holds all of them and little more.

use std::collections::BTreeSet;

use glam::Vec3;

use crate::math::Aabb;

/// Cells of the grid along each side of the points' bounding box.
const CELLS: usize = 8;

/// The corners of tight boxes about the points in each cell of a coarse grid. A box along any axes reaches farther by less than a cell.
pub fn outline(points: &[Vec3]) -> Vec<Vec3> {
    let bounds = Aabb::from_points(points.iter().copied());
    let cell = (bounds.extent() / CELLS as f32).max(Vec3::splat(f32::MIN_POSITIVE));
    let mut boxes = vec![Aabb::EMPTY; CELLS.pow(3)];
    for &point in points {
        let [x, y, z] = ((point - bounds.min) / cell).to_array().map(|at| (at as usize).min(CELLS - 1));
        let own = &mut boxes[(z * CELLS + y) * CELLS + x];
        (own.min, own.max) = (own.min.min(point), own.max.max(point));
    }
    let corners = boxes.iter().filter(|own| own.min.cmple(own.max).all()).flat_map(|own| {
        [0, 1, 2, 3, 4, 5, 6, 7].map(|corner| {
            let upper = glam::BVec3::new(corner & 1 > 0, corner & 2 > 0, corner & 4 > 0);
            Vec3::select(upper, own.max, own.min)
        })
    });
    let different: BTreeSet<[u32; 3]> = corners.map(|corner| corner.to_array().map(f32::to_bits)).collect();
    different.into_iter().map(|bits| Vec3::from_array(bits.map(f32::from_bits))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direction::Directions;
    use crate::settings::Sequence;

    #[test]
    fn boxes_along_any_axis_hold_all_points_and_little_more() {
        // Points of a sphere and one far away.
        let directions = Directions::new(Sequence::R2, 3);
        let mut points: Vec<Vec3> = (0..20_000).map(|i| 0.1 * directions.get(i).vector).collect();
        points.push(Vec3::new(0.7, 0.1, 0.2));
        let few = outline(&points);
        assert!(few.len() < 2000, "{} corners", few.len());
        for i in 0..64 {
            let axis = directions.get(20_000 + i).vector;
            let reach = |points: &[Vec3]| points.iter().map(|point| point.dot(axis)).fold(f32::MIN, f32::max);
            let (all, own) = (reach(&points), reach(&few));
            assert!(own >= all && own < all + 0.15, "{own} of {all} along {axis}");
        }
        let lone = Vec3::splat(0.3);
        assert_eq!(outline(&[lone]), [lone]);
        assert_eq!(outline(&[]), []);
    }
}
