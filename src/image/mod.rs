//! Pictures in memory: named channels of linear 32-bit floats. Submodules read, write and compare them.

use crate::error::{Error, Result};

pub mod compare;
mod exr;
mod file;
mod flip;
mod png;
mod shown;

/// A picture with more samples (4 GiB) is not read.
const MOST_SAMPLES: u64 = 1 << 30;

pub use crate::math::{decode_srgb, encode_srgb};
pub use file::{WriteOptions, check_writable};
pub(crate) use png::encode as encode_png;
pub use png::{tone, write_srgb8};
pub use shown::luminance;

/// A picture: channels of one size with linear values, rows from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    pub width: usize,
    pub height: usize,
    pub channels: Vec<Channel>,
}

/// One plane of samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// The name as in EXR: `R`, `G`, `B`, `A` for the picture itself, `Direct.R` for a layer, `Z` for depth.
    pub name: String,
    /// `width * height` values, row by row from the top left.
    pub samples: Vec<f32>,
}

impl Image {
    /// Returns the samples of the channel with this name.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|channel| channel.name == name).map(|channel| channel.samples.as_slice())
    }

    /// Returns the samples of `R`, `G` and `B`, or an error that names the missing channel.
    pub fn rgb(&self) -> Result<[&[f32]; 3]> {
        self.check()?;
        let find = |name| {
            self.channel(name).ok_or_else(|| {
                let names: Vec<_> = self.channels.iter().map(|channel| channel.name.as_str()).collect();
                Error::usage(
                    format!("the picture has no channel {name}, only {}", names.join(", ")),
                    "use a picture with channels R, G and B",
                )
            })
        };
        Ok([find("R")?, find("G")?, find("B")?])
    }

    /// Checks what the encoders rely on, because the fields are public.
    fn check(&self) -> Result<()> {
        let pixels = self.width.checked_mul(self.height).filter(|&pixels| pixels > 0);
        let Some(pixels) = pixels.filter(|_| !self.channels.is_empty()) else {
            return Err(Error::usage("the picture has no pixels or no channels", "give it at least one of each"));
        };
        match self.channels.iter().find(|channel| channel.samples.len() != pixels) {
            None => Ok(()),
            Some(Channel { name, samples }) => Err(Error::usage(
                format!("channel {name} has {} samples for {} x {} pixels", samples.len(), self.width, self.height),
                "give every channel one sample a pixel",
            )),
        }
    }
}
