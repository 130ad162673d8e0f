//! Writes files whole or not at all, and reads files up to a limit of length.

use std::ffi::OsString;
use std::fs::{self, File, Metadata, Permissions};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, Result};
use crate::nearest::nearest_file;

/// The most bytes of any file.
pub(crate) const MOST_BYTES: u64 = 4 << 30;

/// The most bytes of a text file: scene files, material libraries, descriptions.
pub(crate) const MOST_WORDS: u64 = 64 << 20;

/// Reads a whole file. Fails if it has more than `most` bytes.
pub(crate) fn read_file(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let refused = |kind, problem: String| Err(io::Error::new(kind, problem));
    // Checked before opening, because opening a pipe waits for its writer.
    let about = fs::metadata(path).map_err(|error| explained(path, error))?;
    if about.is_dir() {
        return refused(ErrorKind::IsADirectory, "it is a folder".into());
    }
    if !about.is_file() {
        return refused(ErrorKind::InvalidInput, "it is no regular file".into());
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(about.len().min(most) as usize)?;
    // The file may have grown since.
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    match bytes.len() as u64 > most {
        true => refused(ErrorKind::FileTooLarge, format!("it has more than {most} bytes")),
        false => Ok(bytes),
    }
}

/// The error in plain words if there is no such file, with the one that may have been meant.
pub(crate) fn explained(path: &Path, error: io::Error) -> io::Error {
    let folder = folder_of(path);
    let problem = match error.kind() {
        ErrorKind::NotFound if !folder.exists() => format!("there is no folder {}", folder.display()),
        ErrorKind::NotFound => {
            let like = nearest_file(path).map(|like| format!("; like it: {}", like.display()));
            format!("there is no such file{}", like.unwrap_or_default())
        }
        _ => return error,
    };
    io::Error::new(ErrorKind::NotFound, problem)
}

/// Whether a picture file can hold the `unpacked` bytes that its header states: a byte of deflate stands for at most 1032 bytes, and other codes
/// pack less. Ask before reserving memory for them.
pub(crate) fn can_hold(file: &[u8], unpacked: u64) -> bool {
    unpacked <= 2048 * file.len() as u64
}

/// Checks before the work that [`write_file`] to this path should succeed.
///
/// # Errors
/// [`Error::Usage`] when it should not.
pub fn check_writable(path: &Path) -> Result<()> {
    let shown = path.display();
    if path.is_dir() {
        return Err(Error::usage(format!("{shown}: is a folder"), "give the path of a file in it"));
    }
    let folder = folder_of(path);
    if folder.is_file() {
        return Err(Error::usage(format!("{}: is a file, no folder", folder.display()), "give a path in a folder"));
    }
    if !folder.is_dir() {
        let folder = folder.display();
        return Err(Error::usage(format!("{folder}: there is no such folder"), format!("make it first: mkdir -p {folder}")));
    }
    let refused = |error: io::Error, problem: String, cure: &str| match error.kind() {
        ErrorKind::InvalidFilename => {
            Error::usage(format!("{shown}: the name is too long"), "give a shorter one, to which more can be added")
        }
        _ => Error::usage(format!("{problem}: {error}"), cure),
    };
    let new = Replacement::of(path).map_err(|error| refused(error, shown.to_string(), "give another name"))?;
    new.temporary().map(drop).map_err(|error| {
        let problem = format!("{}: no file can be made in this folder", folder_of(&new.place).display());
        // The kind alone, because the whole error names a temporary file that the user does not know.
        refused(error.kind().into(), problem, "give a path in a folder that can be written")
    })
}

/// Writes a file. On an error, the file stays as it was.
///
/// # Errors
/// [`Error::Output`] when it cannot be written.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    write_by(path, |mut file| file.write_all(bytes))
}

/// As [`write_file`] with the bytes that `fill` writes.
pub(crate) fn write_by(path: &Path, fill: impl FnOnce(&File) -> io::Result<()>) -> Result<()> {
    write_atomically(path, fill).map_err(|error| {
        let cure = match error.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
                "free some space there or raise the limit, or give a path on another disk"
            }
            _ => "give a path in a folder that can be written",
        };
        Error::output(path, format!("not written: {error}"), cure)
    })
}

fn write_atomically(path: &Path, fill: impl FnOnce(&File) -> io::Result<()>) -> io::Result<()> {
    let new = Replacement::of(path)?;
    // Dropping the temporary file removes it, so an early return leaves nothing behind.
    let file = new.temporary()?;
    // As a plain file, whose errors do not name the temporary path.
    fill(file.as_file())?;
    new.hand_over(file.as_file());
    // After a power cut, the new name must not have old or no content.
    file.as_file().sync_all()?;
    file.persist(new.place)?;
    Ok(())
}

/// The canonical path of a file that need not exist: its folder's canonical path, with links of the file followed.
///
/// # Errors
/// If there is no such folder, or links form a cycle.
pub fn place_of(path: &Path) -> io::Result<PathBuf> {
    /// The most links, as in Linux.
    const LINKS: u32 = 40;
    let mut place = path.to_owned();
    for _ in 0..LINKS {
        let name = place.file_name().ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "names no file"))?;
        place = fs::canonicalize(folder_of(&place))?.join(name);
        match fs::read_link(&place) {
            Ok(next) => place = folder_of(&place).join(next),
            Err(_) => return Ok(place),
        }
    }
    Err(io::Error::other("its links lead to each other"))
}

/// A new file that may replace an existing one.
struct Replacement {
    place: PathBuf,
    /// Metadata of the existing file.
    about: Option<Metadata>,
}

impl Replacement {
    /// Fails if `path` is no regular file, is read-only, or cannot be examined: replacing would remove it.
    fn of(path: &Path) -> io::Result<Self> {
        let place = place_of(path)?;
        match fs::metadata(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(Self { place, about: None }),
            Err(error) => Err(error),
            Ok(about) if !about.is_file() => Err(io::Error::new(ErrorKind::InvalidInput, "is no regular file")),
            Ok(about) if about.permissions().readonly() => Err(io::Error::new(ErrorKind::PermissionDenied, "is read-only")),
            Ok(about) => Ok(Self { place, about: Some(about) }),
        }
    }

    /// A temporary file, in the same folder because an atomic rename needs one file system. It has the permissions of the file that it replaces.
    fn temporary(&self) -> io::Result<NamedTempFile> {
        let prefix = temporary_prefix(&self.place);
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).rand_bytes(RANDOM).suffix(SUFFIX);
        // A new file has the permissions that the umask allows. The default of tempfile is for secrets.
        #[cfg(unix)]
        let new = <Permissions as std::os::unix::fs::PermissionsExt>::from_mode(0o666);
        #[cfg(unix)]
        builder.permissions(self.about.as_ref().map_or(new, Metadata::permissions));
        builder.tempfile_in(folder_of(&self.place))
    }

    /// Gives the new file the group and permissions of the existing one, as far as the system allows.
    fn hand_over(&self, file: &File) {
        let Some(about) = &self.about else { return };
        #[cfg(unix)]
        let _ = std::os::unix::fs::fchown(file, None, Some(std::os::unix::fs::MetadataExt::gid(about)));
        let _ = file.set_permissions(about.permissions());
    }
}

/// Number of random letters in a temporary file's name.
const RANDOM: usize = 6;
/// End of a temporary file's name.
const SUFFIX: &str = ".part";

/// Start of a temporary file's name; it contains the name of the file to write.
fn temporary_prefix(path: &Path) -> OsString {
    let mut prefix = OsString::from(".finalgather-");
    prefix.push(path.file_name().unwrap_or_default());
    prefix.push("-");
    prefix
}

/// Keeps other runs from writing a file, by a system lock on a file beside it. The lock ends with the process.
pub struct Lock {
    path: PathBuf,
    _held: File,
}

impl Lock {
    /// Takes the lock, and removes temporary files of the file that killed runs have left.
    ///
    /// # Errors
    /// [`ErrorKind::WouldBlock`] if another run has the lock; others if the file system has no locks.
    pub fn take(path: &Path) -> io::Result<Self> {
        let path = &place_of(path)?;
        let mut name = path.clone().into_os_string();
        name.push(".lock");
        let name = PathBuf::from(name);
        loop {
            let held = File::options().create(true).append(true).open(&name)?;
            if let Err(error) = held.try_lock() {
                let error = io::Error::from(error);
                if error.kind() != ErrorKind::WouldBlock {
                    // Without locks, no run would remove it.
                    let _ = fs::remove_file(&name);
                }
                return Err(error);
            }
            // A run that just ended may have removed the file after it was opened here. Then try again.
            if is_at(&held, &name) {
                remove_temporaries(path);
                return Ok(Self { path: name, _held: held });
            }
        }
    }

    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // A lock file that stays does no harm.
        let _ = fs::remove_file(&self.path);
    }
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |about: &fs::Metadata| (about.dev(), about.ino());
    matches!((file.metadata(), fs::metadata(path)), (Ok(a), Ok(b)) if identity(&a) == identity(&b))
}

#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

/// Removes temporary files of this file. None is in use, because the lock is held.
fn remove_temporaries(path: &Path) {
    let prefix = temporary_prefix(path);
    for entry in fs::read_dir(folder_of(path)).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let middle =
            name.as_encoded_bytes().strip_prefix(prefix.as_encoded_bytes()).and_then(|rest| rest.strip_suffix(SUFFIX.as_bytes()));
        if middle.is_some_and(|middle| middle.len() == RANDOM) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// The folder of a file.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
