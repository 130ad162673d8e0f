//! FLIP, the difference that a person sees when flipping between two pictures (Andersson et al. 2020). The authors' code computes it.

use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageRgb8};

use crate::error::{Error, Result};

/// The difference of each pixel, from 0 to 1, of pictures of three bytes a pixel, at 67 pixels a degree (a 4K display 70 cm wide, 70 cm away).
pub fn flip(width: usize, height: usize, test: &[u8], reference: &[u8]) -> Result<Vec<f32>> {
    // nv_flip counts samples in 32 bits and does not check for overflow.
    if width.saturating_mul(height).saturating_mul(3) > i32::MAX as usize {
        return Err(Error::usage(format!("{width} x {height} pixels are too many for FLIP"), "compare a part of the picture"));
    }
    let picture = |rgb8| FlipImageRgb8::with_data(width as u32, height as u32, rgb8);
    Ok(nv_flip::flip(picture(reference), picture(test), DEFAULT_PIXELS_PER_DEGREE).to_vec())
}

/// The colour map of FLIP, from dark for 0 to bright for 1.
pub fn magma() -> impl Fn(f32) -> [u8; 3] {
    let colours = nv_flip::magma_lut().to_vec();
    move |value| {
        let index = 3 * (value.clamp(0.0, 1.0) * 255.0).round() as usize;
        [colours[index], colours[index + 1], colours[index + 2]]
    }
}
