//! The cache at the vertices of the scene: what was gathered there in one stage lights the surfaces that the next stage sees. It replaces the photon
//! map, and holds the transfer by way of other surfaces. Mirrors `glsl/include/carriers.glsl`.
//!
//! Only fronts of surfaces have values: the back of a surface is black.

use std::rc::Rc;

use glam::{DVec4, Vec3, Vec4};

use super::hits::StoredHits;
use super::integrals::Values;
use super::plan::Plan;
use crate::error::Result;
use crate::geometry::{corner_weights, triangle_order, upload_table};
use crate::gpu::{Filter, Format, Gpu, Texture, Uniform, Wrap};
use crate::image::Channel;
use crate::points::{GatherPoint, Vertices};
use crate::quantity::Quantity;
use crate::scene::Scene;

/// Texels in a row of cached values.
const WIDTH: usize = 1024;

/// The vertices, and what they have found in the stage before.
pub struct VertexCache {
    vertices: Vertices,
    /// Between which vertices a hit lies: for each triangle in the order of the shaders' table.
    triangles: Rc<Texture>,
    /// Irradiance, where it replaces photons.
    pub radiance: Option<CachedValues>,
    pub transfer: Option<CachedValues>,
    /// What the vertices see, if there is memory for it.
    pub hits: Option<StoredHits>,
}

/// Values at the vertices, on the GL side.
pub struct CachedValues {
    triangles: Rc<Texture>,
    values: Texture,
    /// Of a vertex.
    texels: usize,
}

impl VertexCache {
    /// `scene` is in unit space; the inset is that of [`Vertices::new`].
    ///
    /// # Errors
    /// When the device's limits are below the scene's size.
    pub fn new(gpu: &Gpu, scene: &Scene, inset: f32) -> Result<Self> {
        let vertices = Vertices::new(&scene.mesh, inset);
        let texels = |triangle: usize| {
            let [a, b, c] = vertices.mesh().triangles[triangle].vertices.map(f64::from);
            let [second, third] = corner_weights(&scene.mesh, triangle);
            [DVec4::new(a, b, c, 0.0), second, third, DVec4::ZERO].map(|texel| texel.as_vec4().to_array())
        };
        let triangles = triangle_order(scene).into_iter().flat_map(texels).collect();
        let triangles = Rc::new(upload_table(gpu, Format::Rgba32F, triangles)?);
        Ok(Self { vertices, triangles, radiance: None, transfer: None, hits: None })
    }

    /// The points that gather for it.
    pub fn points(&self) -> &[GatherPoint] {
        self.vertices.points()
    }

    pub fn is_filled(&self) -> bool {
        self.radiance.is_some() || self.transfer.is_some()
    }

    pub fn clear(&mut self) {
        (self.radiance, self.transfer) = (None, None);
    }

    /// Replaces its values by those that a stage has found, with `direct` light.
    ///
    /// # Errors
    /// When the device's limits are below their number.
    pub fn fill(&mut self, gpu: &Gpu, plan: &Plan, values: &Values, direct: &[Vec3]) -> Result<()> {
        let inside = values.inside();
        let cached = |quantity, columns| {
            let all = values.columns(quantity, plan.order, self.points(), direct);
            self.upload(gpu, all.into_iter().take(columns).collect(), &inside)
        };
        let transfer = plan.wants(Quantity::Prt).then(|| cached(Quantity::Prt, usize::MAX)).transpose()?;
        // The first three columns are the sum of direct and indirect light.
        let radiance = plan.caches_radiance().then(|| cached(Quantity::Irradiance, 3)).transpose()?;
        (self.radiance, self.transfer) = (radiance, transfer);
        Ok(())
    }

    /// Takes `columns` of values, one for each vertex, to the GL side, after those of hidden vertices are filled.
    fn upload(&self, gpu: &Gpu, mut columns: Vec<Channel>, inside: &[f32]) -> Result<CachedValues> {
        self.vertices.fill(&mut columns, inside);
        let texels = columns.len().div_ceil(4);
        let rows = (self.points().len() * texels).div_ceil(WIDTH).max(1);
        let mut values = vec![Vec4::ZERO; rows * WIDTH];
        for (k, column) in columns.iter().enumerate() {
            for (vertex, &sample) in column.samples.iter().enumerate() {
                values[vertex * texels + k / 4][k % 4] = sample;
            }
        }
        let size = [WIDTH as u32, rows as u32];
        let values = Texture::from_texels(gpu, Format::Rgba32F, size, Filter::Nearest, Wrap::Clamp, &values)?;
        Ok(CachedValues { triangles: self.triangles.clone(), values, texels })
    }
}

impl CachedValues {
    /// The uniforms that shaders read.
    pub fn uniforms(&self) -> [(&'static str, Uniform<'_>); 3] {
        [
            ("carriers_of", Uniform::Texture(&self.triangles)),
            ("carried_values", Uniform::Texture(&self.values)),
            ("carried_texels", Uniform::Int(self.texels as i32)),
        ]
    }
}
