//! Gather points: positions and normals at which irradiance is gathered. They come from camera pixels, vertices, texels of light maps, or files.
//! Every source yields the same pair of textures, with the layout of `glsl/include/points.glsl`.

mod accumulator;
mod camera;
pub mod file;
mod gloss;
mod ground;
mod interleave;
mod lightmap;
mod list;
pub mod packets;
mod sharing;
mod traced;
mod vertices;

pub use accumulator::Accumulator;
pub use camera::{CameraPoints, GBuffer};
pub use gloss::{GlossTextures, PointGloss};
pub use ground::Ground;
pub use interleave::{Interleave, Subset};
pub use lightmap::{LightMap, LightMapCounts, LightMapOptions, Mended, Resolution, UvSource};
pub use list::{GatherPoint, PointList};
pub use sharing::Sharing;
pub use traced::EyeRays;
pub use vertices::{VertexCounts, Vertices};

use std::rc::Rc;

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use crate::error::Result;
use crate::gpu::{Blend, DepthTest, Draw, Filter, Format, Gpu, Program, Shape, Target, Texture, Uniform, Wrap};
use crate::scene::Scene;
use crate::settings::{FilmSettings, PointSource};

/// A point lies inside something if more than this fraction of its hits are back faces. Inside, all hits are, except for leaks. Outside none are,
/// except on surfaces without thickness, such as leaves, of which about half show their backs.
const INSIDE: f32 = 0.5;

/// With more triangles than this for each pixel, eye rays are faster than the rasteriser of a software driver: at one million triangles and 512 x 512
/// pixels, three times. The rule does not know the device, so that pictures of all have the same points.
const FINE: usize = 2;

/// Positions of points with the normals of their surfaces, for [`Photons::new`](crate::prepared::Photons::new).
pub fn sides(points: &[GatherPoint]) -> Vec<(Vec3, Vec3)> {
    points.iter().map(|point| (point.position, point.surface_normal)).collect()
}

/// What the settings stand for in a picture of this scene, through a lens or a pinhole.
pub fn chosen_source(scene: &Scene, lens: bool, film: &FilmSettings) -> PointSource {
    let pixels: usize = film.size.map(|side| side as usize).iter().product();
    // Rays cost by pixels, the rasteriser by triangles. Textures stay with the rasteriser, which filters them where they are far.
    let is_fine = !scene.is_textured() && scene.mesh.triangles.len() > FINE * pixels;
    match film.points {
        PointSource::Auto if lens || is_fine || scene.has_caustics() => PointSource::Traced,
        PointSource::Auto => PointSource::Camera,
        asked => asked,
    }
}

/// Owned point textures, one texel for each point.
pub struct PointTextures {
    position: Texture,
    normal: Texture,
    gloss: Option<GlossTextures>,
    count: u32,
    identity: Rc<()>,
}

impl PointTextures {
    /// Uploads texels with the layout of [`Points`], of which `count` are points.
    ///
    /// # Errors
    /// If `size` exceeds the device's limits.
    pub fn upload(gpu: &Gpu, size: [u32; 2], position: &[Vec4], normal: &[Vec4], count: u32) -> Result<Self> {
        let upload = |texels| Texture::from_texels(gpu, Format::Rgba32F, size, Filter::Nearest, Wrap::CLAMP, texels);
        Ok(Self { position: upload(position)?, normal: upload(normal)?, gloss: None, count, identity: Rc::default() })
    }

    /// The points with their gloss.
    pub fn with_gloss(self, gloss: Option<GlossTextures>) -> Self {
        Self { gloss, ..self }
    }

    /// Bytes that [`Self::upload`] takes.
    pub fn bytes(size: [u32; 2]) -> usize {
        Target::bytes(size, &[Format::Rgba32F; 2], false)
    }

    pub fn points(&self) -> Points<'_> {
        let gloss = self.gloss.as_ref().map(GlossTextures::textures);
        let (position, normal, subset) = (&self.position, &self.normal, Subset::ALL);
        Points { position, normal, gloss, subset, count: self.count, identity: Some(&self.identity) }
    }
}

/// Borrowed point textures, one texel for each point.
#[derive(Clone, Copy)]
pub struct Points<'a> {
    /// xyz: position in unit space; w: geometric normal, octahedral x.
    pub position: &'a Texture,
    /// xyz: unit shading normal, zero where there is no point; w: octahedral y.
    pub normal: &'a Texture,
    /// Those of [`GlossTextures`], in scenes with gloss.
    pub gloss: Option<[&'a Texture; 2]>,
    /// The texels that a pass covers.
    pub subset: Subset,
    /// The approximate number of points in the subset.
    pub count: u32,
    /// Tells textures whose texels never change from all others, while they exist. `None`: they may change.
    pub identity: Option<&'a Rc<()>>,
}

impl<'a> Points<'a> {
    /// Restricts all points to `subset`.
    pub fn only(self, subset: Subset) -> Self {
        Self { subset, count: self.count.div_ceil(subset.stride * subset.stride), ..self }
    }

    /// Width and height of a texture with one value for each point of the subset.
    pub fn size(&self) -> [u32; 2] {
        self.subset.size([self.position.width(), self.position.height()])
    }

    /// All points, whatever the subset, row by row from the bottom.
    pub fn read(&self) -> Vec<Option<GatherPoint>> {
        let (position, normal) = (self.position.read::<Vec4>(), self.normal.read::<Vec4>());
        position.par_iter().zip(&normal).map(|(&position, &normal)| GatherPoint::decode(position, normal)).collect()
    }

    /// Runs a full-screen pass of `program` over the points. Each subset of points has a tile of its own in the target.
    pub(crate) fn draw(&self, (target, blend): (&Target, Blend), program: &Program, uniforms: &[(&'static str, Uniform)]) {
        let [width, height] = self.size().map(|side| side as i32);
        let [x, y] = [self.subset.offset[0] as i32 * width, self.subset.offset[1] as i32 * height];
        Draw {
            target,
            region: Some([x, y, width, height]),
            program,
            uniforms: &[uniforms, &self.uniforms(), &[("first_texel", Uniform::IVec2([x, y]))]].concat(),
            depth: DepthTest::Off,
            blend,
            geometry: Shape::FullScreen,
        }
        .run();
    }

    /// The uniforms that the shaders read.
    pub fn uniforms(&self) -> Vec<(&'static str, Uniform<'a>)> {
        let gloss = self.gloss.map(|textures| textures.map(Uniform::Texture));
        let gloss = gloss.map(|[view, straight]| [("point_view", view), ("point_straight", straight)]);
        let own = [
            ("point_position", Uniform::Texture(self.position)),
            ("point_normal", Uniform::Texture(self.normal)),
            ("point_stride", Uniform::Int(self.subset.stride as i32)),
            ("point_offset", Uniform::IVec2(self.subset.offset.map(|o| o as i32))),
        ];
        own.into_iter().chain(gloss.into_iter().flatten()).collect()
    }
}
