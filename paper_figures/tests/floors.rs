//! Imports between modules go one way, as the table in `src/main.rs` says, and only `lab` calls the library.

use std::fs;
use std::path::{Path, PathBuf};

/// All modules, named like `figures::times`, with their lines of code without comments.
fn modules() -> Vec<(String, Vec<String>)> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let (mut folders, mut files): (_, Vec<PathBuf>) = (vec![source.clone()], Vec::new());
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { folders.push(path) } else { files.push(path) }
        }
    }
    files.retain(|file| file.extension().is_some_and(|ending| ending == "rs"));
    let module = |file: PathBuf| {
        let name = file.strip_prefix(&source).unwrap().with_extension("").to_str().unwrap().replace('/', "::");
        let text = fs::read_to_string(&file).unwrap();
        let code = text.lines().filter(|line| !line.trim_start().starts_with("//")).map(str::to_owned).collect();
        (name.trim_end_matches("::mod").to_owned(), code)
    };
    files.into_iter().map(module).collect()
}

/// The rows of the table: a floor, and its modules, where `a::*` means all in `a`.
fn table() -> Vec<(u32, String)> {
    let main = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/main.rs")).unwrap();
    let rows = main.lines().filter_map(|line| line.strip_prefix("//! | ")?.split_once(" | "));
    let rows = rows.filter_map(|(floor, rest)| Some((floor.parse().ok()?, rest.split(" |").next()?)));
    rows.flat_map(|(floor, names)| names.split(", ").map(move |name| (floor, name.trim_matches('`').to_owned()))).collect()
}

/// Panics where a module has no floor.
fn floor(table: &[(u32, String)], module: &str) -> u32 {
    let exact = table.iter().find(|(_, name)| name == module);
    let within = |name: &str| name.strip_suffix('*').is_some_and(|folder| module.starts_with(folder));
    exact.or_else(|| table.iter().find(|(_, name)| within(name))).unwrap_or_else(|| panic!("{module} is not in the table")).0
}

/// What follows `crate::` in a line, as the longest name of a module that it begins with.
fn imports<'a>(line: &'a str, modules: &'a [(String, Vec<String>)]) -> impl Iterator<Item = &'a str> {
    line.split("crate::").skip(1).map(move |path| {
        let begins = |name: &&str| path.strip_prefix(*name).is_some_and(|rest| !rest.starts_with(|c: char| c.is_alphanumeric()));
        let names = modules.iter().map(|(name, _)| name.as_str()).filter(begins);
        names.max_by_key(|name| name.len()).unwrap_or_else(|| panic!("{line} imports no module by its name"))
    })
}

#[test]
fn imports_go_down() {
    let (table, modules) = (table(), modules());
    let mut seen = 0;
    for (module, code) in &modules {
        for line in code {
            for import in imports(line, &modules) {
                seen += 1;
                let floors = [module, import].map(|module| floor(&table, module));
                assert!(floors[1] < floors[0], "{module} on floor {} imports {import} on floor {}", floors[0], floors[1]);
            }
            assert!(!line.contains("super::") || line.trim() == "use super::*;", "{module} imports by super: {line}");
        }
    }
    assert!(seen > 50, "the search finds only {seen} imports");
    for (_, name) in table {
        assert!(modules.iter().any(|(module, _)| module.starts_with(name.trim_end_matches('*'))), "{name} does not exist");
    }
}

#[test]
fn only_lab_calls_the_library() {
    let calls = |code: &[String]| code.iter().any(|line| line.contains("finalgather::"));
    for (module, code) in modules() {
        assert!(module.starts_with("lab") || !calls(&code), "{module} calls the library");
    }
    assert!(modules().iter().any(|(_, code)| calls(code)), "the search finds nothing");
}
