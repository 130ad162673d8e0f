//! A scene reads no file outside its folder, and the command-line tool refuses malformed inputs.

use std::fs;
use std::path::Path;
#[cfg(unix)]
use std::process::Command;
use std::sync::mpsc;
use std::thread;

use finalgather::blocks::Part;
use finalgather::error::Error;
use finalgather::scene::{Files, LoadOptions, World};
use serde_json::{Value, json};

use super::PATIENCE;
use super::common::tool;
use super::forged::{bmp, exr, npy, png, seed};

/// A folder with a scene of two folders in it, `scene` and `scene/parts`, and beside it what is none of its business. A model, its library, a picture and a
/// sky are in all three.
fn neighbours() -> tempfile::TempDir {
    let folder = tool::folder();
    for place in [".", "scene", "scene/parts"] {
        let place = folder.path().join(place);
        fs::create_dir_all(&place).unwrap();
        for (name, from) in [("t.tga", "texture/rgb.png"), ("e.hdr", "environment/sky.hdr")] {
            fs::write(place.join(name), seed(from)).unwrap();
        }
        fs::write(place.join("m.mtl"), "newmtl lamp\nKe 5 5 5\nmap_Kd t.tga\n").unwrap();
        fs::write(place.join("m.obj"), "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 1\nusemtl lamp\nf 1/1 2/1 3/1\n").unwrap();
    }
    folder
}

const MODEL: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl lamp\nf 1 2 3\n";

#[test]
fn a_scene_reads_nothing_outside_its_folder() {
    let folder = neighbours();
    let path = |name: &str| folder.path().join(name);
    let absolute = path("m.obj").display().to_string();
    let inside = path("scene/parts/m.obj").display().to_string();
    let library = "newmtl lamp\nKe 5 5 5\n";
    #[cfg(unix)]
    for (link, target) in [("link.obj", "m.obj"), ("link.mtl", "m.mtl"), ("link.tga", "t.tga"), ("link.hdr", "e.hdr")] {
        std::os::unix::fs::symlink(Path::new("..").join(target), path("scene").join(link)).unwrap();
    }
    let outside: Vec<(&str, String)> = vec![
        ("s.toml", "mesh = '../m.obj'".into()),
        ("s.toml", "mesh = 'parts/../../m.obj'".into()),
        ("s.toml", "mesh = '..\\m.obj'".into()),
        ("s.toml", format!("mesh = '{absolute}'")),
        // Not even looked for.
        ("s.toml", "mesh = '../none.obj'".into()),
        ("s.toml", "mesh = '/dev/zero'".into()),
        ("s.toml", "mesh = 'm.obj'\nmaterials.lamp.albedo_texture = '../t.tga'".into()),
        ("s.toml", "mesh = 'm.obj'\nenvironment.file = '../e.hdr'".into()),
        ("m.obj", MODEL.replace("m.mtl", "../m.mtl")),
        ("m.obj", MODEL.replace("m.mtl", "../none.mtl")),
        ("m.mtl", format!("{library}map_Kd ../t.tga\n")),
        #[cfg(unix)]
        ("s.toml", "mesh = 'link.obj'".into()),
        #[cfg(unix)]
        ("s.toml", "mesh = 'm.obj'\nenvironment.file = 'link.hdr'".into()),
        #[cfg(unix)]
        ("m.obj", MODEL.replace("m.mtl", "link.mtl")),
        #[cfg(unix)]
        ("m.mtl", format!("{library}map_Kd link.tga\n")),
    ];
    let sound = [("s.toml", "mesh = 'm.obj'"), ("m.obj", MODEL), ("m.mtl", library)];
    let restore = || sound.into_iter().for_each(|(name, text)| fs::write(path("scene").join(name), text).unwrap());
    let with = |files| LoadOptions { files, ..LoadOptions::default() };
    for (name, text) in outside {
        restore();
        fs::write(path("scene").join(name), &text).unwrap();
        let strict = LoadOptions { strict: true, ..LoadOptions::default() };
        let error = World::load_with(&path("scene/s.toml"), strict).map(drop).expect_err(&text);
        let message = error.to_string();
        assert!(matches!(error, Error::Input { .. }), "{text}: {message}");
        assert!(message.contains("outside the scene's folder") && message.contains("--allow-outside"), "{text}: {message}");
        // Where faults are mended, the scene does without.
        if let Ok(loaded) = World::load(&path("scene/s.toml")) {
            assert!(!name.ends_with("toml"), "{text}");
            let inside = fs::canonicalize(path("scene")).unwrap();
            assert!(loaded.report.files.iter().all(|file| file.starts_with(&inside)), "{text}: {:?}", loaded.report.files);
            assert!(loaded.report.warnings[0].contains("outside the scene's folder"), "{text}: {:?}", loaded.report.warnings);
        } else {
            assert!(name.ends_with("toml"), "{text}");
        }
        // Asked to, it is read, or missed.
        match World::load_with(&path("scene/s.toml"), with(Files::Anywhere)) {
            Ok(loaded) => assert_eq!(loaded.world.meshes[0].triangles.len(), 1),
            Err(error) if text.contains("none") || text.contains("/dev") => {
                assert!(error.to_string().contains("cannot read"), "{text}: {error}");
            }
            Err(error) => panic!("{text}: {error}"),
        }
    }
    // What is in the folder may go by any name, and what was asked for may lie anywhere.
    for (name, text) in [
        ("s.toml", format!("mesh = '{inside}'")),
        ("s.toml", "mesh = 'parts/../parts/m.obj'\nenvironment.file = 'parts/../e.hdr'".into()),
        ("s.toml", "mesh = '../scene/m.obj'".into()),
        ("parts/m.mtl", format!("{library}map_Kd ../t.tga\n")),
    ] {
        restore();
        fs::write(path("scene").join(name), &text).unwrap();
        World::load(&path("scene/s.toml")).unwrap_or_else(|error| panic!("{text}: {error}"));
    }
    #[cfg(unix)]
    {
        restore();
        std::os::unix::fs::symlink("parts/m.obj", path("scene/own.obj")).unwrap();
        std::os::unix::fs::symlink("scene/s.toml", path("far.toml")).unwrap();
        World::load(&path("scene/own.obj")).unwrap();
        // Its folder is where it was found.
        World::load(&path("far.toml")).unwrap();
    }
}

#[test]
fn what_is_no_file_is_not_waited_for() {
    let folder = tool::folder();
    fs::create_dir(folder.path().join("m.obj")).unwrap();
    let error = World::load(&folder.path().join("m.obj")).map(drop).unwrap_err();
    assert!(error.to_string().contains("it is a folder"), "{error}");
    #[cfg(unix)]
    {
        let pipe = folder.path().join("p.ply");
        assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let (sender, receiver) = mpsc::channel();
        thread::spawn(move || sender.send(finalgather::points::file::read(&pipe).map(drop)));
        let error = receiver.recv_timeout(PATIENCE).expect("waits for a writer").unwrap_err();
        assert!(error.to_string().contains("no regular file"), "{error}");
    }
}

/// What the tool says, having ended with `code`, written nothing and not panicked.
fn refusal(folder: &Path, arguments: &str, code: i32) -> String {
    let said = tool::refusal(tool::tool(folder).args(arguments.split(' ')), code);
    assert!(said.contains("cure: ") && !said.contains("panicked"), "{arguments}: {said}");
    let names = tool::names_in(folder);
    assert!(!names.iter().any(|name| name.starts_with("out") || name.contains("finalgather")), "{arguments} left {names:?}");
    said
}

/// The checksum of a part proves nothing about what it says.
#[test]
fn parts_of_bakes_are_sound_or_refused() {
    let folder = neighbours();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("s.toml"), "mesh = 'm.obj'\n[settings]\nsize = [8, 8]\ndirections = 8\nphotons = 100\n").unwrap();
    let bake = "bake s.toml --to camera --what ao --layer-size 16 --shard 1/1 -o sound.part";
    tool::success(tool::tool(&folder).args(bake.split(' ')));
    let sound = Part::read(&path("sound.part")).unwrap();
    type Change = fn(&mut Value, &mut Value);
    let changes: [Change; 13] = [
        |job, _| job["plan"] = json!(7),
        |job, _| job["plan"]["order"] = json!(100),
        |job, _| job["settings"]["size"] = json!([4_294_967_295_u32, 4_294_967_295_u32]),
        |job, _| job["settings"]["directions"] = json!(0),
        |job, _| job["version"] = json!("0.0.0"),
        |_, state| state["runs"] = json!([]),
        |_, state| state["runs"][0]["count"] = json!(4_294_967_295_u32),
        |_, state| state["runs"][0]["count"] = json!(1_u64 << 60),
        |_, state| state["runs"][0]["turn"]["of"] = json!(0),
        |_, state| state["memory"] = json!(-1),
        |_, state| state["request"] = Value::Null,
        |_, state| state["request"]["scene"]["path"] = json!("none.obj"),
        |_, state| state["request"]["work"] = json!("render"),
    ];
    for (i, change) in changes.into_iter().enumerate() {
        let (mut job, mut state) = (sound.job.clone(), sound.state.clone());
        change(&mut job, &mut state);
        let mut part = Part::new(job, state);
        sound.names().for_each(|name| part.put(name, sound.get(name).unwrap()));
        part.write(&path("false.part")).unwrap();
        let said = refusal(folder.path(), "merge false.part -o out.npy", 65);
        assert!(said.contains("false.part") || said.contains("none.obj"), "change {i}: {said}");
    }
    tool::success(tool::tool(&folder).args("merge sound.part -o out.npy".split(' ')));
}

#[test]
fn the_tool_ends_with_words_and_no_file() {
    let folder = neighbours();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("s.toml"), "mesh = 'm.obj'\n[settings]\nsize = [8, 8]\ndirections = 2\nphotons = 100\n").unwrap();
    fs::write(path("huge.toml"), "mesh = 'm.obj'\n[settings]\nsize = [4000000000, 4000000000]\n").unwrap();
    fs::write(path("deep.toml"), format!("camera = {}", "[".repeat(100_000))).unwrap();
    fs::write(path("escape.obj"), MODEL.replace("usemtl lamp", "usemtl \x1b[2J\x07lamp")).unwrap();
    fs::write(path("bomb.tga"), bmp(16384, 16384)).unwrap();
    fs::write(path("bomb.toml"), "mesh = 'm.obj'\nmaterials.lamp.albedo_texture = 'bomb.tga'\n").unwrap();
    fs::write(path("bomb.png"), png(30_000, 30_000)).unwrap();
    fs::write(path("bomb.exr"), exr("environment/sky.exr", [3, 1], [8191, 4095])).unwrap();
    fs::write(path("cut.hdr"), &seed("environment/sky.hdr")[..70]).unwrap();
    fs::write(path("p.csv"), "0,0,0,0,0,1\n0,0,0,nan,0,1\n").unwrap();
    fs::write(path("prt.npy"), npy("4294967296, 4294967296, 4294967296", b"")).unwrap();
    fs::write(path("prt.json"), seed("transfer/prt.json")).unwrap();
    fs::write(path("scene/s.toml"), "mesh = '../m.obj'\n[settings]\nsize = [8, 8]\ndirections = 2\nphotons = 100\n").unwrap();
    for arguments in [
        "render huge.toml -o out.png",
        "render deep.toml -o out.png",
        "render bomb.toml -o out.png -o out.exr",
        "render s.toml --env cut.hdr -o out.png",
        "render s.toml --env bomb.exr -o out.png",
        "bake s.toml --to points:p.csv --what ao -o out.npy",
        "bake deep.toml --to vertices --what ao -o out.ply",
        "relight prt.npy --env e.hdr -o out.npy",
        "compare bomb.png bomb.png -o out.png",
        "compare bomb.exr bomb.exr",
        "bench deep.toml",
    ] {
        refusal(folder.path(), arguments, 65);
    }
    refusal(folder.path(), "render s.toml --size 4000000000 -o out.png", 2);
    // A name in a file is no command to the terminal.
    let said = refusal(folder.path(), "render escape.obj --strict -o out.png", 65);
    assert!(said.contains("[2J") && !said.contains(['\x1b', '\x07']), "{said:?}");
    // Each command that loads a scene asks before it leaves the folder.
    fs::write(path("prt.npy"), seed("transfer/prt.npy")).unwrap();
    for (arguments, code) in [
        ("render scene/s.toml -o out.png", 0),
        ("bake scene/s.toml --to vertices --what ao -o out.npy", 0),
        // Too dark to measure, and of other vertices, as is found out once they are read.
        ("bench scene/s.toml --size 8 --directions 1 --pipelines kill --rounds 1 --photons 100", 2),
        ("relight prt.npy --env e.hdr --scene scene/s.toml -o out.npy", 65),
    ] {
        assert!(refusal(folder.path(), arguments, 65).contains("--allow-outside"), "{arguments}");
        let allowed = format!("{arguments} --allow-outside");
        let output = tool::tool(&folder).args(allowed.split(' ')).output().unwrap();
        let said = tool::stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{allowed}: {said}");
        assert!(!said.contains("outside"), "{allowed}: {said}");
        ["out.png", "out.npy", "out.json", "out.sources.npy"].into_iter().for_each(|name| drop(fs::remove_file(path(name))));
    }
}
