//! Polygons into triangles, whatever their shape. [`triangulate`] is the entry point.

use earcut::Earcut;
use glam::{DVec2, DVec3, Vec3};

/// Cuts a polygon into triangles of the same winding and gives them as indices into `corners`: a fan from the first corner
/// where that covers the polygon, ears otherwise. Nothing comes back from a polygon without an area.
pub fn triangulate(corners: &[Vec3]) -> Vec<[usize; 3]> {
    if corners.len() == 3 {
        return vec![[0, 1, 2]];
    }
    let Some(flat) = project(corners) else { return Vec::new() };
    let doubled_area = |[a, b, c]: [usize; 3]| (flat[b] - flat[a]).perp_dot(flat[c] - flat[a]);
    let fan: Vec<_> = (2..flat.len()).map(|i| [0, i - 1, i]).collect();
    let whole: f64 = fan.iter().map(|&triangle| doubled_area(triangle)).sum();
    // A fan triangle that is flat or turns over means a straight or reflex corner, or one that is seen from the first only
    // through the outside.
    if fan.iter().all(|&triangle| doubled_area(triangle) > whole * 1e-9) {
        return fan;
    }
    let mut ears: Vec<usize> = Vec::new();
    Earcut::new().earcut(flat.iter().map(|p| p.to_array()), &[], &mut ears);
    let wind = |triangle @ [a, b, c]: [usize; 3]| if doubled_area(triangle) < 0.0 { [a, c, b] } else { triangle };
    ears.as_chunks().0.iter().copied().map(wind).collect()
}

/// The corners in the polygon's own plane, counter-clockwise. The plane's normal is Newell's, which also serves polygons that
/// are not quite flat; f64 holds the products of f32 coordinates exactly, so small polygons may lie far from the origin.
fn project(corners: &[Vec3]) -> Option<Vec<DVec2>> {
    let corners: Vec<DVec3> = corners.iter().map(|corner| corner.as_dvec3()).collect();
    let next = corners.iter().cycle().skip(1);
    let normal = corners.iter().zip(next).map(|(a, b)| a.cross(*b)).sum::<DVec3>().try_normalize()?;
    let x = normal.any_orthonormal_vector();
    let y = normal.cross(x);
    Some(corners.iter().map(|p| DVec2::new(p.dot(x), p.dot(y))).collect())
}
