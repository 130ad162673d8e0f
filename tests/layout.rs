//! Rules for the source: allowed imports, file length, unique type names, files that may use GL, a header in each file, existing file names in
//! comments.

mod common;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use common::need::need;
use common::tool::stderr;

/// The top-level modules of `src/` by floor, the lowest first. A module imports from lower floors only: never from a higher one, nor from another
/// module of its own floor.
const FLOORS: [&[&str]; 11] = [
    &["error", "harmonics", "math", "nearest", "random"],
    &["file", "gpu", "npy", "ply", "quantity", "settings"],
    &["blocks", "direction", "image", "shaders"],
    &["scene"],
    &["export", "geometry", "photon"],
    &["points", "prepared"],
    &["direct", "film", "photon_map", "reference", "relight"],
    &["gather"],
    &["memory"],
    &["bake", "bench", "render"],
    &["job"],
];

/// No file has more lines.
const MOST_LINES: usize = 500;

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
    ["src", "tests", "python/src"].into_iter().flat_map(|folder| files(folder, "rs")).collect()
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
            // A test that another test runs as a process is not left out.
            found.retain(|line| !line.contains("= \"a part of "));
            assert!(found.is_empty(), "{}", found.join("\n"));
        }
    }
}

/// Rust without its comments, and without its tests, which stand last. Lines keep their numbers.
fn code(path: &Path) -> String {
    let source = read(path);
    let (code, _) = source.split_once("#[cfg(test)]\nmod ").unwrap_or((&source, ""));
    let lines = code.lines().map(|line| if line.trim_start().starts_with("//") { "" } else { line });
    lines.flat_map(|line| [line, "\n"]).collect()
}

fn is_of_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// The first names behind `root`, such as `crate::`, of all paths in `code`: `crate::a::b` and `use crate::{a::b, c::{d, e}}`. With their lines.
fn imports<'a>(code: &'a str, root: &str) -> Vec<(usize, &'a str)> {
    let mut found = Vec::new();
    for (at, _) in code.match_indices(root) {
        // Not the root but the end of a longer name or path.
        if code[..at].ends_with(|c| is_of_name(c) || c == ':') {
            continue;
        }
        let start = at + root.len();
        let mut depth = 0;
        for (offset, c) in code[start..].char_indices() {
            let place = start + offset;
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                _ if depth <= 1 && is_of_name(c) && (place == start || code[..place].trim_end().ends_with(['{', ','])) => {
                    let name = code[place..].split(|c| !is_of_name(c)).next().unwrap();
                    found.push((code[..place].matches('\n').count() + 1, name));
                }
                _ => {}
            }
            if depth == 0 {
                break;
            }
        }
    }
    found
}

/// The top-level module of the crate in `folder` that a file belongs to; none for the root, and for programs.
fn module_of(path: &Path, folder: &str) -> Option<String> {
    let first = path.strip_prefix(folder).unwrap().components().next()?;
    let name = Path::new(&first).file_stem()?.to_str()?.to_owned();
    (!["lib", "main", "bin"].contains(&name.as_str())).then_some(name)
}

struct Import {
    importer: String,
    imported: String,
    place: String,
}

/// All imports of a top-level module of the crate in `folder` from another.
fn imports_among_modules(folder: &str) -> Vec<Import> {
    let mut found = Vec::new();
    for path in files(folder, "rs") {
        let Some(importer) = module_of(&path, folder) else { continue };
        // From a.rs and a/mod.rs `super::` is the root too, from a/b.rs `super::super::`.
        let below_root = path.strip_prefix(folder).unwrap().components().count() - usize::from(path.ends_with("mod.rs"));
        let code = code(&path);
        for (line, imported) in imports(&code, "crate::").into_iter().chain(imports(&code, &"super::".repeat(below_root))) {
            if *imported != importer {
                let place = format!("{}:{line}", path.display());
                found.push(Import { importer: importer.clone(), imported: imported.to_owned(), place });
            }
        }
    }
    found
}

fn floor_of(module: &str) -> Option<usize> {
    FLOORS.iter().position(|floor| floor.contains(&module))
}

#[test]
fn imports_go_down() {
    let modules: BTreeSet<_> = files("src", "rs").iter().filter_map(|path| module_of(path, "src")).collect();
    let listed: Vec<_> = FLOORS.concat();
    assert_eq!(listed.iter().collect::<BTreeSet<_>>().len(), listed.len(), "FLOORS names a module twice");
    for module in &modules {
        assert!(floor_of(module).is_some(), "module {module} has no floor in FLOORS");
    }
    for module in listed {
        assert!(modules.contains(module), "FLOORS names module {module}, which does not exist");
    }
    let imports = imports_among_modules("src");
    assert!(imports.len() > 100, "the search finds only {} imports", imports.len());
    let mut wrong = Vec::new();
    for Import { importer, imported, place } in &imports {
        let own = floor_of(importer).unwrap();
        match floor_of(imported) {
            Some(floor) if floor < own => {}
            Some(floor) => wrong.push(format!("{place}: module {importer} (floor {own}) imports {imported} (floor {floor})")),
            None => wrong.push(format!("{place}: module {importer} imports {imported}, which is no module of FLOORS")),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The shortest way from an import along others to its importer, with itself.
fn way_back<'a>(imports: &'a [Import], first: &'a Import) -> Option<Vec<&'a Import>> {
    let (mut ways, mut met) = (VecDeque::from([vec![first]]), BTreeSet::from([&first.imported]));
    while let Some(way) = ways.pop_front() {
        let end = &way.last()?.imported;
        if *end == first.importer {
            return Some(way);
        }
        for next in imports.iter().filter(|import| import.importer == *end) {
            if met.insert(&next.imported) {
                ways.push_back([&way[..], &[next]].concat());
            }
        }
    }
    None
}

/// Of the library and of the tool, in which modules have no floors.
#[test]
fn no_module_imports_itself_by_way_of_others() {
    for folder in ["src", "src/bin/finalgather"] {
        let imports = imports_among_modules(folder);
        let cycles = imports.iter().filter_map(|first| way_back(&imports, first));
        let cycle: Vec<_> = cycles.min_by_key(Vec::len).unwrap_or_default();
        let lines: Vec<_> = cycle
            .iter()
            .map(|import| format!("{}: module {} imports {}", import.place, import.importer, import.imported))
            .collect();
        assert!(cycle.is_empty(), "a cycle:\n{}", lines.join("\n"));
    }
}

#[test]
fn imports_are_found_in_all_their_forms() {
    let code = "use crate::a::B;\nuse crate::{c::{D, E}, f, g::H};\nuse crate::{\n    i::{J, K},\n    l as z,\n};\nfn x() { crate::m::n() }\n\
                use subcrate::o;\n";
    assert_eq!(imports(code, "crate::"), [(1, "a"), (2, "c"), (2, "f"), (2, "g"), (4, "i"), (5, "l"), (7, "m")]);
}

#[test]
fn no_file_is_long() {
    let mut paths = Vec::new();
    for folder in ["src", "tests", "paper_figures/src", "paper_figures/tests", "fuzz/src", "fuzz/fuzz_targets", "glsl"] {
        for ending in ["rs", "glsl", "vert", "frag", "c", "py"] {
            paths.extend(files(folder, ending));
        }
    }
    assert!(paths.len() > 150, "the search finds only {} files", paths.len());
    let lines = |path: &Path| read(path).lines().count();
    for path in &paths {
        assert!(lines(path) <= MOST_LINES, "{} has {} lines, more than {MOST_LINES}", path.display(), lines(path));
    }
}

/// The name of the struct, enum, trait or union that a line declares, or of the type alias that it declares outside any block.
fn declared(line: &str) -> Option<&str> {
    let mut words = line.split_whitespace().skip_while(|word| word.starts_with("pub") || *word == concat!("un", "safe"));
    let kind = words.next()?;
    let declares = ["struct", "enum", "trait", "union"].contains(&kind) || kind == "type" && !line.starts_with(' ');
    let name = words.next()?.split(|c| !is_of_name(c)).next()?;
    (declares && name.starts_with(char::is_uppercase)).then_some(name)
}

#[test]
fn each_type_has_a_name_of_its_own() {
    let mut places: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for path in files("src", "rs") {
        for (i, line) in (1..).zip(code(&path).lines()) {
            if let Some(name) = declared(line) {
                places.entry(name.to_owned()).or_default().push(format!("{}:{i}", path.display()));
            }
        }
    }
    assert!(places.len() > 150, "the search finds only {} types", places.len());
    if let Some((name, places)) = places.iter().find(|(_, places)| places.len() > 1) {
        panic!("{name} stands for {} types: {}", places.len(), places.join(", "));
    }
}

/// Run by [`what_is_missing_fails_on_ci_and_is_said_elsewhere`], with and without the environment variable `CI`.
#[test]
#[ignore = "a part of what_is_missing_fails_on_ci_and_is_said_elsewhere"]
fn needs_what_is_not_here() {
    assert_eq!(need("a horse", Ok::<_, String>(1)), Some(1));
    assert_eq!(need("a unicorn", Err::<(), _>("there are none")), None);
}

#[test]
fn what_is_missing_fails_on_ci_and_is_said_elsewhere() {
    for (ci, passes) in [("true", false), ("", true)] {
        let mut command = Command::new(std::env::current_exe().unwrap());
        let output = command.args(["--ignored", "--exact", "needs_what_is_not_here"]).env("CI", ci).output().unwrap();
        // The harness shows what a failing test has written on stdout.
        let all = String::from_utf8_lossy(&output.stdout).into_owned() + &stderr(&output);
        assert_eq!(output.status.success(), passes, "CI={ci:?}: {all}");
        assert!(all.contains("NOT TESTED: a unicorn: there are none") && !all.contains("a horse"), "CI={ci:?}: {all}");
        assert!(all.contains(if passes { "1 passed" } else { "1 failed" }), "CI={ci:?}: {all}");
    }
}
