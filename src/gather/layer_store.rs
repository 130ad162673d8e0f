//! All layers of several directions at once: each direction has a tile in a row of them, and each texel the surfaces on its line, far to near,
//! one in a slot. Mirrors `glsl/layer_store.frag` and `glsl/include/layer_store.glsl`.
//!
//! The layers are those of [`super::Peel`], found in the same way; here one draw peels a layer of all directions, and what is stored is what
//! a reader of all layers wants to fetch together: two surfaces in 16 bytes. Which triangle it is, of the one hit alone, lies apart.

use std::rc::Rc;

use glam::{Mat4, Vec4};

use super::Bundle;
use crate::error::{Error, Result};
use crate::geometry::Geometry;
use crate::gpu::{Blend, DepthTest, Draw, Format, Gpu, Program, SampleQuery, Target, Texture, Uniform};
use crate::shaders;

/// Texels in a row of tiles, as far as one layer is not wider.
const WIDTH: u32 = 2048;
/// Slots at first; deeper scenes double them.
const SLOTS: u32 = 8;

/// The layers of one batch of directions at a time.
pub struct LayerStore {
    gpu: Gpu,
    /// For the farthest layer, and for the others.
    programs: [Program; 2],
    any: SampleQuery,
    layer_size: u32,
    tiles: u32,
    planes: Rc<Texture>,
    triangles: Rc<Texture>,
    /// Of the even layers and of the odd ones.
    depths: [Rc<Texture>; 2],
    /// One for each slot.
    slots: Vec<Target>,
    /// Layers of the batch.
    layers: u32,
}

impl LayerStore {
    /// # Errors
    /// When sizes are beyond the device's limits.
    pub fn new(gpu: &Gpu, layer_size: u32) -> Result<Self> {
        let tiles = (WIDTH.min(gpu.info().limits.max_texture_size) / layer_size).clamp(1, shaders::BATCH as u32);
        let depth = || Texture::empty(gpu, Format::Depth32F, tiles * layer_size, layer_size).map(Rc::new);
        let depths = [depth()?, depth()?];
        let (planes, triangles, slots) = store(gpu, [tiles * layer_size, layer_size], SLOTS, &depths)?;
        Ok(Self {
            gpu: gpu.clone(),
            programs: [Program::new(gpu, &shaders::STORE_FARTHEST)?, Program::new(gpu, &shaders::STORE)?],
            any: SampleQuery::new(gpu)?,
            layer_size,
            tiles,
            planes,
            triangles,
            depths,
            slots,
            layers: 0,
        })
    }

    /// How many directions it holds.
    pub fn tiles(&self) -> u32 {
        self.tiles
    }

    pub fn layer_size(&self) -> u32 {
        self.layer_size
    }

    /// Peels all layers of `bundles`, each into a tile, from the first on. Returns how many layers were drawn: the most that one
    /// of them has, or a little fewer than the bundles before had, whichever is more.
    ///
    /// # Errors
    /// When the scene has more layers than the device has memory or array elements for: 12 bytes a texel each.
    pub fn peel(&mut self, geometry: &Geometry, bundles: &[Bundle]) -> Result<u32> {
        let to_clip: Vec<Mat4> = (0..).zip(bundles).map(|(tile, bundle)| bundle.to_clip_of_tile(tile, self.tiles)).collect();
        assert!((1..=self.tiles as usize).contains(&bundles.len()), "{} bundles for {} tiles", bundles.len(), self.tiles);
        // To ask whether anything is left, one must wait; most of the layers that were drawn last time are taken for granted.
        let granted = self.layers.saturating_sub(1 + self.layers / 8);
        let mut layer = 0;
        loop {
            if layer == self.slots.len() as u32 {
                self.grow()?;
                layer = 0;
            }
            if layer < granted {
                self.draw(geometry, &to_clip, layer);
            } else if self.any.count(|| self.draw(geometry, &to_clip, layer)) == 0 {
                self.layers = layer;
                return Ok(layer);
            }
            layer += 1;
        }
    }

    /// Draws one layer of all tiles into its slot.
    fn draw(&self, geometry: &Geometry, to_clip: &[Mat4], layer: u32) {
        let target = &self.slots[layer as usize];
        if layer.is_multiple_of(2) {
            target.clear_unsigned(0, [0; 4]);
        }
        target.clear_depth(0.0);
        let previous = &self.depths[(layer as usize + 1) % 2];
        Draw {
            target,
            region: None,
            program: &self.programs[usize::from(layer > 0)],
            uniforms: &[("to_clip", Uniform::Mat4s(to_clip)), ("previous_depth", Uniform::Texture(previous))],
            depth: DepthTest::Greater,
            blend: Blend::ReplaceHalf(layer % 2),
            geometry: geometry.instances(to_clip.len() as u32),
        }
        .run();
    }

    /// Keeps twice as many layers from now on; those there are get lost.
    fn grow(&mut self) -> Result<()> {
        let now = self.slots.len() as u32;
        let slots = (2 * now).min(self.gpu.info().limits.max_array_layers);
        let size = [self.planes.width(), self.planes.height()];
        let grown = if slots > now { store(&self.gpu, size, slots, &self.depths).ok() } else { None };
        let Some(grown) = grown else {
            return Err(Error::usage(
                format!("the scene has at least {now} layers along a direction, and this GL device keeps no more"),
                "use the pipeline kill, which keeps none, or smaller layers (--layer-size)",
            ));
        };
        (self.planes, self.triangles, self.slots) = grown;
        Ok(())
    }

    /// The layers of one tile as [`super::Peel`] has them, far to near, each row by row: (depth, its change to the next texel in x and y, triangle
    /// counted from 1), the last 0 where nothing is.
    pub fn read(&self, tile: u32) -> Vec<Vec<Vec4>> {
        let (planes, triangles) = (self.planes.read::<[u32; 4]>(), self.triangles.read::<u32>());
        let size = self.layer_size;
        let surface = |layer: u32, at: u32| {
            let texel = |element: u32| ((element * size + at / size) * self.tiles * size + tile * size + at % size) as usize;
            let [high, low] = match planes[texel(layer / 2)] {
                [high, low, _, _] if layer.is_multiple_of(2) => [high, low],
                [_, _, high, low] => [high, low],
            };
            let slopes = [high << 24 | low >> 8 & 0x00ff_f000, low << 12].map(f32::from_bits);
            let depth = (high >> 8) as f32 / 16_777_216.0;
            if depth == 0.0 { Vec4::ZERO } else { Vec4::new(depth, slopes[0], slopes[1], triangles[texel(layer)] as f32 + 1.0) }
        };
        (0..self.layers).map(|layer| (0..size * size).map(|at| surface(layer, at)).collect()).collect()
    }

    /// The uniforms that shaders of `glsl/include/layer_store.glsl` read.
    pub fn uniforms(&self) -> [(&'static str, Uniform<'_>); 3] {
        [
            ("planes", Uniform::Texture(&self.planes)),
            ("stored_triangles", Uniform::Texture(&self.triangles)),
            ("slot_count", Uniform::Int(self.layers as i32)),
        ]
    }
}

/// Planes, two slots in an element, triangles, and a target for each slot.
fn store(gpu: &Gpu, size: [u32; 2], slots: u32, depths: &[Rc<Texture>; 2]) -> Result<(Rc<Texture>, Rc<Texture>, Vec<Target>)> {
    let planes = Rc::new(Texture::empty_array(gpu, Format::Rgba32Ui, size, slots.div_ceil(2))?);
    let triangles = Rc::new(Texture::empty_array(gpu, Format::R32Ui, size, slots)?);
    let target = |slot: u32| {
        let colors = vec![(planes.clone(), slot / 2), (triangles.clone(), slot)];
        Target::of(gpu, colors, Some(depths[slot as usize % 2].clone()))
    };
    let targets = (0..slots).map(target).collect::<Result<_>>()?;
    Ok((planes, triangles, targets))
}
