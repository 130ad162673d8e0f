//! Which side of a surface is its front: turns it, and compares it with shading normals.

use super::{Mesh, Triangle, World};

impl World {
    /// Turns the surfaces of all meshes, as [`Mesh::turn`] does.
    pub fn flip(&mut self) {
        self.meshes.iter_mut().for_each(|mesh| mesh.turn(|_| true));
    }
}

impl Mesh {
    /// Whether the shading normals of a triangle point to its back. `None` if it has none, or they lie across.
    pub fn is_against_normals(&self, triangle: usize) -> Option<bool> {
        let normals = self.triangles[triangle].vertices.map(|vertex| self.normals[vertex as usize]);
        let along = normals.into_iter().sum::<glam::Vec3>().dot(self.geometric_normal(triangle));
        (along != 0.0).then_some(along < 0.0)
    }

    /// Swaps front and back of the `chosen` triangles. If the shading normals of most of those that have some point to their backs, the normals are
    /// right: then only triangles with such normals turn. Else normals turn with their triangles.
    pub fn turn(&mut self, chosen: impl Fn(&Triangle) -> bool) {
        let chosen: Vec<usize> = (0..self.triangles.len()).filter(|&triangle| chosen(&self.triangles[triangle])).collect();
        let against: Vec<usize> =
            chosen.iter().copied().filter(|&triangle| self.is_against_normals(triangle) == Some(true)).collect();
        let smooth = chosen.iter().filter(|&&triangle| self.is_against_normals(triangle).is_some()).count();
        if 2 * against.len() > smooth {
            return self.swap(&against);
        }
        self.swap(&chosen);
        let mut vertices: Vec<u32> = chosen.iter().flat_map(|&triangle| self.triangles[triangle].vertices).collect();
        vertices.sort_unstable();
        vertices.dedup();
        for vertex in vertices {
            self.normals[vertex as usize] *= -1.0;
        }
    }

    fn swap(&mut self, triangles: &[usize]) {
        triangles.iter().for_each(|&triangle| self.triangles[triangle].vertices.swap(1, 2));
    }
}
