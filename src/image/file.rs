//! Picture files: the format by the path's ending, and writing that leaves the whole picture or nothing.

use std::fs::{self, Permissions};
use std::io::{self, ErrorKind, Write};
use std::path::Path;

use tempfile::NamedTempFile;

use super::Image;
use crate::error::{Error, Result};

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
        let format = Format::of(path)?;
        let bytes = fs::read(path)
            .map_err(|error| Error::input(path, None, format!("not readable: {error}"), "give the path of a picture"))?;
        match format {
            Format::Exr => Self::from_exr(path, &bytes),
            Format::Png => Self::from_png(path, &bytes),
        }
    }
}

/// Whether [`Image::write`] to this path can be expected to work, for asking before the work of a render.
pub fn check_writable(path: &Path) -> Result<()> {
    Format::of(path)?;
    if path.is_dir() {
        return Err(Error::usage(format!("{}: is a folder", path.display()), "give the path of a file in it"));
    }
    let folder = folder_of(path);
    if !folder.is_dir() {
        let folder = folder.display();
        return Err(Error::usage(format!("{folder}: there is no such folder"), format!("make it first: mkdir -p {folder}")));
    }
    temporary_in(folder).map(drop).map_err(|error| {
        let problem = format!("{}: no file can be made in this folder: {error}", folder.display());
        Error::usage(problem, "give a path in a folder that can be written")
    })
}

/// The file is there with all of these bytes, or as it was before.
pub(super) fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    write_atomically(path, bytes).map_err(|error| {
        let cure = match error.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
                "free some space there or raise the limit, or give a path on another disk"
            }
            _ => "give a path in a folder that can be written",
        };
        Error::output(path, format!("not written: {error}"), cure)
    })
}

fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    // Dropping the temporary file removes it, so that every early return leaves nothing behind.
    let file = temporary_in(folder_of(path))?;
    // Through the file itself, whose errors do not speak of the temporary name.
    file.as_file().write_all(bytes)?;
    // A name that outlives a power cut must not outlive its content.
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}

/// In the same folder, because a file can be renamed in one step only within its file system.
fn temporary_in(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".finalgather-").suffix(".part");
    // As for any new file, the umask decides; tempfile's own default is for secrets.
    #[cfg(unix)]
    builder.permissions(<Permissions as std::os::unix::fs::PermissionsExt>::from_mode(0o666));
    builder.tempfile_in(folder)
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
