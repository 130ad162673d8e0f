//! How far two pictures are apart, in numbers that a test can hold a limit against.

use serde::Serialize;

use super::Image;
use crate::error::{Error, Result};

/// Which pixels count.
#[derive(Clone, Copy, Debug, Default)]
pub struct Selection<'a> {
    /// One a pixel, true where it counts; all count without it.
    pub mask: Option<&'a [bool]>,
    /// Share of the counted pixels, those with the largest squared error, that are left out of every number.
    pub trim: f32,
}

/// Differences of picture `a` from reference `b` over the R, G and B of the selected pixels, all three weighted alike.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Pixels that the numbers are over.
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
}

/// Compares `a` with the reference `b`, which must be of the same size. A sample that is not finite is an error wherever it counts.
pub fn compare(a: &Image, b: &Image, selection: Selection) -> Result<Comparison> {
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

    let mut differences = Vec::with_capacity(pixels);
    for pixel in (0..pixels).filter(|&pixel| selection.mask.is_none_or(|mask| mask[pixel])) {
        let difference = Difference::new(rgb_a.map(|samples| samples[pixel]), rgb_b.map(|samples| samples[pixel]));
        if !difference.squared.is_finite() {
            let (x, y) = (pixel % a.width, pixel / a.width);
            return Err(Error::usage(format!("a sample of pixel ({x}, {y}) is not finite"), "mask this pixel"));
        }
        differences.push(difference);
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
    Ok(Comparison {
        pixels: differences.len(),
        mean_a,
        mean_b,
        bias: ratio(mean_a - mean_b, mean_b),
        mae: mean(|d| d.absolute),
        rmse,
        relative_rmse: ratio(rmse, mean_b),
    })
}

/// A mask that leaves out every pixel within `radius` pixels, along both axes, of one that is `inside`.
pub fn dilated_mask(width: usize, height: usize, inside: impl Fn(usize) -> bool, radius: usize) -> Vec<bool> {
    // A square is the product of two intervals: along the rows first, then along the columns.
    let around = |at: usize, end: usize| at.saturating_sub(radius)..(at + radius + 1).min(end);
    let near_in_row: Vec<bool> = (0..width * height)
        .map(|pixel| {
            let (x, y) = (pixel % width, pixel / width);
            around(x, width).any(|x| inside(y * width + x))
        })
        .collect();
    (0..width * height)
        .map(|pixel| {
            let (x, y) = (pixel % width, pixel / width);
            !around(y, height).any(|y| near_in_row[y * width + x])
        })
        .collect()
}

/// One pixel, each number the mean over its R, G and B.
struct Difference {
    a: f64,
    b: f64,
    absolute: f64,
    squared: f64,
}

impl Difference {
    fn new(a: [f32; 3], b: [f32; 3]) -> Self {
        let (a, b) = (a.map(f64::from), b.map(f64::from));
        let mean = |value: fn(f64, f64) -> f64| (0..3).map(|i| value(a[i], b[i])).sum::<f64>() / 3.0;
        Self { a: mean(|a, _| a), b: mean(|_, b| b), absolute: mean(|a, b| (a - b).abs()), squared: mean(|a, b| (a - b).powi(2)) }
    }
}

/// Nothing compared with nothing is no difference.
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
    fn same_pictures_do_not_differ() {
        let black = row(&[0.0, 0.0]);
        let found = compare(&black, &black, Selection::default()).unwrap();
        assert_eq!((found.bias, found.mae, found.rmse, found.relative_rmse), (0.0, 0.0, 0.0, 0.0));
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
        assert!(says(&row(&[1.0, f32::NAN]), &a, all).contains("pixel (1, 0)"));
        assert!(says(&a, &a, Selection { mask: Some(&[true]), ..all }).contains("mask"));
        assert!(says(&a, &a, Selection { mask: Some(&[false; 2]), ..all }).contains("no pixel"));
        assert!(says(&a, &a, Selection { trim: 1.0, ..all }).contains("trim"));
    }

    #[test]
    fn mask_keeps_its_distance() {
        let mask = dilated_mask(6, 5, |pixel| pixel == 2 * 6 + 1, 1);
        let rows: Vec<String> =
            mask.chunks(6).map(|row| row.iter().map(|&counted| if counted { '#' } else { '.' }).collect()).collect();
        assert_eq!(rows, ["######", "...###", "...###", "...###", "######"]);
        assert!(dilated_mask(3, 3, |_| false, 2).iter().all(|&counted| counted));
        assert!(dilated_mask(3, 3, |pixel| pixel == 0, 2).iter().all(|&counted| !counted));
    }
}
