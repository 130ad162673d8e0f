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
    program: Program,
    /// The farthest layer, then two that hold the others in turn.
    layers: [Target; 3],
    /// Layers of this bundle so far.
    count: usize,
}

/// One layer, as `glsl/peel.frag` writes it.
#[derive(Clone, Copy)]
pub struct Layer<'a> {
    pub surfaces: &'a Texture,
    /// The first layer of the bundle, which tells where the scene is.
    pub farthest: &'a Texture,
}

impl Peel {
    pub fn new(gpu: &Gpu, layer_size: u32) -> Result<Self> {
        let layer = || Target::new(gpu, [layer_size; 2], &[Format::Rgba32F], true);
        Ok(Self { program: Program::new(gpu, &shaders::PEEL)?, layers: [layer()?, layer()?, layer()?], count: 0 })
    }

    /// Begins a bundle.
    pub fn start(&mut self) {
        self.count = 0;
        self.layers[1].clear(BEYOND, 0.0);
    }

    /// The farthest layer not yet peeled; empty when there is none.
    pub fn next(&mut self, geometry: &Geometry, bundle: &Bundle) -> Layer<'_> {
        // The slots in turn: 0, 2, 1, 2, 1, ...; what comes before the first is in slot 1.
        let slot = |count: usize| if count == 0 { 0 } else { 1 + count % 2 };
        let previous = if self.count == 0 { 1 } else { slot(self.count - 1) };
        let target = &self.layers[slot(self.count)];
        self.count += 1;
        target.clear(EMPTY, 0.0);
        geometry.draw(SurfacePass {
            target,
            region: None,
            program: &self.program,
            to_clip: bundle.to_clip,
            depth: DepthTest::Greater,
            uniforms: &[("previous_layer", Uniform::Texture(self.layers[previous].color(0)))],
        });
        Layer { surfaces: target.color(0), farthest: self.layers[0].color(0) }
    }
}
