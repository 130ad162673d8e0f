//! The tables by which shaders cast exact rays: a bounding volume hierarchy and the triangles in its leaves. Mirrors `glsl/include/bvh.glsl`.
//!
//! They take about 130 bytes a triangle; devices with textures of 16384² hold four million triangles.

use glam::{DVec3, Vec3, Vec4};

use super::corner_weights;
use crate::error::Result;
use crate::gpu::{Format, Gpu, Texture, Uniform};
use crate::scene::FlatBvh;

/// Growth of triangles in unit space, so that no ray passes between two neighbours: a few times the rounding of a hit's position at coordinates of 1.
const EDGE: f64 = 3e-7;

/// All triangles of a scene, for rays on the GL side.
pub struct RayTables {
    /// The tree; its nodes and triangles are in the textures below.
    tree: FlatBvh,
    nodes: Texture,
    triangles: Texture,
}

impl RayTables {
    /// Bytes for each triangle: the tables, and the same again while they are made.
    pub(crate) const BYTES: usize = 2 * 130;

    /// Builds the tree of triangles in unit space, given by corners in the order of the shaders' table.
    ///
    /// # Errors
    /// When the scene is beyond the device's limits.
    pub(super) fn new(gpu: &Gpu, corners: &[[Vec3; 3]]) -> Result<Self> {
        let mut tree = FlatBvh::new(corners);
        let nodes = std::mem::take(&mut tree.nodes);
        let order = std::mem::take(&mut tree.triangles);
        let triangles = order.into_iter().flat_map(|index| texels(corners[index as usize], index)).collect();
        Ok(Self {
            nodes: Texture::table(gpu, Format::Rgba32Ui, nodes)?,
            triangles: Texture::table(gpu, Format::Rgba32F, triangles)?,
            tree,
        })
    }

    /// The uniforms of `glsl/include/bvh.glsl`.
    pub fn uniforms(&self) -> [(&'static str, Uniform<'_>); 5] {
        [
            ("bvh_nodes", Uniform::Texture(&self.nodes)),
            ("bvh_triangles", Uniform::Texture(&self.triangles)),
            ("bvh_count", Uniform::Int(self.tree.count as i32)),
            ("bvh_origin", Uniform::Vec3(self.tree.origin)),
            ("bvh_step", Uniform::Vec3(self.tree.step)),
        ]
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
