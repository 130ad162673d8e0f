//! Every shader is used, compiles on this driver, and passes the reference compiler glslangValidator.

mod common;

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;
use std::{fs, io};

use common::{gpu, writes_images};
use finalgather::error::Error;
use finalgather::gpu::{Program, ShaderSource};
use finalgather::shaders::{BATCH, variants};

/// The names and texts of the files in a folder.
fn files(folder: &str) -> Vec<(String, String)> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let files = entries.filter(|path| path.is_file());
    files.map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), fs::read_to_string(&path).unwrap())).collect()
}

#[test]
fn all_compile_and_link_here() {
    let gpu = gpu();
    let with_images = writes_images(&gpu);
    for source in variants().iter().filter(|source| with_images || !source.writes_images()) {
        Program::new(&gpu, source).unwrap_or_else(|error| panic!("{error}"));
    }
}

#[test]
fn no_file_is_dead() {
    let variants = variants();
    for (name, text) in files("glsl") {
        let used = match name.strip_suffix(".frag") {
            Some(name) => variants.iter().any(|source| source.name == name && source.fragment == text),
            None => variants.iter().any(|source| source.vertex == text),
        };
        assert!(used, "glsl/{name} is part of no program in src/shaders.rs");
        let with_images = variants.iter().any(|source| source.fragment == text && source.writes_images());
        let version = if with_images { "#version 420 core\n" } else { "#version 330 core\n" };
        assert!(text.starts_with(version), "glsl/{name} is not for GLSL of {version}");
    }
    let resolved: Vec<_> = variants.iter().map(|source| source.resolve().unwrap()).collect();
    for (name, text) in ["consumer", "finder", "include"].into_iter().flat_map(|folder| files(&format!("glsl/{folder}"))) {
        // The comment at its beginning is no other file's.
        let first = text.lines().next().unwrap();
        assert!(
            resolved.iter().any(|(vertex, fragment)| [vertex, fragment].iter().any(|stage| stage.contains(first))),
            "no program includes {name}"
        );
        assert!(!text.contains("#version"), "{name} would repeat #version");
    }
}

/// Programs are of [`variants`] alone, so that the tests here see all of them.
#[test]
fn sources_are_made_in_one_place() {
    let made = |path: &Path| fs::read_to_string(path).unwrap().matches("ShaderSource {").count();
    let mut folders = vec![Path::new("src").to_owned()];
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() {
                folders.push(path);
            } else if path != Path::new("src/shaders.rs") && path != Path::new("src/gpu/program.rs") {
                assert_eq!(made(&path), 0, "{} makes a shader source", path.display());
            }
        }
    }
    assert!(made(Path::new("src/shaders.rs")) > 0, "the search finds nothing");
}

#[test]
fn variants_are_all_there_and_differ() {
    let variants = variants();
    let defines = |source: &ShaderSource| source.defines.join(" ");
    let gathers: BTreeSet<_> = variants.iter().filter(|source| source.name == "gather").map(defines).collect();
    for (finder, pass) in ["layers", "rays", "stored"]
        .into_iter()
        .flat_map(|finder| [(1, 0), (2, 0), (3, 0), (4, 1), (5, 2)].map(|pass| (finder, pass)))
    {
        let (order, last) = pass;
        for of in ["RADIANCE", "RADIANCE VERTEX_CACHE TEXTURED", "TRANSFER", "RADIANCE VERTEX_CACHE TRANSFER"] {
            let wanted = format!("CONSUMER harmonics {of} ORDER {order} PASS {last} BATCH 8 FINDER {finder}");
            assert!(gathers.contains(&wanted), "{wanted} is not among {gathers:#?}");
        }
    }
    let names: BTreeSet<_> = variants.iter().map(|source| (source.name, source.defines.clone())).collect();
    assert_eq!(names.len(), variants.len(), "a variant stands twice");
}

#[test]
fn all_are_valid_by_the_letter() {
    let folder = tempfile::tempdir().unwrap();
    let mut texts = BTreeSet::new();
    for source in variants() {
        let (vertex, fragment) = source.resolve().unwrap();
        texts.extend([("vert", vertex), ("frag", fragment)]);
    }
    let write = |(number, (stage, text)): (usize, (&str, String))| {
        let file = folder.path().join(format!("{number}.{stage}"));
        fs::write(&file, text).unwrap();
        file
    };
    let files: Vec<_> = texts.into_iter().enumerate().map(write).collect();
    match Command::new("glslangValidator").args(&files).output() {
        Ok(output) => assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            panic!(
                "glslangValidator is not installed\n  cure: scripts/setup.sh --tests (Debian, Ubuntu: apt-get install glslang-tools)"
            )
        }
        Err(error) => panic!("glslangValidator does not run: {error}"),
    }
}

fn failure(source: &ShaderSource) -> String {
    match Program::new(&gpu(), source) {
        Err(error @ Error::Gl { .. }) => error.to_string(),
        Err(error) => panic!("not an error of GL: {error}"),
        Ok(_) => panic!("it compiles"),
    }
}

const VERTEX: &str = "#version 330 core\nin vec3 position;\nvoid main() { gl_Position = vec4(position, 1.0); }\n";

#[test]
fn broken_shaders_are_shown_with_the_drivers_words() {
    let fragment = "#version 330 core\n// A comment.\nvoid main() { undeclared_name = 1.0; }\n";
    let message = failure(&ShaderSource { name: "broken", vertex: VERTEX, fragment, defines: Vec::new(), includes: &[] });
    assert!(message.contains("shader broken does not compile on "), "{message}");
    assert!(message.contains("   3 void main() { undeclared_name = 1.0; }"), "the numbered source: {message}");
    // The driver names what it stumbles over: once in its log, once in the source.
    assert!(message.matches("undeclared_name").count() >= 2, "the log: {message}");
    assert!(message.contains("\n  cure: "), "{message}");
}

#[test]
fn stages_that_do_not_fit_are_shown_both() {
    let vertex = "#version 330 core\nout float shade;\nvoid main() { shade = 1.0; gl_Position = vec4(0.0); }\n";
    let fragment = "#version 330 core\nin vec3 shade;\nout vec3 color;\nvoid main() { color = shade; }\n";
    let message = failure(&ShaderSource { name: "apart", vertex, fragment, defines: Vec::new(), includes: &[] });
    assert!(message.contains("shader apart does not link on "), "{message}");
    assert!(message.contains("   2 out float shade;") && message.contains("   2 in vec3 shade;"), "{message}");
}

#[test]
fn arrays_hold_as_many_as_a_batch_has() {
    let sized: Vec<_> =
        variants().into_iter().flat_map(|source| source.defines).filter(|define| define.starts_with("BATCH")).collect();
    assert!(sized.len() >= 6, "{sized:?}");
    assert!(sized.iter().all(|define| *define == format!("BATCH {BATCH}")), "{sized:?}");
}

#[test]
fn missing_includes_are_named() {
    let fragment = "#version 330 core\n#include \"nowhere.glsl\"\nvoid main() {}\n";
    let message = failure(&ShaderSource { name: "lost", vertex: VERTEX, fragment, defines: Vec::new(), includes: &[] });
    assert!(message.contains("shader lost includes nowhere.glsl, which does not exist"), "{message}");
}
