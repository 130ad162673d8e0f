//! Fills the layer store in one pass over the geometry: appends every surface to its texel's list, then sorts each list into the slots.
//! Shaders must be able to write to images. Mirrors `glsl/store_append.frag` and `glsl/store_sort.frag`.

use super::{Bundle, Slots};
use crate::error::Result;
use crate::geometry::{CutOuts, Geometry};
use crate::gpu::{Blend, DepthTest, Draw, Format, Gpu, Program, Shape, Target, Texture, Uniform};
use crate::shaders;

/// Tiles that have lists at a time: enough to keep a device busy. Not more, because a surface in a list takes 16 bytes.
const TILES: u32 = 2;

pub struct StoreSort {
    gpu: Gpu,
    layer_size: u32,
    tiles: u32,
    append: Program,
    sort: Program,
    /// Length of each texel's list.
    counts: Target,
    /// One array element for each place in a list.
    lists: Texture,
    /// One texel: the length of the longest list.
    deepest: Target,
    /// The target of draws that write to images only.
    area: Target,
    /// The array elements of the slots' planes.
    elements: Vec<Target>,
    /// Number of slots that may hold surfaces.
    dirty: u32,
}

impl StoreSort {
    pub fn new(gpu: &Gpu, layer_size: u32, tiles: u32, slots: &Slots) -> Result<Self> {
        let tiles = tiles.min(TILES);
        let size = [tiles * layer_size, layer_size];
        let element = |element| Target::of(gpu, vec![(slots.planes.clone(), element)], None);
        Ok(Self {
            gpu: gpu.clone(),
            layer_size,
            tiles,
            append: Program::new(gpu, &shaders::STORE_APPEND)?,
            sort: Program::new(gpu, &shaders::STORE_SORT)?,
            counts: Target::new(gpu, size, &[Format::R32Ui], false)?,
            lists: Texture::empty_array(gpu, Format::Rgba32Ui, size, slots.count)?,
            deepest: Target::new(gpu, [1, 1], &[Format::R32Ui], false)?,
            area: Target::new(gpu, size, &[], true)?,
            elements: (0..slots.count.div_ceil(2)).map(element).collect::<Result<_>>()?,
            dirty: slots.count,
        })
    }

    /// Bytes that [`Self::new`] takes besides the slots.
    pub fn bytes(layer_size: u32, tiles: u32, slots: u32) -> usize {
        let size = [tiles.min(TILES) * layer_size, layer_size];
        let lists = slots as usize * Target::bytes(size, &[Format::Rgba32Ui], false);
        lists + Target::bytes(size, &[Format::R32Ui], true)
    }

    /// Returns the length of the longest list, at least `granted`. Surfaces beyond the slots are lost.
    pub fn fill(&mut self, geometry: &Geometry, bundles: &[Bundle], granted: u32, slots: &Slots) -> u32 {
        self.elements.iter().take(self.dirty.div_ceil(2) as usize).for_each(|element| element.clear_unsigned(0, [0; 4]));
        self.deepest.clear_unsigned(0, [granted; 4]);
        for (first, bundles) in (0..).step_by(self.tiles as usize).zip(bundles.chunks(self.tiles as usize)) {
            self.append(geometry, bundles, slots.count);
            self.sort(first * self.layer_size, granted, slots);
        }
        self.dirty = self.deepest.color(0).read::<u32>()[0];
        self.dirty
    }

    fn append<'a>(&'a self, geometry: &'a Geometry, bundles: &[Bundle], limit: u32) {
        let to_clip = Bundle::to_clip_of_tiles(bundles, self.tiles);
        self.counts.clear_unsigned(0, [0; 4]);
        let numbers = Bundle::numbers(bundles);
        let own = [
            ("to_clip", Uniform::Mat4s(&to_clip)),
            ("tiles", Uniform::Int(self.tiles as i32)),
            ("counts", Uniform::Image(self.counts.color(0))),
            ("lists", Uniform::Image(&self.lists)),
            ("list_limit", Uniform::Int(limit as i32)),
            ("numbers", Uniform::UInts(&numbers)),
        ];
        let uniforms = [&own[..], &geometry.uniforms()].concat();
        let of_cut_outs = |cut_outs: &'a CutOuts| cut_outs.store_append.as_ref().unwrap_or(&self.append);
        for (shape, program) in geometry.instances(to_clip.len() as u32, &self.append, of_cut_outs) {
            self.draw(program, &uniforms, shape);
        }
    }

    /// Sorts the lists into the slots, from texel column `column` on.
    fn sort(&self, column: u32, granted: u32, slots: &Slots) {
        self.draw(
            &self.sort,
            &[
                ("counts", Uniform::Texture(self.counts.color(0))),
                ("lists", Uniform::Texture(&self.lists)),
                ("list_limit", Uniform::Int(slots.count as i32)),
                ("first_texel", Uniform::IVec2([column as i32, 0])),
                ("planes", Uniform::Image(&slots.planes)),
                ("stored_triangles", Uniform::Image(&slots.triangles)),
                ("deepest", Uniform::Image(self.deepest.color(0))),
                ("granted", Uniform::Int(granted as i32)),
            ],
            Shape::FullScreen,
        );
    }

    fn draw(&self, program: &Program, uniforms: &[(&'static str, Uniform)], geometry: Shape) {
        Draw { target: &self.area, region: None, program, uniforms, depth: DepthTest::Off, blend: Blend::Replace, geometry }
            .run();
        self.gpu.settle_images();
    }
}
