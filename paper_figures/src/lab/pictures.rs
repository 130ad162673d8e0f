//! Renders of a scene, and how far they are from its path-traced picture.

use std::path::Path;

use finalgather::gpu::StageClock;
use finalgather::image::Channel;
pub use finalgather::image::compare::{Comparison, ErrorMap};
use finalgather::image::compare::{Selection, ViewingConditions, compare, compare_as, mask_of};
use finalgather::render::{Render, RenderStatistics, StageSeconds};
use finalgather::scene::{Loaded, World};
pub use finalgather::settings::PhotonMapKind;
use serde::{Deserialize, Serialize};

use crate::figure::Result;
use crate::lab::library::{Gpu, Image, Pipeline, Scene, Settings, gpu, in_repository};

/// A scene and its path-traced picture. Comparisons leave out what `tests/reference.rs` leaves out: the lamp, and the worst of the other
/// pixels.
pub struct Pictures {
    gpu: Gpu,
    loaded: Loaded,
    pub path_traced: Image,
    /// Pixels of the path-traced picture that count.
    mask: Vec<bool>,
}

/// A picture and its error against path tracing.
pub struct Rendered {
    pub picture: Image,
    pub statistics: RenderStatistics,
    pub error: Comparison,
}

/// Of a [`Rendered`] picture, the numbers that most figures keep.
#[derive(Serialize, Deserialize)]
pub struct Measured {
    pub bias: f64,
    pub relative_rmse: f64,
    /// On a machine that may be shared.
    pub gather_seconds: f64,
}

/// Seconds of a render's stages, on a machine that may be shared.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct Stages {
    pub photons: f64,
    pub visible_points: f64,
    pub direct: f64,
    pub gather: f64,
}

impl Stages {
    pub fn of(RenderStatistics { seconds, .. }: &RenderStatistics) -> Self {
        let StageSeconds { photons, visible_points, direct, gather, .. } = *seconds;
        Self { photons, visible_points, direct, gather }
    }
}

impl Rendered {
    pub fn measured(&self) -> Measured {
        let Comparison { bias, relative_rmse, .. } = self.error;
        Measured { bias, relative_rmse, gather_seconds: self.statistics.seconds.gather }
    }
}

/// Share of the pixels that is left out: single pixels on outlines.
const TRIM: f32 = 0.001;

impl Pictures {
    /// Of the Cornell box.
    pub fn new() -> Result<Self> {
        Self::of("scenes/cornell.toml", "tests/reference/cornell_256")
    }

    /// Of a scene, against `<reference>.exr` where `<reference>_mask.png` is white.
    pub fn of(scene: &str, reference: &str) -> Result<Self> {
        let read = |ending| Image::read(&in_repository(&format!("{reference}{ending}")));
        let (loaded, path_traced) = (World::load(&in_repository(scene))?, read(".exr")?);
        Ok(Self { gpu: gpu()?, loaded, path_traced, mask: mask_of(&read("_mask.png")?) })
    }

    pub fn scene_in_unit_space(&self) -> Scene {
        self.loaded.world.flatten()
    }

    /// Of the path-traced picture's size, with the poster's photon map, everything else as the scene has it.
    pub fn settings(&self, directions: u32) -> Settings {
        let size = [self.path_traced.width as u32, self.path_traced.height as u32];
        let figure = |s: &mut Settings| {
            (s.film.size, s.directions.count) = (size, directions);
            (s.gather.pipeline, s.photons.map) = (Pipeline::Fused, PhotonMapKind::Grid);
        };
        self.of_scene().with(figure)
    }

    /// As the scene has them.
    pub fn of_scene(&self) -> Settings {
        self.loaded.settings
    }

    pub fn render(&self, settings: &Settings) -> Result<(Image, RenderStatistics)> {
        self.render_in_steps(settings, |_, _| ())
    }

    /// After each step tells the number of directions done and the seconds of gathering so far.
    pub fn render_in_steps(&self, settings: &Settings, mut tell: impl FnMut(u32, f64)) -> Result<(Image, RenderStatistics)> {
        let mut render = Render::new(&self.gpu, &self.loaded.world, settings)?;
        while !render.is_done() {
            render.step()?;
            tell(render.directions_done(), render.statistics().seconds.gather);
        }
        Ok((render.picture(), render.statistics().clone()))
    }

    pub fn measure(&self, settings: &Settings) -> Result<Rendered> {
        let (picture, statistics) = self.render(settings)?;
        Ok(Rendered { error: self.against_path_tracing(&picture)?, picture, statistics })
    }

    /// Share of one stage in the device's time for all, null where the driver tells no time.
    pub fn share_of_stage(&self, stage: &str, settings: &Settings) -> Result<Option<f64>> {
        let clock = StageClock::start(&self.gpu);
        self.render(settings)?;
        let stages = clock.take().stages;
        let of_stage: Option<f64> = stages.iter().filter(|(name, _)| *name == stage).map(|&(_, seconds)| seconds).sum();
        let all: Option<f64> = stages.iter().map(|&(_, seconds)| seconds).sum();
        Ok(of_stage.zip(all).map(|(of_stage, all)| of_stage / all))
    }

    /// Of two sizes the larger picture is averaged to the smaller one's.
    pub fn against_path_tracing(&self, picture: &Image) -> Result<Comparison> {
        Ok(self.map_against_path_tracing(picture, 0.0)?.0)
    }

    /// The same, with FLIP for pictures shown at this exposure, and the map of it.
    pub fn map_against_path_tracing(&self, picture: &Image, exposure: f32) -> Result<(Comparison, ErrorMap)> {
        let side = picture.width.min(self.path_traced.width);
        let counted: Vec<f32> = self.mask.iter().map(|&counted| f32::from(counted)).collect();
        let mask = averaged(&rgb(self.path_traced.width, [(); 3].map(|()| counted.clone())), side)?;
        let mask: Vec<bool> = mask.rgb()?[0].iter().map(|&counted| counted == 1.0).collect();
        let selection = Selection { mask: Some(&mask), trim: TRIM };
        let view = ViewingConditions { exposure, ..ViewingConditions::default() };
        Ok(compare_as(&averaged(picture, side)?, &averaged(&self.path_traced, side)?, selection, view)?)
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
}

/// A picture of this width.
pub fn rgb(width: usize, samples: [Vec<f32>; 3]) -> Image {
    let height = samples[0].len() / width;
    let channels = ["R", "G", "B"].into_iter().zip(samples);
    Image { width, height, channels: channels.map(|(name, samples)| Channel { name: name.into(), samples }).collect() }
}

/// The sum of parts of a picture, such as `Direct` and `Emission`, as a picture.
pub fn sum_of(picture: &Image, parts: &[&str]) -> Result<Image> {
    let mut sums = [(); 3].map(|()| vec![0.0; picture.width * picture.height]);
    for (sum, channel) in sums.iter_mut().zip(["R", "G", "B"]) {
        for part in parts {
            let samples = picture.channel(&format!("{part}.{channel}")).ok_or_else(|| format!("no channel {part}"))?;
            sum.iter_mut().zip(samples).for_each(|(sum, sample)| *sum += sample);
        }
    }
    Ok(rgb(picture.width, sums))
}

/// R, G and B of a picture, averaged over squares of pixels to a width that divides its own.
pub fn averaged(picture: &Image, width: usize) -> Result<Image> {
    let factor = picture.width / width;
    if factor * width != picture.width || !picture.height.is_multiple_of(factor) {
        return Err(
            format!("a picture of {} x {} cannot be averaged to a width of {width}", picture.width, picture.height).into()
        );
    }
    let average = |samples: &[f32]| {
        let mean = |x: usize, y: usize| {
            let squares =
                (0..factor * factor).map(|i| samples[(y * factor + i / factor) * picture.width + x * factor + i % factor]);
            squares.sum::<f32>() / (factor * factor) as f32
        };
        (0..width * picture.height / factor).map(|pixel| mean(pixel % width, pixel / width)).collect()
    };
    Ok(rgb(width, picture.rgb()?.map(average)))
}

/// A square part of a square picture: its left, top and side as shares of the whole.
pub fn cropped(picture: &Image, place: [f32; 3]) -> Result<Image> {
    let [x, y, side] = place.map(|share| (share * picture.width as f32).round() as usize);
    let side = side.max(1);
    let crop = |samples: &[f32]| (y..y + side).flat_map(|row| samples[row * picture.width + x..][..side].to_vec()).collect();
    Ok(rgb(side, picture.rgb()?.map(crop)))
}

/// A copy of a PNG that takes little room.
pub fn write_small(from: &Path, to: &Path) -> Result<()> {
    const SIDE: u32 = 256;
    let picture = image::open(from)?;
    let picture = if picture.width() > SIDE { picture.thumbnail(SIDE, SIDE) } else { picture };
    Ok(picture.save(to)?)
}
