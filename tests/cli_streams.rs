//! Scenes on stdin, results on stdout, and scene files that `init` writes.

mod common;

use std::fs::{self, File};
use std::path::Path;
use std::process::Command;

use common::tool::{bytes, folder, json, refusal, scene, small_scene, stderr, success, text, tool};

const QUICK: [&str; 6] = ["--size", "16", "--directions", "16", "--photons", "1000"];

/// A command that reads this file on stdin.
fn piped(folder: &Path, name: &str) -> Command {
    let mut command = tool(folder);
    command.stdin(File::open(folder.join(name)).unwrap());
    command
}

#[test]
fn a_render_is_a_filter() {
    let folder = folder();
    small_scene(folder.path());
    success(tool(&folder).args(["render", "small.toml", "-o", "a.png", "-o", "a.exr"]).args(QUICK));
    let sent = success(piped(folder.path(), "small.toml").args(["render", "-"]).args(QUICK));
    assert!(sent.stdout == bytes(&folder, "a.png"));
    assert!(stderr(&sent).starts_with("stdout: 16x16, "), "{}", stderr(&sent));
    let sent = success(tool(&folder).args(["render", "small.toml", "-o", "exr:-"]).args(QUICK));
    assert!(sent.stdout == bytes(&folder, "a.exr"));
    // The model finds its materials in the current folder.
    let of_model = success(piped(folder.path(), "cornell.obj").args(["render", "-"]).args(QUICK)).stdout;
    success(tool(&folder).args(["render", "cornell.obj", "-o", "b.png"]).args(QUICK));
    assert!(of_model == bytes(&folder, "b.png"));
}

#[test]
fn a_bake_is_a_filter() {
    let folder = folder();
    fs::write(folder.path().join("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let bake = ["bake", "-", "--to", "vertices", "--what", "ao", "--directions", "8"];
    let sent = success(piped(folder.path(), "m.obj").args(bake).args(["-o", "npy:-"])).stdout;
    success(tool(&folder).args(["bake", "m.obj"]).args(&bake[2..]).args(["-o", "m.npy"]));
    assert!(sent == bytes(&folder, "m.npy"));
    assert!(success(piped(folder.path(), "m.obj").args(bake).args(["-o", "vertices:npy:-"])).stdout == sent);
    let about = json(piped(folder.path(), "m.obj").args(["info", "-", "--json"]));
    assert_eq!((&about["file"], &about["triangles"]), (&"stdin.obj".into(), &1.into()));
}

#[test]
fn streams_hold_one_thing() {
    let folder = folder();
    small_scene(folder.path());
    fs::write(folder.path().join("empty"), "").unwrap();
    let refused = |command: &mut Command, code| refusal(command, code);
    let render = |options: &[&str]| refused(tool(&folder).args(["render", "small.toml"]).args(options), 2);
    assert!(render(&["-o", "-", "-o", "exr:-"]).contains("stdout holds one result"));
    assert!(render(&["-o", "-", "--json"]).contains("--json is on it too"));
    assert!(render(&["-o", "-", "--resume"]).contains("stdout has no checkpoint to go on from"));
    let bake = refused(tool(&folder).args(["bake", "small.toml", "--to", "vertices", "-o", "-"]), 2);
    assert!(bake.contains("as in -o ply:-"), "{bake}");
    let bake = refused(tool(&folder).args(["bake", "cornell.obj", "--to", "lightmap", "-o", "obj:-"]), 2);
    assert!(bake.contains("an OBJ has files beside it"), "{bake}");
    // A merge would not find the scene.
    let bake = ["bake", "-", "--to", "vertices", "--what", "ao", "--shard", "1/2", "-o", "1.part"];
    assert!(refused(piped(folder.path(), "cornell.obj").args(bake), 2).contains("stdin has none"));
    assert!(refused(piped(folder.path(), "empty").args(["render", "-"]), 65).contains("stdin: it is empty"));
}

#[test]
fn init_writes_a_scene_that_renders_as_the_model() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    for name in ["cornell.obj", "cornell.mtl"] {
        fs::copy(scene(name), path(name)).unwrap();
    }
    fs::write(path("dark.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0.5\nf 1 2 3\n").unwrap();
    for model in ["cornell", "dark"] {
        let said = stderr(&success(tool(&folder).args(["init", &format!("{model}.obj")])));
        assert!(said.ends_with(&format!("{model}.toml: written; edit it, then: finalgather render {model}.toml\n")), "{said}");
        for ending in ["obj", "toml"] {
            success(tool(&folder).args(["render", &format!("{model}.{ending}"), "-o", &format!("{ending}.png")]).args(QUICK));
        }
        assert!(bytes(&folder, "obj.png") == bytes(&folder, "toml.png"), "{model}");
    }
    // Every line can be taken into use.
    let written = text(&bytes(&folder, "cornell.toml"));
    let (head, body) = written.split_once('\n').unwrap();
    assert!(head.starts_with("# ") && body.contains("# [materials.white]\n# albedo = [0.725, 0.71, 0.68]\n"), "{written}");
    // An environment and a sky exclude each other.
    let kept = body.lines().filter(|line| !line.contains("sky") && !line.contains("turbidity"));
    let used: String = kept.map(|line| format!("{}\n", line.trim_start_matches("# "))).collect();
    let used = used
        .replace("Light from outside, beside that of lamps and materials that emit.\n", "")
        .replace("Lamps without a surface.\n", "")
        .replace("Materials, with the values of the model.\n", "");
    fs::write(path("used.toml"), used).unwrap();
    success(tool(&folder).args(["render", "used.toml", "-o", "used.png"]).args(QUICK));

    assert!(refusal(tool(&folder).args(["init", "cornell.obj"]), 2).contains("cornell.toml: is there already"));
    success(tool(&folder).args(["init", "cornell.obj", "--force"]));
    success(tool(&folder).args(["init", "cornell.obj", "--flip", "-o", "flipped.toml"]));
    let flipped = text(&bytes(&folder, "flipped.toml"));
    assert!(flipped.contains("mesh = \"cornell.obj\"\nflip = true\n\n[camera]\n"), "{flipped}");
    assert!(refusal(tool(&folder).args(["init", "cornell.obj", "-o", "a.txt"]), 2).contains("end it in .toml"));
    assert!(refusal(tool(&folder).args(["init", "-"]), 2).contains("stdin has none"));
    assert!(refusal(tool(&folder).args(["init", "cornell.toml"]), 2).contains("is a scene file already"));
    fs::create_dir(path("below")).unwrap();
    let said = refusal(tool(&folder).args(["init", "cornell.obj", "-o", "below/a.toml"]), 2);
    assert!(said.contains("cornell.obj: lies outside the folder of the scene file, below\n"), "{said}");
    let sent = success(tool(&folder).args(["init", "cornell.obj", "-o", "-"])).stdout;
    assert_eq!(text(&sent).trim_end(), written.trim_end());
}
