//! Polygons into triangles, whatever their shape. [`triangulate`] is the entry point.

use std::collections::HashMap;

use earcut::Earcut;
use glam::{DVec2, DVec3, Vec3};

/// Cuts a polygon into triangles of the same winding and gives them as indices into `corners`: a fan from the first corner
/// where that covers the polygon or nothing could, ears otherwise. Nothing comes back from a polygon without an area.
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
    let wind = |triangle @ [a, b, c]: [usize; 3]| if doubled_area(triangle) < 0.0 { [a, c, b] } else { triangle };
    if corners.len() > FEW && is_tangled(&flat, whole * 1e-12) {
        return fan.into_iter().map(wind).collect();
    }
    let mut ears: Vec<usize> = Vec::new();
    Earcut::new().earcut(flat.iter().map(|p| p.to_array()), &[], &mut ears);
    ears.as_chunks().0.iter().copied().map(wind).collect()
}

/// Of so few corners, ears take no time even from a polygon that crosses itself. From one that does they take the cube of the corners: 21 s of 3000.
const FEW: usize = 64;

/// The most often that a corner is passed: a hole that is reached by an edge there and back passes it twice.
const PASSES: u32 = 16;

/// Whether edges cross, by areas beyond `rounding`, or a corner is passed again and again, so that there is no telling what is inside.
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
