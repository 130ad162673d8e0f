//! The baseline of the bundles: the same gather by ray shooting on the same GL device. Mirrors `glsl/rays.frag` and `glsl/include/bvh.glsl`.
//!
//! Each point casts one ray along each direction, towards the end on its side of its surface: E(x) = π Σ L w / Σ w with w = |n·d|. What a ray
//! meets first is found in a bounding volume hierarchy, so hits are exact, and the cost of a direction grows with the logarithm of the
//! number of triangles, times the number of points.
//!
//! The tables take some 130 bytes a triangle; devices with textures of 16384² hold four million.

use glam::{DVec3, Vec3, Vec4};

use super::hit_pass::HitPass;
use super::hits::{Begun, Find, FoundHits, Hits, KeptHits};
use super::{Beyond, Gather, Work};
use crate::direction::Direction;
use crate::error::Result;
use crate::geometry::{Geometry, triangle_order, upload_table};
use crate::gpu::{Format, Gpu, Program, Texture, Uniform};
use crate::points::Points;
use crate::scene::{FlatBvh, Scene};
use crate::shaders;

/// How far triangles reach beyond their edges, so that no ray slips through between two: a few times what a hit's position is rounded
/// by, at coordinates of 1.
const EDGE: f64 = 3e-7;

/// Rays through one scene, and what they bring added up.
pub struct RayGather {
    pass: HitPass,
    rays: Rays,
}

/// Rays through one scene, and what they meet written down.
pub struct RayFind {
    gpu: Gpu,
    program: Program,
    hits: FoundHits,
    rays: Rays,
    /// Of the batch begun with.
    directions: Vec<Vec4>,
}

/// A scene as rays see it.
struct Rays {
    /// Without its nodes and triangles, which are in textures.
    tree: FlatBvh,
    nodes: Texture,
    triangles: Texture,
}

impl Rays {
    /// Builds the tree; `scene` is in unit space.
    ///
    /// # Errors
    /// When the device's limits are below the scene's size.
    pub fn new(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let corners: Vec<_> = triangle_order(scene).into_iter().map(|triangle| scene.mesh.corners(triangle)).collect();
        let mut tree = FlatBvh::new(&corners);
        let nodes = std::mem::take(&mut tree.nodes);
        let order = std::mem::take(&mut tree.triangles);
        let triangles = order.into_iter().flat_map(|index| texels(corners[index as usize], index)).collect();
        Ok(Self {
            nodes: upload_table(gpu, Format::Rgba32Ui, nodes)?,
            triangles: upload_table(gpu, Format::Rgba32F, triangles)?,
            tree,
        })
    }

    /// What shaders of rays along `directions` read.
    fn uniforms<'a>(&'a self, directions: &'a [Vec4]) -> [(&'static str, Uniform<'a>); 7] {
        [
            ("bvh_nodes", Uniform::Texture(&self.nodes)),
            ("bvh_triangles", Uniform::Texture(&self.triangles)),
            ("bvh_count", Uniform::Int(self.tree.count as i32)),
            ("bvh_origin", Uniform::Vec3(self.tree.origin)),
            ("bvh_step", Uniform::Vec3(self.tree.step)),
            ("directions", Uniform::Vec4s(directions)),
            ("direction_count", Uniform::Int(directions.len() as i32)),
        ]
    }
}

fn vectors(directions: &[Direction]) -> Vec<Vec4> {
    directions.iter().map(|direction| direction.vector.extend(0.0)).collect()
}

impl RayGather {
    /// Builds the tree; `scene` is in unit space.
    ///
    /// # Errors
    /// When the device's limits are below the scene's size.
    pub fn new(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let pass = HitPass::new(gpu, &shaders::RAYS, &shaders::RAYS_TEXTURED)?;
        Ok(Self { pass, rays: Rays::new(gpu, scene)? })
    }
}

impl RayFind {
    /// For points in textures of one size.
    ///
    /// # Errors
    /// As [`RayGather::new`].
    pub fn new(gpu: &Gpu, scene: &Scene, points: [u32; 2]) -> Result<Self> {
        let program = Program::new(gpu, &shaders::RAYS_FIND)?;
        let (hits, rays) = (FoundHits::new(gpu, points)?, Rays::new(gpu, scene)?);
        Ok(Self { gpu: gpu.clone(), program, hits, rays, directions: Vec::new() })
    }
}

impl Find for RayFind {
    fn batch(&self) -> usize {
        shaders::BATCH
    }

    fn begin(&mut self, _: &Geometry, directions: &[Direction]) -> Result<Begun> {
        self.directions = vectors(directions);
        Ok(Begun { directions: directions.len(), layers: 0 })
    }

    fn find(&mut self, _: &Geometry, points: Points) -> Result<Hits<'_>> {
        self.hits.write(points, &self.program, &self.rays.uniforms(&self.directions));
        Ok(Hits::new(self.hits.texture(), &self.directions, true))
    }

    fn keep(&mut self) -> Result<KeptHits> {
        self.hits.keep(&self.gpu, &self.directions)
    }
}

impl Gather for RayGather {
    fn batch(&self) -> usize {
        shaders::BATCH
    }

    fn both_ends(&self) -> bool {
        true
    }

    fn add(&mut self, work: Work, directions: &[Direction]) -> Result<u32> {
        for batch in directions.chunks(shaders::BATCH) {
            let beyond = Beyond::new(work.scene, batch.iter().map(|direction| direction.vector));
            let vectors = vectors(batch);
            let uniforms = [&self.rays.uniforms(&vectors)[..], &beyond.uniforms()].concat();
            // No stage: llvmpipe's timer takes a scene of one long draw for a twentieth of what it was.
            self.pass.run(work, &uniforms);
        }
        Ok(0)
    }
}

/// A triangle as `glsl/include/bvh.glsl` reads it: its plane, and the weights of two corners as functions of the position; in f64, as
/// thin triangles need.
fn texels(corners: [Vec3; 3], index: u32) -> [[f32; 4]; 4] {
    let [a, b, c] = grown(corners.map(|corner| corner.as_dvec3()));
    let normal = (b - a).cross(c - a);
    let function = |gradient: DVec3| gradient.extend(-gradient.dot(a)).as_vec4().to_array();
    let weight = |edge: DVec3| function(edge / normal.length_squared());
    [function(normal.normalize()), weight((c - a).cross(normal)), weight(normal.cross(b - a)), [index as f32, 0.0, 0.0, 0.0]]
}

/// The triangle with each edge [`EDGE`] farther out: larger about the centre of its inscribed circle.
fn grown([a, b, c]: [DVec3; 3]) -> [DVec3; 3] {
    let lengths = [b.distance(c), c.distance(a), a.distance(b)];
    let around: f64 = lengths.iter().sum();
    let center = (lengths[0] * a + lengths[1] * b + lengths[2] * c) / around;
    let radius = (b - a).cross(c - a).length() / around;
    [a, b, c].map(|corner| center + (1.0 + EDGE / radius) * (corner - center))
}
