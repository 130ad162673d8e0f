//! Finds the name that was meant, for messages.

use std::fs;
use std::path::{Path, PathBuf};

use strsim::damerau_levenshtein;

/// More entries of a folder are not looked at.
const MOST_ENTRIES: usize = 2000;

/// The one of `known` that `name` was meant to be, if it is so near that it is likely. Case, hyphens and underscores do not count.
pub fn nearest<T: AsRef<str>>(name: &str, known: impl IntoIterator<Item = T>) -> Option<T> {
    let plain = |name: &str| name.to_lowercase().replace('-', "_");
    let name = plain(name);
    // One wrong letter in three.
    let most = (name.chars().count() / 3).max(1);
    let distance = |known: &T| damerau_levenshtein(&name, &plain(known.as_ref()));
    known
        .into_iter()
        .map(|known| (distance(&known), known))
        .filter(|(far, _)| *far <= most)
        .min_by_key(|(far, _)| *far)
        .map(|(_, known)| known)
}

/// The existing file that the missing `path` was meant to be: one of a like name, or of the same name with an ending.
pub fn nearest_file(path: &Path) -> Option<PathBuf> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries = fs::read_dir(folder).ok()?;
    let mut names: Vec<_> =
        entries.flatten().take(MOST_ENTRIES).filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort_unstable();
    let name = path.file_name()?.to_str()?;
    let same_stem = |known: &&String| Path::new(known).file_stem().is_some_and(|stem| stem == name);
    let known = nearest(name, &names).or_else(|| names.iter().find(same_stem))?;
    Some(path.with_file_name(known))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn likely_names_are_found() {
        let known = ["photons", "photon_depth", "size", "seed"];
        let found = ["photon", "Photons", "photno-depth", "sixe", "directions", ""].map(|name| nearest(name, known));
        assert_eq!(found, [Some("photons"), Some("photons"), Some("photon_depth"), Some("size"), None, None]);
    }

    #[test]
    fn likely_files_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        ["cornell.toml", "spot.obj", "spot.mtl"].iter().for_each(|name| fs::write(path(name), "").unwrap());
        for (name, meant) in [
            ("cornell.tml", Some("cornell.toml")),
            ("spto.obj", Some("spot.obj")),
            ("cornell", Some("cornell.toml")),
            ("x.obj", None),
        ] {
            assert_eq!(nearest_file(&path(name)), meant.map(path), "{name}");
        }
    }
}
