//! Every shader is used, compiles on this driver, and passes the reference compiler glslangValidator.

mod common;

use std::path::Path;
use std::process::Command;
use std::{fs, io};

use common::{gpu, writes_images};
use finalgather::error::Error;
use finalgather::gpu::{Program, ShaderSource};
use finalgather::shaders::{self, ALL, WITH_IMAGES};

/// The names and texts of the files in a folder.
fn files(folder: &str) -> Vec<(String, String)> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let files = entries.filter(|path| path.is_file());
    files.map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), fs::read_to_string(&path).unwrap())).collect()
}

fn both() -> impl Iterator<Item = &'static &'static ShaderSource> {
    ALL.iter().chain(&WITH_IMAGES)
}

#[test]
fn all_compile_and_link_here() {
    let gpu = gpu();
    let with_images = if writes_images(&gpu) { &WITH_IMAGES[..] } else { &[] };
    for source in ALL.iter().chain(with_images) {
        Program::new(&gpu, source).unwrap_or_else(|error| panic!("{error}"));
    }
}

#[test]
fn no_file_is_dead() {
    for (name, text) in files("glsl") {
        let used = match name.strip_suffix(".frag") {
            Some(name) => both().any(|source| source.name == name && source.fragment == text),
            None => both().any(|source| source.vertex == text),
        };
        assert!(used, "glsl/{name} is part of no program in src/shaders.rs");
        let with_images = WITH_IMAGES.iter().any(|source| source.fragment == text);
        let version = if with_images { "#version 420 core\n" } else { "#version 330 core\n" };
        assert!(text.starts_with(version), "glsl/{name} is not for GLSL of {version}");
    }
    for (name, text) in files("glsl/include") {
        let line = format!("#include \"{name}\"");
        let used = both().any(|source| {
            let by_another = source.includes.iter().any(|(_, text)| text.contains(&line));
            source.vertex.contains(&line) || source.fragment.contains(&line) || by_another
        });
        assert!(used, "no shader includes glsl/include/{name}");
        assert!(!text.contains("#version"), "glsl/include/{name} would repeat #version");
    }
}

#[test]
fn all_are_valid_by_the_letter() {
    let folder = tempfile::tempdir().unwrap();
    for source in both() {
        let (vertex, fragment) = source.resolve().unwrap();
        for (stage, text) in [("vert", vertex), ("frag", fragment)] {
            let file = folder.path().join(format!("{}_{}.{stage}", source.name, source.defines.concat()));
            fs::write(&file, text).unwrap();
            check(&file);
        }
    }
}

fn check(file: &Path) {
    match Command::new("glslangValidator").arg(file).output() {
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
    let message = failure(&ShaderSource { name: "broken", vertex: VERTEX, fragment, defines: &[], includes: &[] });
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
    let message = failure(&ShaderSource { name: "apart", vertex, fragment, defines: &[], includes: &[] });
    assert!(message.contains("shader apart does not link on "), "{message}");
    assert!(message.contains("   2 out float shade;") && message.contains("   2 in vec3 shade;"), "{message}");
}

#[test]
fn arrays_hold_as_many_as_a_batch_has() {
    let sized: Vec<_> = both().flat_map(|source| source.defines).filter(|define| define.starts_with("BATCH")).collect();
    assert!(sized.len() >= 6, "{sized:?}");
    assert!(sized.iter().all(|define| **define == format!("BATCH {}", shaders::BATCH)), "{sized:?}");
}

#[test]
fn missing_includes_are_named() {
    let fragment = "#version 330 core\n#include \"nowhere.glsl\"\nvoid main() {}\n";
    let message = failure(&ShaderSource { name: "lost", vertex: VERTEX, fragment, defines: &[], includes: &[] });
    assert!(message.contains("shader lost includes nowhere.glsl, which does not exist"), "{message}");
}
