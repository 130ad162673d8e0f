//! Pictures in memory: named channels of linear 32-bit floats, and what is done to them outside the renderer.

pub mod compare;
mod exr;
mod file;
mod png;

/// A picture: channels of equal size, rows from the top, linear values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    pub width: usize,
    pub height: usize,
    pub channels: Vec<Channel>,
}

/// One plane of samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// As in EXR: `R`, `G`, `B`, `A` for the picture itself, `Direct.R` for a layer, `Z` for depth.
    pub name: String,
    /// `width * height` values, row by row from the top left.
    pub samples: Vec<f32>,
}
