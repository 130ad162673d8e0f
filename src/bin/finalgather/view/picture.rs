//! Makes the displayed pixels from the channels of the renderer.

use std::sync::Arc;

use egui::ColorImage;
use finalgather::error::{Error, Result};
use finalgather::image::{Channel, Image, encode_srgb, luminance as luminance_of};
use finalgather::settings::{Background, Exposure};

use super::false_color::{ColorMap, ColorScale, automatic_range};
use super::histogram::{Axis, Histogram};

/// What is displayed of a picture, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisplayOptions {
    pub content: DisplayContent,
    /// Whether direct light is part of the displayed radiance. The next three are likewise.
    pub direct: bool,
    pub indirect: bool,
    pub caustics: bool,
    pub emission: bool,
    pub exposure: Exposure,
    /// What a PNG shows where there is no surface.
    pub background: Background,
    pub false_color: bool,
    /// Values of the first and the last false colour; `None`: by the picture.
    pub range: Option<[f32; 2]>,
    /// Shows the difference from the reference.
    pub difference: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DisplayContent {
    Radiance,
    PhotonMap,
    Albedo,
    Normals,
    Openness,
    Error,
}

/// Pixels to display, and how to read them.
#[derive(Clone)]
pub struct Developed {
    pub image: Arc<ColorImage>,
    /// The scale of false colours.
    pub scale: Option<ColorScale>,
    pub histogram: Histogram,
    /// The exposure.
    pub stops: f32,
}

impl Default for DisplayOptions {
    fn default() -> Self {
        Self {
            content: DisplayContent::Radiance,
            direct: true,
            indirect: true,
            caustics: true,
            emission: true,
            exposure: Exposure::default(),
            background: Background::default(),
            false_color: false,
            range: None,
            difference: false,
        }
    }
}

impl DisplayContent {
    /// With their names and what they show.
    pub const ALL: [(Self, &str, &str); 6] = [
        (Self::Radiance, "Radiance", "The picture: the light that reaches the camera."),
        (Self::PhotonMap, "Photon map", "The light of the photon map itself, without the final gather."),
        (Self::Albedo, "Albedo", "The colour of surfaces without light: the share of light that they reflect."),
        (Self::Normals, "Normals", "Directions of surfaces: x, y, z from -1 to 1 as red, green, blue."),
        (
            Self::Openness,
            "Occlusion",
            "Ambient occlusion: the share of the sky above each point that nothing hides. White where nothing is seen.",
        ),
        (Self::Error, "Error", "The standard error of each pixel by its value, estimated from two halves of the directions."),
    ];

    /// Whether exposure and the tone curve apply.
    pub fn is_light(self) -> bool {
        matches!(self, Self::Radiance | Self::PhotonMap)
    }
}

impl DisplayOptions {
    /// Whether the display shows all radiance, as a saved PNG does.
    pub fn is_radiance(&self) -> bool {
        self.content == DisplayContent::Radiance && self.has_all_light() && !self.false_color && !self.difference
    }

    fn has_all_light(&self) -> bool {
        self.direct && self.indirect && self.caustics && self.emission
    }
}

/// Red, green and blue, or three times the same numbers, of what is displayed.
type ShownPlanes = [Vec<f32>; 3];

/// Makes the displayed pixels. If all radiance is displayed and the background is not transparent, they have the bytes of the saved PNG.
///
/// # Errors
/// If the picture lacks a channel.
pub fn develop(picture: &Image, shown: &DisplayOptions) -> Result<Developed> {
    let size = [picture.width, picture.height];
    let planes = planes(picture, shown)?;
    let (light, stops) = (shown.content.is_light(), picture.stops(shown.exposure));
    let error = shown.content == DisplayContent::Error;
    let axis = match shown.content {
        _ if light => Axis::Stops(stops),
        DisplayContent::Normals => Axis::Values([-1.0, 1.0]),
        DisplayContent::Error => Axis::Values([0.0, automatic_range(&planes[0])[1]]),
        _ => Axis::Values([0.0, 1.0]),
    };
    let histogram = Histogram::new(planes.each_ref().map(Vec::as_slice), axis);
    if shown.is_radiance() {
        // The window has nothing behind the picture, so a transparent one shows the environment.
        let background = Some(shown.background).filter(|&it| it != Background::Transparent).unwrap_or(Background::Environment);
        let bytes = picture.to_srgba8(stops, background)?;
        let image = Arc::new(ColorImage::from_rgba_unmultiplied(size, &bytes));
        return Ok(Developed { image, scale: None, histogram, stops });
    }
    let (bytes, scale) = if error || shown.false_color && shown.content != DisplayContent::Normals {
        let values = luminance(&planes);
        let [low, high] = automatic_range(&values);
        let automatic = if error { [0.0, high] } else { [low, high] };
        let what = match shown.content {
            DisplayContent::Error => "Standard error by value",
            DisplayContent::Openness => "Share of the sky",
            DisplayContent::Albedo => "Luminance of the albedo",
            _ => "Luminance",
        };
        let scale = ColorScale { map: ColorMap::Viridis, range: shown.range.unwrap_or(automatic), what, percent: error };
        (scale.colors(&values), Some(scale))
    } else {
        (bytes(picture, planes, shown.content, stops)?, None)
    };
    Ok(Developed { image: Arc::new(ColorImage::from_rgb(size, &bytes)), scale, histogram, stops })
}

/// The difference of luminance from the reference, in false colours.
///
/// # Errors
/// If a picture lacks a channel, or the sizes differ.
pub fn develop_difference(picture: &Image, reference: &Image, shown: &DisplayOptions) -> Result<Developed> {
    if shown.content == DisplayContent::Normals {
        return Err(Error::usage("the difference of normals is no number", "show another view, or the reference itself"));
    }
    let [of_picture, of_reference] = [planes(picture, shown)?, planes(reference, shown)?];
    let differences: ShownPlanes = [0, 1, 2].map(|k| of_picture[k].iter().zip(&of_reference[k]).map(|(a, b)| a - b).collect());
    let values = luminance(&differences);
    let sizes: Vec<f32> = values.iter().map(|value| value.abs()).collect();
    let [_, most] = shown.range.map_or_else(|| automatic_range(&sizes), |[low, high]| [0.0, low.abs().max(high.abs())]);
    let range = [-most, most];
    let scale = ColorScale {
        map: ColorMap::BlueToRed,
        range,
        what: "Difference from the reference: blue is darker, red is brighter",
        percent: false,
    };
    let histogram = Histogram::new(differences.each_ref().map(Vec::as_slice), Axis::Values(range));
    let image = ColorImage::from_rgb([picture.width, picture.height], &scale.colors(&values));
    Ok(Developed { image: Arc::new(image), scale: Some(scale), histogram, stops: shown.exposure.given() })
}

fn luminance([r, g, b]: &ShownPlanes) -> Vec<f32> {
    r.iter().zip(g).zip(b).map(|((&r, &g), &b)| luminance_of([r, g, b])).collect()
}

fn missing(name: &str) -> Error {
    match name {
        "Error.R" => Error::usage("the error is known from two blocks of directions on", "wait, or gather more directions"),
        "AO" => Error::usage("the occlusion has no directions yet", "wait"),
        _ => Error::usage(format!("this picture has no channel {name}"), "show its radiance, or open one with all channels"),
    }
}

fn planes(picture: &Image, shown: &DisplayOptions) -> Result<ShownPlanes> {
    let channel = |name: &str| picture.channel(name).map(<[f32]>::to_vec).ok_or_else(|| missing(name));
    let three = |[a, b, c]: [&str; 3]| Ok([channel(a)?, channel(b)?, channel(c)?]);
    match shown.content {
        DisplayContent::Radiance if shown.has_all_light() => three(["R", "G", "B"]),
        DisplayContent::Radiance | DisplayContent::PhotonMap => {
            let photon_map = shown.content == DisplayContent::PhotonMap;
            let parts = [
                (photon_map, "PhotonMap"),
                (shown.direct && !photon_map, "Direct"),
                (shown.indirect && !photon_map, "Indirect"),
                (shown.caustics && !photon_map, "Caustics"),
                (shown.emission, "Emission"),
            ];
            let sum = |c: &str| {
                let mut sum = vec![0.0; picture.width * picture.height];
                for (_, part) in parts.iter().filter(|(on, _)| *on) {
                    let name = format!("{part}.{c}");
                    let samples = picture.channel(&name).ok_or_else(|| missing(&name))?;
                    sum.iter_mut().zip(samples).for_each(|(sum, sample)| *sum += sample);
                }
                Ok(sum)
            };
            Ok([sum("R")?, sum("G")?, sum("B")?])
        }
        DisplayContent::Albedo => three(["Albedo.R", "Albedo.G", "Albedo.B"]),
        DisplayContent::Normals => three(["N.X", "N.Y", "N.Z"]),
        DisplayContent::Openness => three(["AO"; 3]),
        DisplayContent::Error => {
            let relative = relative_error(&three(["Error.R", "Error.G", "Error.B"])?, &three(["R", "G", "B"])?);
            Ok([relative.clone(), relative.clone(), relative])
        }
    }
}

/// The error of each pixel's luminance by the luminance. Below a hundredth of the picture's mean, by that: black pixels have no relative error.
fn relative_error(error: &ShownPlanes, radiance: &ShownPlanes) -> Vec<f32> {
    let (error, radiance) = (luminance(error), luminance(radiance));
    let mean = radiance.iter().sum::<f32>() / radiance.len().max(1) as f32;
    let least = (0.01 * mean).max(f32::MIN_POSITIVE);
    error.iter().zip(&radiance).map(|(error, radiance)| error / radiance.max(least)).collect()
}

/// The bytes of a PNG of these planes.
fn bytes(picture: &Image, planes: ShownPlanes, content: DisplayContent, stops: f32) -> Result<Vec<u8>> {
    let by = |byte: &dyn Fn(f32) -> f32| {
        (0..planes[0].len()).flat_map(|pixel| planes.each_ref().map(|plane| (255.0 * byte(plane[pixel])).round() as u8)).collect()
    };
    Ok(match content {
        // Normals and openness are data: no exposure, no curve.
        DisplayContent::Normals => by(&|value| 0.5 * (1.0 + value)),
        DisplayContent::Openness => by(&|value| value.clamp(0.0, 1.0)),
        DisplayContent::Albedo => by(&|value| encode_srgb(value)),
        _ => {
            let channels = ["R", "G", "B"].into_iter().zip(planes);
            let channels = channels.map(|(name, samples)| Channel { name: name.into(), samples }).collect();
            Image { channels, ..*picture }.to_srgb8(stops)?
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(channels: &[(&str, &[f32])]) -> Image {
        let channels = channels.iter().map(|&(name, samples)| Channel { name: name.into(), samples: samples.to_vec() });
        Image { width: 2, height: 1, channels: channels.collect() }
    }

    #[test]
    fn the_error_is_relative_and_finite_where_it_is_dark() {
        let image = picture(&[
            ("R", &[2.0, 0.0]),
            ("G", &[2.0, 0.0]),
            ("B", &[2.0, 0.0]),
            ("Error.R", &[0.2, 0.001]),
            ("Error.G", &[0.2, 0.001]),
            ("Error.B", &[0.2, 0.001]),
        ]);
        let shown = DisplayOptions { content: DisplayContent::Error, range: Some([0.0, 0.2]), ..DisplayOptions::default() };
        let [values, ..] = planes(&image, &shown).unwrap();
        assert!((values[0] - 0.1).abs() < 1e-6 && (values[1] - 0.1).abs() < 1e-6, "{values:?}");
        let Developed { scale, image, .. } = develop(&image, &shown).unwrap();
        assert!(scale.unwrap().percent);
        assert_eq!(image.pixels[0], image.pixels[1]);
    }

    #[test]
    fn a_picture_without_the_channel_says_so() {
        let image = picture(&[("R", &[1.0; 2]), ("G", &[1.0; 2]), ("B", &[1.0; 2])]);
        let shown = DisplayOptions { content: DisplayContent::Albedo, ..DisplayOptions::default() };
        assert!(develop(&image, &shown).err().unwrap().to_string().contains("Albedo.R"));
    }

    #[test]
    fn openness_and_differences_have_plain_ends() {
        let image = picture(&[("AO", &[0.0, 1.0]), ("R", &[1.0, 3.0]), ("G", &[1.0, 3.0]), ("B", &[1.0, 3.0])]);
        let shown = DisplayOptions { content: DisplayContent::Openness, ..DisplayOptions::default() };
        let open = develop(&image, &shown).unwrap().image;
        assert_eq!((open.pixels[0].r(), open.pixels[1].r()), (0, 255));
        let reference = picture(&[("R", &[1.0, 2.0]), ("G", &[1.0, 2.0]), ("B", &[1.0, 2.0])]);
        let difference = develop_difference(&image, &reference, &DisplayOptions::default()).unwrap();
        assert_eq!(difference.image.pixels[0], egui::Color32::WHITE);
        assert!(difference.image.pixels[1].r() > difference.image.pixels[1].b(), "brighter is red");
    }
}
