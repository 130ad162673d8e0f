//! Stores all layers of several directions. Each direction has a tile; the tiles stand in a row. Each texel has slots, which hold the surfaces
//! on its line, far to near. Mirrors `glsl/include/layer_store.glsl`.
//!
//! The layers are those of [`super::Peel`]. Readers look at all layers of a texel, so one fetch of 16 bytes holds two surfaces. Readers need the
//! triangle of the hit alone, so another texture holds the triangles. Two ways fill the slots, with equal results: [`peel`] draws the scene once
//! for each layer, on any device; [`sort`] draws it once for all layers, where shaders can write to images.

mod peel;
mod sort;

use std::iter::successors;
use std::rc::Rc;

use glam::Vec4;

use self::peel::StorePeel;
use self::sort::StoreSort;
use super::Bundle;
use crate::error::{Error, Result};
use crate::geometry::Geometry;
use crate::gpu::{Format, Gpu, Target, Texture, Uniform};
use crate::shaders;

/// Most texels in a row of tiles, unless one layer is wider.
const WIDTH: u32 = 2048;
/// Slots at the start; deeper scenes double them.
const SLOTS: u32 = 8;

/// The layers of one batch of directions.
pub struct LayerStore {
    gpu: Gpu,
    layer_size: u32,
    tiles: u32,
    slots: u32,
    /// Whether to fill by sorting; false once the device has failed at it.
    sorts: bool,
    /// `None` while the memory is free for other uses.
    kept: Option<Kept>,
    /// Number of layers of the last batch.
    layers: u32,
}

/// Result of [`LayerStore::fill`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Filled {
    /// How many of the given bundles are stored, from the first on.
    pub bundles: usize,
    /// How many slots readers must look at: the most surfaces on a line, or a little fewer than the batch before had, whichever is more.
    pub layers: u32,
}

/// The allocated slots and their filler.
struct Kept {
    tiles: u32,
    slots: Slots,
    filler: Filler,
}

/// Array textures of one size.
struct Slots {
    /// Two slots in an array element.
    planes: Rc<Texture>,
    /// Four slots in an array element.
    triangles: Rc<Texture>,
    count: u32,
}

enum Filler {
    Peel(StorePeel),
    Sort(StoreSort),
}

impl LayerStore {
    /// A store filled by sorting where the device can, else by peeling.
    ///
    /// # Errors
    /// When sizes are beyond the device's limits, or it has no memory for the layers of one direction.
    pub fn new(gpu: &Gpu, layer_size: u32) -> Result<Self> {
        Self::with(gpu, layer_size, gpu.writes_images())
    }

    /// A store always filled by peeling.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn peeling(gpu: &Gpu, layer_size: u32) -> Result<Self> {
        Self::with(gpu, layer_size, false)
    }

    /// Most bytes that [`Self::new`] takes. Deeper scenes take more later.
    pub fn bytes(layer_size: u32) -> usize {
        let tiles = Self::tiles_in(WIDTH, layer_size);
        Slots::bytes([tiles * layer_size, layer_size], SLOTS) + StoreSort::bytes(layer_size, tiles, SLOTS)
    }

    fn tiles_in(width: u32, layer_size: u32) -> u32 {
        (width / layer_size).clamp(1, shaders::BATCH as u32)
    }

    fn with(gpu: &Gpu, layer_size: u32, sorts: bool) -> Result<Self> {
        let tiles = Self::tiles_in(WIDTH.min(gpu.info().limits.max_texture_size), layer_size);
        let kept = Kept::fitting(gpu, layer_size, tiles, SLOTS, sorts)?;
        Ok(Self { gpu: gpu.clone(), layer_size, tiles: kept.tiles, slots: SLOTS, sorts, kept: Some(kept), layers: 0 })
    }

    /// How many directions it holds. The number falls when the scene's layers need more memory than the device has.
    pub fn tiles(&self) -> u32 {
        self.tiles
    }

    pub fn layer_size(&self) -> u32 {
        self.layer_size
    }

    /// Frees the memory, and takes half as much from now on. Returns false, and does nothing, for a store of one direction.
    pub fn halve(&mut self) -> bool {
        let possible = self.tiles > 1;
        if possible {
            (self.tiles, self.kept) = (self.tiles / 2, None);
        }
        possible
    }

    /// Stores all layers of `bundles`, each in a tile: from the first on, as many as fit.
    ///
    /// # Errors
    /// When the scene has more layers than the device has memory or array elements for. A layer takes 12 bytes a texel, and 4 to 16 more for sorting.
    ///
    /// # Panics
    /// When `bundles` is empty.
    pub fn fill(&mut self, geometry: &Geometry, bundles: &[Bundle]) -> Result<Filled> {
        assert!(!bundles.is_empty(), "no bundles");
        // Asking the device whether surfaces are left means waiting for it. So most of the last batch's layers are filled without asking.
        let granted = self.layers.saturating_sub(1 + self.layers / 8);
        loop {
            // A store that is too small or fails is freed here, before a new one is made.
            let mut kept = match self.kept.take() {
                Some(kept) => kept,
                None => Kept::fitting(&self.gpu, self.layer_size, self.tiles, self.slots, self.sorts)?,
            };
            self.tiles = kept.tiles;
            let bundles = &bundles[..bundles.len().min(self.tiles as usize)];
            let (layers, sorted) = match &mut kept.filler {
                Filler::Peel(peel) => (peel.fill(geometry, bundles, granted), false),
                Filler::Sort(sort) => (sort.fill(geometry, bundles, granted, &kept.slots), true),
            };
            match self.gpu.check("storing layers") {
                // The driver promises image writes, but fails or loses them. (Otherwise only a scene seen edge-on has no layer.) Peel from now on.
                checked if sorted && !self.gpu.is_lost() && (checked.is_err() || layers == 0) => self.sorts = false,
                Err(error) => return Err(error),
                Ok(()) if layers > self.slots => {
                    let most = self.gpu.info().limits.max_array_layers;
                    self.slots = layers.next_power_of_two().min(most).max(layers);
                }
                Ok(()) => {
                    (self.layers, self.kept) = (layers, Some(kept));
                    return Ok(Filled { bundles: bundles.len(), layers });
                }
            }
        }
    }

    /// The slots filled last.
    fn slots(&self) -> &Slots {
        &self.kept.as_ref().expect("a store is filled before it is read").slots
    }

    /// The layers of one tile, far to near, row by row, as [`super::Peel`]: (depth, its change to the next texel in x and y, triangle from 1 or 0).
    pub fn read(&self, tile: u32) -> Vec<Vec<Vec4>> {
        let (planes, triangles) = (self.slots().planes.read::<[u32; 4]>(), self.slots().triangles.read::<[u32; 4]>());
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

    /// The uniforms of `glsl/include/layer_store.glsl`.
    pub fn uniforms(&self) -> [(&'static str, Uniform<'_>); 3] {
        [
            ("planes", Uniform::Texture(&self.slots().planes)),
            ("stored_triangles", Uniform::Texture(&self.slots().triangles)),
            ("slot_count", Uniform::Int(self.layers as i32)),
        ]
    }
}

impl Kept {
    /// For `tiles` directions, halved until the device has room. With `sorts` fills by sorting where the device can.
    fn fitting(gpu: &Gpu, layer_size: u32, mut tiles: u32, slots: u32, sorts: bool) -> Result<Self> {
        loop {
            let sorting = sorts.then(|| Self::new(gpu, layer_size, tiles, slots, true).ok()).flatten();
            match sorting.map_or_else(|| Self::new(gpu, layer_size, tiles, slots, false), Ok) {
                Err(_) if tiles > 1 => tiles /= 2,
                Err(Error::Gl { .. }) if !gpu.is_lost() => return Err(no_room(gpu, layer_size, slots)),
                made => return made,
            }
        }
    }

    fn new(gpu: &Gpu, layer_size: u32, tiles: u32, slots: u32, sorts: bool) -> Result<Self> {
        let slots = Slots::new(gpu, [tiles * layer_size, layer_size], slots)?;
        let filler = match sorts {
            true => Filler::Sort(StoreSort::new(gpu, layer_size, tiles, &slots)?),
            false => Filler::Peel(StorePeel::new(gpu, tiles, &slots)?),
        };
        Ok(Self { tiles, slots, filler })
    }
}

/// The error when memory is too small for the layers of one direction.
fn no_room(gpu: &Gpu, layer_size: u32, slots: u32) -> Error {
    let mebibytes = 12.0 * f64::from(layer_size).powi(2) * f64::from(slots) / f64::from(1 << 20);
    let mut smaller = successors(Some(layer_size / 2), |size| Some(size / 2)).take_while(|&size| size > 0);
    let fits = smaller.find(|&size| Kept::new(gpu, size, 1, slots, false).is_ok());
    Error::gl(
        format!("the GL device has no room for {slots} layers of {layer_size}x{layer_size} texels: {mebibytes:.1} MiB"),
        match fits {
            Some(size) => format!("use --layer-size {size}, for which it has, or the pipeline kill, which keeps no layers"),
            None => "use the pipeline kill, which keeps no layers".to_owned(),
        },
    )
}

impl Slots {
    fn new(gpu: &Gpu, size: [u32; 2], count: u32) -> Result<Self> {
        let array = |in_element| Texture::empty_array(gpu, Format::Rgba32Ui, size, count.div_ceil(in_element)).map(Rc::new);
        Ok(Self { planes: array(2)?, triangles: array(4)?, count })
    }

    fn bytes(size: [u32; 2], count: u32) -> usize {
        (count.div_ceil(2) + count.div_ceil(4)) as usize * Target::bytes(size, &[Format::Rgba32Ui], false)
    }
}
