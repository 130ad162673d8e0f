//! The 2004 way to sample layers: a pass over all points for each layer, in which texels behind a point are culled by KILL (`discard`) and
//! the others overwrite its sample. Mirrors `glsl/kill.frag`.

use super::bundle::Bundle;
use super::peel::Layer;
use crate::error::Result;
use crate::gpu::{Blend, DepthTest, Draw, Format, Geometry, Gpu, Program, SampleQuery, Target, Texture, Uniform};
use crate::points::Points;
use crate::shaders;

/// Holds the nearest hit of each point so far.
pub struct Kill {
    /// For the farthest layer, and for the others.
    programs: [Program; 2],
    hits: Target,
    survivors: SampleQuery,
}

impl Kill {
    pub fn new(gpu: &Gpu, points: [u32; 2]) -> Result<Self> {
        Ok(Self {
            programs: [Program::new(gpu, &shaders::KILL_FARTHEST)?, Program::new(gpu, &shaders::KILL)?],
            hits: Target::new(gpu, points, &[Format::Rg32F], false)?,
            survivors: SampleQuery::new(gpu)?,
        })
    }

    /// Begins a bundle: every ray misses.
    pub fn start(&self) {
        self.hits.clear([0.0; 4], 0.0);
    }

    /// Lets each point sample `layer`, the `index`-th from afar. Returns how many did.
    pub fn sample(&self, points: Points, bundle: &Bundle, layer: Layer, index: u32) -> u32 {
        let own = [("layers", Uniform::Texture(layer.layers)), ("element", Uniform::Int(layer.element as i32))];
        let uniforms = [&own[..], &points.uniforms()[..], &bundle.uniforms()].concat();
        self.survivors.count(|| {
            Draw {
                target: &self.hits,
                region: None,
                program: &self.programs[usize::from(index > 0)],
                uniforms: &uniforms,
                depth: DepthTest::Off,
                blend: Blend::Replace,
                geometry: Geometry::FullScreen,
            }
            .run();
        })
    }

    /// What each point saw along the direction, as `glsl/kill.frag` writes it.
    pub fn hits(&self) -> &Texture {
        self.hits.color(0)
    }
}
