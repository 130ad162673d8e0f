//! Files that a scene names. Who opens a scene from elsewhere asks for what is in its folder, and for nothing else that this machine can read.

use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};
use std::{fs, io};

use crate::error::Error;
use crate::file::{folder_of, read_file};

/// Where the files of a scene come from.
#[derive(Clone, Debug, Default)]
pub enum Files {
    /// From the folder of the scene file, or of the bare model, and those below it. A symbolic link counts as what it leads to.
    #[default]
    Folder,
    /// From wherever the scene says.
    Anywhere,
    /// From memory, by their paths; the scene is one of them.
    Memory(BTreeMap<PathBuf, Vec<u8>>),
}

/// Reads the files of one scene.
pub struct Reader<'a> {
    /// The file that was asked for, wherever it may lie.
    scene: &'a Path,
    files: &'a Files,
    /// All that were read so far, by the paths of [`Self::find`].
    done: RefCell<Vec<PathBuf>>,
}

/// Why a file was not read, and the cure where a better one is known than to put it there.
pub struct Unread {
    problem: String,
    cure: Option<String>,
}

impl<'a> Reader<'a> {
    pub fn new(scene: &'a Path, files: &'a Files) -> Self {
        Self { scene, files, done: RefCell::default() }
    }

    /// The one path of a file, by whatever name it goes, if it may be read.
    pub fn find(&self, path: &Path) -> Result<PathBuf, Unread> {
        if let Files::Memory(_) = self.files {
            return Ok(path.to_owned());
        }
        // Before the disk is asked: to look for a file is to touch it.
        if !self.is_inside_by_name(path).map_err(unread)? {
            return Err(self.outside());
        }
        let file = fs::canonicalize(path).map_err(unread)?;
        if !self.is_free(path) && !file.starts_with(fs::canonicalize(folder_of(self.scene)).map_err(unread)?) {
            return Err(self.outside());
        }
        Ok(file)
    }

    /// What is in a file that [`Self::find`] found: at most so many bytes.
    pub fn read(&self, file: &Path, most: u64) -> Result<Cow<'_, [u8]>, Unread> {
        self.done.borrow_mut().push(file.to_owned());
        match self.files {
            Files::Memory(files) => files.get(file).map(Cow::from).ok_or_else(|| unread(io::ErrorKind::NotFound.into())),
            _ => read_file(file, most).map(Cow::from).map_err(unread),
        }
    }

    /// All files that were read.
    pub fn into_done(self) -> Vec<PathBuf> {
        self.done.into_inner()
    }

    /// What is in a file of this name.
    pub fn read_named(&self, path: &Path, most: u64) -> Result<Cow<'_, [u8]>, Unread> {
        self.read(&self.find(path)?, most)
    }

    /// Whether there is such a file to read.
    pub fn has(&self, path: &Path) -> bool {
        match self.files {
            Files::Memory(files) => files.contains_key(path),
            _ => self.is_inside_by_name(path).unwrap_or(false) && path.is_file(),
        }
    }

    /// Whether it may lie anywhere.
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
    /// That `what` cannot be read, with this cure if none is known.
    pub fn error(self, path: &Path, line: Option<usize>, what: &str, cure: impl Into<String>) -> Error {
        Error::input(path, line, format!("cannot read {what}: {}", self.problem), self.cure.unwrap_or_else(|| cure.into()))
    }
}

fn unread(error: io::Error) -> Unread {
    Unread { problem: error.to_string(), cure: None }
}

/// The path from the root, with each `..` resolved by name alone.
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
