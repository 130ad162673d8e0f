//! The tables by which shaders choose one of many lamps: a tree and its lamps. Mirrors `glsl/include/light_tree.glsl`.

use crate::error::Result;
use crate::gpu::{Format, Gpu, Texture, Uniform};
use crate::scene::{Lamp, Lights};

/// All lamps of a scene, with the tree over them.
pub struct LightTables {
    nodes: Texture,
    lamps: Texture,
}

impl LightTables {
    /// `None` if the lights have no tree. `place_of`: the place of a triangle of the scene in the shaders' table.
    ///
    /// # Errors
    /// When the scene is beyond the device's limits.
    pub(super) fn new(gpu: &Gpu, lights: &Lights, place_of: impl Fn(usize) -> usize) -> Result<Option<Self>> {
        let Some(tree) = lights.tree() else { return Ok(None) };
        let texels = |lamp: Lamp| {
            let [a, b, c] = lamp.corners;
            let [red, green, blue] = lamp.flux.to_array();
            let picture = if lamp.is_pictured { place_of(lamp.triangle) + 1 } else { 0 };
            [a.extend(red), (b - a).extend(green), (c - a).extend(blue), lamp.normal.extend(picture as f32)]
                .map(|texel| texel.to_array())
        };
        Ok(Some(Self {
            nodes: Texture::table(gpu, Format::Rgba32F, tree.texels())?,
            lamps: Texture::table(gpu, Format::Rgba32F, lights.lamps().flat_map(texels).collect())?,
        }))
    }

    /// The uniforms of `glsl/include/light_tree.glsl`, besides those of the surfaces.
    pub fn uniforms(&self) -> [(&'static str, Uniform<'_>); 2] {
        [("light_nodes", Uniform::Texture(&self.nodes)), ("lamps", Uniform::Texture(&self.lamps))]
    }
}
