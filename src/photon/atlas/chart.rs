//! Charts: connected groups of triangles that are almost flat, each with a plane of its own.
//!
//! Two triangles belong together if they share an edge, go on from each other across it, and both lie close to the plane of the chart's first
//! triangle. Vertices at one position count as one, because many files repeat them.

use std::collections::HashMap;

use glam::{Vec2, Vec3};

use crate::scene::Mesh;

/// Least cosine between the normals of a chart's triangles and of its first one.
const LIKE: f32 = 0.75;
/// Edges of more triangles than this do not connect them all with each other.
const MOST_AT_EDGE: usize = 8;

/// The charts of a mesh.
pub struct Charts {
    /// The chart of each triangle.
    pub of: Vec<u32>,
    /// Whether the triangle's front lies on the back of its chart.
    pub turned: Vec<bool>,
    /// Bit k is set if no other triangle of the chart has the edge from corner k to the next one.
    pub rim: Vec<u8>,
    /// The triangles of each chart.
    pub triangles: Vec<Vec<u32>>,
    pub planes: Vec<ChartPlane>,
}

/// The plane of a chart.
#[derive(Clone, Copy, Debug)]
pub struct ChartPlane {
    /// Unit vectors at right angles, in the plane.
    x: Vec3,
    y: Vec3,
    /// Of the chart's bounding rectangle, in unit space along x and y.
    pub low: Vec2,
    pub high: Vec2,
}

impl ChartPlane {
    /// The position of a point of unit space in the plane.
    pub fn place(&self, position: Vec3) -> Vec2 {
        Vec2::new(self.x.dot(position), self.y.dot(position))
    }

    /// The same from the lower corner, in pages of this side.
    pub fn in_pages(&self, position: Vec3, side: f32) -> Vec2 {
        (self.place(position) - self.low) / side
    }

    /// The axes in unit space.
    pub fn axes(&self) -> [Vec3; 2] {
        [self.x, self.y]
    }
}

/// The use of an edge by a triangle.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct EdgeUse {
    /// Ends, the lower number first.
    ends: [u32; 2],
    triangle: u32,
    corner: u8,
    /// Whether the triangle goes from the higher to the lower end.
    reversed: bool,
}

impl Charts {
    /// Groups the triangles of `mesh`. `thickness`: the greatest distance of a chart's corners from its plane.
    pub fn new(mesh: &Mesh, thickness: f32) -> Self {
        let uses = edge_uses(mesh);
        let runs: Vec<&[EdgeUse]> = uses.chunk_by(|a, b| a.ends == b.ends).collect();
        let mut run_of = vec![[0u32; 3]; mesh.triangles.len()];
        for (index, run) in (0..).zip(&runs) {
            run.iter().for_each(|side| run_of[side.triangle as usize][side.corner as usize] = index);
        }
        let neighbours = |triangle: u32, corner: usize| {
            let run = runs[run_of[triangle as usize][corner] as usize];
            let own = run.iter().find(|side| side.triangle == triangle && side.corner as usize == corner);
            let reach = if run.len() > MOST_AT_EDGE { &[] } else { run };
            reach
                .iter()
                .filter(move |side| side.triangle != triangle)
                .map(move |side| (side.triangle, own.is_some_and(|own| own.reversed != side.reversed)))
        };

        let count = mesh.triangles.len();
        let mut charts = Self {
            of: vec![u32::MAX; count],
            turned: vec![false; count],
            rim: vec![0; count],
            triangles: Vec::new(),
            planes: Vec::new(),
        };
        for seed in 0..count {
            if charts.of[seed] != u32::MAX {
                continue;
            }
            let chart = charts.triangles.len() as u32;
            let normal = mesh.geometric_normal(seed);
            let height = normal.dot(mesh.corners(seed)[0]);
            let mut members = vec![seed as u32];
            charts.of[seed] = chart;
            let mut next = 0;
            while let Some(&triangle) = members.get(next) {
                next += 1;
                for corner in 0..3 {
                    for (other, goes_on) in neighbours(triangle, corner) {
                        let facing = mesh.geometric_normal(other as usize).dot(normal);
                        // Where windings agree at the edge, sides agree too, unless the surface folds back.
                        let turned = facing < 0.0;
                        let folds = (turned == charts.turned[triangle as usize]) != goes_on;
                        let near = |corner: Vec3| (normal.dot(corner) - height).abs() <= thickness;
                        if charts.of[other as usize] == u32::MAX
                            && facing.abs() > LIKE
                            && !folds
                            && mesh.corners(other as usize).into_iter().all(near)
                        {
                            charts.of[other as usize] = chart;
                            charts.turned[other as usize] = turned;
                            members.push(other);
                        }
                    }
                }
            }
            charts.planes.push(plane(mesh, seed, normal, &members));
            charts.triangles.push(members);
        }
        for triangle in 0..count {
            for corner in 0..3 {
                let inner =
                    neighbours(triangle as u32, corner).any(|(other, _)| charts.of[other as usize] == charts.of[triangle]);
                charts.rim[triangle] |= u8::from(!inner) << corner;
            }
        }
        charts
    }
}

/// All edges of all triangles, sorted by their ends.
fn edge_uses(mesh: &Mesh) -> Vec<EdgeUse> {
    let mut numbers = HashMap::new();
    // Zero and minus zero are one place.
    let number = |position: &Vec3| {
        let next = numbers.len() as u32;
        *numbers.entry((*position + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert(next)
    };
    let welded: Vec<u32> = mesh.positions.iter().map(number).collect();
    let mut uses: Vec<EdgeUse> = (0u32..)
        .zip(&mesh.triangles)
        .flat_map(|(triangle, corners)| {
            let vertices = corners.vertices.map(|vertex| welded[vertex as usize]);
            [0u8, 1, 2].map(|corner| {
                let [from, to] = [vertices[corner as usize], vertices[(corner as usize + 1) % 3]];
                EdgeUse { ends: [from.min(to), from.max(to)], triangle, corner, reversed: from > to }
            })
        })
        .collect();
    uses.sort_unstable();
    uses
}

/// The plane along the first triangle, with x along its longest edge.
fn plane(mesh: &Mesh, seed: usize, normal: Vec3, members: &[u32]) -> ChartPlane {
    let [a, b, c] = mesh.corners(seed);
    let edges = [b - a, c - b, a - c];
    let longest = edges.into_iter().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    // An edge of a thin triangle may be a little off its rounded normal.
    let x = longest.unwrap_or(Vec3::X).reject_from_normalized(normal).normalize_or(normal.any_orthonormal_vector());
    let plane = ChartPlane { x, y: normal.cross(x), low: Vec2::INFINITY, high: Vec2::NEG_INFINITY };
    let places = members.iter().flat_map(|&triangle| mesh.corners(triangle as usize)).map(|corner| plane.place(corner));
    places.fold(plane, |grown, place| ChartPlane { low: grown.low.min(place), high: grown.high.max(place), ..grown })
}
