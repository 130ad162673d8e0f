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

/// The tree passes over boxes that a ray leaves within 1e-4 of its origin, and would lose what is in corners. Built at this scale, a power of
/// two so that nothing is rounded, it passes over a tenth of [`RAY_OFFSET`].
const SCALE: f32 = 1024.0;

/// How far beside a triangle a ray still meets it, in barycentric coordinates, so that no ray slips through between two: ten times what they
/// are rounded by.
const EDGE: f32 = 1e-6;

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
                let [v0, v1, v2] = mesh.corners(triangle).map(|corner| SCALE * Vec3A::from(corner));
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
        // The tree takes -0 for negative in one place and for positive in another, and then misses what it should meet; +0 is right.
        let ray = Ray::new_inf(SCALE * Vec3A::from(origin), Vec3A::from(direction) + Vec3A::ZERO);
        let mut hit = RayHit::none();
        let found = self.tree.ray_traverse(ray, &mut hit, |ray, leaf| {
            if Some(self.tree.primitive_indices[leaf] as usize) == except {
                return f32::INFINITY;
            }
            intersect(&self.triangles[leaf], ray)
        });
        found.then(|| Hit { triangle: self.tree.primitive_indices[hit.primitive_id as usize] as usize, distance: hit.t / SCALE })
    }
}

/// Where along the ray a triangle is, either side, or infinity (after Möller and Trumbore 1997). The tree's own test leaves gaps along edges.
fn intersect(triangle: &obvhs::triangle::Triangle, ray: &Ray) -> f32 {
    let (e1, e2) = (triangle.v0 - triangle.v1, triangle.v2 - triangle.v0);
    let normal = e1.cross(e2);
    let to_corner = triangle.v0 - ray.origin;
    let across = ray.direction.cross(to_corner);
    let scale = 1.0 / normal.dot(ray.direction);
    let (u, v) = (across.dot(e2) * scale, across.dot(e1) * scale);
    let distance = normal.dot(to_corner) * scale;
    // A ray in the triangle's plane gets infinity or no number, and meets nothing.
    let met = u.min(v).min(1.0 - u - v) >= -EDGE && distance >= ray.tmin && distance <= ray.tmax;
    if met { distance } else { f32::INFINITY }
}
