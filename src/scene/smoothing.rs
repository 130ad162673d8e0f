//! Shading normals for meshes without: the mean normal of the faces around a vertex.

use std::collections::HashMap;
use std::ops::RangeInclusive;

use glam::{DVec3, Vec3};

use super::{Mesh, World};

impl World {
    /// The angles that [`Self::smooth`] takes.
    pub const SMOOTH_ANGLES: RangeInclusive<f32> = 0.0..=180.0;
    /// What to do about others.
    pub const SMOOTH_ANGLE_CURE: &str = "give degrees from 0, all edges sharp, to 180, none";

    /// Gives vertices without normals smooth ones, see [`Mesh::smooth`].
    pub fn smooth(&mut self, degrees: f32) {
        self.meshes.iter_mut().for_each(|mesh| mesh.smooth(degrees));
    }
}

impl Mesh {
    /// Gives vertices without normals those of [`FaceNormals`]. Faces that meet at more than `degrees` do not mix: their edge stays sharp, and its
    /// vertices are split. Triangles keep their order.
    pub fn smooth(&mut self, degrees: f32) {
        let faces = FaceNormals::new(self);
        let mut split: HashMap<(u32, [u32; 3]), u32> = HashMap::new();
        let mut taken = vec![false; self.positions.len()];
        for triangle in 0..self.triangles.len() {
            for corner in 0..3 {
                let vertex = self.triangles[triangle].vertices[corner];
                // A vertex of an earlier face has its normal by now.
                if !taken[vertex as usize] && self.normals[vertex as usize] != Vec3::ZERO {
                    continue;
                }
                let normal = faces.mean(self, vertex, triangle, degrees);
                let index = *split.entry((vertex, normal.to_array().map(f32::to_bits))).or_insert_with(|| {
                    if std::mem::replace(&mut taken[vertex as usize], true) { self.copy_vertex(vertex) } else { vertex }
                });
                self.normals[index as usize] = normal;
                self.triangles[triangle].vertices[corner] = index;
            }
        }
    }
}

/// The normals of a mesh's faces, and the faces around each place.
pub struct FaceNormals {
    /// Unit normals on the fronts.
    pub faces: Vec<Vec3>,
    /// Triangles with a corner at a place, and their angles there.
    around: HashMap<[u32; 3], Vec<(usize, f32)>>,
}

impl FaceNormals {
    pub fn new(mesh: &Mesh) -> Self {
        let faces: Vec<Vec3> = (0..mesh.triangles.len()).map(|triangle| mesh.geometric_normal(triangle)).collect();
        let mut around: HashMap<[u32; 3], Vec<(usize, f32)>> = HashMap::new();
        for triangle in 0..faces.len() {
            for (corner, &vertex) in mesh.triangles[triangle].vertices.iter().enumerate() {
                around.entry(place(mesh, vertex)).or_default().push((triangle, mesh.angle(triangle, corner)));
            }
        }
        Self { faces, around }
    }

    /// The unit mean normal, weighted by angles, of the faces around a vertex of `triangle` whose normals are within `degrees` of its own.
    pub fn mean(&self, mesh: &Mesh, vertex: u32, triangle: usize, degrees: f32) -> Vec3 {
        let least = degrees.to_radians().cos();
        let own = self.faces[triangle];
        let near = || {
            let around = self.around[&place(mesh, vertex)].iter().map(|&(other, angle)| (other, f64::from(angle)));
            around.filter(|&(other, _)| other == triangle || self.faces[other].dot(own) > least)
        };
        let normal = near().map(|(other, angle)| self.faces[other].as_dvec3() * angle).sum::<DVec3>();
        // Faces back to back, as of leaves, leave nothing but rounding.
        let angles: f64 = near().map(|(_, angle)| angle).sum();
        if normal.length() < 1e-3 * angles { own } else { normal.normalize().as_vec3() }
    }
}

fn place(mesh: &Mesh, vertex: u32) -> [u32; 3] {
    // 0 and -0 are one place.
    (mesh.positions[vertex as usize] + Vec3::ZERO).to_array().map(f32::to_bits)
}
