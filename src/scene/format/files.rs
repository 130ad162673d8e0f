//! Access to the files of a scene. A scene from an unknown source may read files in its own folder, and no others on this machine.

use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};
use std::{fs, io};

use crate::error::Error;
use crate::file::{explained, folder_of, read_file};

/// Where the files of a scene may be.
#[derive(Clone, Debug, Default)]
pub enum Files {
    /// In the folder of the scene file or bare model, and in folders below it. A symbolic link counts as its target.
    #[default]
    Folder,
    /// Anywhere.
    Anywhere,
    /// In memory, by path. The scene file is one of them.
    Memory(BTreeMap<PathBuf, Vec<u8>>),
}

/// Reads the files of one scene.
pub struct Reader<'a> {
    /// The scene file or model. It may be anywhere.
    scene: &'a Path,
    files: &'a Files,
    /// The bytes of the scene file or model, if they are not to be read.
    given: Option<&'a [u8]>,
    /// All files read so far, as paths that [`Self::find`] returned.
    done: RefCell<Vec<PathBuf>>,
}

/// Why a file was not read. `cure` is `None` if the only cure is to put the file there.
pub struct Unread {
    problem: String,
    cure: Option<String>,
}

impl<'a> Reader<'a> {
    pub fn new(scene: &'a Path, files: &'a Files) -> Self {
        Self { scene, files, given: None, done: RefCell::default() }
    }

    /// The same with these bytes for the scene file or model.
    pub fn with_bytes(self, given: Option<&'a [u8]>) -> Self {
        Self { given, ..self }
    }

    /// Returns the canonical path of a file, if the scene may read it. Different names of one file give the same path.
    pub fn find(&self, path: &Path) -> Result<PathBuf, Unread> {
        if self.is_given(path) || matches!(self.files, Files::Memory(_)) {
            return Ok(path.to_owned());
        }
        // Checked before the file system is asked, because even a look-up touches the file.
        if !self.is_inside_by_name(path).map_err(unread)? {
            return Err(self.outside());
        }
        let file = fs::canonicalize(path).map_err(|error| unread(explained(path, error)))?;
        if !self.is_free(path) && !file.starts_with(fs::canonicalize(folder_of(self.scene)).map_err(unread)?) {
            return Err(self.outside());
        }
        Ok(file)
    }

    /// Reads a file that [`Self::find`] returned, at most `most` bytes.
    pub fn read(&self, file: &Path, most: u64) -> Result<Cow<'_, [u8]>, Unread> {
        self.done.borrow_mut().push(file.to_owned());
        match (self.files, self.given) {
            (_, Some(bytes)) if self.is_given(file) => Ok(bytes.into()),
            (Files::Memory(files), _) => files.get(file).map(Cow::from).ok_or_else(|| unread(io::ErrorKind::NotFound.into())),
            _ => read_file(file, most).map(Cow::from).map_err(unread),
        }
    }

    fn is_given(&self, path: &Path) -> bool {
        self.given.is_some() && path == self.scene
    }

    /// The scene file or model, and where its files may be.
    pub fn origin(&self) -> (&'a Path, &'a Files) {
        (self.scene, self.files)
    }

    /// All files that were read.
    pub fn into_done(self) -> Vec<PathBuf> {
        self.done.into_inner()
    }

    /// Finds and reads a file.
    pub fn read_named(&self, path: &Path, most: u64) -> Result<Cow<'_, [u8]>, Unread> {
        self.read(&self.find(path)?, most)
    }

    /// Whether the scene may read this file and it exists.
    pub fn has(&self, path: &Path) -> bool {
        match self.files {
            Files::Memory(files) => files.contains_key(path),
            _ => self.is_inside_by_name(path).unwrap_or(false) && path.is_file(),
        }
    }

    /// The files in a folder of the scene and in folders up to two levels below, the nearest first. Empty for a folder outside the scene's.
    pub fn below(&self, folder: &Path) -> Vec<PathBuf> {
        /// More entries are not looked at.
        const MOST_ENTRIES: usize = 2000;
        const LEVELS: usize = 2;
        let level = |file: &Path| file.strip_prefix(folder).ok().map(|inside| inside.components().count());
        if let Files::Memory(files) = self.files {
            let mut files: Vec<_> =
                files.keys().filter(|file| level(file).is_some_and(|level| level <= LEVELS + 1)).cloned().collect();
            files.sort_by_key(|file| level(file));
            return files;
        }
        let (mut files, mut folders, mut entries) = (Vec::new(), vec![folder.to_owned()], 0);
        for _ in 0..=LEVELS {
            for folder in std::mem::take(&mut folders) {
                let place = if folder.as_os_str().is_empty() { Path::new(".") } else { &folder };
                // A folder may be a link.
                if self.find(place).is_err() {
                    continue;
                }
                let listed = fs::read_dir(place).into_iter().flatten().flatten().take(MOST_ENTRIES - entries);
                let mut listed: Vec<_> = listed.map(|entry| folder.join(entry.file_name())).collect();
                entries += listed.len();
                listed.sort_unstable();
                let (below, here): (Vec<_>, Vec<_>) = listed.into_iter().partition(|path| path.is_dir());
                folders.extend(below);
                files.extend(here);
            }
        }
        files
    }

    /// Whether the file may be anywhere.
    fn is_free(&self, path: &Path) -> bool {
        matches!(self.files, Files::Anywhere) || path == self.scene
    }

    fn is_inside_by_name(&self, path: &Path) -> io::Result<bool> {
        if self.is_free(path) {
            return Ok(true);
        }
        let folder = folder_of(self.scene);
        let path = without_parents(path)?;
        Ok(path.starts_with(without_parents(folder)?) || path.starts_with(fs::canonicalize(folder)?))
    }

    fn outside(&self) -> Unread {
        let folder = folder_of(self.scene).display();
        let cure = format!(
            "put it into {folder} and name it by its place there; or, if you trust this scene, give --allow-outside (in the library, \
             Files::Anywhere)"
        );
        Unread { problem: format!("it lies outside the scene's folder, {folder}"), cure: Some(cure) }
    }
}

impl Unread {
    /// An error: `what` cannot be read. It uses `cure` if no better cure is known.
    pub fn error(self, path: &Path, line: Option<usize>, what: &str, cure: impl Into<String>) -> Error {
        Error::input(path, line, format!("cannot read {what}: {}", self.problem), self.cure.unwrap_or_else(|| cure.into()))
    }
}

fn unread(error: io::Error) -> Unread {
    Unread { problem: error.to_string(), cure: None }
}

/// The absolute path. Each `..` removes the name before it, without a look at the file system.
fn without_parents(path: &Path) -> io::Result<PathBuf> {
    let mut plain = PathBuf::new();
    for component in std::path::absolute(path)?.components() {
        match component {
            Component::ParentDir => drop(plain.pop()),
            other => plain.push(other),
        }
    }
    Ok(plain)
}
