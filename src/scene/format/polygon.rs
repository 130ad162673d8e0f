//! Triangulates polygons of any shape. [`triangulate`] is the entry point.

use std::collections::HashMap;

use earcut::Earcut;
use glam::{DVec2, DVec3, Vec3};

/// Most corners of a polygon that a file may have. The test for a self-crossing polygon takes quadratic time in its corners.
pub const MOST_CORNERS: usize = 5000;

/// Cuts a polygon into triangles of the same winding, as indices into `corners`. It uses a fan from the first corner if the fan covers the polygon or
/// nothing can, and ear clipping otherwise. A polygon without area gives no triangles.
pub fn triangulate(corners: &[Vec3]) -> Vec<[usize; 3]> {
    if corners.len() == 3 {
        return vec![[0, 1, 2]];
    }
    let Some(flat) = project(corners) else { return Vec::new() };
    let doubled_area = |[a, b, c]: [usize; 3]| (flat[b] - flat[a]).perp_dot(flat[c] - flat[a]);
    let fan: Vec<_> = (2..flat.len()).map(|i| [0, i - 1, i]).collect();
    let whole: f64 = fan.iter().map(|&triangle| doubled_area(triangle)).sum();
    // A flat or inverted fan triangle means a straight or reflex corner, or a corner that the first one sees only through the outside.
    if fan.iter().all(|&triangle| doubled_area(triangle) > whole * 1e-9) {
        return fan;
    }
    let wind = |triangle @ [a, b, c]: [usize; 3]| if doubled_area(triangle) < 0.0 { [a, c, b] } else { triangle };
    if corners.len() > FEW && is_tangled(&flat, whole * 1e-12) {
        return fan.into_iter().map(wind).collect();
    }
    let mut ears: Vec<usize> = Vec::new();
    Earcut::new().earcut(flat.iter().map(|p| p.to_array()), &[], &mut ears);
    ears.as_chunks().0.iter().copied().map(wind).collect()
}

/// Up to this many corners, ear clipping is fast even if the polygon crosses itself. Beyond, such polygons take cubic time: 21 s for 3000 corners.
const FEW: usize = 64;

/// Maximum number of passes through a corner. A hole that an edge joins to the outline passes it twice.
const PASSES: u32 = 16;

/// Whether edges cross, by areas above `rounding`, or a corner is passed too often. Then the inside of the polygon is undefined.
fn is_tangled(flat: &[DVec2], rounding: f64) -> bool {
    let mut passes: HashMap<[u64; 2], u32> = HashMap::new();
    for corner in flat {
        let passed = passes.entry(corner.to_array().map(f64::to_bits)).or_default();
        *passed += 1;
        if *passed > PASSES {
            return true;
        }
    }
    let edge = |i: usize| [flat[i], flat[(i + 1) % flat.len()]];
    let side = |[a, b]: [DVec2; 2], p: DVec2| Some((b - a).perp_dot(p - a)).filter(|area| area.abs() > rounding).map(f64::signum);
    let parts = |line: [DVec2; 2], [a, b]: [DVec2; 2]| side(line, a).zip(side(line, b)).is_some_and(|(a, b)| a != b);
    let cross = |a: [DVec2; 2], b: [DVec2; 2]| parts(a, b) && parts(b, a);
    (0..flat.len()).any(|i| (i + 2..flat.len()).any(|k| cross(edge(i), edge(k))))
}

/// Projects the corners onto the polygon's plane, counter-clockwise. Newell's normal also serves polygons that are not quite flat. f64 holds products
/// of f32 coordinates exactly, so small polygons may be far from the origin.
fn project(corners: &[Vec3]) -> Option<Vec<DVec2>> {
    let corners: Vec<DVec3> = corners.iter().map(|corner| corner.as_dvec3()).collect();
    let next = corners.iter().cycle().skip(1);
    let normal = corners.iter().zip(next).map(|(a, b)| a.cross(*b)).sum::<DVec3>().try_normalize()?;
    let x = normal.any_orthonormal_vector();
    let y = normal.cross(x);
    Some(corners.iter().map(|p| DVec2::new(p.dot(x), p.dot(y))).collect())
}
