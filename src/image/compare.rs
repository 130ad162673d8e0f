//! Differences between two pictures, as numbers that tests can bound and as a map.

use std::path::Path;

use serde::Serialize;

use super::file::PictureFormat;
use super::{Channel, Image, WriteOptions, flip, png};
use crate::error::{Error, Result};
use crate::file::write_file;

/// The pixels that a comparison counts.
#[derive(Clone, Copy, Debug, Default)]
pub struct Selection<'a> {
    /// One value a pixel, true where the pixel counts. Without a mask, all pixels count.
    pub mask: Option<&'a [bool]>,
    /// The fraction of the counted pixels that is left out of every number: those with the largest squared errors.
    pub trim: f32,
}

/// How FLIP sees the pictures: as the PNGs that [`Image::write`] makes.
#[derive(Clone, Copy, Debug, Default)]
pub struct ViewingConditions {
    /// In stops.
    pub exposure: f32,
    /// Whether `a` and `b` have a tone curve applied already, as pictures from 8-bit files have.
    pub toned: [bool; 2],
}

/// Differences of picture `a` from reference `b` over R, G and B of the selected pixels. Ratios to zero are infinite, in JSON null.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Number of counted pixels.
    pub pixels: usize,
    pub mean_a: f64,
    pub mean_b: f64,
    /// `(mean_a - mean_b) / mean_b`
    pub bias: f64,
    /// Mean absolute error.
    pub mae: f64,
    /// Root of the mean squared error.
    pub rmse: f64,
    /// `rmse / mean_b`
    pub relative_rmse: f64,
    /// Mean of `(a - b)² / (b² + 0.01)`, the relMSE of papers on Monte Carlo rendering. The usual 0.01 keeps black references finite. Errors
    /// in dark pixels count here, and hardly in `rmse`.
    pub relative_mse: f64,
    /// `20 log10(1 / rmse)` in dB, infinite for equal pictures. The peak is 1, white in a PNG, and not the brightest light.
    pub psnr: f64,
    /// Mean FLIP, from 0 to 1. Left out pixels are replaced by the reference's, so that they do not change their neighbours' FLIP.
    pub flip: f64,
}

/// A map of differences: `R`, `G` and `B` of `a - b`, `FLIP`, and `A`, which is 1 where a pixel counts. All channels are 0 elsewhere.
#[derive(Clone, Debug)]
pub struct ErrorMap(pub Image);

/// The colour of left out pixels in an [`ErrorMap`]'s PNG: grey, which the colours of FLIP do not contain.
const NOT_COUNTED: [u8; 3] = [96; 3];

impl ErrorMap {
    /// Writes all channels to an EXR. A PNG shows FLIP: black for 0, then purple, orange, pale yellow for 1; grey where pixels do not count.
    pub fn write(&self, path: &Path) -> Result<()> {
        match PictureFormat::of(path)? {
            PictureFormat::Exr => self.0.write(path, &WriteOptions::default()),
            PictureFormat::Png => write_file(path, &self.to_png()?),
        }
    }

    /// The bytes of that PNG.
    pub fn to_png(&self) -> Result<Vec<u8>> {
        png::encode(self.0.width, self.0.height, &self.to_rgb8())
    }

    fn to_rgb8(&self) -> Vec<u8> {
        let magma = flip::magma();
        let [counted, flip] = ["A", "FLIP"].map(|name| self.0.channel(name).unwrap_or_default());
        counted.iter().zip(flip).flat_map(|(&counted, &flip)| if counted > 0.0 { magma(flip) } else { NOT_COUNTED }).collect()
    }
}

/// Compares `a` with the reference `b`. Both must have one size, and all counted samples must be finite.
pub fn compare(a: &Image, b: &Image, selection: Selection) -> Result<Comparison> {
    compare_as(a, b, selection, ViewingConditions::default()).map(|(comparison, _)| comparison)
}

/// As [`compare`] with FLIP under these conditions, and with the map of differences.
pub fn compare_as(a: &Image, b: &Image, selection: Selection, view: ViewingConditions) -> Result<(Comparison, ErrorMap)> {
    if (a.width, a.height) != (b.width, b.height) {
        let problem = format!("the pictures are {} x {} and {} x {}", a.width, a.height, b.width, b.height);
        return Err(Error::usage(problem, "compare pictures of one size"));
    }
    let (rgb_a, rgb_b) = (a.rgb()?, b.rgb()?);
    let pixels = a.width * a.height;
    if let Some(mask) = selection.mask.filter(|mask| mask.len() != pixels) {
        return Err(Error::usage(format!("the mask has {} values for {pixels} pixels", mask.len()), "give one a pixel"));
    }
    if !(0.0..1.0).contains(&selection.trim) {
        return Err(Error::usage(format!("trim is {}", selection.trim), "give a share from 0 up to, not including, 1"));
    }
    if !view.exposure.is_finite() {
        return Err(Error::usage(format!("exposure is {}", view.exposure), "give a number of stops"));
    }

    let mut differences = Vec::with_capacity(pixels);
    for pixel in (0..pixels).filter(|&pixel| selection.mask.is_none_or(|mask| mask[pixel])) {
        let (of_a, of_b) = (rgb_a.map(|samples| samples[pixel]), rgb_b.map(|samples| samples[pixel]));
        for (which, samples) in [("picture", of_a), ("reference", of_b)] {
            if let Some(sample) = samples.iter().find(|sample| !sample.is_finite()) {
                let (x, y) = (pixel % a.width, pixel / a.width);
                return Err(Error::usage(format!("pixel ({x}, {y}) of the {which} has a sample {sample}"), "mask this pixel"));
            }
        }
        differences.push(Difference::new(pixel, of_a, of_b));
    }
    differences.sort_by(|one, other| one.squared.total_cmp(&other.squared));
    let trimmed = (f64::from(selection.trim) * differences.len() as f64).round() as usize;
    differences.truncate(differences.len() - trimmed);
    if differences.is_empty() {
        return Err(Error::usage("no pixel is left to compare", "select more of the picture"));
    }

    let mean = |value: fn(&Difference) -> f64| differences.iter().map(value).sum::<f64>() / differences.len() as f64;
    let (mean_a, mean_b) = (mean(|d| d.a), mean(|d| d.b));
    let rmse = mean(|d| d.squared).sqrt();
    let map = error_map(a, b, differences.iter().map(|difference| difference.pixel), view)?;
    let flip_map = map.0.channel("FLIP").unwrap_or_default();
    let comparison = Comparison {
        pixels: differences.len(),
        mean_a,
        mean_b,
        bias: ratio(mean_a - mean_b, mean_b),
        mae: mean(|d| d.absolute),
        rmse,
        relative_rmse: ratio(rmse, mean_b),
        relative_mse: mean(|d| d.relative),
        psnr: 20.0 * (1.0 / rmse).log10(),
        flip: flip_map.iter().copied().map(f64::from).sum::<f64>() / differences.len() as f64,
    };
    Ok((comparison, map))
}

fn error_map(a: &Image, b: &Image, counted_pixels: impl Iterator<Item = usize>, view: ViewingConditions) -> Result<ErrorMap> {
    let mut counted = vec![false; a.width * a.height];
    counted_pixels.for_each(|pixel| counted[pixel] = true);
    let only_counted = |value: &dyn Fn(usize) -> f32| -> Vec<f32> {
        counted.iter().enumerate().map(|(pixel, &counted)| if counted { value(pixel) } else { 0.0 }).collect()
    };

    let shown = |image: &Image, toned| image.to_rgb8(view.exposure, if toned { std::convert::identity } else { png::tone });
    let (mut shown_a, shown_b) = (shown(a, view.toned[0])?, shown(b, view.toned[1])?);
    for pixel in (0..counted.len()).filter(|&pixel| !counted[pixel]) {
        let samples = 3 * pixel..3 * pixel + 3;
        shown_a[samples.clone()].copy_from_slice(&shown_b[samples]);
    }
    let flip = flip::flip(a.width, a.height, &shown_a, &shown_b)?;

    let (rgb_a, rgb_b) = (a.rgb()?, b.rgb()?);
    let difference = |k: usize| only_counted(&|pixel| rgb_a[k][pixel] - rgb_b[k][pixel]);
    let samples = [difference(0), difference(1), difference(2), only_counted(&|_| 1.0), only_counted(&|pixel| flip[pixel])];
    let channels = ["R", "G", "B", "A", "FLIP"].into_iter().zip(samples);
    let channels = channels.map(|(name, samples)| Channel { name: name.into(), samples }).collect();
    Ok(ErrorMap(Image { width: a.width, height: a.height, channels }))
}

/// Returns true for the pixels whose R is above one half. A picture without R is judged by its first channel.
pub fn mask_of(image: &Image) -> Vec<bool> {
    let samples = image.channel("R").or(image.channels.first().map(|channel| channel.samples.as_slice()));
    samples.unwrap_or_default().iter().map(|&sample| sample > 0.5).collect()
}

/// Numbers of one pixel, each the mean over R, G and B.
struct Difference {
    pixel: usize,
    a: f64,
    b: f64,
    absolute: f64,
    squared: f64,
    relative: f64,
}

impl Difference {
    fn new(pixel: usize, a: [f32; 3], b: [f32; 3]) -> Self {
        let (a, b) = (a.map(f64::from), b.map(f64::from));
        let mean = |value: fn(f64, f64) -> f64| (0..3).map(|i| value(a[i], b[i])).sum::<f64>() / 3.0;
        Self {
            pixel,
            a: mean(|a, _| a),
            b: mean(|_, b| b),
            absolute: mean(|a, b| (a - b).abs()),
            squared: mean(|a, b| (a - b).powi(2)),
            relative: mean(|a, b| (a - b).powi(2) / (b * b + 0.01)),
        }
    }
}

/// `difference / reference`, and 0 where the difference is 0.
fn ratio(difference: f64, reference: f64) -> f64 {
    if difference == 0.0 { 0.0 } else { difference / reference }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Channel;

    /// One row of pixels, G twice and B three times R.
    fn row(red: &[f32]) -> Image {
        let channel =
            |name: &str, factor: f32| Channel { name: name.into(), samples: red.iter().map(|value| value * factor).collect() };
        Image { width: red.len(), height: 1, channels: vec![channel("R", 1.0), channel("G", 2.0), channel("B", 3.0)] }
    }

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-12 * b.abs().max(1.0)
    }

    #[test]
    fn known_answers() {
        // Red differs by 1 and 3: absolute errors 2 and 6 a pixel, squared (1 + 4 + 9) / 3 and nine times that.
        let found = compare(&row(&[2.0, 5.0]), &row(&[1.0, 2.0]), Selection::default()).unwrap();
        assert_eq!(found.pixels, 2);
        assert!(close(found.mean_a, 7.0), "{found:?}");
        assert!(close(found.mean_b, 3.0), "{found:?}");
        assert!(close(found.bias, 4.0 / 3.0), "{found:?}");
        assert!(close(found.mae, 4.0), "{found:?}");
        assert!(close(found.rmse, (14.0_f64 / 3.0 * 5.0).sqrt()), "{found:?}");
        assert!(close(found.relative_rmse, found.rmse / 3.0), "{found:?}");
    }

    #[test]
    fn relative_mse_and_psnr() {
        // Squared errors of 0.01, 0.04 and 0.09, over 0.01 at black, and over 0.02, 0.05 and 0.10.
        let found = compare(&row(&[0.1, 0.2]), &row(&[0.0, 0.1]), Selection::default()).unwrap();
        let over_light = 0.01 / 0.02 + 0.04 / 0.05 + 0.09 / 0.10;
        assert!((found.relative_mse - (1.0 + 4.0 + 9.0 + over_light) / 6.0).abs() < 1e-6, "{found:?}");
        assert!((found.psnr - 10.0 * f64::log10(3.0 / 0.14)).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn same_pictures_do_not_differ() {
        let black = row(&[0.0, 0.0]);
        let found = compare(&black, &black, Selection::default()).unwrap();
        assert_eq!((found.bias, found.mae, found.rmse, found.relative_rmse), (0.0, 0.0, 0.0, 0.0));
        assert_eq!((found.relative_mse, found.psnr, found.flip), (0.0, f64::INFINITY, 0.0));
    }

    /// A square of one grey.
    fn grey(value: f32) -> Image {
        let channel = |name: &str| Channel { name: name.into(), samples: vec![value; 64] };
        Image { width: 8, height: 8, channels: ["R", "G", "B"].map(channel).into() }
    }

    fn flip_of(a: &Image, b: &Image, view: ViewingConditions) -> f64 {
        compare_as(a, b, Selection::default(), view).unwrap().0.flip
    }

    /// Without edges, FLIP is a formula of two colours. These values were computed from the paper's formula, without the authors' code.
    #[test]
    fn flip_of_plain_greys() {
        for (a, b, flip) in [(0.5, 0.25, 0.454_534), (0.25, 0.5, 0.454_534), (0.5, 0.0, 0.958_611)] {
            let found = flip_of(&grey(a), &grey(b), ViewingConditions::default());
            assert!((found - flip).abs() < 1e-4, "{a} and {b}: {found}, not {flip}");
        }
    }

    #[test]
    fn flip_is_of_what_a_png_shows() {
        let (one, other, at) =
            (grey(50.0), grey(60.0), |exposure| ViewingConditions { exposure, ..ViewingConditions::default() });
        assert_eq!(flip_of(&one, &other, at(0.0)), 0.0, "both are white");
        assert!(flip_of(&one, &other, at(-7.0)) > 0.05);

        let png = Image::from_png(Path::new("a.png"), &grey(1.5).to_png(0.0, crate::settings::Background::Environment).unwrap())
            .unwrap();
        let toned = |toned| ViewingConditions { toned, ..ViewingConditions::default() };
        assert_eq!(flip_of(&png, &grey(1.5), toned([true, false])), 0.0);
        assert_eq!(flip_of(&grey(1.5), &png, toned([false, true])), 0.0);
        assert!(flip_of(&png, &grey(1.5), toned([false, false])) > 0.0);
    }

    #[test]
    fn flip_does_not_see_what_is_left_out() {
        let (mut a, b) = (grey(0.5), grey(0.5));
        a.channels[1].samples[27] = 7.0;
        assert!(flip_of(&a, &b, ViewingConditions::default()) > 0.0);
        let mask: Vec<bool> = (0..64).map(|pixel| pixel != 27).collect();
        let flip = |selection| compare(&a, &b, selection).unwrap().flip;
        assert_eq!(flip(Selection { mask: Some(&mask), trim: 0.0 }), 0.0);
        assert_eq!(flip(Selection { mask: None, trim: 1.0 / 64.0 }), 0.0);
        // The mean is also over the counted pixels alone.
        let one = [vec![true], vec![false; 63]].concat();
        let found = compare(&b, &grey(0.25), Selection { mask: Some(&one), trim: 0.0 }).unwrap();
        let (_, map) =
            compare_as(&b, &grey(0.25), Selection { mask: Some(&one), trim: 0.0 }, ViewingConditions::default()).unwrap();
        assert!(found.flip > 0.0 && found.flip == f64::from(map.0.channel("FLIP").unwrap()[0]), "{found:?}");
    }

    #[test]
    fn map_of_the_errors() {
        let (mut a, b) = (grey(0.5), grey(0.5));
        a.channels[2].samples[27] = 0.25;
        let mask: Vec<bool> = (0..64).map(|pixel| pixel != 63).collect();
        a.channels[0].samples[63] = f32::NAN;
        let (_, map) = compare_as(&a, &b, Selection { mask: Some(&mask), trim: 0.0 }, ViewingConditions::default()).unwrap();
        let at = |name: &str, pixel: usize| map.0.channel(name).unwrap()[pixel];
        assert_eq!(["R", "G", "B", "A"].map(|name| at(name, 27)), [0.0, 0.0, -0.25, 1.0]);
        assert_eq!(["R", "G", "B", "A", "FLIP"].map(|name| at(name, 63)), [0.0; 5]);
        assert!(at("FLIP", 27) > at("FLIP", 0));

        let colours = map.to_rgb8();
        let brightness = |pixel: usize| colours[3 * pixel..3 * pixel + 3].iter().map(|&byte| u32::from(byte)).sum::<u32>();
        assert_eq!(colours[3 * 63..], NOT_COUNTED);
        assert!(brightness(27) > brightness(0));
        assert_eq!((flip::magma()(0.0), flip::magma()(1.0)), ([0, 0, 4], [252, 253, 191]));
    }

    #[test]
    fn masks_are_white_where_pixels_count() {
        let mut mask = row(&[0.0, 0.5, 0.51, f32::NAN]);
        // An EXR orders channels by name.
        mask.channels.insert(0, Channel { name: "A".into(), samples: vec![1.0; 4] });
        assert_eq!(mask_of(&mask), [false, false, true, false]);
        let y = Channel { name: "Y".into(), samples: vec![1.0, 0.0, 0.0, 1.0] };
        assert_eq!(mask_of(&Image { channels: vec![y], ..mask }), [true, false, false, true]);
    }

    #[test]
    fn mask_and_trim_select() {
        let (a, b) = (row(&[f32::NAN, 1.0, 9.0, 2.0, 2.0]), row(&[1.0, 1.0, 1.0, 1.0, 2.0]));
        let mask = [false, true, true, true, true];
        let masked = compare(&a, &b, Selection { mask: Some(&mask), trim: 0.0 }).unwrap();
        assert_eq!(masked.pixels, 4);
        assert!(close(masked.mae, (16.0 + 2.0) / 4.0), "{masked:?}");
        let trimmed = compare(&a, &b, Selection { mask: Some(&mask), trim: 0.25 }).unwrap();
        assert_eq!(trimmed.pixels, 3);
        assert!(close(trimmed.mae, 2.0 / 3.0), "{trimmed:?}");
        assert!(close(trimmed.mean_a, 10.0 / 3.0), "{trimmed:?}");
        assert!(close(trimmed.bias, 0.25), "{trimmed:?}");
    }

    #[test]
    fn what_does_not_match_is_an_error() {
        let (a, mut grey) = (row(&[1.0, 2.0]), row(&[1.0, 2.0]));
        grey.channels.truncate(1);
        let says = |a: &Image, b: &Image, selection: Selection| compare(a, b, selection).unwrap_err().to_string();
        let all = Selection::default();
        assert!(says(&a, &row(&[1.0]), all).contains("2 x 1 and 1 x 1"));
        assert!(says(&a, &grey, all).contains("no channel G"));
        assert!(says(&row(&[1.0, f32::NAN]), &a, all).contains("pixel (1, 0) of the picture has a sample NaN"));
        assert!(says(&a, &row(&[f32::INFINITY, 0.0]), all).contains("pixel (0, 0) of the reference has a sample inf"));
        let dark = ViewingConditions { exposure: f32::NEG_INFINITY, ..ViewingConditions::default() };
        assert!(compare_as(&a, &a, all, dark).unwrap_err().to_string().contains("exposure is -inf"));
        assert!(says(&a, &a, Selection { mask: Some(&[true]), ..all }).contains("mask"));
        assert!(says(&a, &a, Selection { mask: Some(&[false; 2]), ..all }).contains("no pixel"));
        assert!(says(&a, &a, Selection { trim: 1.0, ..all }).contains("trim"));
    }
}
