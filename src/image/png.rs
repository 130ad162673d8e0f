//! 8-bit PNG for display: exposure, then a tone curve that keeps detail in highlights, then sRGB.

use std::io::Cursor;
use std::path::Path;

use ::image::codecs::png::{PngDecoder, PngEncoder};
use ::image::{DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, Limits};

use super::{Channel, Image, MOST_SAMPLES, decode_srgb, encode_srgb};
use crate::error::{Error, Result};
use crate::file::{can_hold, write_file};
use crate::settings::Background;

/// The value at which the shoulder of the tone curve begins.
const KNEE: f32 = 0.8;

impl Image {
    /// The bytes of a PNG file, with an alpha channel if the background is transparent.
    ///
    /// # Errors
    /// As [`Self::rgb`].
    pub fn to_png(&self, exposure: f32, background: Background) -> Result<Vec<u8>> {
        let rgba = self.to_srgba8(exposure, background)?;
        if background == Background::Transparent && self.channel("A").is_some() {
            return encode_as(self.width, self.height, &rgba, ExtendedColorType::Rgba8);
        }
        let rgb: Vec<u8> = rgba.chunks_exact(4).flat_map(|pixel| &pixel[..3]).copied().collect();
        encode(self.width, self.height, &rgb)
    }

    /// The bytes of a PNG with this exposure in stops: R, G and B of each pixel in turn.
    pub fn to_srgb8(&self, exposure: f32) -> Result<Vec<u8>> {
        self.to_rgb8(exposure, tone)
    }

    /// R, G and B of each pixel in turn: times 2^`exposure`, then `curve` ([`tone`] or the identity), then [`encode_srgb`].
    pub(super) fn to_rgb8(&self, exposure: f32, curve: fn(f32) -> f32) -> Result<Vec<u8>> {
        let scale = exposure.exp2();
        self.to_bytes(|sample| encode_srgb(curve(sample * scale)))
    }

    /// Maps each R, G and B by `encode`, from 0..1 to 0..255.
    fn to_bytes(&self, encode: impl Fn(f32) -> f32) -> Result<Vec<u8>> {
        let rgb = self.rgb()?;
        let byte = |sample| (encode(sample) * 255.0).round() as u8;
        Ok((0..self.width * self.height).flat_map(|pixel| rgb.map(|samples| byte(samples[pixel]))).collect())
    }

    /// Writes R, G and B from 0 to 1 as a PNG without exposure, tone curve or sRGB, for data such as openness and normals.
    pub fn write_data_png(&self, path: &Path) -> Result<()> {
        write_srgb8(path, [self.width, self.height], &self.to_bytes(|sample| sample.clamp(0.0, 1.0))?)
    }

    /// Decodes R, G and B to linear values, over black where the picture is transparent. Does not invert the tone curve.
    pub(super) fn from_png(path: &Path, bytes: &[u8]) -> Result<Self> {
        let bad = |problem: String| Error::input(path, None, problem, "give a PNG picture");
        let unreadable = |error| bad(format!("not readable as PNG: {error}"));
        let decoder = PngDecoder::with_limits(Cursor::new(bytes), Limits::no_limits()).map_err(unreadable)?;
        let (width, height) = decoder.dimensions();
        if 4 * u64::from(width) * u64::from(height) > MOST_SAMPLES || !can_hold(bytes, decoder.total_bytes()) {
            return Err(bad(format!("{width} x {height} pixels are too many, or too many for a file of its length")));
        }
        let picture = DynamicImage::from_decoder(decoder).map_err(unreadable)?.into_rgba32f();
        let channels = ["R", "G", "B"].into_iter().enumerate().map(|(index, name)| Channel {
            name: name.into(),
            samples: picture.pixels().map(|pixel| pixel[3] * decode_srgb(pixel[index])).collect(),
        });
        Ok(Self { width: picture.width() as usize, height: picture.height() as usize, channels: channels.collect() })
    }
}

/// Writes three sRGB bytes a pixel as a PNG. The file is written whole or not at all.
pub fn write_srgb8(path: &Path, [width, height]: [usize; 2], rgb8: &[u8]) -> Result<()> {
    write_file(path, &encode(width, height, rgb8)?)
}

/// Encodes three sRGB bytes a pixel.
pub(crate) fn encode(width: usize, height: usize, rgb8: &[u8]) -> Result<Vec<u8>> {
    encode_as(width, height, rgb8, ExtendedColorType::Rgb8)
}

fn encode_as(width: usize, height: usize, samples: &[u8], kind: ExtendedColorType) -> Result<Vec<u8>> {
    let refused = |problem: String| Error::usage(format!("PNG cannot hold this picture: {problem}"), "render it smaller");
    let side = |length: usize| u32::try_from(length).map_err(|error| refused(error.to_string()));
    let mut bytes = Vec::new();
    PngEncoder::new(Cursor::new(&mut bytes))
        .write_image(samples, side(width)?, side(height)?, kind)
        .map_err(|error| refused(error.to_string()))?;
    Ok(bytes)
}

/// Maps radiance to [0, 1]: the identity up to 0.8, then an exponential shoulder from slope 1. Negative values and NaN become 0, infinity 1.
pub fn tone(x: f32) -> f32 {
    let room = 1.0 - KNEE;
    if x > KNEE { KNEE + room * (1.0 - ((KNEE - x) / room).exp()) } else { x.max(0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tone_curve() {
        assert_eq!(tone(0.25), 0.25);
        assert_eq!(tone(KNEE), KNEE);
        // 0.8 + 0.2 (1 - 1/e)
        assert!((tone(1.0) - 0.926_424_1).abs() < 1e-6);
        let slope = (tone(KNEE + 1e-3) - KNEE) / 1e-3;
        assert!((slope - 1.0).abs() < 5e-3, "slope above the knee is {slope}");
        for (x, y) in [(f32::NAN, 0.0), (-1.0, 0.0), (f32::NEG_INFINITY, 0.0), (f32::INFINITY, 1.0), (1e30, 1.0)] {
            assert_eq!(tone(x), y, "{x}");
        }
    }

    #[test]
    fn srgb_both_ways() {
        assert!((encode_srgb(0.5) - 0.735_357).abs() < 1e-5);
        for step in 0..=255_u8 {
            let x = f32::from(step) / 255.0;
            assert!((encode_srgb(decode_srgb(x)) - x).abs() < 1e-5, "{step}");
        }
    }

    #[test]
    fn exposure_is_in_stops() {
        let channels = ["R", "G", "B"].map(|name| Channel { name: name.into(), samples: vec![0.05, f32::NAN] });
        let image = Image { width: 2, height: 1, channels: channels.into() };
        let bytes = image.to_png(2.0, Background::Environment).unwrap();
        let back = Image::from_png(Path::new("a.png"), &bytes).unwrap();
        for samples in back.rgb().unwrap() {
            assert!((samples[0] - 0.2).abs() < 2e-3, "{samples:?}");
            assert_eq!(samples[1], 0.0);
        }
    }
}
