//! CPU ray queries. The tree is the compressed wide BVH of the `obvhs` crate.

use std::time::Duration;

use glam::{UVec2, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::{Ray, RayHit};
use obvhs::traverse;

use super::Mesh;
use crate::math::Aabb;

/// A ray starts this far from its surface, in unit space. Coordinates there are at most 1, and half a unit in the last place is 3e-8. Rasterised
/// positions have an error of some tens of these, ray casts of a few more. Details of a picture are larger: the scene's radius is 1e6 times this.
pub const RAY_OFFSET: f32 = 1e-6;

/// The tree skips boxes that a ray leaves within 1e-4 of its origin, and would lose geometry in corners. At this scale it skips a tenth of
/// [`RAY_OFFSET`]. The scale is a power of two, so nothing is rounded.
pub(super) const SCALE: f32 = 1024.0;

/// A ray hits a triangle up to this far outside its edge (barycentric; ten times the rounding error). So no ray slips between two triangles.
pub(super) const EDGE: f32 = 1e-6;

/// A bounding volume hierarchy over a mesh.
pub struct Bvh {
    pub(super) tree: CwBvh,
    /// In the order of the tree's leaves.
    pub(super) triangles: Vec<obvhs::triangle::Triangle>,
}

/// The nearest intersection of a ray with the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Index into [`Mesh::triangles`].
    pub triangle: usize,
    /// In multiples of the length of the ray's direction.
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

    /// The nearest hit of the ray from `origin` along `direction`, on either side of a triangle. The ray starts on triangle `except` and ignores it.
    pub fn nearest(&self, origin: Vec3, direction: Vec3, except: Option<usize>) -> Option<Hit> {
        self.nearest_of(origin, direction, except, |_| true)
    }

    /// The nearest hit that counts. `counts` is asked of some hits, in any order.
    pub(super) fn nearest_of(
        &self,
        origin: Vec3,
        direction: Vec3,
        except: Option<usize>,
        counts: impl Fn(Hit) -> bool,
    ) -> Option<Hit> {
        // The tree treats -0 as negative in one place and as positive in another, and then misses triangles. +0 is right.
        let ray = Ray::new_inf(SCALE * Vec3A::from(origin), Vec3A::from(direction) + Vec3A::ZERO);
        let mut hit = RayHit::none();
        let found = self.tree.ray_traverse(ray, &mut hit, |ray, leaf| {
            let triangle = self.tree.primitive_indices[leaf] as usize;
            if Some(triangle) == except {
                return f32::INFINITY;
            }
            let distance = intersect(&self.triangles[leaf], ray);
            let is_hit = distance.is_finite() && counts(Hit { triangle, distance: distance / SCALE });
            if is_hit { distance } else { f32::INFINITY }
        });
        found.then(|| Hit { triangle: self.tree.primitive_indices[hit.primitive_id as usize] as usize, distance: hit.t / SCALE })
    }

    /// Calls `visit` for each triangle whose bounding box may overlap `bounds`, in an order that depends on the mesh alone.
    pub fn overlapping(&self, bounds: &Aabb, mut visit: impl FnMut(usize)) {
        let bounds = obvhs::aabb::Aabb::new(SCALE * Vec3A::from(bounds.min), SCALE * Vec3A::from(bounds.max));
        let mut state = self.tree.new_traversal(Vec3A::ONE);
        let mut node;
        traverse!(self.tree, node, state, node.intersect_aabb(&bounds, state.oct_inv4), {
            visit(self.tree.primitive_indices[state.primitive_id as usize] as usize);
        });
    }
}

/// Distance along the ray to either side of a triangle; infinity without a hit (Möller and Trumbore 1997). The tree's own test leaves gaps at edges.
fn intersect(triangle: &obvhs::triangle::Triangle, ray: &Ray) -> f32 {
    let (e1, e2) = (triangle.v0 - triangle.v1, triangle.v2 - triangle.v0);
    let normal = e1.cross(e2);
    let to_corner = triangle.v0 - ray.origin;
    let across = ray.direction.cross(to_corner);
    let scale = 1.0 / normal.dot(ray.direction);
    let (u, v) = (across.dot(e2) * scale, across.dot(e1) * scale);
    let distance = normal.dot(to_corner) * scale;
    // For a ray in the triangle's plane the distance is infinite or NaN. It hits nothing.
    let met = u.min(v).min(1.0 - u - v) >= -EDGE && distance >= ray.tmin && distance <= ray.tmax;
    if met { distance } else { f32::INFINITY }
}
