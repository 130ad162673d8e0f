//! The vertices of a mesh as gather points.
//!
//! A vertex has the normal of the file. If the file has none, it has the mean normal of its faces, weighted by their angles. Faces that meet at
//! more than [`CREASE`] do not mix, and the vertex is split. Vertices lie on edges, where a layer of a bundle may show either side of the edge.
//! So each point is moved a little into the face with the widest angle at the vertex.

use std::collections::HashMap;

use glam::Vec3;
use serde::Serialize;

use super::{GatherPoint, INSIDE};
use crate::image::Channel;
use crate::scene::{FaceNormals, Mesh, Triangle};

/// An edge between faces is a crease if the angle between their normals is more than this, in degrees.
const CREASE: f32 = 40.0;

/// The vertices of a mesh, split at creases.
pub struct Vertices {
    mesh: Mesh,
    points: Vec<GatherPoint>,
    /// See [`VertexCounts::turned`].
    turned: usize,
}

/// Numbers of vertices by their treatment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct VertexCounts {
    pub vertices: usize,
    /// Vertices whose normal in the file points to the back of the face. They get a normal from their faces.
    pub turned: usize,
    /// Vertices inside something that got the mean of their neighbours.
    pub filled: usize,
    /// Vertices inside something with no neighbour outside. They keep their values.
    pub hidden: usize,
}

impl Vertices {
    /// `mesh` is in unit space. Points lie `inset` from their vertex or a third of the way to the centre of their face, whichever is less.
    pub fn new(mesh: &Mesh, inset: f32) -> Self {
        let around = FaceNormals::new(mesh);
        let faces = &around.faces;
        let corners = (0..faces.len()).flat_map(|triangle| (0..3).map(move |corner| (triangle, corner)));

        let mut new = Self { mesh: Mesh::default(), points: Vec::new(), turned: 0 };
        let mut triangles = mesh.triangles.clone();
        let mut shared: HashMap<(u32, [u32; 3]), u32> = HashMap::new();
        let mut widest = Vec::new();
        for (triangle, corner) in corners {
            let vertex = mesh.triangles[triangle].vertices[corner];
            let own = mesh.normals[vertex as usize];
            let turned = own != Vec3::ZERO && own.dot(faces[triangle]) <= 0.0;
            let normal = if own == Vec3::ZERO || turned { around.mean(mesh, vertex, triangle, CREASE) } else { own };
            let index = *shared.entry((vertex, normal.to_array().map(f32::to_bits))).or_insert_with(|| {
                new.turned += usize::from(turned);
                widest.push((0.0, 0));
                let index = new.mesh.push_vertex_of(mesh, vertex);
                new.mesh.normals[index as usize] = normal;
                index
            });
            triangles[triangle].vertices[corner] = index;
            let angle = mesh.angle(triangle, corner);
            if angle > widest[index as usize].0 {
                widest[index as usize] = (angle, triangle);
            }
        }
        let point = |(index, &(_, triangle)): (usize, &(f32, usize))| {
            let position = new.mesh.positions[index];
            let to_middle = mesh.corners(triangle).iter().sum::<Vec3>() / 3.0 - position;
            let share = (inset / to_middle.length()).min(1.0 / 3.0);
            GatherPoint {
                position: position + share * to_middle,
                normal: new.mesh.normals[index],
                surface_normal: faces[triangle],
            }
        };
        new.points = widest.iter().enumerate().map(point).collect();
        new.mesh.triangles = triangles;
        new
    }

    /// The mesh with split vertices. Triangles keep their order, and every vertex has a normal.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// One point for each vertex of [`Self::mesh`].
    pub fn points(&self) -> &[GatherPoint] {
        &self.points
    }

    /// Gives vertices inside something the mean of their neighbours, from outside inwards. `inside` is the fraction of back-face hits of each.
    pub fn fill(&self, columns: &mut [Channel], inside: &[f32]) -> VertexCounts {
        let mut known: Vec<bool> = inside.iter().map(|&share| share <= INSIDE).collect();
        let edges = |triangle: &Triangle| {
            let [a, b, c] = triangle.vertices.map(|vertex| vertex as usize);
            [(a, b), (b, c), (c, a)]
        };
        let mut filled = 0;
        loop {
            // For each vertex without a value, its neighbours that have one.
            let mut next: HashMap<usize, Vec<usize>> = HashMap::new();
            for (a, b) in self.mesh.triangles.iter().flat_map(edges) {
                for (from, to) in [(a, b), (b, a)] {
                    if known[from] && !known[to] {
                        next.entry(to).or_default().push(from);
                    }
                }
            }
            for column in columns.iter_mut() {
                for (&vertex, neighbours) in &next {
                    let sum: f32 = neighbours.iter().map(|&neighbour| column.samples[neighbour]).sum();
                    column.samples[vertex] = sum / neighbours.len() as f32;
                }
            }
            if next.is_empty() {
                break;
            }
            filled += next.len();
            next.keys().for_each(|&vertex| known[vertex] = true);
        }
        let hidden = known.iter().filter(|known| !**known).count();
        VertexCounts { vertices: self.points.len(), turned: self.turned, filled, hidden }
    }
}
