//! What the source promises about itself: where GL is named, that every file says what it is for, and that names of files are true.

use std::fs;
use std::path::{Path, PathBuf};

/// All files below `folder` with this ending.
fn files(folder: &str, ending: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(self::files(path.to_str().unwrap(), ending));
        } else if path.extension().is_some_and(|extension| extension == ending) {
            files.push(path);
        }
    }
    files
}

fn rust() -> Vec<PathBuf> {
    ["src", "tests"].into_iter().flat_map(|folder| files(folder, "rs")).collect()
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap()
}

/// The lines of code, comments apart, that contain `text`, with their places.
fn naming(path: &Path, text: &str) -> Vec<String> {
    let code = |line: &str| !line.trim_start().starts_with("//") && line.contains(text);
    let source = read(path);
    (1..).zip(source.lines()).filter(|(_, line)| code(line)).map(|(i, line)| format!("{}:{i}: {line}", path.display())).collect()
}

#[test]
fn gl_is_named_in_one_folder() {
    // This file spells them only in part.
    for text in [concat!("gl", "ow::"), concat!("un", "safe")] {
        let outside = rust().into_iter().filter(|path| !path.starts_with("src/gpu"));
        let found: Vec<String> = outside.flat_map(|path| naming(&path, text)).collect();
        assert!(found.is_empty(), "{text} outside src/gpu:\n{}", found.join("\n"));
        assert!(files("src/gpu", "rs").iter().any(|path| !naming(path, text).is_empty()), "the search for {text} finds nothing");
    }
}

#[test]
fn every_file_says_what_it_is_for() {
    for path in rust() {
        assert!(read(&path).starts_with("//! "), "{} does not open with module documentation", path.display());
    }
    for path in files("glsl", "vert").into_iter().chain(files("glsl", "frag")).chain(files("glsl", "glsl")) {
        let text = read(&path);
        let first = ["#version 330 core\n", "#version 420 core\n"].into_iter().find_map(|version| text.strip_prefix(version));
        let first = first.unwrap_or(&text);
        assert!(first.starts_with("// "), "{} does not open with a comment", path.display());
    }
}

#[test]
fn mirrors_exist() {
    // Both sides of a shader interface name each other; a file that moved takes its name along.
    let mut names = 0;
    for path in rust().into_iter().chain(["vert", "frag", "glsl"].into_iter().flat_map(|ending| files("glsl", ending))) {
        let text = read(&path);
        for word in text.split(|c: char| c.is_whitespace() || "`(),;\"".contains(c)) {
            let word = word.trim_end_matches(['.', ':']);
            let is_path = ["src/", "glsl/", "tests/"].iter().any(|folder| word.starts_with(folder))
                && [".rs", ".glsl", ".frag", ".vert"].iter().any(|ending| word.ends_with(ending));
            if is_path {
                names += 1;
                assert!(Path::new(word).is_file(), "{} names {word}, which does not exist", path.display());
            }
        }
    }
    assert!(names > 20, "the search finds only {names} names of files");
}

#[test]
fn nothing_is_left_undone() {
    for path in rust() {
        for text in [concat!("to", "do!"), concat!("unimpl", "emented!"), concat!("#[ig", "nore")] {
            let mut found = naming(&path, text);
            // A test that another test runs in a process of its own is not left out.
            found.retain(|line| !line.contains("= \"a part of "));
            assert!(found.is_empty(), "{}", found.join("\n"));
        }
    }
}
