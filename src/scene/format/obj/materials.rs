//! Finds the material libraries of an OBJ file and the materials that it uses. [`Materials::read`] is the entry point.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use super::mtl::{self, Placement};
use super::scan::{Named, Scan};
use super::search::Search;
use super::text::{Decoder, names_of, uncomment, unquote};
use crate::error::{Error, Result};
use crate::file::MOST_WORDS;
use crate::scene::Material;
use crate::scene::format::warnings::{Fault, Place};
use crate::scene::format::{Loader, Reader, Unread, beside, names};

/// More names are not looked for.
const MOST_LIBRARIES: usize = 1000;

/// The most words of a file name.
const MOST_NAME_WORDS: usize = 8;

/// The materials of a model.
#[derive(Default)]
pub struct Materials {
    /// Materials of libraries, then those without definition.
    pub list: Vec<Material>,
    /// Where textures lie, for each material of libraries.
    pub placements: Vec<Placement>,
    /// For each used name, its index in `list`.
    pub used: Vec<usize>,
    by_name: HashMap<String, usize>,
    /// Indices by names without comments and quotes, and by names in lower case. Made when it is needed.
    similar: Option<HashMap<String, usize>>,
}

impl Materials {
    /// Reads all libraries of a model, and gives each name that it uses a material.
    pub fn read(loader: &mut Loader, decoder: &mut Decoder, path: &Path, scan: &Scan) -> Result<Self> {
        let reader = loader.reader;
        let search = Search::new(reader);
        let mut libraries =
            Libraries { loader, decoder, path, search, read: HashSet::new(), missing: Vec::new(), materials: Self::default() };
        for statement in scan.libraries.iter().take(MOST_LIBRARIES) {
            libraries.open(statement)?;
        }
        libraries.replace_missing(scan);
        let Libraries { loader, mut materials, missing, .. } = libraries;
        for (problem, line) in &missing {
            let text = || format!("{problem}; materials that no other library defines are grey");
            loader.warnings.tell(Place { path, line: Some(*line) }, "library", &text);
        }
        for named in &scan.materials {
            let index = materials.find(loader, path, named, missing.is_empty())?;
            materials.used.push(index);
        }
        Ok(materials)
    }

    fn add(&mut self, (material, placement): (Material, Placement)) {
        // A later definition of a name replaces the earlier one.
        if let Some(&known) = self.by_name.get(&material.name) {
            self.list[known] = material;
            self.placements[known] = placement;
        } else {
            self.by_name.insert(material.name.clone(), self.list.len());
            self.list.push(material);
            self.placements.push(placement);
        }
    }

    /// The material of a used name. A name without definition gets a grey one. This is told, unless a library is missing, which explains it.
    fn find(&mut self, loader: &mut Loader, path: &Path, named: &Named, tell: bool) -> Result<usize> {
        let name = &named.name;
        if let Some(&known) = self.by_name.get(name) {
            return Ok(known);
        }
        let place = Place { path, line: Some(named.line) };
        let known = &self.list[..self.placements.len()];
        let cure = format!("define it in a file that mtllib names, or use a defined one: {}", names(known));
        let problem = || format!("no material library defines material \"{name}\"");
        let fault = |mend| Fault { kind: "material", problem: &problem, mend, cure: &cure };
        if let Some(similar) = self.similar(name) {
            let mend = format!("\"{}\" is used", self.list[similar].name);
            loader.warnings.mend(place, &fault(&mend))?;
            return Ok(similar);
        }
        if tell && !name.is_empty() {
            loader.warnings.mend(place, &fault("it is the default material, grey"))?;
        }
        let name = if name.is_empty() { Material::default().name } else { name.clone() };
        self.list.push(Material { name, ..Material::default() });
        Ok(self.list.len() - 1)
    }

    /// A defined material whose name differs in a comment, in quotes or in case.
    fn similar(&mut self, name: &str) -> Option<usize> {
        let defined = &self.list[..self.placements.len()];
        let similar = self.similar.get_or_insert_with(|| {
            let names = || (0..).zip(defined).flat_map(|(index, known)| names_of(&known.name).map(move |name| (name, index)));
            let mut similar = HashMap::new();
            for (name, index) in names() {
                similar.entry(name.into_owned()).or_insert(index);
            }
            for (name, index) in names() {
                similar.entry(name.to_lowercase()).or_insert(index);
            }
            similar
        });
        let exact = names_of(name).find_map(|name| similar.get(&*name));
        exact.or_else(|| names_of(name).find_map(|name| similar.get(&name.to_lowercase()))).copied()
    }
}

/// Libraries while they are read.
struct Libraries<'a, 'b> {
    loader: &'a mut Loader<'b>,
    decoder: &'a mut Decoder,
    /// The OBJ file.
    path: &'a Path,
    search: Search<'b>,
    /// Files that were read.
    read: HashSet<PathBuf>,
    /// Why libraries could not be read, and the lines that name them. Empty where faults are errors.
    missing: Vec<(String, usize)>,
    materials: Materials,
}

impl Libraries<'_, '_> {
    /// Reads the libraries of a `mtllib` statement, and notes why some cannot be read.
    fn open(&mut self, statement: &Named) -> Result<()> {
        let line = statement.line;
        for name in self.names(statement)? {
            let library = beside(self.path, &name);
            let read = match name.is_empty() {
                true => Err(Failure::Unread(Error::input(
                    self.path,
                    Some(line),
                    "mtllib without a name",
                    "name it, or remove the line",
                ))),
                false => self.load(&library, line),
            };
            let error = match read {
                Ok(()) => continue,
                Err(Failure::Unread(error)) if !self.loader.warnings.is_strict() => error,
                Err(Failure::Unread(error) | Failure::Fault(error)) => return Err(error),
            };
            let Error::Input { problem, .. } = error else { return Err(error) };
            let found = self.search.find([self.path; 2], &[&name]).filter(|found| *found != library);
            if !found.is_some_and(|found| self.replace(&found, &problem, line)) {
                self.missing.push((problem, line));
            }
        }
        Ok(())
    }

    /// The names in a `mtllib` statement. It is a list of files, but some exporters write names with spaces or quotes.
    fn names(&mut self, statement: &Named) -> Result<Vec<String>> {
        let (reader, path) = (self.loader.reader, self.path);
        let whole = &statement.name;
        let has = |name: &str| reader.has(&beside(path, name));
        if whole.is_empty() || has(whole) {
            return Ok(vec![whole.clone()]);
        }
        let names = split_names(whole, has);
        let plain: Vec<&str> = whole.split_whitespace().collect();
        if plain != names {
            let problem = || format!("mtllib has other text than plain names: {whole}");
            let mend = format!("it is read as {}", names.join(" and "));
            let cure = "give names without spaces, quotes and comments";
            let place = Place { path, line: Some(statement.line) };
            self.loader.warnings.mend(place, &Fault { kind: "mtllib", problem: &problem, mend: &mend, cure })?;
        }
        Ok(names)
    }

    /// Reads another library than the named one, and tells so. Returns whether it could be read.
    fn replace(&mut self, found: &Path, problem: &str, line: usize) -> bool {
        let is_read = self.load(found, line).is_ok();
        if is_read {
            let text = || format!("{problem}; {} is used", found.display());
            self.loader.warnings.tell(Place { path: self.path, line: Some(line) }, "other library", &text);
        }
        is_read
    }

    /// Reads the library of the model's own name in place of the first that is missing, or where none is named.
    fn replace_missing(&mut self, scan: &Scan) {
        let own = self.path.with_extension("mtl");
        let reader = self.loader.reader;
        let is_new = reader.has(&own) && reader.find(&own).is_ok_and(|file| !self.read.contains(&file));
        if !is_new || self.loader.warnings.is_strict() {
            return;
        }
        if let Some(first) = scan.materials.first().filter(|_| scan.libraries.is_empty()) {
            self.replace(&own, "no mtllib names a material library", first.line);
        } else if let Some((problem, line)) = self.missing.first().cloned()
            && self.replace(&own, &problem, line)
        {
            self.missing.remove(0);
        }
    }

    fn load(&mut self, library: &Path, line: usize) -> Result<(), Failure> {
        let reader: &Reader = self.loader.reader;
        let unread = |unread: Unread| {
            let what = format!("material library {}", library.display());
            let cure = "put it there, or correct or remove the mtllib line";
            Failure::Unread(unread.error(self.path, Some(line), &what, cure))
        };
        let file = reader.find(library).map_err(unread)?;
        if !self.read.insert(file.clone()) {
            return Ok(());
        }
        let bytes = reader.read(&file, MOST_WORDS).map_err(unread)?;
        let text = self.decoder.decode(&mut self.loader.warnings, library, &bytes).map_err(|error| {
            match self.loader.warnings.is_strict() {
                true => Failure::Fault(error),
                false => Failure::Unread(error),
            }
        })?;
        let read = mtl::load(self.loader, &mut self.search, self.decoder, [library, self.path], &text).map_err(Failure::Fault)?;
        read.into_iter().for_each(|material| self.materials.add(material));
        Ok(())
    }
}

/// Why a library could not be loaded.
enum Failure {
    /// The file cannot be read at all.
    Unread(Error),
    /// The file is refused for what it says.
    Fault(Error),
}

/// Splits a list of names. Names with spaces are found by looking for them.
fn split_names(text: &str, has: impl Fn(&str) -> bool) -> Vec<String> {
    if let Some(name) = names_of(text).find(|name| has(name)) {
        return vec![name.into_owned()];
    }
    let text = uncomment(text);
    let words: Vec<(usize, usize)> = text
        .split_whitespace()
        .map(|word| word.as_ptr() as usize - text.as_ptr() as usize)
        .map(|start| (start, start + text[start..].split_whitespace().next().unwrap_or_default().len()))
        .collect();
    let mut names = Vec::new();
    let mut first = 0;
    while first < words.len() && names.len() < MOST_LIBRARIES {
        let name = |end: usize| unquote(&text[words[first].0..words[end - 1].1]).replace("\\ ", " ");
        let ends = first + 1..=words.len().min(first + MOST_NAME_WORDS);
        let is_library = |end: &usize| name(*end).to_lowercase().ends_with(".mtl");
        let found = ends.clone().rev().find(|&end| has(&name(end)));
        let end = found.or_else(|| ends.clone().find(is_library)).unwrap_or(first + 1);
        names.push(name(end));
        first = end;
    }
    names
}
