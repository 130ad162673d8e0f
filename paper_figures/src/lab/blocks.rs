//! Renders of a scene against means of its path-traced picture over squares of pixels.

use finalgather::image::Channel;
use finalgather::image::compare::{Comparison, Selection, compare, mask_of};
use finalgather::render::Render;
use finalgather::scene::{Loaded, World};

use crate::figure::Result;
use crate::lab::library::{Gpu, Image, gpu, in_repository};

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
        let side = picture.width / self.means.width;
        let mean = |samples: &[f32], i: usize| {
            let (x, y) = (i % self.means.width * side, i / self.means.width * side);
            let square = (0..side * side).map(|k| samples[(y + k / side) * picture.width + x + k % side]);
            square.sum::<f32>() / (side * side) as f32
        };
        let channels = ["R", "G", "B"].into_iter().zip(picture.rgb()?);
        let count = self.means.width * self.means.height;
        let averaged = |(name, samples): (&str, &[f32])| Channel {
            name: name.to_owned(),
            samples: (0..count).map(|i| mean(samples, i)).collect(),
        };
        let means = Image { width: self.means.width, height: self.means.height, channels: channels.map(averaged).collect() };
        Ok(compare(&means, &self.means, Selection { mask: Some(&self.mask), trim: 0.0 })?)
    }
}
