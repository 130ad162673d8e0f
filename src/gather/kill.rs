//! The 2004 way to sample layers: a pass over all points for each layer, in which texels behind a point are culled by KILL (`discard`) and
//! the others overwrite its sample. Mirrors `glsl/kill.frag`.
//!
//! The poster's KILL did not stop the shader, and it expects more of "future hardware with an early KILL operation". [`Kill::early`] is that: what a
//! layer has culled, the stencil test rejects before the same shader runs for nearer ones. Mirrors `glsl/reject.frag`.

use std::rc::Rc;

use super::bundle::Bundle;
use crate::error::Result;
use crate::gpu::{Blend, DepthTest, Draw, Format, Gpu, Program, SampleQuery, ShaderSource, Shape, Target, Texture, Uniform};
use crate::points::Points;
use crate::shaders;

/// Holds the nearest hit of each point so far.
pub struct Kill {
    /// For the farthest layer, and for the others.
    programs: [Program; 2],
    hits: Target,
    survivors: SampleQuery,
    /// With early KILL: what rejects the culled points.
    reject: Option<Program>,
}

/// The depth that marks points which have sampled a layer: not that of the layer before, nor of a cleared target.
fn mark(index: u32) -> f32 {
    if index.is_multiple_of(2) { 0.0 } else { 1.0 }
}

impl Kill {
    pub fn new(gpu: &Gpu, points: [u32; 2]) -> Result<Self> {
        Self::with(gpu, &shaders::KILL_FARTHEST, Target::of(gpu, vec![(Self::texture(gpu, points)?, 0)], None)?, None)
    }

    /// What a layer culls is rejected before the shader from the next layer on.
    ///
    /// Points that sample a layer write a mark as their depth, and those that have not are rejected in a pass that has no work for a shader. In
    /// one pass it would take a shader that discards and a stencil that is written, and then drivers test after the shader.
    ///
    /// Far to near, a point that is culled is culled by all that follows, but for one ray in 300 000 (Cornell box, 256² layers): beside
    /// a concave edge its own surface may seem the farther of two that meet there, or only a later layer's neighbour counts. Most of these rays
    /// keep a hit farther away. Those without one would be lost, mostly to the farthest layer; so that one culls no points that
    /// face the direction, and one ray in a million is lost. That leaves the furnace white and the difference from exact rays as it is.
    pub fn early(gpu: &Gpu, points: [u32; 2]) -> Result<Self> {
        let hits = Target::with_stencil(gpu, Self::texture(gpu, points)?)?;
        Self::with(gpu, &shaders::KILL_FARTHEST_EARLY, hits, Some(Program::new(gpu, &shaders::REJECT)?))
    }

    /// Of one element, as `glsl/include/hits.glsl` reads hits.
    fn texture(gpu: &Gpu, points: [u32; 2]) -> Result<Rc<Texture>> {
        Ok(Rc::new(Texture::empty_array(gpu, Format::Rg32F, points, 1)?))
    }

    fn with(gpu: &Gpu, farthest: &ShaderSource, hits: Target, reject: Option<Program>) -> Result<Self> {
        let programs = [Program::new(gpu, farthest)?, Program::new(gpu, &shaders::KILL)?];
        Ok(Self { programs, hits, survivors: SampleQuery::new(gpu)?, reject })
    }

    /// Begins a bundle: every ray misses, and none is marked or rejected.
    pub fn start(&self) {
        self.hits.clear([0.0; 4], 0.5);
    }

    /// Lets each point sample `layer`, the `index`-th from afar. Returns how many did; for the farthest with early KILL, how many face it.
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

    /// What each point saw along the direction, as `glsl/kill.frag` writes it.
    pub fn hits(&self) -> &Texture {
        self.hits.color(0)
    }
}
