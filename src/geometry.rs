//! The scene's surfaces on the GL side: a vertex array, a table of triangles, a table of materials, vertex colours and the albedo textures.
//! Mirrors `glsl/surface.vert`, `glsl/include/surface.glsl` and `glsl/include/radiance.glsl`.

mod cut_outs;
mod light_tables;
mod ray_tables;

use std::cell::OnceCell;
use std::ops::Range;
use std::rc::Rc;

use bytemuck::cast_slice;
use glam::{DVec3, DVec4, Mat4, Vec3};

use crate::error::{Error, Result};
use crate::gpu::{Blend, DepthTest, Draw, Filter, Format, Gpu, Program, Shape, Target, Texture, Uniform, VertexArray, Wrap};
use crate::math::dominant_axis;
use crate::scene::{ImageTexture, Lights, Material, Mesh, Sampler, Scene, WrapMode};

pub use cut_outs::CutOuts;
pub use light_tables::LightTables;
pub use ray_tables::RayTables;

/// All data of the scene's surfaces that shaders read, in unit space.
pub struct Geometry {
    gpu: Gpu,
    vertices: VertexArray,
    triangles: Texture,
    materials: Texture,
    /// The vertex colours of each triangle, if the mesh has them.
    colors: Texture,
    /// Albedo textures for drawing; the last one is white, for triangles without a texture.
    textures: Vec<Texture>,
    /// All albedo textures in one, for the albedo of hits.
    texels: Texture,
    batches: Vec<Batch>,
    /// `None`: all surfaces are opaque.
    cut_outs: Option<CutOuts>,
    /// All vertex positions. Bundles fit their projections to them.
    pub positions: Vec<Vec3>,
    /// The triangle of each entry of the table, by its index in the scene's mesh.
    pub order: Vec<usize>,
    /// Corners of the triangles in the order of the table, as indices of positions.
    corners: Vec<[u32; 3]>,
    /// Made when the first ray needs them.
    ray_tables: OnceCell<Rc<RayTables>>,
    /// Made when the first sample of many lamps needs them.
    light_tables: OnceCell<Option<Rc<LightTables>>>,
}

/// Triangles that share an albedo texture, and are all opaque or all cut out.
struct Batch {
    texture: usize,
    triangles: Range<u32>,
}

impl Geometry {
    /// Uploads a scene in unit space.
    ///
    /// # Errors
    /// When the device has no memory left or the scene exceeds its limits.
    pub fn upload(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let mesh = &scene.mesh;
        let white = scene.textures.len();
        let texture_of = |triangle: usize| texture_of(scene, triangle);
        let order = triangle_order(scene);
        let opaque = order.partition_point(|&triangle| !scene.is_cut_out(triangle)) as u32;

        let mut batches: Vec<Batch> = Vec::new();
        let (mut table, mut colors) = (Vec::with_capacity(order.len()), Vec::new());
        let (mut positions, mut normals) = (Vec::with_capacity(order.len() * 3), Vec::with_capacity(order.len() * 3));
        for (slot, &triangle) in (0u32..).zip(&order) {
            match batches.last_mut() {
                Some(batch) if batch.texture == texture_of(triangle) && slot != opaque => batch.triangles.end = slot + 1,
                _ => batches.push(Batch { texture: texture_of(triangle), triangles: slot..slot + 1 }),
            }
            let normal = mesh.geometric_normal(triangle);
            let code = mesh.triangles[triangle].material as usize * 4 + dominant_axis(normal);
            table.push(normal.extend(code as f32).to_array());
            table.extend(planes(mesh, triangle, &mesh.uvs));
            table.push([triangle as f32, f32::from(u8::from(slot >= opaque)), 0.0, 0.0]);
            if !mesh.colors.is_empty() {
                colors.extend(planes(mesh, triangle, &mesh.colors));
                colors.push([0.0; 4]);
            }
            positions.extend(mesh.corners(triangle));
            normals.extend(mesh.triangles[triangle].vertices.map(|vertex| mesh.normals[vertex as usize]));
        }
        let unused = ImageTexture { width: 1, height: 1, texels: vec![[255; 4]], sampler: Sampler::default() };
        let in_shaders = |&(index, _): &(usize, _)| scene.materials.iter().any(|material| material.is_in_shaders(index));
        let scene_textures: Vec<&ImageTexture> =
            scene.textures.iter().enumerate().map(|texture| if in_shaders(&texture) { texture.1 } else { &unused }).collect();
        let (texels, first_rows) = upload_texels(gpu, &scene_textures)?;
        let entry = |(index, material): (usize, &Material)| {
            let texture_entry = |texture: Option<usize>| {
                texture.map_or([0.0; 4], |texture| {
                    let ImageTexture { width, height, sampler, .. } = scene.textures[texture];
                    [width as f32, height as f32, first_rows[texture] as f32, sampler_code(sampler)]
                })
            };
            let gloss = scene.gloss_mean(index);
            // Bits: a texture, colours of vertices, gloss.
            let varied = u8::from(material.albedo_texture.is_some())
                + 2 * u8::from(!mesh.colors.is_empty())
                + 4 * u8::from(gloss.is_some());
            let [share, rest] = gloss.unwrap_or_default().map(|value| value.extend(0.0).to_array());
            [
                material.albedo.extend(f32::from(varied)).to_array(),
                material.emission.extend(f32::from(material.two_sided)).to_array(),
                texture_entry(material.albedo_texture),
                rest,
                texture_entry(material.opacity.texture),
                [material.opacity.share, material.opacity.cutoff.unwrap_or(-1.0), 0.0, 0.0],
                texture_entry(material.emission_texture),
                share,
            ]
        };
        let materials = scene.materials.iter().enumerate().flat_map(entry).collect();

        let mut textures = Vec::with_capacity(white + 1);
        for texture in scene_textures {
            let size = [texture.width, texture.height];
            textures.push(Texture::from_texels(
                gpu,
                Format::Srgb8Alpha8,
                size,
                if texture.sampler.nearest { Filter::MipmappedNearest } else { Filter::Mipmapped },
                texture.sampler.wrap.map(Wrap::from),
                &texture.texels,
            )?);
        }
        textures.push(Texture::from_texels(gpu, Format::Srgb8Alpha8, [1, 1], Filter::Nearest, Wrap::CLAMP, &[[255u8; 4]])?);

        let attributes: [(i32, &[u8]); 2] = [(3, cast_slice(&positions)), (3, cast_slice(&normals))];
        Ok(Self {
            gpu: gpu.clone(),
            vertices: VertexArray::new(gpu, &attributes)?,
            triangles: Texture::table(gpu, Format::Rgba32F, table)?,
            materials: Texture::table(gpu, Format::Rgba32F, materials)?,
            colors: Texture::table(gpu, Format::Rgba32F, colors)?,
            textures,
            texels,
            batches,
            cut_outs: (opaque < order.len() as u32).then(|| CutOuts::new(gpu, opaque..order.len() as u32)).transpose()?,
            positions: mesh.positions.clone(),
            corners: order.iter().map(|&triangle| mesh.triangles[triangle].vertices).collect(),
            ray_tables: OnceCell::new(),
            light_tables: OnceCell::new(),
            order,
        })
    }

    /// The tables for exact rays. All that cast rays share them.
    ///
    /// # Errors
    /// When the device has no memory left or the scene exceeds its limits.
    pub fn ray_tables(&self) -> Result<Rc<RayTables>> {
        if let Some(tables) = self.ray_tables.get() {
            return Ok(Rc::clone(tables));
        }
        let corners: Vec<_> = self.corners.iter().map(|corners| corners.map(|vertex| self.positions[vertex as usize])).collect();
        let tables = Rc::new(RayTables::new(&self.gpu, &corners)?);
        Ok(Rc::clone(self.ray_tables.get_or_init(|| tables)))
    }

    /// The tables by which points choose one of many lamps. `None` if `lights`, which are those of the scene, are few.
    ///
    /// # Errors
    /// As [`Self::ray_tables`].
    pub fn light_tables(&self, lights: &Lights) -> Result<Option<Rc<LightTables>>> {
        if let Some(tables) = self.light_tables.get() {
            return Ok(tables.clone());
        }
        let mut places = vec![0; self.order.len()];
        self.order.iter().enumerate().for_each(|(place, &triangle)| places[triangle] = place);
        let tables = LightTables::new(&self.gpu, lights, |triangle| places[triangle])?.map(Rc::new);
        Ok(self.light_tables.get_or_init(|| tables).clone())
    }

    /// Bytes that it takes: per triangle the vertices, a table entry and the tables for rays; per texel the mipmaps and the copy in the joint texture.
    pub fn bytes(scene: &Scene) -> usize {
        const TRIANGLE: usize = 3 * size_of::<[Vec3; 2]>() + 4 * size_of::<[f32; 4]>() + size_of::<[u32; 3]>() + RayTables::BYTES;
        let texels: usize = scene.textures.iter().map(|texture| texture.texels.len()).sum();
        let colors = if scene.mesh.colors.is_empty() { 0 } else { 4 * size_of::<[f32; 4]>() };
        (TRIANGLE + colors) * scene.mesh.triangles.len() + Format::Srgb8Alpha8.bytes() * (texels + texels * 4 / 3)
    }

    /// The uniforms by which shaders read the surface of a hit.
    pub fn uniforms(&self) -> [(&'static str, Uniform<'_>); 5] {
        [
            ("triangles", Uniform::Texture(&self.triangles)),
            ("materials", Uniform::Texture(&self.materials)),
            ("colors", Uniform::Texture(&self.colors)),
            ("albedo_texels", Uniform::Texture(&self.texels)),
            ("albedo_shift", Uniform::Int(self.texels.width().ilog2() as i32)),
        ]
    }

    /// Programs and triangles of the surfaces that may be cut; `None` if there are none.
    pub fn cut_outs(&self) -> Option<&CutOuts> {
        self.cut_outs.as_ref()
    }

    /// `count` instances of all triangles, drawn without textures by `program`, and those that may be cut by another.
    pub fn instances<'a>(
        &'a self,
        count: u32,
        program: &'a Program,
        of_cut_outs: impl FnOnce(&'a CutOuts) -> &'a Program,
    ) -> impl Iterator<Item = (Shape<'a>, &'a Program)> {
        let all = self.order.len() as u32;
        let opaque = 0..self.cut_outs.as_ref().map_or(all, |cut_outs| cut_outs.triangles.start);
        let cut = self.cut_outs.as_ref().map(|cut_outs| (cut_outs.triangles.clone(), of_cut_outs(cut_outs)));
        let draws = [(opaque, program)].into_iter().chain(cut).filter(|(range, _)| !range.is_empty());
        draws.map(move |(range, program)| (Shape::Instances(&self.vertices, range, count), program))
    }

    /// Draws all surfaces.
    pub fn draw(&self, pass: SurfacePass) {
        let numbers = [pass.number.reverse_bits()];
        for batch in &self.batches {
            let own = [
                ("to_clip", Uniform::Mat4(pass.to_clip)),
                ("albedo_texture", Uniform::Texture(&self.textures[batch.texture])),
                ("numbers", Uniform::UInts(&numbers)),
            ];
            let uniforms = [&own[..], &self.uniforms(), pass.uniforms].concat();
            let cut_outs = self.cut_outs.as_ref().filter(|cut_outs| cut_outs.triangles.start <= batch.triangles.start);
            Draw {
                target: pass.target,
                region: pass.region,
                program: cut_outs.map_or(pass.program, pass.of_cut_outs),
                uniforms: &uniforms,
                depth: pass.depth,
                blend: Blend::Replace,
                geometry: Shape::Triangles(&self.vertices, batch.triangles.clone()),
            }
            .run();
        }
    }
}

/// Index of a triangle's texture in the textures of a [`Geometry`].
fn texture_of(scene: &Scene, triangle: usize) -> usize {
    scene.material(triangle).albedo_texture.unwrap_or(scene.textures.len())
}

/// The scene's triangle indices in the order of the shaders' table. Those that may be cut come last.
pub(crate) fn triangle_order(scene: &Scene) -> Vec<usize> {
    let mut order: Vec<usize> = (0..scene.mesh.triangles.len()).collect();
    order.sort_by_key(|&triangle| (scene.is_cut_out(triangle), texture_of(scene, triangle)));
    order
}

/// A pass that draws all surfaces.
pub struct SurfacePass<'a> {
    pub target: &'a Target,
    /// [x, y, width, height] in the target, in texels; `None`: the whole target.
    pub region: Option<[i32; 4]>,
    pub program: &'a Program,
    /// The program for surfaces that may be cut.
    pub of_cut_outs: fn(&CutOuts) -> &Program,
    /// The number by which they are cut: see [`crate::scene::Chance`].
    pub number: u32,
    pub to_clip: Mat4,
    pub depth: DepthTest,
    /// Uniforms of the program, besides those of the surfaces.
    pub uniforms: &'a [(&'static str, Uniform<'a>)],
}

/// The barycentric weights of a triangle's second and third corner as linear functions of the position: (gradient, offset). Shaders compute a hit's
/// weights from its position alone, without the corners. Thin triangles need f64.
pub(crate) fn corner_weights([a, b, c]: [DVec3; 3]) -> [DVec4; 2] {
    let normal = (b - a).cross(c - a);
    let weight = |edge: DVec3| {
        let gradient = edge / normal.length_squared();
        gradient.extend(-gradient.dot(a))
    };
    [weight((c - a).cross(normal)), weight(normal.cross(b - a))]
}

/// Values at a triangle's corners as linear functions of the position, one for each component: (gradient, offset).
fn planes<const N: usize, V: Copy + Into<[f32; N]>>(mesh: &Mesh, triangle: usize, values: &[V]) -> [[f32; 4]; N] {
    let [second, third] = corner_weights(mesh.corners(triangle).map(|corner| corner.as_dvec3()));
    let [a, b, c] = mesh.triangles[triangle].vertices.map(|vertex| values[vertex as usize].into().map(f64::from));
    std::array::from_fn(|k| (second * (b[k] - a[k]) + third * (c[k] - a[k]) + DVec4::W * a[k]).as_vec4().to_array())
}

/// A sampler as `glsl/include/albedo.glsl` reads it. Bits 0 and 1: mode along u. Bits 2 and 3: along v. Bit 4: nearest texel.
fn sampler_code(Sampler { wrap, nearest }: Sampler) -> f32 {
    let [u, v] = wrap.map(|mode| match mode {
        WrapMode::Repeat => 0,
        WrapMode::Mirror => 1,
        WrapMode::Clamp => 2,
    });
    f32::from(u + 4 * v + 16 * u8::from(nearest))
}

impl From<WrapMode> for Wrap {
    fn from(mode: WrapMode) -> Self {
        match mode {
            WrapMode::Repeat => Self::Repeat,
            WrapMode::Mirror => Self::Mirror,
            WrapMode::Clamp => Self::Clamp,
        }
    }
}

/// All textures in one, and the first row of each. Each begins a new row, which wastes least when narrow: the width grows only as device limits need.
fn upload_texels(gpu: &Gpu, textures: &[&ImageTexture]) -> Result<(Texture, Vec<usize>)> {
    let limit = gpu.info().limits.max_texture_size as usize;
    let rows_of = |texture: &&ImageTexture, width: usize| texture.texels.len().div_ceil(width);
    let rows = |width: usize| textures.iter().map(|texture| rows_of(texture, width)).sum::<usize>().max(1);
    let widths = (10..=limit.ilog2()).map(|power| 1usize << power);
    let Some(width) =
        widths.into_iter().find(|&width| rows(width) <= limit.min(4 * width)).or((rows(limit) <= limit).then_some(limit))
    else {
        let total: usize = textures.iter().map(|texture| texture.texels.len()).sum();
        return Err(Error::usage(
            format!("the albedo textures have {total} texels together, and this GL device takes about {}", limit * limit),
            "shrink some of them, or use another device",
        ));
    };
    let (mut texels, mut first_rows) = (Vec::with_capacity(width * rows(width)), Vec::new());
    for texture in textures {
        first_rows.push(texels.len() / width);
        texels.extend(&texture.texels);
        texels.resize(texels.len().next_multiple_of(width), [0u8; 4]);
    }
    texels.resize(texels.len().max(width), [0; 4]);
    let size = [width, texels.len() / width].map(|side| side as u32);
    Ok((Texture::from_texels(gpu, Format::Srgb8Alpha8, size, Filter::Nearest, Wrap::CLAMP, &texels)?, first_rows))
}
