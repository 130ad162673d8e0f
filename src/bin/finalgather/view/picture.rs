//! Converts channels of the renderer to pixels for the display.

use egui::ColorImage;
use finalgather::error::Result;
use finalgather::image::{Channel, Image};

/// The displayed part of the picture, and its exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisplayOptions {
    pub content: DisplayContent,
    /// Whether direct light is part of the displayed radiance. The next two are likewise.
    pub direct: bool,
    pub indirect: bool,
    pub emission: bool,
    /// In stops.
    pub exposure: f32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DisplayContent {
    Radiance,
    PhotonMap,
    Normals,
}

impl Default for DisplayOptions {
    fn default() -> Self {
        Self { content: DisplayContent::Radiance, direct: true, indirect: true, emission: true, exposure: 0.0 }
    }
}

impl DisplayOptions {
    /// Whether the display shows all radiance, as a saved PNG does.
    pub fn is_radiance(&self) -> bool {
        self.content == DisplayContent::Radiance && self.direct && self.indirect && self.emission
    }
}

/// Makes the displayed pixels. If all radiance is displayed, they have the bytes of the saved PNG.
pub fn develop(image: &Image, shown: &DisplayOptions) -> Result<ColorImage> {
    let size = [image.width, image.height];
    let channel = |name: &str| image.channel(name).unwrap_or_default();
    let bytes = match shown.content {
        _ if shown.is_radiance() => image.to_srgb8(shown.exposure)?,
        DisplayContent::Radiance | DisplayContent::PhotonMap => {
            let photon_map = shown.content == DisplayContent::PhotonMap;
            let parts = [
                (photon_map, "PhotonMap"),
                (shown.direct && !photon_map, "Direct"),
                (shown.indirect && !photon_map, "Indirect"),
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
        // Normals are displayed as (1 + n) / 2, without exposure.
        DisplayContent::Normals => {
            let axes = ["N.X", "N.Y", "N.Z"].map(channel);
            let byte = |pixel: usize, axis: &[f32]| (127.5 * (1.0 + axis[pixel])).round() as u8;
            (0..image.width * image.height).flat_map(|pixel| axes.map(|axis| byte(pixel, axis))).collect()
        }
    };
    Ok(ColorImage::from_rgb(size, &bytes))
}
