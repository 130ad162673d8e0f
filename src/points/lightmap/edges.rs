//! Edges between triangles. Meshes split vertices for normals and texture coordinates, so one edge in space may be two in the mesh. Corners
//! therefore count as one if their positions have the same bits.

use std::collections::HashMap;

use glam::{Vec2, Vec3};

use crate::scene::Mesh;

/// An edge is smooth if the cosine between the normals on its two sides is more than this, 26°. Charts do not cross other edges, the creases.
const SMOOTH: f32 = 0.9;

/// A smooth edge between two triangles.
#[derive(Clone, Copy, Debug)]
pub struct Joint {
    /// For each side, the triangle and its two corners at the edge's ends, both sides in the same order.
    pub sides: [(usize, [usize; 2]); 2],
}

/// The number of each vertex's position: the same for the same position.
pub fn weld(mesh: &Mesh) -> Vec<u32> {
    let mut numbers = HashMap::new();
    // Adding zero turns -0 into 0.
    let key = |position: Vec3| (position + Vec3::ZERO).to_array().map(f32::to_bits);
    mesh.positions
        .iter()
        .map(|&position| {
            let next = numbers.len() as u32;
            *numbers.entry(key(position)).or_insert(next)
        })
        .collect()
}

/// All joints, in the order of their edges.
pub fn joints(mesh: &Mesh, welded: &[u32]) -> Vec<Joint> {
    let mut edges = Vec::new();
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        for from in 0..3 {
            let to = (from + 1) % 3;
            let [a, b] = [from, to].map(|corner| welded[triangle.vertices[corner] as usize]);
            edges.push(if a < b { ((a, b), true, index, [from, to]) } else { ((b, a), false, index, [to, from]) });
        }
    }
    edges.sort_unstable();
    let mut joints = Vec::new();
    for edge in edges.chunk_by(|p, q| p.0 == q.0) {
        // Triangles wound alike run along their edge in opposite directions.
        let (backward, forward) = edge.split_at(edge.partition_point(|side| !side.1));
        for (&(.., p, p_ends), &(.., q, q_ends)) in backward.iter().flat_map(|b| forward.iter().map(move |f| (b, f))) {
            let smooth = |end: usize| normal(mesh, p, p_ends[end]).dot(normal(mesh, q, q_ends[end])) > SMOOTH;
            if smooth(0) && smooth(1) {
                joints.push(Joint { sides: [(p, p_ends), (q, q_ends)] });
            }
        }
    }
    joints
}

/// For each triangle, which of its edges (from a corner to the next) are no joints, but creases and borders.
pub fn cuts(mesh: &Mesh, joints: &[Joint]) -> Vec<[bool; 3]> {
    let mut cuts = vec![[true; 3]; mesh.triangles.len()];
    for &(triangle, [p, q]) in joints.iter().flat_map(|joint| &joint.sides) {
        // An edge has the number of the corner that it begins at.
        cuts[triangle][if (p + 1) % 3 == q { p } else { q }] = false;
    }
    cuts
}

/// The shading normal at a corner.
fn normal(mesh: &Mesh, triangle: usize, corner: usize) -> Vec3 {
    let normal = mesh.normals[mesh.triangles[triangle].vertices[corner] as usize];
    if normal == Vec3::ZERO { mesh.geometric_normal(triangle) } else { normal }
}

/// Returns the chart of each triangle, numbered in the order of triangles, and the seams: joints whose sides lie at different places of the map.
/// `uvs` are the coordinates of each triangle's corners.
pub fn charts(uvs: &[[Vec2; 3]], joints: &[Joint]) -> (Vec<u32>, Vec<Joint>) {
    let mut parent: Vec<usize> = (0..uvs.len()).collect();
    fn root(parent: &mut [usize], mut at: usize) -> usize {
        while parent[at] != at {
            parent[at] = parent[parent[at]];
            at = parent[at];
        }
        at
    }
    let (within, seams): (Vec<Joint>, _) = joints.iter().partition(|Joint { sides: [(p, p_ends), (q, q_ends)] }| {
        p_ends.map(|corner| uvs[*p][corner]) == q_ends.map(|corner| uvs[*q][corner])
    });
    for Joint { sides: [(p, _), (q, _)] } in within {
        let [p, q] = [p, q].map(|side| root(&mut parent, side));
        // The first triangle of a chart is its root.
        parent[p.max(q)] = p.min(q);
    }
    let mut chart = vec![0; uvs.len()];
    let mut count = 0;
    for triangle in 0..uvs.len() {
        let first = root(&mut parent, triangle);
        chart[triangle] = if first == triangle { count } else { chart[first] };
        count += u32::from(first == triangle);
    }
    (chart, seams)
}
