//! Renders of a scene against means of its path-traced picture over squares of pixels.

use finalgather::image::compare::{Comparison, Selection, compare, mask_of};
use finalgather::render::Render;
use finalgather::scene::{Loaded, World};

use crate::figure::Result;
use crate::lab::library::{Gpu, Image, gpu, in_repository};
use crate::lab::pictures::averaged;

/// A scene and the means.
pub struct Blocks {
    gpu: Gpu,
    loaded: Loaded,
    means: Image,
    /// Means that count: without lamps.
    mask: Vec<bool>,
}

impl Blocks {
    /// `means` is a path without its ending: NAME.exr and NAME_mask.png.
    pub fn read(scene: &str, means: &str) -> Result<Self> {
        let read = |ending| Image::read(&in_repository(&format!("{means}{ending}")));
        let loaded = World::load(&in_repository(scene))?;
        Ok(Self { gpu: gpu()?, loaded, means: read(".exr")?, mask: mask_of(&read("_mask.png")?) })
    }

    /// With the settings of the scene file, but so many directions.
    pub fn render(&self, directions: u32) -> Result<Image> {
        let settings = self.loaded.settings.with(|s| s.directions.count = directions);
        let mut render = Render::new(&self.gpu, &self.loaded.world, &settings)?;
        while !render.is_done() {
            render.step()?;
        }
        Ok(render.picture())
    }

    pub fn against_path_tracing(&self, picture: &Image) -> Result<Comparison> {
        let means = averaged(picture, self.means.width)?;
        Ok(compare(&means, &self.means, Selection { mask: Some(&self.mask), trim: 0.0 })?)
    }
}
