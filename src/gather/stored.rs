//! Stores hits in a texture. Several consumers can read them, also after the finder's next batch. Mirrors `glsl/finder/stored.glsl` and
//! `glsl/consumer/record.glsl`.

use std::rc::Rc;

use glam::Vec4;

use super::pass::GatherPass;
use super::{Found, shader_of};
use crate::error::Result;
use crate::gpu::{Format, Gpu, Target, Texture, Uniform};
use crate::points::Points;
use crate::scene::Scene;
use crate::settings::Pipeline;
use crate::shaders::{BATCH, Consumer, Finder};

/// Bytes of a hit.
pub const HIT_BYTES: usize = 8;

/// The hits of a batch of directions.
pub struct StoredHits {
    /// Two directions in an array element, or one. Each has its distance in unit space, and the slot of its triangle in
    /// [`crate::geometry::Geometry`], counted from 1; 0: a miss.
    texture: Rc<Texture>,
    /// Unit vectors.
    directions: Vec<Vec4>,
    /// As [`super::HitFinder::both_ends`].
    both_ends: bool,
    /// As [`Found::layers`].
    layers: u32,
}

impl StoredHits {
    /// Number of directions.
    pub fn directions(&self) -> usize {
        self.directions.len()
    }

    /// The hits as a pass reads them.
    pub fn found(&self) -> Found<'_> {
        Found::stored(&self.texture, &self.directions, self.both_ends, self.layers)
    }
}

impl<'a> Found<'a> {
    /// Hits in a texture laid out as in [`StoredHits`].
    pub(super) fn stored(texture: &'a Texture, directions: &'a [Vec4], both_ends: bool, layers: u32) -> Self {
        let uniforms = vec![("hits", Uniform::Texture(texture)), ("both_ends", Uniform::Int(both_ends.into()))];
        Self { finder: Finder::Stored, layers, directions, both_ends, uniforms }
    }
}

/// Records hits, so that a finder does not search again for each consumer.
pub struct Recorder {
    gpu: Gpu,
    pass: GatherPass,
    /// Hits of the batch in progress. `None`: the finder itself stores its hits.
    batch: Option<(Rc<Texture>, Target)>,
}

impl Recorder {
    /// For the finder of `pipeline` in `scene`, and point textures of at most size `points`.
    ///
    /// # Errors
    /// When the device has no memory for the hits of a batch.
    pub fn new(gpu: &Gpu, pipeline: Pipeline, scene: &Scene, points: [u32; 2]) -> Result<Self> {
        let finder = shader_of(pipeline, scene);
        let batch = (finder != Finder::Stored).then(|| storage(gpu, points, BATCH)).transpose()?;
        Ok(Self { gpu: gpu.clone(), pass: GatherPass::new(gpu, finder, Consumer::Record)?, batch })
    }

    /// Stores the found hits until the next call, and returns them as stored hits.
    pub fn record<'a>(&'a self, found: Found<'a>, points: Points) -> Found<'a> {
        let Some((texture, target)) = &self.batch else { return found };
        self.pass.write(&found, points, target);
        Found::stored(texture, found.directions, found.both_ends, found.layers)
    }

    /// Stores hits in a new texture, which the caller keeps.
    ///
    /// # Errors
    /// When the device has no memory for them.
    pub fn keep(&self, found: &Found, points: Points) -> Result<StoredHits> {
        let (texture, target) = storage(&self.gpu, points.size(), found.directions.len())?;
        self.pass.write(found, points, &target);
        let directions = found.directions.to_vec();
        Ok(StoredHits { texture, directions, both_ends: found.both_ends, layers: found.layers })
    }
}

/// A texture for the hits of so many directions, and a target that writes to it.
fn storage(gpu: &Gpu, points: [u32; 2], directions: usize) -> Result<(Rc<Texture>, Target)> {
    let format = if directions == 1 { Format::Rg32F } else { Format::Rgba32F };
    let elements = directions.div_ceil(2) as u32;
    let texture = Rc::new(Texture::empty_array(gpu, format, points, elements)?);
    let target = Target::of(gpu, (0..elements).map(|element| (texture.clone(), element)).collect(), None)?;
    Ok((texture, target))
}
