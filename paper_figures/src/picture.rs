//! Pictures of the Cornell box, and how far they are from the path-traced one.

use finalgather::image::compare::{Comparison, Selection, compare, mask_of};
use finalgather::render::Statistics;
use finalgather::{Gpu, Image, Render, Scene, Settings};

use crate::cornell::{self, in_repository};
use crate::figure::{Result, Scale};
use crate::machine::gpu;

/// Renders and compares as `tests/reference.rs` does: without the lamp, and without the worst of the other pixels.
pub struct Pictures {
    gpu: Gpu,
    scene: Scene,
    path_traced: Image,
    mask: Vec<bool>,
}

/// Single pixels on outlines.
const TRIM: f32 = 0.001;

impl Pictures {
    pub fn new() -> Result<Self> {
        Ok(Self {
            gpu: gpu()?,
            scene: cornell::load()?,
            path_traced: Image::read(&in_repository("tests/reference/cornell_256.exr"))?,
            mask: mask_of(&Image::read(&in_repository("tests/reference/cornell_256_mask.png"))?),
        })
    }

    /// Of the path-traced picture's size, everything else by default.
    pub fn settings(&self, scale: Scale) -> Settings {
        let size = [self.path_traced.width as u32, self.path_traced.height as u32];
        Settings { size, directions: scale.of(1000, 8), ..self.scene.settings.clone() }
    }

    pub fn render(&self, settings: &Settings) -> Result<(Image, Statistics)> {
        let mut render = Render::new(&self.gpu, &self.scene, settings)?;
        while !render.is_done() {
            render.step()?;
        }
        Ok((render.picture(), render.statistics().clone()))
    }

    pub fn against_path_tracing(&self, picture: &Image) -> Result<Comparison> {
        self.compare(picture, &self.path_traced)
    }

    pub fn path_traced(&self) -> &Image {
        &self.path_traced
    }

    /// Share of a picture's squared error against path tracing that averaging over 8 x 8 pixels leaves, over squares that count whole.
    pub fn correlated(&self, picture: &Image) -> Result<f64> {
        const SIDE: usize = 8;
        let (width, height) = (picture.width, picture.height);
        let (mut whole, mut averaged) = (0.0, 0.0);
        for (a, b) in picture.rgb()?.into_iter().zip(self.path_traced.rgb()?) {
            for (x, y) in (0..height / SIDE).flat_map(|y| (0..width / SIDE).map(move |x| (x * SIDE, y * SIDE))) {
                let pixels = || (0..SIDE * SIDE).map(|i| (y + i / SIDE) * width + x + i % SIDE);
                if pixels().all(|pixel| self.mask[pixel]) {
                    let error = |pixel: usize| f64::from(a[pixel] - b[pixel]);
                    whole += pixels().map(|pixel| error(pixel).powi(2)).sum::<f64>();
                    averaged += pixels().map(error).sum::<f64>().powi(2) / (SIDE * SIDE) as f64;
                }
            }
        }
        Ok(averaged / whole)
    }

    pub fn compare(&self, a: &Image, b: &Image) -> Result<Comparison> {
        Ok(compare(a, b, Selection { mask: Some(&self.mask), trim: TRIM })?)
    }
}
