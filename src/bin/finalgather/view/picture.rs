//! From the renderer's channels to what a display shows.

use egui::ColorImage;
use finalgather::error::Result;
use finalgather::image::{Channel, Image};

/// Which part of the picture is shown, and how brightly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    pub what: What,
    /// Parts of the radiance.
    pub direct: bool,
    pub indirect: bool,
    pub emission: bool,
    /// In stops.
    pub exposure: f32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    Radiance,
    /// The rough solution.
    PhotonMap,
    Normals,
}

impl Default for Shown {
    fn default() -> Self {
        Self { what: What::Radiance, direct: true, indirect: true, emission: true, exposure: 0.0 }
    }
}

impl Shown {
    /// Whether it is all of the radiance, which a PNG has.
    pub fn is_radiance(&self) -> bool {
        self.what == What::Radiance && self.direct && self.indirect && self.emission
    }
}

/// As the PNG has it, where all of the radiance is shown.
pub fn developed(image: &Image, shown: &Shown) -> Result<ColorImage> {
    let size = [image.width, image.height];
    let channel = |name: &str| image.channel(name).unwrap_or_default();
    let bytes = match shown.what {
        _ if shown.is_radiance() => image.to_srgb8(shown.exposure)?,
        What::Radiance | What::PhotonMap => {
            let rough = shown.what == What::PhotonMap;
            let parts = [
                (rough, "PhotonMap"),
                (shown.direct && !rough, "Direct"),
                (shown.indirect && !rough, "Indirect"),
                (shown.emission, "Emission"),
            ];
            let sum = |c: &str| {
                let mut samples = vec![0.0; image.width * image.height];
                for (_, part) in parts.iter().filter(|(on, _)| *on) {
                    samples.iter_mut().zip(channel(&format!("{part}.{c}"))).for_each(|(sum, sample)| *sum += sample);
                }
                Channel { name: c.into(), samples }
            };
            Image { channels: ["R", "G", "B"].map(sum).into(), ..*image }.to_srgb8(shown.exposure)?
        }
        // By custom half of 1 + n, whatever the exposure.
        What::Normals => {
            let axes = ["N.X", "N.Y", "N.Z"].map(channel);
            let byte = |pixel: usize, axis: &[f32]| (127.5 * (1.0 + axis[pixel])).round() as u8;
            (0..image.width * image.height).flat_map(|pixel| axes.map(|axis| byte(pixel, axis))).collect()
        }
    };
    Ok(ColorImage::from_rgb(size, &bytes))
}
