//! Fills the layer store by depth peeling, as [`super::super::Peel`] does. One draw peels a layer of all tiles. Mirrors `glsl/store_peel.frag`.

use std::rc::Rc;

use glam::Mat4;

use super::{Bundle, Slots};
use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::{Blend, DepthTest, Draw, Format, Gpu, Program, SampleQuery, Target, Texture, Uniform};
use crate::shaders;

pub struct StorePeel {
    tiles: u32,
    /// For the farthest layer, and for the others.
    programs: [Program; 2],
    any: SampleQuery,
    /// Depth buffers of the even layers and of the odd ones.
    depths: [Rc<Texture>; 2],
    /// One for each slot.
    targets: Vec<Target>,
}

impl StorePeel {
    pub fn new(gpu: &Gpu, tiles: u32, slots: &Slots) -> Result<Self> {
        let depth = || Texture::empty(gpu, Format::Depth32F, slots.planes.width(), slots.planes.height()).map(Rc::new);
        let depths = [depth()?, depth()?];
        let target = |slot: u32| {
            let colors = vec![(slots.planes.clone(), slot / 2), (slots.triangles.clone(), slot / 4)];
            Target::of(gpu, colors, Some(depths[slot as usize % 2].clone()))
        };
        Ok(Self {
            tiles,
            programs: [Program::new(gpu, &shaders::STORE_PEEL_FARTHEST)?, Program::new(gpu, &shaders::STORE_PEEL)?],
            any: SampleQuery::new(gpu)?,
            targets: (0..slots.count).map(target).collect::<Result<_>>()?,
            depths,
        })
    }

    /// Peels all layers, at least `granted`. Returns their number, or the number of slots plus 1 when the layers fill all slots.
    pub fn fill(&self, geometry: &Geometry, bundles: &[Bundle], granted: u32) -> u32 {
        let own = (Bundle::to_clip_of_tiles(bundles, self.tiles), Bundle::numbers(bundles));
        for layer in 0..self.targets.len() as u32 {
            if layer < granted {
                self.draw(geometry, &own, layer);
            } else if self.any.count(|| self.draw(geometry, &own, layer)) == 0 {
                return layer;
            }
        }
        self.targets.len() as u32 + 1
    }

    /// Draws one layer of all tiles into its slot.
    fn draw(&self, geometry: &Geometry, (to_clip, numbers): &(Vec<Mat4>, Vec<u32>), layer: u32) {
        let target = &self.targets[layer as usize];
        if layer.is_multiple_of(2) {
            target.clear_unsigned(0, [0; 4]);
        }
        target.clear_depth(0.0);
        let previous = &self.depths[(layer as usize + 1) % 2];
        let channels = |in_element| std::array::from_fn(|channel| channel as u32 * in_element / 4 == layer % in_element);
        let own = [
            ("to_clip", Uniform::Mat4s(to_clip)),
            ("tiles", Uniform::Int(self.tiles as i32)),
            ("previous_depth", Uniform::Texture(previous)),
            ("numbers", Uniform::UInts(numbers)),
        ];
        let uniforms = [&own[..], &geometry.uniforms()].concat();
        let which = usize::from(layer > 0);
        for (geometry, program) in
            geometry.instances(to_clip.len() as u32, &self.programs[which], |cut_outs| &cut_outs.store_peel[which])
        {
            Draw {
                target,
                region: None,
                program,
                uniforms: &uniforms,
                depth: DepthTest::Greater,
                blend: Blend::ReplaceChannels([channels(2), channels(4)]),
                geometry,
            }
            .run();
        }
    }
}
