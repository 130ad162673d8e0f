//! Picture files. The path's ending selects the format.

use std::path::Path;

use super::Image;
use crate::error::{Error, Result};
use crate::file::{self, MOST_BYTES, read_file, write_file};
use crate::settings::Background;

/// Options of the file formats.
#[derive(Clone, Copy, Debug, Default)]
pub struct WriteOptions<'a> {
    /// In stops; only for 8-bit formats.
    pub exposure: f32,
    /// Only for 8-bit formats.
    pub background: Background,
    /// JSON for the attribute `finalgather` of an EXR.
    pub metadata: Option<&'a str>,
}

#[derive(Clone, Copy)]
pub(super) enum PictureFormat {
    Exr,
    Png,
}

impl PictureFormat {
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
    /// Writes the picture in the format of the path's ending and replaces an existing file. The file is written whole or not at all.
    pub fn write(&self, path: &Path, options: &WriteOptions) -> Result<()> {
        let bytes = match PictureFormat::of(path)? {
            PictureFormat::Exr => self.to_exr(options.metadata)?,
            PictureFormat::Png => self.to_png(options.exposure, options.background)?,
        };
        write_file(path, &bytes)
    }

    /// Reads an EXR or a PNG into linear samples.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = read_file(path, MOST_BYTES)
            .map_err(|error| Error::input(path, None, format!("not readable: {error}"), "give the path of a picture"))?;
        Self::decode(path, &bytes)
    }

    /// As [`Self::read`], from the `bytes` of the file at `path`.
    pub fn decode(path: &Path, bytes: &[u8]) -> Result<Self> {
        match PictureFormat::of(path)? {
            PictureFormat::Exr => Self::from_exr(path, bytes),
            PictureFormat::Png => Self::from_png(path, bytes),
        }
    }
}

/// Checks before a render that [`Image::write`] to this path should succeed.
pub fn check_writable(path: &Path) -> Result<()> {
    PictureFormat::of(path)?;
    file::check_writable(path)
}
