//! Finds files that a model names by a place of another machine or in other letters. [`Search::find`] is the entry point.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use crate::scene::format::Reader;

/// Lists folders of the scene once.
pub struct Search<'a> {
    reader: &'a Reader<'a>,
    folders: HashMap<PathBuf, Rc<[Listed]>>,
    /// How many names were looked for.
    count: usize,
}

struct Listed {
    /// The place in the folder, in lower case.
    place: String,
    file: PathBuf,
}

/// More names are not looked for: that would take too long.
const MOST_NAMES: usize = 10_000;

impl<'a> Search<'a> {
    pub fn new(reader: &'a Reader<'a>) -> Self {
        Self { reader, folders: HashMap::new(), count: 0 }
    }

    /// A file of the same name as one of `names`, in the folders of the files `near` or below. Its place there, in any case, counts more than its
    /// name alone.
    pub fn find(&mut self, near: [&Path; 2], names: &[impl AsRef<str>]) -> Option<PathBuf> {
        self.count += 1;
        if self.count > MOST_NAMES {
            return None;
        }
        let listed = near.map(|file| self.below(file.parent().unwrap_or(Path::new(""))));
        let search =
            |fits: &dyn Fn(&str) -> bool| listed.iter().flat_map(|listed| listed.iter()).find(|listed| fits(&listed.place));
        names.iter().find_map(|name| {
            let name = name.as_ref().replace('\\', "/").to_lowercase();
            let base = name.rsplit('/').next().filter(|base| !base.is_empty())?;
            let found = search(&|place| place == name).or_else(|| search(&|place| place.rsplit('/').next() == Some(base)))?;
            Some(found.file.clone())
        })
    }

    fn below(&mut self, folder: &Path) -> Rc<[Listed]> {
        let reader = self.reader;
        let list = || {
            let place =
                |file: &Path| file.strip_prefix(folder).unwrap_or(file).to_string_lossy().replace('\\', "/").to_lowercase();
            reader.below(folder).into_iter().map(|file| Listed { place: place(&file), file }).collect()
        };
        self.folders.entry(folder.to_owned()).or_insert_with(list).clone()
    }
}
