//! Pictures of a scene, and how far they are from the path-traced one.

use std::path::Path;

use finalgather::gpu::StageClock;
use finalgather::image::Channel;
use finalgather::image::compare::{Comparison, ErrorMap, Selection, View, compare, compare_as, mask_of};
use finalgather::render::RenderStatistics;
use finalgather::{Gpu, Image, Loaded, Render, Settings, World};

use crate::cornell::in_repository;
use crate::figure::Result;
use crate::machine::gpu;

/// Renders and compares as `tests/reference.rs` does: without the lamp, and without the worst of the other pixels.
pub struct Pictures {
    gpu: Gpu,
    loaded: Loaded,
    path_traced: Image,
    mask: Vec<bool>,
}

/// Single pixels on outlines.
pub const TRIM: f32 = 0.001;

impl Pictures {
    /// Of the Cornell box.
    pub fn new() -> Result<Self> {
        Self::of("scenes/cornell.toml", "tests/reference/cornell_256")
    }

    /// Of a scene, against `<reference>.exr` where `<reference>_mask.png` is white.
    pub fn of(scene: &str, reference: &str) -> Result<Self> {
        Ok(Self {
            gpu: gpu()?,
            loaded: World::load(&in_repository(scene))?,
            path_traced: Image::read(&in_repository(&format!("{reference}.exr")))?,
            mask: mask_of(&Image::read(&in_repository(&format!("{reference}_mask.png")))?),
        })
    }

    pub fn loaded(&self) -> &Loaded {
        &self.loaded
    }

    /// Of the path-traced picture's size, everything else as the scene has it.
    pub fn settings(&self, directions: u32) -> Settings {
        let size = [self.path_traced.width as u32, self.path_traced.height as u32];
        Settings { size, directions, ..self.loaded.settings.clone() }
    }

    pub fn start(&self, settings: &Settings) -> Result<Render> {
        Ok(Render::new(&self.gpu, &self.loaded.world, settings)?)
    }

    pub fn render(&self, settings: &Settings) -> Result<(Image, RenderStatistics)> {
        let mut render = self.start(settings)?;
        while !render.is_done() {
            render.step()?;
        }
        Ok((render.picture(), render.statistics().clone()))
    }

    /// Share of one stage in the device's time for all, null where the driver tells no time.
    pub fn share_of_stage(&self, stage: &str, settings: &Settings) -> Result<Option<f64>> {
        let clock = StageClock::start(&self.gpu);
        self.render(settings)?;
        let stages: Option<Vec<_>> = clock.take().stages.into_iter().map(|(name, seconds)| Some((name, seconds?))).collect();
        let sum = |stages: &[(&str, f64)], all: bool| -> f64 {
            stages.iter().filter(|(name, _)| all || *name == stage).map(|(_, seconds)| seconds).sum()
        };
        Ok(stages.map(|stages| sum(&stages, false) / sum(&stages, true)))
    }

    /// Of two sizes the larger picture is averaged to the smaller one's.
    pub fn against_path_tracing(&self, picture: &Image) -> Result<Comparison> {
        Ok(self.map_against_path_tracing(picture, 0.0)?.0)
    }

    /// The same, with FLIP for pictures shown at this exposure, and the map of it.
    pub fn map_against_path_tracing(&self, picture: &Image, exposure: f32) -> Result<(Comparison, ErrorMap)> {
        let side = picture.width.min(self.path_traced.width);
        let mask = averaged(&self.mask_image(), side)?;
        let mask: Vec<bool> = mask.rgb()?[0].iter().map(|&counted| counted == 1.0).collect();
        let selection = Selection { mask: Some(&mask), trim: TRIM };
        let view = View { exposure, ..View::default() };
        Ok(compare_as(&averaged(picture, side)?, &averaged(&self.path_traced, side)?, selection, view)?)
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

    /// Two pictures of the path-traced one's size.
    pub fn compare(&self, a: &Image, b: &Image) -> Result<Comparison> {
        Ok(compare(a, b, Selection { mask: Some(&self.mask), trim: TRIM })?)
    }

    fn mask_image(&self) -> Image {
        let samples: Vec<f32> = self.mask.iter().map(|&counted| f32::from(counted)).collect();
        rgb(&self.path_traced, [samples.clone(), samples.clone(), samples])
    }
}

/// A picture of the size of another.
fn rgb(of: &Image, samples: [Vec<f32>; 3]) -> Image {
    let channels = ["R", "G", "B"].into_iter().zip(samples);
    Image { channels: channels.map(|(name, samples)| Channel { name: name.into(), samples }).collect(), ..*of }
}

/// The sum of parts of a picture, such as `Direct` and `Emission`, as a picture.
pub fn sum_of(picture: &Image, parts: &[&str]) -> Result<Image> {
    let mut sums = [const { Vec::new() }; 3];
    for (sum, channel) in sums.iter_mut().zip(["R", "G", "B"]) {
        *sum = vec![0.0; picture.width * picture.height];
        for part in parts {
            let samples = picture.channel(&format!("{part}.{channel}")).ok_or_else(|| format!("no channel {part}"))?;
            sum.iter_mut().zip(samples).for_each(|(sum, sample)| *sum += sample);
        }
    }
    Ok(rgb(picture, sums))
}

/// R, G and B of a square picture, averaged over squares of pixels to a side that divides its own.
pub fn averaged(picture: &Image, side: usize) -> Result<Image> {
    let factor = picture.width / side;
    if picture.width != picture.height || factor * side != picture.width {
        return Err(format!("a picture of {} x {} cannot be averaged to {side} x {side}", picture.width, picture.height).into());
    }
    let average = |samples: &[f32]| {
        let mean = |x: usize, y: usize| {
            let squares =
                (0..factor * factor).map(|i| samples[(y * factor + i / factor) * picture.width + x * factor + i % factor]);
            squares.sum::<f32>() / (factor * factor) as f32
        };
        (0..side * side).map(|pixel| mean(pixel % side, pixel / side)).collect()
    };
    let size = Image { width: side, height: side, channels: Vec::new() };
    Ok(rgb(&size, picture.rgb()?.map(average)))
}

/// A square part of a square picture: its left, top and side as shares of the whole.
pub fn cropped(picture: &Image, [left, top, side]: [f32; 3]) -> Result<Image> {
    let [x, y, side] = [left, top, side].map(|share| (share * picture.width as f32).round() as usize);
    let side = side.max(1);
    let crop = |samples: &[f32]| (y..y + side).flat_map(|row| samples[row * picture.width + x..][..side].to_vec()).collect();
    let size = Image { width: side, height: side, channels: Vec::new() };
    Ok(rgb(&size, picture.rgb()?.map(crop)))
}

/// A copy of a PNG that takes little room.
pub fn write_small(from: &Path, to: &Path) -> Result<()> {
    const SIDE: u32 = 256;
    let picture = image::open(from)?;
    let picture = if picture.width() > SIDE { picture.thumbnail(SIDE, SIDE) } else { picture };
    Ok(picture.save(to)?)
}
