//! Samples layers as the poster of 2004 does: one pass over all points for each layer. KILL (`discard`) culls the samples of texels behind a
//! point; the others overwrite the point's sample. Mirrors `glsl/kill.frag`.
//!
//! The poster's KILL did not stop the shader; the poster hopes for "future hardware with an early KILL operation". [`Kill::early`] does that: the
//! stencil test rejects points that a layer has culled, before the shader runs for nearer layers. Mirrors `glsl/reject.frag`.

use std::rc::Rc;

use super::bundle::Bundle;
use crate::error::Result;
use crate::gpu::{Blend, DepthTest, Draw, Format, Gpu, Program, SampleQuery, Shape, Target, Texture, Uniform};
use crate::points::Points;
use crate::shaders;

/// The nearest hit of each point so far.
pub struct Kill {
    /// For the farthest layer, and for the others.
    programs: [Program; 2],
    hits: Target,
    survivors: SampleQuery,
    /// The program that rejects culled points, with early KILL.
    reject: Option<Program>,
}

/// The depth that marks points which have sampled layer `index`. It differs from the mark of the layer before and from a cleared target.
fn mark(index: u32) -> f32 {
    if index.is_multiple_of(2) { 0.0 } else { 1.0 }
}

impl Kill {
    /// For point textures of size `points`.
    ///
    /// # Errors
    /// When the size is beyond the device's limits.
    pub fn new(gpu: &Gpu, points: [u32; 2]) -> Result<Self> {
        Self::with(gpu, points, false)
    }

    /// With early KILL: once a layer culls a point, the stencil test rejects the point before the shader, for all later layers.
    ///
    /// Points that sample a layer write a mark as their depth. A second pass, with an empty shader, rejects the points without the mark. A single
    /// pass would need a shader that discards and also writes the stencil; for those, drivers test after the shader.
    ///
    /// Nearer layers also cull a point that a farther one culled, except for one ray in 300 000 (Cornell box, 256² layers). Beside a concave edge
    /// the point's own surface may seem the farther of two that meet there, or only the neighbour texel of a later layer is a hit. Most of these
    /// rays keep a farther hit. The others would be lost, mostly at the farthest layer. So the farthest layer culls no point that faces the
    /// direction, and one ray in a million is lost. The furnace stays white and the difference from exact rays stays the same.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn early(gpu: &Gpu, points: [u32; 2]) -> Result<Self> {
        Self::with(gpu, points, true)
    }

    fn with(gpu: &Gpu, points: [u32; 2], early: bool) -> Result<Self> {
        let texture = Rc::new(Texture::empty_array(gpu, Format::Rg32F, points, 1)?);
        let (farthest, hits) = match early {
            true => (&shaders::KILL_FARTHEST_EARLY, Target::with_stencil(gpu, texture)?),
            false => (&shaders::KILL_FARTHEST, Target::of(gpu, vec![(texture, 0)], None)?),
        };
        let programs = [Program::new(gpu, farthest)?, Program::new(gpu, &shaders::KILL)?];
        let reject = early.then(|| Program::new(gpu, &shaders::REJECT)).transpose()?;
        Ok(Self { programs, hits, survivors: SampleQuery::new(gpu)?, reject })
    }

    /// Begins a bundle: all rays miss, and no point is marked or rejected.
    pub fn start(&self) {
        self.hits.clear([0.0; 4], 0.5);
    }

    /// Each point samples `layer`, number `index` from far to near. Returns how many points pass KILL; early KILL passes, in the farthest layer, all
    /// points that face the direction.
    pub fn sample(&self, points: Points, bundle: &Bundle, layer: &Texture, index: u32) -> u32 {
        let uniforms = [&[("layer", Uniform::Texture(layer))], &points.uniforms()[..], &bundle.uniforms()].concat();
        let program = &self.programs[usize::from(index > 0)];
        let Some(reject) = &self.reject else {
            return self.survivors.count(|| self.draw(program, &uniforms, DepthTest::Off));
        };
        if let Some(before) = index.checked_sub(1) {
            self.draw(reject, &[], DepthTest::RejectUnmarked(mark(before)));
        }
        self.survivors.count(|| self.draw(program, &uniforms, DepthTest::MarkAccepted(mark(index))))
    }

    fn draw(&self, program: &Program, uniforms: &[(&'static str, Uniform)], depth: DepthTest) {
        Draw { target: &self.hits, region: None, program, uniforms, depth, blend: Blend::Replace, geometry: Shape::FullScreen }
            .run();
    }

    /// The hit of each point along the direction, as `glsl/kill.frag` writes it.
    pub fn hits(&self) -> &Texture {
        self.hits.color(0)
    }
}
