//! Files out: whole under their names, or not at all. Files in: no more than they may be.

use std::ffi::OsString;
use std::fs::{self, File, Metadata, Permissions};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, Result};

/// The most that is read of any file.
pub(crate) const MOST_BYTES: u64 = 4 << 30;

/// The most of a file whose statements say what else there is: scene files, material libraries, descriptions.
pub(crate) const MOST_WORDS: u64 = 64 << 20;

/// The whole of a file, if it has at most so many bytes.
pub(crate) fn read_file(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let refused = |kind, problem: String| Err(io::Error::new(kind, problem));
    // Before it is opened, for a pipe would wait for its writer.
    let about = fs::metadata(path)?;
    if !about.is_file() {
        return refused(ErrorKind::InvalidInput, "it is no regular file".into());
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(about.len().min(most) as usize)?;
    // It may have grown since.
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    match bytes.len() as u64 > most {
        true => refused(ErrorKind::FileTooLarge, format!("it has more than {most} bytes")),
        false => Ok(bytes),
    }
}

/// Whether a picture file can hold what its header says, of `unpacked` bytes: a byte of deflate stands for 1032 at most, one of the other codes in use for
/// fewer. To be asked before there is memory for that.
pub(crate) fn can_hold(file: &[u8], unpacked: u64) -> bool {
    unpacked <= 2048 * file.len() as u64
}

/// Whether [`write_file`] to this path can be expected to work, for asking before the work whose result it is to hold.
pub(crate) fn check_writable(path: &Path) -> Result<()> {
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
        // Without the name that nobody gave.
        refused(error.kind().into(), problem, "give a path in a folder that can be written")
    })
}

/// The file is there with all of these bytes, or as it was before.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    write_by(path, |mut file| file.write_all(bytes))
}

/// The file is there with all that `fill` writes, or as it was before.
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
    // Dropping the temporary file removes it, so that every early return leaves nothing behind.
    let file = new.temporary()?;
    // Through the file itself, whose errors do not speak of the temporary name.
    fill(file.as_file())?;
    new.hand_over(file.as_file());
    // A name that outlives a power cut must not outlive its content.
    file.as_file().sync_all()?;
    file.persist(new.place)?;
    Ok(())
}

/// Where a file of this name is or will be, however it is spelled: its folder's own path, and a link is what it leads to.
///
/// # Errors
/// When there is no such folder, or links lead to each other.
pub fn place_of(path: &Path) -> io::Result<PathBuf> {
    /// As many as Linux follows.
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

/// A file that takes the place of one, or of nothing.
struct Replacement {
    place: PathBuf,
    /// Of the file that is there.
    about: Option<Metadata>,
}

impl Replacement {
    /// # Errors
    /// When there is something that is no file, or not to be written: what takes its place would do away with it. Or that cannot be told.
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

    /// In the same folder, because a file can be renamed in one step only within its file system. Whom it is kept from is kept from it from the
    /// beginning.
    fn temporary(&self) -> io::Result<NamedTempFile> {
        let prefix = temporary_prefix(&self.place);
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).rand_bytes(RANDOM).suffix(SUFFIX);
        // As for any new file, the umask decides; tempfile's own default is for secrets.
        #[cfg(unix)]
        let new = <Permissions as std::os::unix::fs::PermissionsExt>::from_mode(0o666);
        #[cfg(unix)]
        builder.permissions(self.about.as_ref().map_or(new, Metadata::permissions));
        builder.tempfile_in(folder_of(&self.place))
    }

    /// Gives it the group and the permissions of the file that is there, as far as the system lets it.
    fn hand_over(&self, file: &File) {
        let Some(about) = &self.about else { return };
        #[cfg(unix)]
        let _ = std::os::unix::fs::fchown(file, None, Some(std::os::unix::fs::MetadataExt::gid(about)));
        let _ = file.set_permissions(about.permissions());
    }
}

/// Of a temporary file's name: random letters, and what stands after them.
const RANDOM: usize = 6;
const SUFFIX: &str = ".part";

/// Names the file that it is to be.
fn temporary_prefix(path: &Path) -> OsString {
    let mut prefix = OsString::from(".finalgather-");
    prefix.push(path.file_name().unwrap_or_default());
    prefix.push("-");
    prefix
}

/// Keeps other runs from writing a file, by a lock on one beside it that is there for as long. A lock is the system's, and ends with the process.
pub struct Lock {
    path: PathBuf,
    _held: File,
}

impl Lock {
    /// Takes it, and removes what runs that were killed have left of the file unfinished.
    ///
    /// # Errors
    /// [`ErrorKind::WouldBlock`] when another run has it; others where there are no locks.
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
                    // Where there are no locks it would stay for ever.
                    let _ = fs::remove_file(&name);
                }
                return Err(error);
            }
            // Unless a run that just ended has removed the file that was opened.
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
        // One that stays does no harm.
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

/// Those of this file. None is in use, for the lock is held.
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

/// The folder that a file is in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
