//! The scene's surfaces on the GL side: one vertex array, a table of triangles, a table of materials and the albedo textures.
//! Mirrors `glsl/surface.vert` and `glsl/include/surface.glsl`.

use std::ops::Range;

use bytemuck::cast_slice;
use glam::{Mat4, Vec3};

use crate::error::Result;
use crate::gpu::{
    Blend, DepthTest, Draw, Filter, Format, Geometry as Shape, Gpu, Program, Target, Texture, Uniform, VertexArray, Wrap,
};
use crate::math::dominant_axis;
use crate::scene::Scene;

/// Width of the tables: within the least that 3.3 promises for textures, and tall enough for 16 million triangles on today's devices.
const TABLE_WIDTH: usize = 1024;

/// Everything that shaders read of a scene's surfaces.
pub struct Geometry {
    vertices: VertexArray,
    triangles: Texture,
    materials: Texture,
    /// One for each texture, and a white one for triangles without.
    textures: Vec<Texture>,
    batches: Vec<Batch>,
    /// All vertex positions, for fitting projections.
    pub positions: Vec<Vec3>,
}

/// Triangles that share an albedo texture.
struct Batch {
    texture: usize,
    triangles: Range<u32>,
}

impl Geometry {
    /// # Errors
    /// When the device has no memory or its limits are below the scene's sizes.
    pub fn upload(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let mesh = &scene.mesh;
        let white = scene.textures.len();
        let texture_of = |triangle: usize| scene.material(triangle).albedo_texture.unwrap_or(white);
        let mut order: Vec<usize> = (0..mesh.triangles.len()).collect();
        order.sort_by_key(|&triangle| texture_of(triangle));

        let mut batches: Vec<Batch> = Vec::new();
        let mut table = Vec::with_capacity(order.len());
        let mut indices = Vec::with_capacity(order.len() * 3);
        for (slot, &triangle) in (0u32..).zip(&order) {
            match batches.last_mut() {
                Some(batch) if batch.texture == texture_of(triangle) => batch.triangles.end = slot + 1,
                _ => batches.push(Batch { texture: texture_of(triangle), triangles: slot..slot + 1 }),
            }
            let normal = mesh.geometric_normal(triangle);
            let code = mesh.triangles[triangle].material as usize * 4 + dominant_axis(normal);
            table.push(normal.extend(code as f32).to_array());
            indices.extend(mesh.triangles[triangle].vertices);
        }
        let colors: Vec<[f32; 4]> =
            scene.materials.iter().flat_map(|m| [m.albedo.extend(0.0).to_array(), m.emission.extend(0.0).to_array()]).collect();

        let mut textures = Vec::with_capacity(white + 1);
        for texture in &scene.textures {
            let size = [texture.width, texture.height];
            textures.push(Texture::from_texels(
                gpu,
                Format::Srgb8Alpha8,
                size,
                Filter::Mipmapped,
                Wrap::Repeat,
                &texture.texels,
            )?);
        }
        textures.push(Texture::from_texels(gpu, Format::Srgb8Alpha8, [1, 1], Filter::Nearest, Wrap::Repeat, &[[255u8; 4]])?);

        let attributes: [(i32, &[u8]); 3] =
            [(3, cast_slice(&mesh.positions)), (3, cast_slice(&mesh.normals)), (2, cast_slice(&mesh.uvs))];
        Ok(Self {
            vertices: VertexArray::new(gpu, &attributes, &indices)?,
            triangles: upload_table(gpu, table)?,
            materials: upload_table(gpu, colors)?,
            textures,
            batches,
            positions: mesh.positions.clone(),
        })
    }

    /// Draws all surfaces into `region` of `target` under `to_clip`.
    pub fn draw(&self, gpu: &Gpu, pass: SurfacePass) {
        for batch in &self.batches {
            let mut uniforms = vec![
                ("to_clip", Uniform::Mat4(pass.to_clip)),
                ("triangles", Uniform::Texture(&self.triangles)),
                ("materials", Uniform::Texture(&self.materials)),
                ("albedo_texture", Uniform::Texture(&self.textures[batch.texture])),
                ("first_triangle", Uniform::Int(batch.triangles.start as i32)),
            ];
            uniforms.extend(pass.uniforms);
            gpu.draw(&Draw {
                target: pass.target,
                region: pass.region,
                program: pass.program,
                uniforms: &uniforms,
                depth: pass.depth,
                blend: Blend::Replace,
                geometry: Shape::Triangles(&self.vertices, batch.triangles.clone()),
            });
        }
    }
}

/// How surfaces are drawn.
pub struct SurfacePass<'a> {
    pub target: &'a Target,
    /// [x, y, width, height] of the target in texels; `None` is all of it.
    pub region: Option<[i32; 4]>,
    pub program: &'a Program,
    pub to_clip: Mat4,
    pub depth: DepthTest,
    /// Beside those of the surfaces.
    pub uniforms: &'a [(&'static str, Uniform<'a>)],
}

/// A list as a texture, row by row.
fn upload_table(gpu: &Gpu, mut texels: Vec<[f32; 4]>) -> Result<Texture> {
    let rows = texels.len().div_ceil(TABLE_WIDTH).max(1);
    texels.resize(rows * TABLE_WIDTH, [0.0; 4]);
    Texture::from_texels(gpu, Format::Rgba32F, [TABLE_WIDTH as u32, rows as u32], Filter::Nearest, Wrap::Clamp, &texels)
}
