//! What points see along a batch of directions, written down: whatever integral over the hemisphere is wanted is then a pass over hits, and the
//! layers are peeled once for all of them. Mirrors `glsl/include/hits.glsl` and `glsl/include/found.glsl`.

use std::rc::Rc;

use glam::Vec4;

use crate::direction::Direction;
use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::{Blend, DepthTest, Draw, Format, Gpu, Program, Shape, Target, Texture, Uniform};
use crate::points::Points;
use crate::shaders;

/// A way to find hits on the GL side.
pub trait Find {
    /// The most directions that it takes at once.
    fn batch(&self) -> usize;

    /// Does what is the same for all points, for the first of `directions`: as many as there is memory for.
    ///
    /// # Errors
    /// [`crate::Error::Gl`] when the device is too small for the scene.
    fn begin(&mut self, geometry: &Geometry, directions: &[Direction]) -> Result<Begun>;

    /// What `points` see along the directions begun with.
    ///
    /// # Errors
    /// When the device has no memory for them.
    fn find(&mut self, geometry: &Geometry, points: Points) -> Result<Hits<'_>>;

    /// What was found last, for good.
    ///
    /// # Errors
    /// When the device has no memory for the next.
    fn keep(&mut self) -> Result<KeptHits>;

    /// Gives memory back that it can do without, if any.
    fn shrink(&mut self) -> bool {
        false
    }
}

/// What a [`Find`] has begun with.
#[derive(Clone, Copy, Debug)]
pub struct Begun {
    /// How many of those given, at least one.
    pub directions: usize,
    /// The most layers that were peeled for one of them, 0 where none were.
    pub layers: u32,
}

/// Bytes of a hit.
pub const HIT_BYTES: usize = 8;

/// Hits that outlive the next ones.
pub struct KeptHits {
    texture: Rc<Texture>,
    directions: Vec<Vec4>,
    both_ends: bool,
}

impl KeptHits {
    /// Along how many directions.
    pub fn directions(&self) -> usize {
        self.directions.len()
    }

    pub(super) fn new(texture: impl Into<Rc<Texture>>, directions: &[Vec4], both_ends: bool) -> Self {
        Self { texture: texture.into(), directions: directions.to_vec(), both_ends }
    }

    pub fn hits(&self) -> Hits<'_> {
        Hits::new(&self.texture, &self.directions, self.both_ends)
    }
}

/// Distance and triangle, for each point and direction of a batch.
#[derive(Clone, Copy)]
pub struct Hits<'a> {
    /// Two directions in an element: distance in unit space; slot of the triangle in [`Geometry`], counted from 1, 0 where nothing is.
    texture: &'a Texture,
    /// Unit vectors.
    directions: &'a [Vec4],
    /// Whether each point looks along the end on its side of its surface.
    both_ends: bool,
}

impl<'a> Hits<'a> {
    pub(super) fn new(texture: &'a Texture, directions: &'a [Vec4], both_ends: bool) -> Self {
        Self { texture, directions, both_ends }
    }

    /// The uniforms that shaders of `glsl/include/hits.glsl` read.
    pub fn uniforms(&self) -> [(&'static str, Uniform<'a>); 4] {
        [
            ("hits", Uniform::Texture(self.texture)),
            ("directions", Uniform::Vec4s(self.directions)),
            ("direction_count", Uniform::Int(self.directions.len() as i32)),
            ("both_ends", Uniform::Int(self.both_ends.into())),
        ]
    }
}

/// Holds the hits of a batch of directions, for points in textures of one size.
pub(super) struct FoundHits {
    texture: Rc<Texture>,
    target: Target,
}

impl FoundHits {
    pub fn new(gpu: &Gpu, points: [u32; 2]) -> Result<Self> {
        let elements = shaders::BATCH as u32 / 2;
        let texture = Rc::new(Texture::empty_array(gpu, Format::Rgba32F, points, elements)?);
        let target = Target::of(gpu, (0..elements).map(|element| (texture.clone(), element)).collect(), None)?;
        Ok(Self { texture, target })
    }

    /// Runs `program`, of `glsl/include/found.glsl`, over the points.
    pub fn write(&self, points: Points, program: &Program, uniforms: &[(&'static str, Uniform)]) {
        Draw {
            target: &self.target,
            // Textures of these hits may be larger than the points'.
            region: Some([0, 0, points.size()[0] as i32, points.size()[1] as i32]),
            program,
            uniforms: &[uniforms, &points.uniforms()].concat(),
            depth: DepthTest::Off,
            blend: Blend::Replace,
            geometry: Shape::FullScreen,
        }
        .run();
    }

    pub fn texture(&self) -> &Texture {
        &self.texture
    }

    /// Gives them away, for others to come.
    pub fn keep(&mut self, gpu: &Gpu, directions: &[Vec4]) -> Result<KeptHits> {
        let new = Self::new(gpu, self.target.size())?;
        let texture = std::mem::replace(self, new).texture;
        Ok(KeptHits::new(texture, directions, true))
    }
}
