//! Light that was gathered at the vertices of the scene's own mesh, to be seen by the next gather: radiance of surfaces without photons, and transfer
//! by way of other surfaces. Mirrors `glsl/include/vertex_cache.glsl`.
//!
//! Only fronts carry it: the back of a surface is black to it.

use glam::{DVec4, Vec4};

use crate::error::Result;
use crate::geometry::{corner_weights, triangle_order, upload_table};
use crate::gpu::{Filter, Format, Gpu, Texture, Uniform, Wrap};
use crate::image::Channel;
use crate::points::Vertices;
use crate::scene::Scene;

/// Texels in a row of carried values.
const WIDTH: usize = 1024;

/// The vertices that carry light, and which of them a hit lies between.
pub struct Carriers {
    vertices: Vertices,
    /// For each triangle in the order of the shaders' table.
    triangles: Texture,
}

/// Values at carriers, on the GL side.
pub struct Carried {
    values: Texture,
    texels: usize,
}

impl Carriers {
    /// `scene` is in unit space; the inset is that of [`Vertices::new`].
    ///
    /// # Errors
    /// When the device's limits are below the scene's size.
    pub fn new(gpu: &Gpu, scene: &Scene, inset: f32) -> Result<Self> {
        let vertices = Vertices::new(&scene.mesh, inset);
        let texels = |triangle: usize| {
            let [a, b, c] = vertices.mesh().triangles[triangle].vertices.map(f64::from);
            let [second, third] = corner_weights(scene.mesh.corners(triangle).map(|corner| corner.as_dvec3()));
            [DVec4::new(a, b, c, 0.0), second, third, DVec4::ZERO].map(|texel| texel.as_vec4().to_array())
        };
        let triangles = triangle_order(scene).into_iter().flat_map(texels).collect();
        Ok(Self { triangles: upload_table(gpu, Format::Rgba32F, triangles)?, vertices })
    }

    pub fn vertices(&self) -> &Vertices {
        &self.vertices
    }

    /// Takes `columns` of values, one for each vertex, to the GL side, after those of hidden vertices are filled.
    ///
    /// # Errors
    /// When the device's limits are below their number.
    pub fn carry(&self, gpu: &Gpu, mut columns: Vec<Channel>, inside: &[f32]) -> Result<Carried> {
        self.vertices.fill(&mut columns, inside);
        let texels = columns.len().div_ceil(4);
        let count = self.vertices.points().len();
        let rows = (count * texels).div_ceil(WIDTH).max(1);
        let mut values = vec![Vec4::ZERO; rows * WIDTH];
        for (k, column) in columns.iter().enumerate() {
            for (vertex, &sample) in column.samples.iter().enumerate() {
                values[vertex * texels + k / 4][k % 4] = sample;
            }
        }
        let size = [WIDTH as u32, rows as u32];
        let values = Texture::from_texels(gpu, Format::Rgba32F, size, Filter::Nearest, Wrap::Clamp, &values)?;
        Ok(Carried { values, texels })
    }

    /// The uniforms that shaders read of `carried`.
    pub fn uniforms<'a>(&'a self, carried: &'a Carried) -> [(&'static str, Uniform<'a>); 3] {
        [
            ("cache_vertices", Uniform::Texture(&self.triangles)),
            ("cached_values", Uniform::Texture(&carried.values)),
            ("cached_texels", Uniform::Int(carried.texels as i32)),
        ]
    }
}
