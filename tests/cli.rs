//! The command-line tool: its exit codes, its output on each stream, and its files.
#![cfg(unix)]

mod common;

use std::fs::{self, Permissions};
use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use common::tool::{bytes, folder, json, names_in, refusal, scene, signal, stderr, success, text, tool};
use finalgather::image::{Channel, Image, WriteOptions};
use serde_json::{Value, json};
use tempfile::TempDir;

const SMALL: [&str; 8] = ["--size", "32", "--directions", "16", "--layer-size", "64", "--photons", "1e4"];

/// A small render with these further arguments, in `folder`.
fn small_render(folder: &TempDir, args: &[&str]) -> Command {
    let mut command = tool(folder);
    command.arg("render").arg(scene("cornell.toml")).args(SMALL).args(args);
    command
}

#[test]
fn wrong_arguments_are_usage_errors() {
    let folder = folder();
    for args in [
        ["--size", "32x"],
        ["--photons", "1.5"],
        ["--directions", "-1"],
        ["--sequence", "halton"],
        ["--backend", "glx"],
        ["--gl-device", "first"],
        ["--no-such", "option"],
    ] {
        let said = refusal(tool(&folder).arg("render").arg(scene("cornell.toml")).args(args), 2);
        assert!(said.starts_with("error: ") && said.contains(args[0]), "{args:?}: {said}");
    }
    refusal(&mut tool(&folder), 2);
    refusal(tool(&folder).arg("render"), 2);
    assert!(names_in(&folder).is_empty());
}

#[test]
fn settings_out_of_range_are_usage_errors() {
    let folder = folder();
    for (args, problem) in [
        (["--size", "0"], "size (width) is 0"),
        (["--size", "32x0"], "size (height) is 0"),
        (["--directions", "0"], "directions is 0"),
        (["--stop-fraction", "-0.5"], "stop-fraction is -0.5"),
        (["--exposure", "nan"], "not a number of stops"),
    ] {
        let said = refusal(tool(&folder).arg("render").arg(scene("cornell.toml")).args(args), 2);
        assert!(said.contains(problem) && (said.contains("\n  cure: ") || said.contains("such as")), "{args:?}: {said}");
    }
    assert!(names_in(&folder).is_empty());
}

#[test]
fn unusable_outputs_are_refused_before_anything_else() {
    let folder = folder();
    // The scene is absent too, which nothing gets to see.
    let said = |path: &str| refusal(tool(&folder).args(["render", "absent.toml", "-o", path]), 2);
    assert!(said("absent/a.png").contains("cure: make it first: mkdir -p absent"));
    assert!(said("a.jpg").contains(".exr"));
    assert!(said("a").contains(".png"));
    // Refuses new files even to root, whom permissions do not bind.
    if cfg!(target_os = "linux") {
        let said = said("/proc/a.png");
        assert!(said.contains("/proc: no file can be made") && !said.contains(".part"), "{said}");
    }
    fs::create_dir(folder.path().join("folder.exr")).unwrap();
    assert!(said("folder.exr").contains("is a folder"));
    fs::write(folder.path().join("a.txt"), "").unwrap();
    assert!(said("a.txt/b.png").contains("a.txt: is a file, no folder"));
    assert_eq!(names_in(&folder), ["a.txt", "folder.exr"]);
}

/// A file put in the place of a device would be the end of that.
#[test]
fn only_files_are_replaced() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    assert!(Command::new("mkfifo").arg(path("pipe.png")).status().unwrap().success());
    symlink("pipe.png", path("to_pipe.png")).unwrap();
    symlink("around.png", path("around.png")).unwrap();
    fs::write(path("kept.png"), "kept").unwrap();
    fs::set_permissions(path("kept.png"), Permissions::from_mode(0o444)).unwrap();
    let names = names_in(&folder);
    for (name, problem) in [
        ("pipe.png", "is no regular file"),
        ("to_pipe.png", "is no regular file"),
        ("around.png", "its links lead to each other"),
        ("kept.png", "is read-only"),
    ] {
        // Of a scene that is absent, for that is found out later.
        for command in ["render", "bake"] {
            let bake = ["--to", "camera", "--what", "ao"];
            let options = if command == "bake" { &bake[..] } else { &[] };
            let said = refusal(tool(&folder).args([command, "absent.toml", "-o", name]).args(options), 2);
            assert!(said.contains(&format!("{name}: {problem}")), "{said}");
        }
    }
    assert!(fs::metadata(path("to_pipe.png")).unwrap().file_type().is_fifo());
    assert_eq!(names_in(&folder), names);
}

#[test]
fn who_may_read_a_file_may_read_what_replaces_it() {
    let folder = folder();
    let path = folder.path().join("a.png");
    fs::write(&path, "before").unwrap();
    fs::set_permissions(&path, Permissions::from_mode(0o604)).unwrap();
    success(&mut small_render(&folder, &["-o", "a.png"]));
    assert!(fs::read(&path).unwrap().starts_with(b"\x89PNG"));
    assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o604);
}

/// Those that the scene names either.
#[test]
fn inputs_are_not_written_over() {
    let folder = folder();
    for name in ["cornell_textured.toml", "cornell_textured.obj", "cornell_textured.mtl", "tiles.png"] {
        fs::copy(scene(name), folder.path().join(name)).unwrap();
    }
    for command in [&["render", "-o", "./tiles.png"][..], &["bake", "--to", "camera", "--what", "ao", "-o", "tiles.png"]] {
        let said =
            refusal(tool(&folder).args(command).arg("cornell_textured.toml").args(["--size", "8", "--directions", "8"]), 2);
        assert!(said.contains("tiles.png: is an input"), "{said}");
    }
    for args in [&["tiles.png", "other.png"][..], &["other.png", "tiles.png"], &["other.png", "other.png", "--mask", "tiles.png"]]
    {
        fs::copy(scene("tiles.png"), folder.path().join("other.png")).unwrap();
        let said = refusal(tool(&folder).arg("compare").args(args).args(["-o", "tiles.png"]), 2);
        assert!(said.contains("tiles.png: is an input"), "{said}");
    }
    assert!(bytes(&folder, "tiles.png") == fs::read(scene("tiles.png")).unwrap());
}

#[test]
fn a_link_leads_to_what_is_written() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir(path("results")).unwrap();
    fs::write(path("results/a.png"), "before").unwrap();
    symlink("results/a.png", path("a.png")).unwrap();
    success(&mut small_render(&folder, &["-o", "a.png"]));
    assert!(path("a.png").is_symlink());
    assert!(fs::read(path("results/a.png")).unwrap().starts_with(b"\x89PNG"));
    assert_eq!(fs::read_dir(path("results")).unwrap().count(), 1, "something is left beside it");
    // To where there is nothing yet, by way of another.
    symlink("results/b.png", path("b.png")).unwrap();
    symlink("b.png", path("c.png")).unwrap();
    for (output, same) in [("a.png", "results/a.png"), ("c.png", "results/b.png"), ("c.png", "./b.png")] {
        assert!(refusal(&mut small_render(&folder, &["-o", output, "-o", same]), 2).contains("written twice"));
    }
    success(&mut small_render(&folder, &["-o", "c.png"]));
    assert!(path("c.png").is_symlink() && path("b.png").is_symlink());
    assert!(fs::read(path("results/b.png")).unwrap() == fs::read(path("results/a.png")).unwrap());
}

#[test]
fn unusable_scenes_are_bad_data() {
    let folder = folder();
    let said = refusal(tool(&folder).args(["render", "absent.toml"]), 65);
    assert!(said.starts_with("error: absent.toml:") && said.contains("\n  cure: "), "{said}");
    fs::write(folder.path().join("bad.toml"), "mesh = [").unwrap();
    let said = refusal(tool(&folder).args(["render", "bad.toml"]), 65);
    assert!(said.starts_with("error: bad.toml:"), "{said}");
    assert_eq!(names_in(&folder), ["bad.toml"]);
}

#[test]
fn a_device_that_is_not_there_is_no_gl() {
    let folder = folder();
    let said = refusal(&mut small_render(&folder, &["--backend", "egl", "--gl-device", "99"]), 69);
    assert!(said.contains("\n  cure: "), "{said}");
    assert!(names_in(&folder).is_empty());
}

#[test]
fn writes_a_png_beside_the_caller() {
    let folder = folder();
    let output = success(&mut small_render(&folder, &["-q"]));
    assert_eq!((text(&output.stdout), stderr(&output)), Default::default());
    assert_eq!(names_in(&folder), ["cornell.png"]);
    let image = Image::read(&folder.path().join("cornell.png")).unwrap();
    assert_eq!((image.width, image.height), (32, 32));
}

/// The number of directions that fits into a time is told, and gives the same picture as that number.
#[test]
fn a_time_stands_for_a_number_of_directions() {
    let folder = folder();
    let render = || {
        let mut command = tool(&folder);
        command.arg("render").arg(scene("cornell.toml")).args(["--size", "40x30", "--photons", "1e4", "--json"]);
        command
    };
    let report = json(render().args(["--time", "0.9s", "-o", "timed.exr"]));
    let directions = report["gather"]["directions"].as_u64().unwrap();
    assert_eq!(report["settings"]["directions"], directions);
    assert!(directions >= 16 && report["seconds"]["probes"].as_f64().unwrap() > 0.0, "{report}");
    success(render().args(["--directions", &directions.to_string(), "-o", "counted.exr"]));
    assert!(bytes(&folder, "timed.exr") == bytes(&folder, "counted.exr"), "{directions} directions");
    let said = refusal(render().args(["--time", "1s", "--shard", "1/2", "-o", "a.part"]), 2);
    assert!(said.contains("give --directions in place of --time"), "{said}");
    for (time, problem) in [("0", "not a time such as"), ("-1", "not a time"), ("soon", "not a time"), ("nan", "not a time")] {
        assert!(refusal(render().args(["--time", time]), 2).contains(problem), "{time}");
    }
}

#[test]
fn json_tells_all_about_the_run() {
    let folder = folder();
    let arguments = ["-o", "a.png", "-o", "b.exr", "--seed", "7", "--size", "32x24", "--json"];
    let mut command = tool(&folder);
    command.arg("render").arg(scene("cornell.toml")).args(&SMALL[2..]).args(arguments);
    let report = json(&mut command);

    let keys = |value: &Value| {
        let mut keys: Vec<_> = value.as_object().unwrap().keys().cloned().collect();
        keys.sort();
        keys.join(" ")
    };
    let top = "camera command error exposure gather gl interrupted outputs peak_memory_bytes photons pipeline scene schema seconds \
               settings version warnings";
    assert_eq!(keys(&report), top);
    assert_eq!(keys(&report["gl"]), "backend renderer version");
    for (section, numbers) in [
        ("scene", "triangles lights"),
        ("seconds", "load device prepare photons visible_points direct caustics gather film probes write total"),
        ("gather", "points directions distinct_directions rays_per_point layer_size layers_mean layers_max"),
        ("gather", "ms_per_direction samples_per_second"),
        ("photons", "emitted stored absorbed escaped cut"),
    ] {
        for key in numbers.split(' ') {
            assert!(report[section][key].is_number(), "{section}.{key} is {}", report[section][key]);
        }
    }
    let seconds = report["seconds"].as_object().unwrap();
    let stages: f64 = seconds.iter().filter(|(stage, _)| *stage != "total").map(|(_, seconds)| seconds.as_f64().unwrap()).sum();
    let share = stages / seconds["total"].as_f64().unwrap();
    assert!((0.9..=1.0).contains(&share), "the stages take {share} of the total: {seconds:?}");
    assert_eq!(report["settings"]["size"], serde_json::json!([32, 24]));
    assert_eq!(report["settings"]["seed"], 7);
    assert_eq!(report["settings"]["directions"], 16);
    assert_eq!([&report["settings"]["pipeline"], &report["pipeline"]], ["auto", "raycast"]);
    assert_eq!(report["outputs"], serde_json::json!(["a.png", "b.exr"]));
    assert_eq!(report["interrupted"], false);
    if cfg!(target_os = "linux") {
        assert!(report["peak_memory_bytes"].as_u64().unwrap() > 1 << 20);
    }

    assert_eq!(names_in(&folder), ["a.png", "b.exr"]);
    let image = Image::read(&folder.path().join("b.exr")).unwrap();
    assert_eq!((image.width, image.height), (32, 24));
    image.rgb().unwrap();
}

#[test]
fn pipelines_go_by_name() {
    let folder = folder();
    let picture = |pipeline: &str| {
        let mut command = small_render(&folder, &["--pipeline", pipeline, "--json", "-o", "a.exr"]);
        let report = json(&mut command);
        assert_eq!(report["settings"]["pipeline"], pipeline);
        let image = Image::read(&folder.path().join("a.exr")).unwrap();
        image.rgb().unwrap().map(<[f32]>::to_vec)
    };
    let pictures = ["kill", "early-kill", "fused", "raycast", "raycast-gl"].map(picture);
    for (i, a) in pictures.iter().enumerate() {
        for (j, b) in pictures.iter().enumerate().skip(i + 1) {
            let differ = (0..32 * 32).filter(|&pixel| (0..3).any(|c| a[c][pixel] != b[c][pixel])).count();
            // With layers as coarse as here, one of 8000 hits is early KILL's own.
            let alike = (i, j) == (0, 1);
            // Hits on the same piece of the photon map bring the same light, so rays and layers often agree to the bit.
            assert!(if alike { differ < 5 } else { differ > 100 }, "pipelines {i} and {j}: {differ} of 1024 pixels differ");
        }
    }
}

#[test]
fn info_lists_what_works() {
    let folder = folder();
    let info = json(tool(&folder).args(["info", "--json"]));
    let backends = info["backends"].as_array().unwrap();
    let working = backends.iter().find(|backend| backend["works"] == true).expect("a backend that works");
    assert!(working["gl"]["renderer"].is_string());
    assert!(working["gl"]["limits"]["max_texture_size"].as_u64().is_some());
    assert!(info["devices"].is_array());
    let plain = text(&success(tool(&folder).arg("info")).stdout);
    assert!(plain.contains("works") && plain.contains("renderer"), "{plain}");
}

#[test]
fn info_tells_what_is_in_a_scene() {
    let folder = folder();
    let cornell = scene("cornell.toml");
    let info = json(tool(&folder).args(["info", "--json"]).arg(&cornell));
    assert_eq!((&info["file"], &info["triangles"], &info["lights"]), (&json!("cornell.obj"), &json!(32), &json!(2)));
    assert_eq!(info["materials"].as_array().unwrap().len(), 4);
    let light = info["materials"].as_array().unwrap().iter().find(|one| one["name"] == "light").unwrap();
    // 130 by 105 millimetres.
    assert!((light["area"].as_f64().unwrap() - 130.0 * 105.0).abs() < 1.0, "{light}");
    let power = info["emitted_power"][0].as_f64().unwrap();
    assert!((power / (17.0 * std::f64::consts::PI * 130.0 * 105.0) - 1.0).abs() < 1e-3, "{power} W");
    assert_eq!(
        (&info["cameras"][0]["name"], &info["size"], &info["environment"]),
        (&json!("camera"), &json!([512, 512]), &Value::Null)
    );
    // The map of this density has as many texels as the surface has, less the gaps.
    let (density, area) = (info["light_map"]["texels_per_unit"].as_f64().unwrap(), info["area"].as_f64().unwrap());
    assert!((0.3..0.9).contains(&(density * density * area / (512.0 * 512.0))), "{density}");
    let estimate = &info["estimate"];
    assert!(estimate["pipeline"] == "raycast" && estimate["seconds"].as_f64().unwrap() > 0.0, "{estimate}");
    assert!((300 << 20..700 << 20).contains(&estimate["memory_bytes"].as_u64().unwrap()), "{estimate}");
    let plain = text(&success(tool(&folder).arg("info").arg(&cornell)).stdout);
    for fragment in [
        "cornell.obj: 8 objects, 32 triangles",
        "bounds: 0 0 0 to 556 548.8 559.2",
        "red: albedo 0.63 0.065 0.05, 2 triangles",
        "emits 17 12 4",
        "camera: at 278 273 -800",
        "2 sides of triangles emit",
        "512 x 512 texels are about",
        "1000 directions (raycast): about",
    ] {
        assert!(plain.contains(fragment), "has no {fragment}:\n{plain}");
    }
    assert!(plain.lines().count() < 30, "{plain}");
    // Long lists are cut, warnings are not.
    let many: String = (0..40).map(|i| format!("newmtl m{i}\n")).collect();
    fs::write(folder.path().join("m.mtl"), many).unwrap();
    let faces: String = (0..40).map(|i| format!("usemtl m{i}\nf 1 2 3\n")).collect();
    fs::write(folder.path().join("m.obj"), format!("mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n{faces}f 1 1 2\n")).unwrap();
    let plain = text(&success(tool(&folder).args(["info", "m.obj"])).stdout);
    assert!(
        plain.contains("and 30 more") && plain.contains("warning: m.obj: 1 of 41 triangles") && plain.contains("lights: none"),
        "{plain}"
    );
}

#[test]
fn a_reader_that_goes_away_is_no_failure() {
    let folder = folder();
    let mut child = small_render(&folder, &["--json", "-q"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), stderr(&output)), (Some(0), String::new()));
    assert_eq!(names_in(&folder), ["cornell.png"]);
}

/// A limit on the size of files stands in for a full disk: the write fails half-way.
#[test]
fn a_write_that_fails_leaves_nothing_and_the_other_files() {
    let folder = folder();
    let mut command = Command::new("sh");
    // Mesa would take the limit for its shader cache too.
    command.current_dir(&folder).env("MESA_SHADER_CACHE_DISABLE", "true");
    command.args(["-c", r#"ulimit -f 8; exec "$@""#, "sh", env!("CARGO_BIN_EXE_finalgather"), "render"]);
    command.arg(scene("cornell.toml")).args(SMALL).args(["-o", "a.exr", "-o", "b.png"]);
    let said = refusal(&mut command, 75);
    assert!(said.starts_with("error: a.exr: not written") && said.contains("\n  cure: "), "{said}");
    assert_eq!(names_in(&folder), ["b.png"]);
}

#[test]
fn interrupt_keeps_the_picture_so_far() {
    stops_with("INT", 130);
}

#[test]
fn termination_keeps_the_picture_so_far() {
    stops_with("TERM", 143);
}

#[test]
fn a_closed_terminal_keeps_the_picture_so_far() {
    stops_with("HUP", 129);
}

/// As `nohup` starts it.
#[test]
fn who_is_to_outlive_the_terminal_does() {
    let folder = folder();
    let run = format!(
        "trap '' HUP; exec {} render {} --directions 1e9",
        env!("CARGO_BIN_EXE_finalgather"),
        scene("cornell.toml").display()
    );
    let mut child = Command::new("sh").current_dir(&folder).args(["-c", &run]).stderr(Stdio::null()).spawn().unwrap();
    for _ in 0..20 {
        sleep(Duration::from_millis(50));
        assert!(signal("HUP", child.id()));
    }
    assert!(signal("TERM", child.id()));
    assert_eq!(child.wait().unwrap().code(), Some(143));
}

/// Nothing outside tells when the first direction is done, so the signal comes later and later until one was.
fn stops_with(signal: &str, code: i32) {
    let mut delay = Duration::from_millis(50);
    loop {
        assert!(delay < Duration::from_secs(120), "no direction was done after half of {delay:?}");
        let folder = folder();
        // Even where the tests were started by nohup.
        let mut command = Command::new("env");
        command
            .current_dir(&folder)
            .args(["--default-signal", env!("CARGO_BIN_EXE_finalgather"), "render"])
            .arg(scene("cornell.toml"));
        // A block of which takes longer than two signals.
        command.args(["--size", "160", "--layer-size", "64", "--photons", "1e4"]);
        command.args(["--directions", "1e9", "--json"]).stdout(Stdio::piped()).stderr(Stdio::piped());
        let child = command.spawn().unwrap();
        sleep(delay);
        // A terminal that closes says so twice.
        let times = if signal == "HUP" { 2 } else { 1 };
        let kill = vec![format!("kill -{signal} {}", child.id()); times].join("; sleep 0.005; ");
        assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
        let output = child.wait_with_output().unwrap();
        let said = stderr(&output);
        delay *= 2;
        // Too early even for the handler.
        if output.status.code().is_none() {
            assert!(names_in(&folder).is_empty());
            continue;
        }
        assert_eq!(output.status.code(), Some(code), "{said}");
        // Early, or within the first block, of which nothing is kept.
        if said.ends_with("stopped before there was a result\n") {
            assert!(output.stdout.is_empty());
            assert!(names_in(&folder).is_empty());
            continue;
        }
        assert!(said.starts_with("stopped after ") && said.contains(" of 1000000000 directions"), "{said}");
        let kept = "picture so far written to cornell.png; no checkpoint is kept (--checkpoint FILE keeps one)\n";
        assert!(said.ends_with(kept), "{said}");
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(report["interrupted"], true);
        assert_eq!(names_in(&folder), ["cornell.png"]);
        Image::read(&folder.path().join("cornell.png")).unwrap();
        return;
    }
}

/// Neither a second run nor the number of threads, here and in Mesa's software driver, changes a byte.
#[test]
fn the_same_command_writes_the_same_bytes() {
    let render = |name: &str, threads: &str, driver_threads: &str| {
        let folder = folder();
        let mut command = small_render(&folder, &["-o", "a.exr", "-o", "a.png"]);
        success(command.env("RAYON_NUM_THREADS", threads).env("LP_NUM_THREADS", driver_threads));
        [".exr", ".png"].map(|ending| fs::read(folder.path().join(format!("a{ending}"))).expect(name))
    };
    let first = render("first", "1", "1");
    assert!(render("again", "1", "1") == first);
    assert!(render("more threads", "3", "2") == first);
    assert!(render("driver without threads", "2", "0") == first);
}

/// A model without a light, under a sky.
#[test]
fn an_environment_lights_a_bare_model() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("m.obj"), "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n").unwrap();
    let render = |args: &[&str]| {
        let mut command = tool(&folder);
        command.args(["render", "m.obj", "-o", "m.exr"]).args(SMALL).args(args);
        command
    };
    assert!(refusal(&mut render(&["--no-default-light"]), 65).contains("--env"));
    assert!(refusal(&mut render(&["--env", "none.exr"]), 65).contains("none.exr: cannot read this environment"));
    let samples = vec![2.0; 2];
    let channels = ["R", "G", "B"].map(|name| Channel { name: name.into(), samples: samples.clone() });
    let sky = Image { width: 2, height: 1, channels: channels.into() };
    sky.write(&path("sky.exr"), &WriteOptions::default()).unwrap();
    success(&mut render(&["--env", "sky.exr"]));
    let image = Image::read(&path("m.exr")).unwrap();
    let (red, coverage) = (image.channel("R").unwrap(), image.channel("A").unwrap());
    // All round the same radiance: the plate, which is flat and grey, shows half of it.
    for (red, coverage) in red.iter().zip(coverage) {
        assert!((red - (2.0 - coverage)).abs() < 1e-4, "{red} of coverage {coverage}");
    }
    assert!(coverage.contains(&0.0) && coverage.contains(&1.0));
}
