//! A hit finder that casts exact rays on the GL device: the baseline for the bundles. Mirrors `glsl/finder/rays.glsl` and `glsl/include/bvh.glsl`.
//!
//! Each point casts one ray along each direction, towards the end on its side of its surface. A bounding volume hierarchy gives the first surface
//! on the ray. The cost of a direction grows with the number of points times the logarithm of the number of triangles.
//!
//! The tables take about 130 bytes a triangle; devices with textures of 16384² hold four million triangles.

use glam::{DVec3, Vec3, Vec4};

use super::{Found, HitFinder};
use crate::direction::Direction;
use crate::error::Result;
use crate::geometry::{Geometry, corner_weights, triangle_order};
use crate::gpu::{Format, Gpu, Texture, Uniform};
use crate::points::Points;
use crate::scene::{FlatBvh, Scene};
use crate::shaders::{BATCH, Finder};

/// Growth of triangles in unit space, so that no ray passes between two neighbours: a few times the rounding of a hit's position at coordinates of 1.
const EDGE: f64 = 3e-7;

/// Casts rays through one scene.
pub struct RayFinder {
    /// The tree; its nodes and triangles are in the textures below.
    tree: FlatBvh,
    nodes: Texture,
    triangles: Texture,
    directions: Vec<Vec4>,
}

impl RayFinder {
    /// Builds the tree; `scene` is in unit space.
    ///
    /// # Errors
    /// When the scene is beyond the device's limits.
    pub fn new(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let corners: Vec<_> = triangle_order(scene).into_iter().map(|triangle| scene.mesh.corners(triangle)).collect();
        let mut tree = FlatBvh::new(&corners);
        let nodes = std::mem::take(&mut tree.nodes);
        let order = std::mem::take(&mut tree.triangles);
        let triangles = order.into_iter().flat_map(|index| texels(corners[index as usize], index)).collect();
        Ok(Self {
            nodes: Texture::table(gpu, Format::Rgba32Ui, nodes)?,
            triangles: Texture::table(gpu, Format::Rgba32F, triangles)?,
            tree,
            directions: Vec::new(),
        })
    }
}

impl HitFinder for RayFinder {
    fn batch(&self) -> usize {
        BATCH
    }

    fn begin(&mut self, _: &Geometry, directions: &[Direction]) -> Result<usize> {
        self.directions = directions.iter().map(|direction| direction.vector.extend(0.0)).collect();
        Ok(self.directions.len())
    }

    fn find(&mut self, _: &Geometry, _: Points) -> Result<Found<'_>> {
        let uniforms = vec![
            ("bvh_nodes", Uniform::Texture(&self.nodes)),
            ("bvh_triangles", Uniform::Texture(&self.triangles)),
            ("bvh_count", Uniform::Int(self.tree.count as i32)),
            ("bvh_origin", Uniform::Vec3(self.tree.origin)),
            ("bvh_step", Uniform::Vec3(self.tree.step)),
        ];
        Ok(Found { finder: Finder::Rays, layers: 0, directions: &self.directions, both_ends: true, uniforms })
    }
}

/// A triangle as `glsl/include/bvh.glsl` reads it: its plane, the weights of two corners as functions of the position, and its index.
fn texels(corners: [Vec3; 3], index: u32) -> [[f32; 4]; 4] {
    let corners @ [a, b, c] = grown(corners.map(|corner| corner.as_dvec3()));
    let normal = (b - a).cross(c - a).normalize();
    let [second, third] = corner_weights(corners);
    let number = Vec4::new(index as f32, 0.0, 0.0, 0.0);
    [normal.extend(-normal.dot(a)).as_vec4(), second.as_vec4(), third.as_vec4(), number].map(|texel| texel.to_array())
}

/// The triangle with each edge [`EDGE`] farther out, scaled about the centre of its inscribed circle.
fn grown([a, b, c]: [DVec3; 3]) -> [DVec3; 3] {
    let lengths = [b.distance(c), c.distance(a), a.distance(b)];
    let around: f64 = lengths.iter().sum();
    let center = (lengths[0] * a + lengths[1] * b + lengths[2] * c) / around;
    let radius = (b - a).cross(c - a).length() / around;
    [a, b, c].map(|corner| center + (1.0 + EDGE / radius) * (corner - center))
}
