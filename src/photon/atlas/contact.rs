//! Contacts: lines along which other surfaces stand on a chart or pass through it.
//!
//! A wall on a floor keeps the light of one room from the other, and what stands on a floor hides a part of it. Both end at such lines.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::chart::Charts;
use super::pieces::ChartPages;
use crate::math::Aabb;
use crate::scene::{Bvh, Mesh};

/// A surface this close to a chart stands on it, as a share of a page.
const GAP: f32 = 0.01;
/// Bounds of that distance, in unit space: the rounding of coordinates, and what nobody calls a gap.
const GAPS: [f32; 2] = [2e-6, 1e-4];
/// Lines this close to the rim of a chart end nothing, as a share of a page: there the chart ends.
const RIM: f32 = 1e-3;

/// A line on a chart, in pages.
pub struct Contact {
    pub chart: u32,
    pub ends: [Vec2; 2],
}

/// All contacts of all charts. `bvh` belongs to `mesh`.
pub fn contacts(mesh: &Mesh, bvh: &Bvh, charts: &Charts, pages: &[ChartPages]) -> Vec<Contact> {
    let of_triangle = |triangle: usize| {
        let chart = charts.of[triangle];
        let (plane, page) = (&charts.planes[chart as usize], pages[chart as usize].side);
        let gap = (GAP * page).clamp(GAPS[0], GAPS[1]);
        let corners = mesh.corners(triangle);
        let normal = mesh.geometric_normal(triangle);
        let place = |position: Vec3| plane.in_pages(position, page);
        let own = corners.map(place);
        let bounds = Aabb::from_points(corners);
        let mut found = Vec::new();
        bvh.overlapping(&Aabb { min: bounds.min - gap, max: bounds.max + gap }, |other| {
            if charts.of[other] == chart {
                return;
            }
            let slab = within(mesh.corners(other), |position| normal.dot(position - corners[0]), gap);
            let outline: Vec<Vec2> = slab.into_iter().map(place).collect();
            for (i, &from) in outline.iter().enumerate() {
                let ends = clip([from, outline[(i + 1) % outline.len()]], own);
                if let Some(ends) = ends.filter(|ends| !on_rim(*ends, own, charts.rim[triangle])) {
                    found.push(Contact { chart, ends });
                }
            }
        });
        found
    };
    (0..mesh.triangles.len()).into_par_iter().flat_map_iter(of_triangle).collect()
}

/// The part of a triangle whose `height` is at most `gap`, on either side. The height is linear.
fn within(triangle: [Vec3; 3], height: impl Fn(Vec3) -> f32, gap: f32) -> Vec<Vec3> {
    let mut polygon = triangle.to_vec();
    for side in [1.0, -1.0] {
        let inside = |position: Vec3| gap - side * height(position);
        let mut rest = Vec::with_capacity(polygon.len() + 1);
        for (i, &a) in polygon.iter().enumerate() {
            let b = polygon[(i + 1) % polygon.len()];
            let (at_a, at_b) = (inside(a), inside(b));
            if at_a >= 0.0 {
                rest.push(a);
            }
            if at_a * at_b < 0.0 {
                rest.push(a + (b - a) * (at_a / (at_a - at_b)));
            }
        }
        polygon = rest;
    }
    polygon
}

/// The part of a line inside a triangle, if it has a length.
fn clip(line: [Vec2; 2], triangle: [Vec2; 3]) -> Option<[Vec2; 2]> {
    let way = line[1] - line[0];
    let (mut from, mut to) = (0.0f32, 1.0f32);
    let turn = (triangle[1] - triangle[0]).perp_dot(triangle[2] - triangle[0]).signum();
    for i in 0..3 {
        let edge = triangle[(i + 1) % 3] - triangle[i];
        let inner = turn * edge.perp().normalize_or_zero();
        // Lines along an edge belong to both of its triangles.
        let (start, slope) = (inner.dot(line[0] - triangle[i]) + RIM, inner.dot(way));
        if slope.abs() < 1e-12 {
            if start < 0.0 {
                return None;
            }
        } else if slope > 0.0 {
            from = from.max(-start / slope);
        } else {
            to = to.min(-start / slope);
        }
    }
    let length = (to - from) * way.length();
    (length > 4.0 * RIM).then(|| [line[0] + from * way, line[0] + to * way])
}

/// Whether a line runs along an edge of the triangle at which the chart ends.
fn on_rim(line: [Vec2; 2], triangle: [Vec2; 3], rim: u8) -> bool {
    (0..3).filter(|corner| rim >> corner & 1 == 1).any(|corner| {
        let across = (triangle[(corner + 1) % 3] - triangle[corner]).perp().normalize_or_zero();
        line.into_iter().all(|end| across.dot(end - triangle[corner]).abs() < 2.0 * RIM)
    })
}
