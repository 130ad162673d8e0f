//! Inverse depth peeling: layers, the farthest first (after Everitt 2001, "Interactive order-independent transparency"). Mirrors `glsl/peel.frag`.
//!
//! Each pass draws the scene with the depth test GREATER and discards fragments that are not nearer than the layer before. The farthest of the
//! others remain. A layer holds triangles and depths; the consumer looks up the light of a triangle only for hits.
//! Depth is a 32-bit float, so the strict comparison needs no epsilon and peeling ends.

use super::bundle::Bundle;
use crate::error::Result;
use crate::geometry::{Geometry, SurfacePass};
use crate::gpu::{DepthTest, Format, Gpu, Program, Target, Texture, Uniform};
use crate::shaders;

/// An empty texel: its depth is nearer than all surfaces, so every point lies beyond it.
const EMPTY: [f32; 4] = [-1.0, 0.0, 0.0, 0.0];
/// A texel of the layer before the first: its depth is beyond all surfaces.
const BEYOND: [f32; 4] = [2.0, 0.0, 0.0, 0.0];

/// Peels one bundle at a time.
pub struct Peel {
    peel: Program,
    /// Targets of the even and the odd layers, because a draw cannot read the layer before from its own target.
    layers: [Target; 2],
    /// Number of layers peeled from this bundle so far.
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

    /// Peels the next layer, far to near, as `glsl/peel.frag` writes it. It is empty when no surface is left.
    pub fn next(&mut self, geometry: &Geometry, bundle: &Bundle) -> &Texture {
        let [target, previous] = [0, 1].map(|back| &self.layers[(self.count + back) % 2]);
        target.clear(EMPTY, 0.0);
        geometry.draw(SurfacePass {
            target,
            region: None,
            program: &self.peel,
            of_cut_outs: |cut_outs| &cut_outs.peel,
            number: bundle.number,
            to_clip: bundle.to_clip,
            depth: DepthTest::Greater,
            uniforms: &[("previous_layer", Uniform::Texture(previous.color(0)))],
        });
        self.count += 1;
        target.color(0)
    }
}
