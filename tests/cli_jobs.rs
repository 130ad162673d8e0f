//! Long jobs. A run resumed from a checkpoint, and merged shards, give the same bits as one run. Parts of different jobs are refused.
#![cfg(unix)]

mod common;

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use common::tool::{bytes, folder, json, names_in, number_after, refusal, signal, stderr, success, tool, wait_for};
use serde_json::{Value, json as value};
use tempfile::TempDir;

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell.toml");
const SMALL: [&str; 8] = ["--size", "24", "--directions", "200", "--layer-size", "64", "--photons", "1e4"];
const VALUES: [&str; 12] = [
    "--to",
    "vertices",
    "--to",
    "lightmap",
    "--resolution",
    "32",
    "--what",
    "irradiance,ao,sh,prt",
    "--order",
    "2",
    "--samples-per-texel",
    "1",
];
/// The longest that a run may take to its first checkpoint, on a loaded machine.
const PATIENCE: Duration = Duration::from_secs(300);
const RECEIVERS: [&str; 4] = ["-o", "vertices:a.npy", "-o", "lightmap:a.exr"];

fn run(folder: &TempDir, args: &[&[&str]]) -> Command {
    let mut command = tool(folder);
    command.args(args.concat());
    command
}

fn render(folder: &TempDir, args: &[&str]) -> Command {
    run(folder, &[&["render", SCENE], &SMALL, args])
}

fn bake(folder: &TempDir, args: &[&str]) -> Command {
    run(folder, &[&["bake", SCENE], &SMALL, &VALUES, args])
}

#[test]
fn shards_of_a_render_make_the_bytes_of_one_run() {
    let folder = folder();
    // Beyond the photons' first map.
    let settings = ["--interleave", "2", "--exposure", "0.5", "--directions", "1100"];
    success(&mut render(&folder, &[&settings[..], &["-o", "one.exr", "-o", "one.png"]].concat()));
    for shard in ["1/3", "2/3", "3/3"] {
        let report = json(&mut render(&folder, &[&settings[..], &["--shard", shard, "-o", "{shard}.part", "--json"]].concat()));
        assert_eq!(report["outputs"][0], shard.replace("/3", ".part"));
    }
    success(&mut run(&folder, &[&["merge", "3.part", "1.part", "2.part", "-o", "merged.exr", "-o", "merged.png"]]));
    for ending in ["exr", "png"] {
        assert!(bytes(&folder, &format!("one.{ending}")) == bytes(&folder, &format!("merged.{ending}")), "{ending} differs");
    }
}

/// The merge needs no OpenGL: what the camera saw is in the parts.
#[test]
fn shards_of_a_bake_make_the_bytes_of_one_run() {
    let folder = folder();
    let (camera, files) = (["--to", "camera"], ["a.npy", "a.json", "a.exr", "c.exr", "c.ply"]);
    let receivers = [&RECEIVERS[..], &["-o", "camera:c.exr", "-o", "camera:c.ply"]].concat();
    success(&mut bake(&folder, &[&camera[..], &receivers].concat()));
    let one = files.map(|name| bytes(&folder, name));
    files.iter().for_each(|name| fs::remove_file(folder.path().join(name)).unwrap());
    // As tasks of an engine, of which the merge is none; one of them with less memory.
    for (index, memory) in [("0", "256"), ("1", "1024")] {
        let mut shard = bake(&folder, &[&camera[..], &["--shard", "auto/2", "--memory", memory, "-o", "{shard}.part"]].concat());
        success(shard.env("JOB_COMPLETION_INDEX", index));
    }
    // A file of another bake is not the merge's.
    fs::write(folder.path().join("a.npy.checkpoint"), "of another").unwrap();
    let without_gl = |mut command: Command| {
        command.env("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere").env("GALLIUM_DRIVER", "none");
        command
    };
    let baked = without_gl(bake(&folder, &[&camera[..], &receivers].concat())).output().unwrap();
    assert!(!baked.status.success(), "there is OpenGL");
    success(&mut without_gl(run(&folder, &[&["merge", "2.part", "1.part"], &receivers])));
    assert_eq!(bytes(&folder, "a.npy.checkpoint"), b"of another");
    assert!(one == files.map(|name| bytes(&folder, name)), "a file differs");
}

/// Runs `command` until it is done, each time killed once its checkpoint `file` has been written again. How often it was.
fn killed_again_and_again(mut command: impl FnMut() -> Command, file: &Path) -> u32 {
    let written = || fs::metadata(file).and_then(|metadata| metadata.modified()).ok();
    let (mut kills, mut done_before) = (0, 0);
    loop {
        let before = written();
        let mut child = command().stderr(Stdio::piped()).spawn().unwrap();
        let began = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break status;
            }
            if kills < 4 && written() != before {
                // Somewhere in the next interval.
                sleep(Duration::from_millis(40 * u64::from(kills)));
                child.kill().unwrap();
                kills += 1;
            }
            assert!(began.elapsed() < PATIENCE, "neither a checkpoint nor an end");
            sleep(Duration::from_millis(5));
        };
        let said = stderr(&child.wait_with_output().unwrap());
        assert!(status.success() || status.code().is_none(), "{status}: {said}");
        // The first run has nothing to go on from.
        if before.is_some() {
            let done = said.split_once("going on from ").and_then(|(_, rest)| rest.split_once(' ')?.0.parse::<u32>().ok());
            let done = done.unwrap_or_else(|| panic!("it began anew: {said}"));
            assert!(done >= done_before, "{done} directions after {done_before}");
            done_before = done;
        }
        if status.success() {
            assert!(done_before > 0, "nothing was kept");
            return kills;
        }
    }
}

#[test]
fn a_render_that_is_killed_goes_on_to_the_same_bytes() {
    let folder = folder();
    let settings = ["--directions", "1000"];
    let again = || {
        render(&folder, &[&settings[..], &["-o", "a.exr", "--checkpoint-every", "0", "--checkpoint", "a", "--resume"]].concat())
    };
    let kills = killed_again_and_again(again, &folder.path().join("a"));
    assert!(kills > 1, "killed {kills} times");
    success(&mut render(&folder, &[&settings[..], &["-o", "one.exr"]].concat()));
    assert!(bytes(&folder, "a.exr") == bytes(&folder, "one.exr"), "the pictures differ");
}

#[test]
fn a_bake_that_is_killed_goes_on_to_the_same_bytes() {
    let folder = folder();
    let settings = ["--directions", "400", "--rough", "gathered"];
    let automatic = folder.path().join("a.npy.checkpoint");
    let again = || bake(&folder, &[&settings[..], &RECEIVERS, &["--checkpoint-every", "0", "--resume"]].concat());
    let kills = killed_again_and_again(again, &automatic);
    assert!(kills > 1, "killed {kills} times");
    assert!(!automatic.exists(), "a checkpoint that nobody asked for is left");
    let resumed = ["a.npy", "a.exr"].map(|name| bytes(&folder, name));
    success(&mut bake(&folder, &[&settings[..], &RECEIVERS].concat()));
    assert!(resumed == ["a.npy", "a.exr"].map(|name| bytes(&folder, name)), "a file differs");
}

#[test]
fn termination_keeps_a_checkpoint_and_what_is_done_is_not_done_again() {
    let folder = folder();
    let settings = ["--directions", "1500", "-o", "a.exr", "--checkpoint", "a.checkpoint"];
    let child = render(&folder, &settings).args(["--checkpoint-every", "0"]).stderr(Stdio::piped()).spawn().unwrap();
    wait_for("a checkpoint", PATIENCE, || folder.path().join("a.checkpoint").exists().then_some(()));
    assert!(signal("TERM", child.id()));
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(143), "{}", stderr(&output));
    assert!(stderr(&output).ends_with("picture so far written to a.exr; --resume goes on\n"), "{}", stderr(&output));
    assert!(!bytes(&folder, "a.exr").is_empty());
    // Without --resume it would be overwritten.
    assert!(refusal(&mut render(&folder, &settings), 2).contains("--resume"));
    success(render(&folder, &settings).arg("--resume"));
    let first = bytes(&folder, "a.exr");
    success(&mut render(&folder, &["--directions", "1500", "-o", "one.exr"]));
    assert!(first == bytes(&folder, "one.exr"), "the pictures differ");
    // Finished, and written again from what is there.
    let report = json(render(&folder, &settings).args(["--resume", "--json"]));
    assert_eq!(report["gather"]["directions"], 0);
    assert!(bytes(&folder, "a.exr") == first);
}

#[test]
fn a_second_run_is_refused_and_what_a_killed_one_left_goes() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    let long = ["--directions", "100000", "--checkpoint-every", "0", "--resume", "-o", "a.png", "--checkpoint", "a.sums"];
    let mut child = render(&folder, &long).stderr(Stdio::null()).spawn().unwrap();
    while !path("a.sums").exists() {
        sleep(Duration::from_millis(10));
    }
    // Another result, the same sums.
    let second = ["--directions", "100000", "--resume", "-o", "b.png", "--checkpoint", "a.sums"];
    let said = refusal(&mut render(&folder, &second), 75);
    assert!(said.contains("a.sums: another run is writing it") && said.contains("cure: "), "{said}");
    assert!(child.try_wait().unwrap().is_none(), "the first run has ended");
    child.kill().unwrap();
    child.wait().unwrap();
    // As from a run that was killed while it wrote, and of files that are not this one.
    let temporary = |of: &str| path(&format!(".finalgather-{of}-aB3dE6.part"));
    let others = ["b.sums", "a.sums-b", "a.su"];
    ["a.sums"].iter().chain(&others).for_each(|of| fs::write(temporary(of), "unfinished").unwrap());
    assert!(path("a.sums.lock").exists(), "nothing was locked");
    success(&mut render(&folder, &["-o", "b.png", "--checkpoint", "b.checkpoint"]));
    assert!(temporary("a.sums").exists(), "removed by a run that has no right to");
    fs::remove_file(path("a.sums")).unwrap();
    success(&mut render(&folder, &["-o", "a.png", "--checkpoint", "a.sums"]));
    assert!(!temporary("a.sums").exists(), "what the killed run has left is there still");
    assert!(others.iter().all(|of| temporary(of).exists()), "another file's is gone");
    assert!(!names_in(&folder).iter().any(|name| name.ends_with(".lock")), "a lock is left");
}

/// Whether it gathered.
fn gathers(command: &mut Command) -> bool {
    let output = success(command.args(["--resume", "--json"]));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let done = [&report["gather"]["directions"], &report["bake"]["directions_done"]].into_iter().find_map(Value::as_u64).unwrap();
    assert_eq!(done == 0, stderr(&output).contains("finished by an earlier run"), "{done} directions: {}", stderr(&output));
    assert_eq!(done > 0, stderr(&output).contains("beginning"), "{}", stderr(&output));
    done > 0
}

#[test]
fn what_is_finished_is_not_made_again() {
    let folder = folder();
    let state = |names: &[&str]| -> Vec<_> {
        let of = |name: &&str| (bytes(&folder, name), fs::metadata(folder.path().join(name)).unwrap().modified().unwrap());
        names.iter().map(of).collect()
    };
    success(&mut bake(&folder, &RECEIVERS));
    let (names, before) = (["a.npy", "a.json"], state(&["a.npy", "a.json"]));
    success(&mut bake(&folder, &["-o", "vertices:b.ply", "-o", "lightmap:b.exr"]));
    assert!(!gathers(&mut bake(&folder, &["-o", "vertices:b.ply", "-o", "lightmap:b.exr"])));
    let reported = json(&mut bake(&folder, &["-o", "vertices:b.ply", "-o", "lightmap:b.exr", "--resume", "--json"]));
    assert_eq!(reported["receivers"][0]["outputs"], value!(["b.ply"]), "{reported}");
    let points = bytes(&folder, "b.ply");
    fs::write(folder.path().join("b.ply"), &points[..points.len() - 4]).unwrap();
    assert!(gathers(&mut bake(&folder, &["-o", "vertices:b.ply", "-o", "lightmap:b.exr"])), "some of its points are gone");
    assert!(bytes(&folder, "b.ply") == points);
    let mut damaged = points.clone();
    *damaged.last_mut().unwrap() ^= 1;
    fs::write(folder.path().join("b.ply"), damaged).unwrap();
    assert!(gathers(&mut bake(&folder, &["-o", "vertices:b.ply", "-o", "lightmap:b.exr"])), "one of its points is another");
    assert!(bytes(&folder, "b.ply") == points);
    assert!(gathers(&mut bake(&folder, &["--padding", "3", "-o", "vertices:b.ply", "-o", "lightmap:b.exr"])));
    assert!(gathers(&mut bake(&folder, &["-o", "vertices:a.npy", "-o", "lightmap:c.exr"])), "one output is not there");
    assert!(state(&names) != before, "the one that is there was not made again with the other");
    // An array's description may be of another run's.
    let array = bytes(&folder, "a.npy");
    assert!(!gathers(&mut bake(&folder, &["-o", "vertices:a.npy", "-o", "lightmap:c.exr"])));
    fs::write(folder.path().join("a.npy"), &array[..array.len() - 4]).unwrap();
    assert!(gathers(&mut bake(&folder, &["-o", "vertices:a.npy", "-o", "lightmap:c.exr"])), "the array is another");
    assert!(bytes(&folder, "a.npy") == array);
    assert!(gathers(&mut render(&folder, &["-o", "a.exr"])), "it was a bake's");
    let before = state(&["a.exr"]);
    assert!(!gathers(&mut render(&folder, &["-o", "a.exr"])));
    assert!(state(&["a.exr"]) == before, "it was written again");
    fs::write(folder.path().join("a.exr"), &before[0].0[..before[0].0.len() / 2]).unwrap();
    assert!(gathers(&mut render(&folder, &["-o", "a.exr"])), "half of it is gone");
    // A PNG does not tell.
    assert!(gathers(&mut render(&folder, &["-o", "a.exr", "-o", "a.png"])));
    assert!(gathers(&mut render(&folder, &["-o", "a.exr", "--exposure", "1"])));
    assert!(gathers(&mut render(&folder, &["-o", "a.exr", "--seed", "1"])));
    assert!(bytes(&folder, "a.exr") != before[0].0);
    // Ended early, and what was summed is lost.
    let settings = ["--directions", "1500", "--checkpoint-every", "0", "-o", "a.exr"];
    let child = render(&folder, &settings).stderr(Stdio::piped()).spawn().unwrap();
    wait_for("a checkpoint", PATIENCE, || folder.path().join("a.exr.checkpoint").exists().then_some(()));
    assert!(signal("TERM", child.id()));
    assert_eq!(child.wait_with_output().unwrap().status.code(), Some(143));
    fs::remove_file(folder.path().join("a.exr.checkpoint")).unwrap();
    assert!(gathers(&mut render(&folder, &settings)));
}

/// A bake goes on whatever memory it was begun with, unless its turns take more than there is.
#[test]
fn a_bake_goes_on_in_other_memory() {
    let folder = folder();
    let job = ["--to", "camera", "--what", "ao", "--size", "128", "--directions", "64", "--layer-size", "128"];
    let job = [&job[..], &["--photons", "1e4", "--gl-device", "sw", "-o", "a.npy", "--checkpoint", "a.sums"]].concat();
    let go_on = |memory: Option<u64>| {
        let memory = memory.map(|memory| format!("--memory={memory}"));
        let given: Vec<_> = memory.iter().map(String::as_str).chain(["--resume"]).collect();
        run(&folder, &[&["bake", SCENE], &job, &given])
    };
    let named = |said: &str| number_after(said, "give --memory ");
    let least = named(&refusal(&mut go_on(Some(1)), 2));
    success(&mut go_on(Some(least + 40)));
    let values = bytes(&folder, "a.npy");
    let said = refusal(&mut go_on(Some(least)), 65);
    assert!(said.contains("a.sums: more points were gathered at a time"), "{said}");
    let enough = named(&said);
    assert!(enough > least && enough <= least + 40, "{said}");
    for memory in [Some(enough), Some(least + 39), Some(least + 41), Some(least + 4000), None] {
        let said = stderr(&success(&mut go_on(memory)));
        assert!(said.contains("going on from ") && bytes(&folder, "a.npy") == values, "{memory:?}: {said}");
    }
}

/// The MiB that a job says it needs, refused for want of memory.
fn needed(command: &mut Command) -> u64 {
    let said = refusal(command, 2);
    let needed = number_after(&said, "may take ");
    assert!(said.contains(&format!("--memory {needed}")), "{said}");
    needed
}

/// The MiB that a job has taken, from its report.
fn peak(report: &Value) -> f64 {
    report["peak_memory_bytes"].as_u64().unwrap() as f64 / f64::from(1 << 20)
}

#[test]
fn memory_is_bounded_by_what_is_said_before() {
    let folder = folder();
    // On a software driver, whose memory is the process's.
    let within = |size: &str, [layers, pipeline]: [&str; 2], memory: &str| {
        let args = ["--size", size, "--directions", "16", "--layer-size", layers, "--gl-device", "sw", "-o", "a.exr", "--json"];
        render(&folder, &[&args[..], &["--pipeline", pipeline, "--memory", memory]].concat())
    };
    for (size, layers) in
        [("320", ["64", "fused"]), ("640", ["64", "raycast"]), ("640", ["64", "auto"]), ("320", ["1024", "fused"])]
    {
        let needed = needed(&mut within(size, layers, "1"));
        assert!(!folder.path().join("a.exr").exists());
        let peak = peak(&json(&mut within(size, layers, &needed.to_string())));
        let ratio = needed as f64 / peak;
        assert!((1.0..1.5).contains(&ratio), "{size}, {layers:?}: {needed} MiB were said, and {peak:.1} taken");
        fs::remove_file(folder.path().join("a.exr")).unwrap();
    }
    let said = refusal(&mut within("640", ["64", "fused"], "250"), 2);
    let (_, size) = said.split_once("--size ").unwrap_or_else(|| panic!("{said}"));
    success(&mut within(size.split_once(' ').unwrap().0, ["64", "fused"], "250"));
}

/// On the CPU too, where the values of all points are.
#[test]
fn memory_of_a_bake_is_bounded() {
    let folder = folder();
    for (to, size, what) in [
        (&["--to", "camera", "-o", "a.npy"][..], "400", "irradiance,ao,bent-normal,sky,sh,prt"),
        (&["--to", "camera", "-o", "a.ply"], "640", "ao"),
        (&["--to", "lightmap", "--resolution", "512", "-o", "a.exr"], "24", "irradiance,sh"),
        (&["--to", "vertices", "-o", "a.npy"], "24", "prt,prt-unshadowed"),
    ] {
        let within = |memory: u64| {
            let args = ["--what", what, "--size", size, "--directions", "16", "--layer-size", "128", "--photons", "1e4"];
            let memory = ["--gl-device", "sw", "--json", "--memory", &memory.to_string()];
            run(&folder, &[&["bake", SCENE], &args, to, &memory])
        };
        let needed = needed(&mut within(1));
        let name = to.last().unwrap();
        assert!(!folder.path().join(name).exists(), "{to:?}");
        let report = json(&mut within(needed));
        let peak = peak(&report);
        let ratio = needed as f64 / peak;
        eprintln!("{to:?}: {needed} MiB were said, and {peak:.1} taken in {} rounds", report["bake"]["rounds"]);
        assert!((1.0..1.6).contains(&ratio), "{to:?}: {needed} MiB were said, and {peak:.1} taken");
        // With more there are fewer rounds, and the same values; and it is not more than that either.
        let values = bytes(&folder, name);
        let most = needed + 60;
        let report = json(&mut within(most));
        assert!(self::peak(&report) <= most as f64, "{to:?}: {most} MiB were allowed: {report}");
        assert!(bytes(&folder, name) == values, "{to:?}: other values with more memory");
        fs::remove_file(folder.path().join(name)).unwrap();
    }
}

#[test]
fn what_does_not_belong_together_is_refused_by_name() {
    let folder = folder();
    let shard = |shard: &str, name: &str, args: &[&str]| {
        success(&mut render(&folder, &[&["--shard", shard, "-o", name][..], args].concat()));
    };
    for number in ["1/4", "2/4", "3/4"] {
        shard(number, "{shard}.part", &[]);
    }
    shard("4/4", "seed.part", &["--seed", "1"]);
    success(&mut bake(&folder, &["--shard", "4/4", "-o", "bake.part"]));
    let damaged = |name: &str, place: usize| {
        let mut bytes = bytes(&folder, "3.part");
        let length = bytes.len();
        bytes[length - place] ^= 1;
        fs::write(folder.path().join(name), bytes).unwrap();
    };
    damaged("flipped.part", 100);
    fs::write(folder.path().join("short.part"), &bytes(&folder, "3.part")[..1000]).unwrap();
    let merge = |parts: &[&str]| run(&folder, &[&["merge"], parts, &["-o", "x.png"]]);
    // 200 directions are 25 blocks of 8, of which the last shard has seven.
    let said = refusal(&mut merge(&["1.part", "2.part", "3.part"]), 2);
    assert!(said.contains("no part has directions 144 to 199 of 200"), "{said}");
    for (part, code, what) in [
        ("1.part", 65, "1.part: its directions 0 to 31 are in an earlier part too"),
        ("seed.part", 65, "seed.part: of another job: settings.seed is 1 there and 0 here"),
        ("bake.part", 65, "bake.part: of another job: what is \"bake\" there"),
        ("flipped.part", 65, "flipped.part: damaged"),
        ("short.part", 65, "short.part: no part, or cut short"),
        ("none.part", 65, "none.part: cannot read"),
    ] {
        let said = refusal(&mut merge(&["1.part", "2.part", part]), code);
        assert!(said.contains(what) && said.contains("cure: "), "{part}: {said}");
    }
    let textured = SCENE.replace("cornell.toml", "cornell_textured.toml");
    let said = refusal(&mut run(&folder, &[&["render", &textured], &SMALL, &["--shard", "1/4", "-o", "1.part", "--resume"]]), 65);
    assert!(said.contains("scene.mesh differs") && said.contains("camera is"), "{said}");
    let resume = |args: &[&str]| render(&folder, &[&["--shard", "1/4", "-o", "1.part", "--resume"][..], args].concat());
    assert!(refusal(&mut resume(&["--directions", "300"]), 65).contains("settings.directions is 200 there and 300 here"));
    for (args, what) in [
        (&["--shard", "1/4", "-o", "x.png"][..], "ending in .part"),
        (&["--shard", "1/4", "-o", "x.part", "-o", "y.part"], "one part"),
        (&["--shard", "1/26", "-o", "x.part"], "26 shards, and the directions fall into 13 blocks"),
        (&["--shard", "1/4", "-o", "x.part", "--until", "0.01"], "--target-error"),
        (&["--shard", "5/4", "-o", "x.part"], "5/4"),
        (&["--shard", "1/4", "-o", "1.part"], "--resume"),
        (&["--shard", "auto/4", "-o", "{shard}.part"], "JOB_COMPLETION_INDEX"),
        (&["-o", "x.png", "--checkpoint", "x.png"], "two names"),
        (&["-o", "x.png", "--checkpoint", "./x.png"], "two names"),
        (&["-o", "x.png", "-o", "y.png", "-o", "./x.png"], "written twice"),
        (&["-o", SCENE], "is an input"),
    ] {
        let said = refusal(&mut render(&folder, args), 2);
        assert!(said.contains(what), "{args:?}: {said}");
    }
    let over_description = ["-o", "vertices:x.npy", "-o", "lightmap:x.exr", "--checkpoint", "x.json"];
    assert!(refusal(&mut bake(&folder, &over_description), 2).contains("two names"));
    let named_alike = ["--shard", "auto/4", "-o", "x.part"];
    assert!(
        refusal(render(&folder, &named_alike).env("JOB_COMPLETION_INDEX", "1"), 2).contains("all tasks would write this file")
    );
    fs::copy(folder.path().join("1.part"), folder.path().join("2.part")).unwrap();
    assert!(refusal(&mut render(&folder, &["--shard", "2/4", "-o", "2.part", "--resume"]), 65).contains("of shard 1/4"));
    assert!(!folder.path().join("x.png").exists() && !folder.path().join("x.part").exists(), "a refused job has left a file");
}
