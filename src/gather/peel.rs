//! Inverse depth peeling (after Everitt 2001, "Interactive order-independent transparency"): layers of a bundle, the farthest first.
//! Mirrors `glsl/peel.frag`.
//!
//! Each pass draws the scene with the depth test GREATER and discards what is not nearer than the layer before; what remains is the
//! farthest of the rest. A layer says which triangle is there and where; what light it sends is looked up once a ray has found its hit.
//! Depth is a 32-bit float, so the strict comparison needs no epsilon and peeling ends.

use super::bundle::Bundle;
use crate::error::Result;
use crate::geometry::{Geometry, SurfacePass};
use crate::gpu::{DepthTest, Format, Gpu, Program, Target, Texture, Uniform};
use crate::shaders;

/// Depth of texels that see nothing: before all surfaces, so that every point lies beyond.
const EMPTY: [f32; 4] = [-1.0, 0.0, 0.0, 0.0];
/// Depth of the layer before the first: beyond all surfaces.
const BEYOND: [f32; 4] = [2.0, 0.0, 0.0, 0.0];

/// Peels one bundle at a time.
pub struct Peel {
    peel: Program,
    /// The even layers and the odd ones: none is drawn into the texture that it reads the one before from.
    layers: [Target; 2],
    /// Layers of this bundle so far.
    count: usize,
}

impl Peel {
    /// # Errors
    /// When the size is beyond the device's limits.
    pub fn new(gpu: &Gpu, layer_size: u32) -> Result<Self> {
        let layer = || Target::new(gpu, [layer_size; 2], &[Format::Rgba32F], true);
        Ok(Self { peel: Program::new(gpu, &shaders::PEEL)?, layers: [layer()?, layer()?], count: 0 })
    }

    /// Begins a bundle.
    pub fn start(&mut self) {
        self.count = 0;
        self.layers[1].clear(BEYOND, 0.0);
    }

    /// The farthest layer not yet peeled, as `glsl/peel.frag` writes it; empty when there is none.
    pub fn next(&mut self, geometry: &Geometry, bundle: &Bundle) -> &Texture {
        let [target, previous] = [0, 1].map(|back| &self.layers[(self.count + back) % 2]);
        target.clear(EMPTY, 0.0);
        geometry.draw(SurfacePass {
            target,
            region: None,
            program: &self.peel,
            to_clip: bundle.to_clip,
            depth: DepthTest::Greater,
            uniforms: &[("previous_layer", Uniform::Texture(previous.color(0)))],
        });
        self.count += 1;
        target.color(0)
    }
}
