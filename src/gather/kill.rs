//! The 2004 way to sample layers: a pass over all points for each layer, in which texels behind a point are culled by KILL (`discard`) and
//! the others overwrite its sample. Mirrors `glsl/kill.frag`.

use super::bundle::Bundle;
use super::peel::Layer;
use crate::error::Result;
use crate::gpu::{Blend, DepthTest, Draw, Geometry, Gpu, Program, SampleQuery, Target, Texture, Uniform};
use crate::points::Points;
use crate::shaders;

/// Holds the nearest sample of each point so far.
pub struct Kill {
    program: Program,
    samples: Target,
    survivors: SampleQuery,
}

impl Kill {
    pub fn new(gpu: &Gpu, points: [u32; 2]) -> Result<Self> {
        Ok(Self {
            program: Program::new(gpu, &shaders::KILL)?,
            samples: Target::new(gpu, points, 1, false)?,
            survivors: SampleQuery::new(gpu)?,
        })
    }

    /// Begins a bundle: every ray misses, and sees nothing.
    pub fn start(&self) {
        self.samples.clear([0.0; 4], 0.0);
    }

    /// Lets each point sample `layer`. Returns how many did.
    pub fn sample(&self, gpu: &Gpu, points: Points, bundle: &Bundle, layer: Layer) -> u32 {
        let mut uniforms =
            vec![("layer_plane", Uniform::Texture(layer.plane)), ("layer_radiance", Uniform::Texture(layer.radiance))];
        uniforms.extend(points.uniforms());
        uniforms.extend(bundle.uniforms());
        self.survivors.count(|| {
            gpu.draw(&Draw {
                target: &self.samples,
                region: None,
                program: &self.program,
                uniforms: &uniforms,
                depth: DepthTest::Off,
                blend: Blend::Replace,
                geometry: Geometry::FullScreen,
            });
        })
    }

    /// Radiance that each point saw along the direction.
    pub fn samples(&self) -> &Texture {
        self.samples.color(0)
    }
}
