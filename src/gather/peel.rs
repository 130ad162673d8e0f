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
    /// The even layers and the odd ones: none is drawn into the array that it reads the one before from.
    layers: [Vec<Target>; 2],
    /// Layers of this bundle so far.
    count: u32,
}

/// One layer, as `glsl/peel.frag` writes it.
#[derive(Clone, Copy)]
pub struct Layer<'a> {
    /// An array of textures,
    pub layers: &'a Texture,
    /// and which of its elements.
    pub element: u32,
}

impl Peel {
    /// Keeps the last `kept` layers, at least two, rounded up to an even number.
    ///
    /// # Errors
    /// When sizes are beyond the device's limits.
    pub fn new(gpu: &Gpu, layer_size: u32, kept: u32) -> Result<Self> {
        let array = || Target::array(gpu, [layer_size; 2], Format::Rgba32F, kept.div_ceil(2).max(1));
        Ok(Self { peel: Program::new(gpu, &shaders::PEEL)?, layers: [array()?, array()?], count: 0 })
    }

    /// Begins a bundle.
    pub fn start(&mut self) {
        self.count = 0;
        self.layers[1][0].clear(BEYOND, 0.0);
    }

    /// The farthest layer not yet peeled; empty when there is none.
    pub fn next(&mut self, geometry: &Geometry, bundle: &Bundle) -> Layer<'_> {
        let layer = self.slot(self.count);
        // Before the first comes the one that was cleared.
        let previous = self.count.checked_sub(1).map_or((1, 0), |before| self.slot(before));
        let target = &self.layers[layer.0][layer.1];
        target.clear(EMPTY, 0.0);
        geometry.draw(SurfacePass {
            target,
            region: None,
            program: &self.peel,
            to_clip: bundle.to_clip,
            depth: DepthTest::Greater,
            uniforms: &[
                ("previous_layers", Uniform::Texture(self.layers[previous.0][previous.1].color(0))),
                ("previous_element", Uniform::Int(previous.1 as i32)),
            ],
        });
        self.count += 1;
        Layer { layers: target.color(0), element: layer.1 as u32 }
    }

    /// Array and element of a layer.
    fn slot(&self, layer: u32) -> (usize, usize) {
        (layer as usize % 2, layer as usize / 2 % self.layers[0].len())
    }
}
