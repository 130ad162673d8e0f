//! What the tool says: messages, progress, the line at the end, help, completions and manual pages.

mod common;

use std::fs;
use std::process::Command;

use common::need::need;
use common::tool::{bytes, folder, names_in, refusal, small_scene, stderr, success, text, tool};

const QUICK: [&str; 6] = ["--size", "16", "--directions", "16", "--photons", "1000"];

/// A model without light, and with one triangle that has no area.
const MODEL: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 1 2\n";

#[test]
fn the_last_line_says_what_was_made() {
    let folder = folder();
    let scene = small_scene(folder.path());
    let output = success(tool(&folder).arg("render").arg(&scene).args(QUICK).args(["-o", "a.png", "-o", "a.exr"]));
    let said = stderr(&output);
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.starts_with("a.png, a.exr: 16x16, "), "{said}");
    for part in [" points, 16 directions, error ", " %, ", " s ("] {
        assert!(said.contains(part), "{part:?}: {said}");
    }
    fs::write(folder.path().join("m.obj"), MODEL).unwrap();
    let said = stderr(&success(tool(&folder).args([
        "bake",
        "m.obj",
        "--to",
        "vertices",
        "--what",
        "ao",
        "--directions",
        "8",
        "-o",
        "m.ply",
    ])));
    let last = said.lines().last().unwrap();
    assert!(last.starts_with("m.ply: 3 points of vertices, 8 directions, "), "{said}");
    assert!(last.ends_with(", 1 warning"), "{said}");
}

#[test]
fn less_and_more_is_said() {
    let folder = folder();
    fs::write(folder.path().join("m.obj"), MODEL).unwrap();
    let say =
        |options: &[&str]| stderr(&success(tool(&folder).args(["render", "m.obj", "-o", "m.png"]).args(QUICK).args(options)));
    let usual = say(&[]);
    assert!(usual.contains("warning: m.obj: 1 of 2 triangles has no area"), "{usual}");
    let quiet = say(&["-q"]);
    assert!(quiet.contains("warning: ") && !quiet.contains("directions"), "{quiet}");
    assert_eq!(say(&["-qq"]), "");
    let more = say(&["-v", "--threads", "1"]);
    for part in ["1 CPU thread\n", "read ", "OpenGL: ", "pipeline ", "gathering took "] {
        assert!(more.contains(part) && !usual.contains(part), "{part:?}: {more}");
    }
    // Errors are always said.
    assert!(refusal(tool(&folder).args(["render", "none.obj", "-qq"]), 65).starts_with("error: none.obj: "));
    assert!(refusal(tool(&folder).args(["render", "m.obj", "--threads", "0"]), 2).contains("threads from 1 to 1024"));
}

#[test]
fn colours_are_of_the_terminal_or_as_asked() {
    let folder = folder();
    let of = |options: &[&str]| stderr(&tool(&folder).args(["render", "none.obj"]).args(options).output().unwrap());
    assert!(!of(&[]).contains('\x1b'));
    let coloured = of(&["--color", "always"]);
    assert!(coloured.contains("\x1b[1m\x1b[31merror:\x1b[0m none.obj"), "{coloured:?}");
    // Also those of clap.
    assert!(of(&["--color=always", "--nonsense"]).contains('\x1b'));
    assert!(!of(&["--color", "never", "--nonsense"]).contains('\x1b'));
    assert!(!of(&["--nonsense"]).contains('\x1b'));
}

#[test]
fn progress_is_one_line_of_a_terminal() {
    if need("script", Command::new("script").arg("--version").output()).is_none() {
        return;
    }
    let folder = folder();
    let scene = small_scene(folder.path());
    let command = format!(
        "stty cols 80; {} render {} -o a.png --size 64 --directions 256",
        env!("CARGO_BIN_EXE_finalgather"),
        scene.display()
    );
    let output = success(Command::new("script").args(["-qec", &command, "/dev/null"]).current_dir(&folder).env("TERM", "xterm"));
    let shown = text(&output.stdout);
    // Each state of the line begins after a carriage return or a control sequence.
    let states: Vec<_> = shown.split(['\r', '\n']).map(plain).collect();
    assert!(states.iter().any(|state| state.contains("gathering") && state.contains(" %")), "{shown:?}");
    let longest = states.iter().filter(|state| state.contains("gathering")).map(|state| state.chars().count()).max();
    assert!(longest.is_some_and(|length| length <= 80), "{longest:?}: {shown:?}");
    assert!(states.iter().any(|state| state.starts_with("a.png: 64x64, ")), "{shown:?}");
}

/// A text without control sequences.
fn plain(text: &str) -> String {
    let mut parts = text.split('\x1b');
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |text, part| text + part.split_once(|c: char| c.is_ascii_alphabetic()).map_or("", |(_, rest)| rest))
}

#[test]
fn a_wrong_path_names_the_one_that_was_meant() {
    let folder = folder();
    small_scene(folder.path());
    for (given, part) in [
        ("small.tml", "error: small.tml: there is no such file; like it: small.toml\n"),
        ("cornell", "error: cornell: there is no such file; like it: cornell.mtl\n"),
        ("scens/small.toml", "error: scens/small.toml: there is no folder scens\n"),
        (".", "error: .: it is a folder\n  cure: give a file in it: ./cornell.obj, ./small.toml\n"),
        ("cornell.mtl", "error: cornell.mtl: not a kind of scene that can be read\n"),
    ] {
        for command in [&["render"][..], &["info"], &["bake", "--to", "vertices", "-o", "a.ply"]] {
            let said = refusal(tool(&folder).args(command).arg(given), 65);
            assert!(said.starts_with(part), "{command:?} {given}: {said}");
        }
    }
    assert!(refusal(tool(&folder).args(["compare", "smal.png", "b.png"]), 65).contains("there is no such file\n"));
    let said = refusal(tool(&folder).arg("small.toml"), 2);
    assert_eq!(said, "error: small.toml: which command?\n  cure: finalgather render small.toml\n");
}

#[test]
fn help_is_short_and_of_the_command() {
    let folder = folder();
    let help = |options: &[&str]| text(&success(tool(&folder).args(options)).stdout);
    let (short, long) = (help(&["render", "-h"]), help(&["render", "--help"]));
    assert!(2 * short.lines().count() < long.lines().count(), "{short}");
    for option in ["--sequence", "--backend", "--checkpoint-every", "Exit codes"] {
        assert!(long.contains(option) && !short.contains(option), "{option}: {short}");
    }
    let bake = help(&["bake", "--help"]);
    for option in ["--estimator", "--interleave", "--points ", "--target-error"] {
        assert!(!bake.contains(option), "{option}: {bake}");
    }
}

#[test]
fn options_without_effect_are_told() {
    let folder = folder();
    fs::write(folder.path().join("m.obj"), MODEL).unwrap();
    let mut command = tool(&folder);
    command.args(["bake", "m.obj", "--to", "vertices", "--what", "ao", "-o", "m.ply", "--directions", "8"]);
    // With 8 directions, squares of 16 pixels would be refused in a picture.
    let said = stderr(&success(command.args(["--size", "64", "--interleave", "4", "--estimator", "plain"])));
    for option in ["size", "interleave", "estimator"] {
        assert!(said.contains(&format!("warning: --{option} has no effect here: ")), "{option}: {said}");
    }
    let said = refusal(tool(&folder).args(["bake", "m.obj", "--to", "lightmap", "-o", "m.exr", "--resolution", "256x128"]), 2);
    assert!(said.contains("not a square; give 256"), "{said}");
    let said = refusal(tool(&folder).args(["render", "m.obj", "--size", "64x"]), 2);
    assert!(said.contains("not a size such as 640x480, or 512 for a square"), "{said}");
    let said = refusal(tool(&folder).args(["render", "m.obj", "--target-error", "small"]), 2);
    assert!(said.contains("not a number such as 0.01, or a percentage such as 1%"), "{said}");
}

#[test]
fn shells_learn_the_options() {
    let folder = folder();
    for shell in ["bash", "zsh", "fish", "powershell"] {
        let script = text(&success(tool(&folder).args(["completions", shell])).stdout);
        assert!(script.contains("target-error") && script.contains("relight"), "{shell}");
    }
    if need("bash", Command::new("bash").arg("--version").output()).is_none() {
        return;
    }
    let script = success(tool(&folder).args(["completions", "bash"])).stdout;
    fs::write(folder.path().join("c.sh"), script).unwrap();
    let ask = "source ./c.sh; COMP_WORDS=(finalgather render --dir); COMP_CWORD=2; _finalgather finalgather --dir render; echo ${COMPREPLY[@]}";
    let answer = text(&success(Command::new("bash").args(["-c", ask]).current_dir(&folder)).stdout);
    assert_eq!(answer.trim(), "--directions");

    fs::create_dir(folder.path().join("man")).unwrap();
    success(tool(&folder).args(["man", "man"]));
    let pages = names_in(folder.path().join("man"));
    for page in ["finalgather.1", "finalgather-render.1", "finalgather-bake.1", "finalgather-init.1"] {
        assert!(pages.iter().any(|name| name == page), "{page}: {pages:?}");
    }
    let page = text(&bytes(&folder, "man/finalgather-render.1"));
    assert!(page.contains(".TH finalgather-render 1") && page.contains("Photons that the lights emit"), "{page}");
    assert!(refusal(tool(&folder).args(["man", "none"]), 2).contains("none: there is no such folder"));
}
