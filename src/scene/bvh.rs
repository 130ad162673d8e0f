//! Ray queries on the CPU, by the `obvhs` crate's compressed wide BVH.

use std::time::Duration;

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::{Ray, RayHit};

use super::Mesh;

/// How far above its surface a ray starts. Coordinates in unit space are at most 1, where half a unit in the last place is 3e-8; a position
/// interpolated by a rasteriser gathers some tens of those, and a ray cast a few more. Nothing that is told apart in a
/// picture is closer together: the radius of the scene is a million times as far.
pub const RAY_OFFSET: f32 = 1e-6;

/// A bounding volume hierarchy over a mesh.
pub struct Bvh {
    tree: CwBvh,
    /// In the order of the tree's leaves.
    triangles: Vec<obvhs::triangle::Triangle>,
}

/// Where a ray first meets the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Into [`Mesh::triangles`].
    pub triangle: usize,
    /// In lengths of the ray's direction.
    pub distance: f32,
}

impl Bvh {
    pub fn new(mesh: &Mesh) -> Self {
        let corners: Vec<_> = (0..mesh.triangles.len())
            .map(|triangle| {
                let [v0, v1, v2] = mesh.corners(triangle).map(Vec3A::from);
                obvhs::triangle::Triangle { v0, v1, v2 }
            })
            .collect();
        let tree = build_cwbvh_from_tris(&corners, BvhBuildParams::medium_build(), &mut Duration::default());
        let triangles = tree.primitive_indices.iter().map(|&index| corners[index as usize]).collect();
        Self { tree, triangles }
    }

    /// The nearest hit of the ray from `origin` along `direction`, both sides of triangles counting. `except` is a triangle
    /// that the ray starts on and cannot meet.
    pub fn nearest(&self, origin: Vec3, direction: Vec3, except: Option<usize>) -> Option<Hit> {
        let ray = Ray::new_inf(origin.into(), direction.into());
        let mut hit = RayHit::none();
        let found = self.tree.ray_traverse(ray, &mut hit, |ray, leaf| {
            if Some(self.tree.primitive_indices[leaf] as usize) == except {
                return f32::INFINITY;
            }
            self.triangles[leaf].intersect(ray)
        });
        found.then(|| Hit { triangle: self.tree.primitive_indices[hit.primitive_id as usize] as usize, distance: hit.t })
    }
}
