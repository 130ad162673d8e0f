//! All layers of several directions at once: each direction has a tile in a row of them, and each texel the surfaces on its line, far to near,
//! one in a slot. Mirrors `glsl/include/layer_store.glsl`.
//!
//! The layers are those of [`super::Peel`], and what is stored is what a reader of all layers wants to fetch together: two surfaces in 16 bytes.
//! Which triangle it is, of the one hit alone, lies apart. Two ways fill the slots, with the same: [`peel`] draws the scene once for each layer,
//! and all devices can; [`sort`] draws it once for all of them, where shaders can write to images.

mod peel;
mod sort;

use glam::Vec4;
use std::rc::Rc;

use self::peel::StorePeel;
use self::sort::StoreSort;
use super::Bundle;
use crate::error::{Error, Result};
use crate::geometry::Geometry;
use crate::gpu::{Format, Gpu, Texture, Uniform};
use crate::shaders;

/// Texels in a row of tiles, as far as one layer is not wider.
const WIDTH: u32 = 2048;
/// Slots at first; deeper scenes double them.
const SLOTS: u32 = 8;

/// The layers of one batch of directions at a time.
pub struct LayerStore {
    gpu: Gpu,
    layer_size: u32,
    tiles: u32,
    slots: Slots,
    filler: Filler,
    /// Layers of the batch.
    layers: u32,
}

/// Textures of one size.
struct Slots {
    /// Two slots in an element.
    planes: Rc<Texture>,
    /// Four in an element.
    triangles: Rc<Texture>,
    count: u32,
}

enum Filler {
    Peel(StorePeel),
    Sort(StoreSort),
}

impl LayerStore {
    /// Filled in one pass over the geometry where the device can.
    ///
    /// # Errors
    /// When sizes are beyond the device's limits.
    pub fn new(gpu: &Gpu, layer_size: u32) -> Result<Self> {
        Self::with(gpu, layer_size, gpu.writes_images())
    }

    /// Filled by peeling on any device.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn peeling(gpu: &Gpu, layer_size: u32) -> Result<Self> {
        Self::with(gpu, layer_size, false)
    }

    fn with(gpu: &Gpu, layer_size: u32, sorts: bool) -> Result<Self> {
        let tiles = (WIDTH.min(gpu.info().limits.max_texture_size) / layer_size).clamp(1, shaders::BATCH as u32);
        let slots = Slots::new(gpu, [tiles * layer_size, layer_size], SLOTS)?;
        let filler = match sorts {
            true => Filler::Sort(StoreSort::new(gpu, layer_size, tiles, &slots)?),
            false => Filler::Peel(StorePeel::new(gpu, tiles, &slots)?),
        };
        Ok(Self { gpu: gpu.clone(), layer_size, tiles, slots, filler, layers: 0 })
    }

    /// How many directions it holds.
    pub fn tiles(&self) -> u32 {
        self.tiles
    }

    pub fn layer_size(&self) -> u32 {
        self.layer_size
    }

    /// Stores all layers of `bundles`, each in a tile, from the first on. Returns how many slots readers need to look at: the most surfaces
    /// on a line, or a little fewer than the bundles before had, whichever is more.
    ///
    /// # Errors
    /// When the scene has more layers than the device has memory or array elements for: 12 bytes a texel each, and 4 to 16 more for
    /// sorting.
    ///
    /// # Panics
    /// With more bundles than tiles, or none.
    pub fn fill(&mut self, geometry: &Geometry, bundles: &[Bundle]) -> Result<u32> {
        assert!((1..=self.tiles as usize).contains(&bundles.len()), "{} bundles for {} tiles", bundles.len(), self.tiles);
        // To ask whether anything is left, one must wait; most of the layers that were there last time are taken for granted.
        let granted = self.layers.saturating_sub(1 + self.layers / 8);
        loop {
            let layers = match &mut self.filler {
                Filler::Peel(peel) => peel.fill(geometry, bundles, granted),
                Filler::Sort(sort) => sort.fill(geometry, bundles, granted, &self.slots),
            };
            if layers <= self.slots.count {
                self.layers = layers;
                return Ok(layers);
            }
            self.grow(layers)?;
        }
    }

    /// Keeps at least so many layers from now on; those there are get lost.
    fn grow(&mut self, layers: u32) -> Result<()> {
        let now = self.slots.count;
        let size = [self.slots.planes.width(), self.slots.planes.height()];
        let wanted = layers.next_power_of_two().min(self.gpu.info().limits.max_array_layers);
        let grown = if wanted < layers {
            None
        } else {
            Slots::new(&self.gpu, size, wanted)
                .and_then(|slots| {
                    match &mut self.filler {
                        Filler::Peel(peel) => peel.grow(&slots)?,
                        Filler::Sort(sort) => sort.grow(&slots)?,
                    }
                    Ok(slots)
                })
                .ok()
        };
        self.slots = grown.ok_or_else(|| {
            Error::usage(
                format!("the scene has more than {now} layers along a direction, and this GL device keeps no more"),
                "use the pipeline kill, which keeps none, or smaller layers (--layer-size)",
            )
        })?;
        Ok(())
    }

    /// The layers of one tile as [`super::Peel`] has them, far to near, each row by row: (depth, its change to the next texel in x and y, triangle
    /// counted from 1), the last 0 where nothing is.
    pub fn read(&self, tile: u32) -> Vec<Vec<Vec4>> {
        let (planes, triangles) = (self.slots.planes.read::<[u32; 4]>(), self.slots.triangles.read::<[u32; 4]>());
        let size = self.layer_size;
        let surface = |layer: u32, at: u32| {
            let texel = |element: u32| ((element * size + at / size) * self.tiles * size + tile * size + at % size) as usize;
            let [high, low] = match planes[texel(layer / 2)] {
                [high, low, _, _] if layer.is_multiple_of(2) => [high, low],
                [_, _, high, low] => [high, low],
            };
            let slopes = [high << 24 | low >> 8 & 0x00ff_f000, low << 12].map(f32::from_bits);
            let depth = (high >> 8) as f32 / 16_777_216.0;
            let triangle = triangles[texel(layer / 4)][layer as usize % 4];
            if depth == 0.0 { Vec4::ZERO } else { Vec4::new(depth, slopes[0], slopes[1], triangle as f32 + 1.0) }
        };
        let layer = |layer: u32| -> Vec<Vec4> { (0..size * size).map(|at| surface(layer, at)).collect() };
        (0..self.layers).map(layer).collect()
    }

    /// The uniforms that shaders of `glsl/include/layer_store.glsl` read.
    pub fn uniforms(&self) -> [(&'static str, Uniform<'_>); 3] {
        [
            ("planes", Uniform::Texture(&self.slots.planes)),
            ("stored_triangles", Uniform::Texture(&self.slots.triangles)),
            ("slot_count", Uniform::Int(self.layers as i32)),
        ]
    }
}

impl Slots {
    fn new(gpu: &Gpu, size: [u32; 2], count: u32) -> Result<Self> {
        let array = |in_element| Texture::empty_array(gpu, Format::Rgba32Ui, size, count.div_ceil(in_element)).map(Rc::new);
        Ok(Self { planes: array(2)?, triangles: array(4)?, count })
    }
}
