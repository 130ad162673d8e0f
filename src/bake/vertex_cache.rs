//! The vertex cache. Results of one stage at the scene's vertices light the surfaces that the next stage hits. It replaces the photon map, and holds
//! transfer by way of other surfaces. Mirrors `glsl/include/vertex_cache.glsl`.
//!
//! Only front sides have values. Back sides are black.

use std::rc::Rc;

use glam::{DVec4, Vec3};

use super::hits::VertexHits;
use super::integrals::Values;
use super::plan::Plan;
use crate::error::Result;
use crate::geometry::{corner_weights, triangle_order};
use crate::gpu::{Format, Gpu, Texture, Uniform};
use crate::image::Channel;
use crate::points::{GatherPoint, Vertices};
use crate::quantity::Quantity;
use crate::scene::Scene;

/// Results of the last stage at the vertices. The default has no vertices.
#[derive(Default)]
pub struct VertexCache {
    /// Vertices, and for each triangle its three vertices with weights, in the order of the shaders' table.
    vertices: Option<(Vertices, Rc<Texture>)>,
    /// Irradiance, if it replaces the photon map.
    pub radiance: Option<CachedValues>,
    pub transfer: Option<CachedValues>,
    /// The hits of the vertices, if memory can hold them.
    pub hits: Option<VertexHits>,
}

/// Values at the vertices, on the GL side.
pub struct CachedValues {
    triangles: Rc<Texture>,
    values: Texture,
    /// Texels for each vertex.
    texels: usize,
}

impl VertexCache {
    /// `scene` is in unit space. `inset` is that of [`Vertices::new`].
    ///
    /// # Errors
    /// When the scene exceeds the device's limits.
    pub fn new(gpu: &Gpu, scene: &Scene, inset: f32) -> Result<Self> {
        let vertices = Vertices::new(&scene.mesh, inset);
        let texels = |triangle: usize| {
            let [a, b, c] = vertices.mesh().triangles[triangle].vertices.map(f64::from);
            let [second, third] = corner_weights(scene.mesh.corners(triangle).map(|corner| corner.as_dvec3()));
            [DVec4::new(a, b, c, 0.0), second, third, DVec4::ZERO].map(|texel| texel.as_vec4().to_array())
        };
        let triangles = triangle_order(scene).into_iter().flat_map(texels).collect();
        let triangles = Rc::new(Texture::table(gpu, Format::Rgba32F, triangles)?);
        Ok(Self { vertices: Some((vertices, triangles)), ..Self::default() })
    }

    /// The points whose values it caches.
    pub fn points(&self) -> &[GatherPoint] {
        self.vertices.as_ref().map_or(&[], |(vertices, _)| vertices.points())
    }

    pub fn is_filled(&self) -> bool {
        self.radiance.is_some() || self.transfer.is_some()
    }

    /// Replaces the values by the results of a stage, with `direct` light.
    ///
    /// # Errors
    /// When the values exceed the device's limits.
    pub fn fill(&mut self, gpu: &Gpu, plan: &Plan, values: &Values, direct: &[Vec3]) -> Result<()> {
        let Some((vertices, triangles)) = &self.vertices else { return Ok(()) };
        let inside = values.inside();
        let cached = |quantity, columns| {
            let mut all = values.columns(quantity, plan.order, vertices.points(), direct);
            all.truncate(columns);
            vertices.fill(&mut all, &inside);
            CachedValues::upload(gpu, triangles, &all)
        };
        let transfer = plan.wants(Quantity::Prt).then(|| cached(Quantity::Prt, usize::MAX)).transpose()?;
        // The first three columns are the sum of direct and indirect light.
        let radiance = plan.caches_radiance().then(|| cached(Quantity::Irradiance, 3)).transpose()?;
        (self.radiance, self.transfer) = (radiance, transfer);
        Ok(())
    }
}

impl CachedValues {
    /// Each of `columns` has a value for each vertex.
    fn upload(gpu: &Gpu, triangles: &Rc<Texture>, columns: &[Channel]) -> Result<Self> {
        let texels = columns.len().div_ceil(4);
        let mut values = vec![[0.0f32; 4]; columns.first().map_or(0, |column| column.samples.len()) * texels];
        for (k, column) in columns.iter().enumerate() {
            column.samples.iter().enumerate().for_each(|(vertex, &sample)| values[vertex * texels + k / 4][k % 4] = sample);
        }
        Ok(Self { triangles: triangles.clone(), values: Texture::table(gpu, Format::Rgba32F, values)?, texels })
    }

    pub fn uniforms(&self) -> [(&'static str, Uniform<'_>); 3] {
        [
            ("cache_vertices", Uniform::Texture(&self.triangles)),
            ("cached_values", Uniform::Texture(&self.values)),
            ("cached_texels", Uniform::Int(self.texels as i32)),
        ]
    }
}
