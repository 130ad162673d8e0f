//! Picture files: the format by the path's ending.

use std::path::Path;

use super::Image;
use crate::error::{Error, Result};
use crate::file::{self, MOST_BYTES, read_file, write_file};

/// What a file says beside the picture's own samples.
#[derive(Clone, Copy, Debug, Default)]
pub struct WriteOptions<'a> {
    /// In stops; for 8-bit formats only.
    pub exposure: f32,
    /// JSON that goes into an EXR as its attribute `finalgather`.
    pub metadata: Option<&'a str>,
}

#[derive(Clone, Copy)]
pub(super) enum Format {
    Exr,
    Png,
}

impl Format {
    pub(super) fn of(path: &Path) -> Result<Self> {
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        match ending.to_str() {
            Some("exr") => Ok(Self::Exr),
            Some("png") => Ok(Self::Png),
            _ => Err(Error::usage(
                format!("{}: the ending names no known picture format", path.display()),
                "end the path in .exr (all channels, linear) or .png (8 bit)",
            )),
        }
    }
}

impl Image {
    /// Writes the picture in the format that the path ends in, replacing a file that is there. The file appears complete
    /// under its name or not at all.
    pub fn write(&self, path: &Path, options: &WriteOptions) -> Result<()> {
        let bytes = match Format::of(path)? {
            Format::Exr => self.to_exr(options.metadata)?,
            Format::Png => self.to_png(options.exposure)?,
        };
        write_file(path, &bytes)
    }

    /// Reads an EXR or a PNG into linear samples.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = read_file(path, MOST_BYTES)
            .map_err(|error| Error::input(path, None, format!("not readable: {error}"), "give the path of a picture"))?;
        Self::decode(path, &bytes)
    }

    /// The same of a file's `bytes`; `path` is where they came from.
    pub fn decode(path: &Path, bytes: &[u8]) -> Result<Self> {
        match Format::of(path)? {
            Format::Exr => Self::from_exr(path, bytes),
            Format::Png => Self::from_png(path, bytes),
        }
    }
}

/// Whether [`Image::write`] to this path can be expected to work, for asking before the work of a render.
pub fn check_writable(path: &Path) -> Result<()> {
    Format::of(path)?;
    file::check_writable(path)
}
