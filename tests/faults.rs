//! Driver faults: a lost context, no memory left, a wrong limit or version, a device reset by a watchdog. The tool gives the same result as without the
//! fault, or an error that names the fault and keeps the sums.
//!
//! The driver is Mesa's, behind tests/faulty_driver/driver.c. GLVND loads that file through its own environment variable, so the tool runs as for
//! users. On softpipe these runs would take a quarter of an hour, so CI uses only the best driver.
#![cfg(target_os = "linux")]

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::LazyLock;
use std::time::Duration;

use common::tool::{bytes, ended, folder, small_scene, tool};
use finalgather::image::Image;
use finalgather::image::compare::{Selection, compare};
use serde_json::Value;
use tempfile::TempDir;

/// What GLVND reads to find the driver.
static DRIVER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let library = folder.join("libEGL_faulty.so");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faulty_driver/driver.c");
    let mut cc = Command::new("cc");
    cc.args(["-shared", "-fPIC", "-O1", "-Wall", "-Wextra", "-Werror", "-o"]).arg(&library).arg(source).arg("-ldl");
    assert!(cc.status().unwrap().success());
    let json = folder.join("faulty.json");
    let text = serde_json::json!({ "file_format_version": "1.0.0", "ICD": { "library_path": library } });
    fs::write(&json, text.to_string()).unwrap();
    json
});

/// Whether it is Mesa's reference rasteriser, which takes its time.
fn slow() -> bool {
    std::env::var("GALLIUM_DRIVER").is_ok_and(|driver| driver == "softpipe")
}

/// How the tool ended.
struct Run {
    code: i32,
    said: String,
    /// What the driver saw.
    log: Value,
}

impl Run {
    fn number(&self, name: &str) -> f64 {
        self.log[name].as_f64().unwrap_or_else(|| panic!("the driver does not tell {name}: {}", self.log))
    }

    /// It failed for this reason, and says what to do.
    fn check_refusal(&self, reasons: &[&str]) {
        let known = reasons.iter().any(|reason| self.said.contains(reason));
        assert!(self.code == 69 && known && self.said.contains("\n  cure: "), "{}: {}", self.code, self.said);
    }
}

/// Faults by the names that the driver knows, and their numbers.
type Faults<'a> = [(&'a str, f64)];

struct Job {
    folder: TempDir,
    args: Vec<String>,
}

impl Job {
    /// The Cornell box, small.
    fn new(command: &str, args: &str) -> Self {
        let folder = folder();
        let scene = small_scene(folder.path());
        let args = [command, scene.to_str().unwrap()].into_iter().chain(args.split(' ')).map(str::to_owned).collect();
        Self { folder, args }
    }

    /// With these arguments more. A run that does not end is a failure.
    fn run(&self, more: &[&str], faults: &Faults) -> Run {
        let log = self.folder.path().join("log.json");
        let mut command = tool(&self.folder);
        command.args(&self.args).args(more).args(["--backend", "egl", "--gl-device", "sw"]);
        command.env("__EGL_VENDOR_LIBRARY_FILENAMES", &*DRIVER).env("FAULTY_LOG", &log);
        command.envs(faults.iter().map(|(name, number)| (name, number.to_string())));
        let said = fs::File::create(self.folder.path().join("said")).unwrap();
        let mut child = command.stdout(Stdio::null()).stderr(said).spawn().unwrap();
        let status = ended(&mut child, Duration::from_secs(120));
        let said = fs::read_to_string(self.folder.path().join("said")).unwrap();
        assert!(!said.contains("panicked"), "{faults:?}: {said}");
        let code = status.code().unwrap_or_else(|| panic!("{faults:?}: {status}: {said}"));
        // GLVND may be missing, or pass the driver over.
        let log = fs::read_to_string(log).unwrap_or_else(|_| panic!("{faults:?}: the driver was not loaded: {said}"));
        Run { code, said, log: serde_json::from_str(&log).unwrap() }
    }

    /// To this file, with these faults, successfully.
    fn make(&self, name: &str, faults: &Faults) -> Run {
        let run = self.run(&["-o", name], faults);
        assert_eq!(run.code, 0, "{faults:?}: {}", run.said);
        run
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        bytes(&self.folder, name)
    }

    /// The numbers of a file of NumPy's first version, in 32 bits.
    fn floats(&self, name: &str) -> Vec<f32> {
        let bytes = self.bytes(name);
        let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        bytes[header..].chunks_exact(4).map(|number| f32::from_le_bytes(number.try_into().unwrap())).collect()
    }

    /// The greatest difference of two such files, as a share of the second's greatest value.
    fn most_difference(&self, a: &str, b: &str) -> f32 {
        let [a, b] = [a, b].map(|name| self.floats(name));
        assert_eq!(a.len(), b.len());
        let most = b.iter().fold(0.0_f32, |most, value| most.max(value.abs()));
        a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / most
    }

    /// Relative root mean square difference of two pictures, and the bias of the first.
    fn difference(&self, a: &str, b: &str) -> [f64; 2] {
        let read = |name: &str| Image::read(&self.folder.path().join(name)).unwrap();
        // The lamp's outline, where few offsets decide.
        let found = compare(&read(a), &read(b), Selection { trim: 0.02, ..Selection::default() }).unwrap();
        [found.relative_rmse, found.bias]
    }
}

/// Sums of another grouping: each is rounded to 6e-8 of it a few hundred times.
const ROUNDING: f64 = 1e-5;

/// Of a single value: where tiles are fewer, vertices are rounded otherwise, and distances with them (measured 2e-5).
const LAYER_ROUNDING: f32 = 1e-4;

#[test]
fn a_lost_context_stops_a_render_cleanly_wherever_it_is_lost() {
    let pipelines = [("kill", 0.0), ("fused", 1.0), ("early-kill", 1.0), ("raycast-gl", 0.0)];
    let count = if slow() { 2 } else { 4 };
    for (pipeline, robust) in &pipelines[..count] {
        // Blocks of four directions, which kill does one by one.
        let job = Job::new("render", &format!("--size 24 --directions 128 --pipeline {pipeline}"));
        let draws = job.make("whole.exr", &[]).number("draws");
        for share in [0.0, 0.3, 0.55, 0.999] {
            let at = (share * draws).ceil().max(1.0);
            let kept = format!("{share}.checkpoint");
            let lost =
                job.run(&["-o", "lost.exr", "--checkpoint", &kept], &[("FAULTY_LOST_AT_DRAW", at), ("FAULTY_ROBUST", *robust)]);
            lost.check_refusal(&["the OpenGL context is lost"]);
            assert_eq!((lost.number("lost"), lost.number("robust")), (1.0, *robust));
            let done = lost.said.strip_prefix("failed after ").map_or(0, |rest| rest.split(' ').next().unwrap().parse().unwrap());
            let calls = lost.number("calls_after");
            eprintln!(
                "| {pipeline}, robust {robust} | lost at draw {at} of {draws} | {done} of 128 directions kept, {calls} calls after |"
            );
            // Of whole blocks.
            assert!((f64::from(done) - 128.0 * share).abs() < 32.0 && done % 4 == 0, "{done} directions of {share} of the work");
            if done >= 32 {
                // 0.03 and less without; where a lost block counts as black, it falls by that block's share of the picture.
                let [_, bias] = job.difference("lost.exr", "whole.exr");
                assert!(bias.abs() < 0.06, "{pipeline}, {done} directions: bias {bias}");
            }
            let resumed = job.run(&["-o", "resumed.exr", "--checkpoint", &kept, "--resume"], &[]);
            assert_eq!(resumed.code, 0, "{}", resumed.said);
            assert!(job.bytes("resumed.exr") == job.bytes("whole.exr"), "{pipeline}, lost at {at}: other bits after --resume");
        }
    }
}

#[test]
fn what_a_lost_context_no_longer_tells_counts_for_nothing() {
    // A block of kill reads seven times: what the camera sees and how bright that is, direct light and what was gathered.
    let job = Job::new("render", "--size 24 --directions 64 --pipeline kill");
    let reads = job.make("whole.exr", &[]).number("reads");
    for at in 0..7 {
        let at = (reads / 2.0).floor() + f64::from(at);
        let faults = [("FAULTY_LOST_AT_READ", at), ("FAULTY_ROBUST", 1.0)];
        let kept = format!("{at}.checkpoint");
        job.run(&["-o", "lost.exr", "--checkpoint", &kept], &faults).check_refusal(&["the OpenGL context is lost"]);
        let resumed = job.run(&["-o", "resumed.exr", "--checkpoint", &kept, "--resume"], &[]);
        assert_eq!(resumed.code, 0, "{}", resumed.said);
        assert!(job.bytes("resumed.exr") == job.bytes("whole.exr"), "lost at read {at} of {reads}: other bits after --resume");
    }
    eprintln!(
        "| render | lost at seven reads in a row, from the {} of {reads} on | same bits after --resume |",
        (reads / 2.0).floor()
    );
}

#[test]
fn a_lost_context_stops_a_bake_cleanly() {
    let job = Job::new("bake", "--to vertices --what prt,irradiance --order 2 --directions 256 --rough gathered --bounces 1");
    let draws = job.make("whole.npy", &[]).number("draws");
    for share in [0.0, 0.4, 0.7, 0.999] {
        let at = (share * draws).ceil().max(1.0);
        let kept = format!("{share}.checkpoint");
        let lost = job.run(&["-o", "lost.npy", "--checkpoint", &kept], &[("FAULTY_LOST_AT_DRAW", at), ("FAULTY_ROBUST", 1.0)]);
        lost.check_refusal(&["the OpenGL context is lost"]);
        let resumed = job.run(&["-o", "resumed.npy", "--checkpoint", &kept, "--resume"], &[]);
        assert_eq!(resumed.code, 0, "{}", resumed.said);
        eprintln!("| bake | lost at draw {at} of {draws} | {} |", lost.said.lines().next().unwrap_or_default());
        assert!(job.bytes("resumed.npy") == job.bytes("whole.npy"), "lost at {at}: other bits after --resume");
    }
    // Hits are found by one of these, and kept in textures that are made anew.
    for at in 0..12 {
        let at = (0.4 * draws).ceil() + f64::from(at);
        let lost = job.run(&["-o", "lost.npy"], &[("FAULTY_LOST_AT_DRAW", at), ("FAULTY_ROBUST", 1.0)]);
        lost.check_refusal(&["the OpenGL context is lost"]);
    }
}

#[test]
fn memory_that_ends_at_any_allocation_stops_a_render_or_leaves_the_picture_as_it_is() {
    // Blocks of eight directions, as many as a store holds; and traced points, which each block uploads.
    let jobs = [
        ("--directions 32 --pipeline fused", 6),
        ("--directions 32 --pipeline kill", -1),
        ("--directions 4 --pipeline fused --points traced", 10),
    ];
    for (args, least) in jobs {
        let job = Job::new("render", &format!("--size 24 {args}"));
        let allocations = job.make("whole.exr", &[]).number("allocations") as u32;
        let mut survived = 0_i64;
        for at in 1..=allocations {
            let run = job.run(&["-o", "short.exr"], &[("FAULTY_MEMORY_ENDS_AT", at.into())]);
            assert_eq!(run.number("refused"), 1.0, "{args}: {at} of {allocations}");
            if run.code == 0 {
                survived += 1;
                let [difference, _] = job.difference("short.exr", "whole.exr");
                assert!(difference < ROUNDING, "{args}: {at} of {allocations}: {difference}");
            } else {
                run.check_refusal(&["the GL device is out of memory"]);
            }
        }
        eprintln!(
            "| render {args} | each of {allocations} allocations fails once | {survived} go on, {} stop |",
            i64::from(allocations) - survived
        );
        // The store's own, and what finds the store in its way.
        assert!(survived > least, "{args}: only {survived} of {allocations}");
    }
}

#[test]
fn a_render_takes_what_memory_there_is_and_else_says_what_would_do() {
    let job = Job::new("render", "--size 24 --directions 256 --pipeline fused --layer-size 256");
    let peak = job.make("whole.exr", &[]).number("peak");
    for share in [0.7, 0.5, 0.3] {
        let run = job.make("short.exr", &[("FAULTY_MEMORY", share * peak)]);
        let [difference, _] = job.difference("short.exr", "whole.exr");
        eprintln!(
            "| render | {share} of the memory it takes | same within {difference:.1e}; {} refused |",
            run.number("refused")
        );
        assert!(run.number("refused") > 0.0 && run.number("peak") <= share * peak, "{}", run.log);
        assert!(difference < ROUNDING, "{share}: {difference}");
    }
    // Not even one direction, at the size asked for.
    let memory = ("FAULTY_MEMORY", 20e6);
    let run = job.run(&["-o", "none.exr", "--layer-size", "512"], &[memory]);
    run.check_refusal(&["the GL device has no room for 8 layers of 512x512 texels: 24.0 MiB"]);
    let size = run.said.split("--layer-size ").nth(1).and_then(|rest| rest.split(',').next()).unwrap();
    eprintln!("| render --layer-size 512 | 20 MB of memory | {} |", run.said.trim().replace('\n', " "));
    let cured = job.run(&["-o", "cured.exr", "--layer-size", size], &[memory]);
    assert_eq!(cured.code, 0, "--layer-size {size}: {}", cured.said);
    assert!(!job.folder.path().join("none.exr").exists());
}

#[test]
fn a_bake_takes_what_memory_there_is() {
    let job = Job::new("bake", "--to vertices --what prt --order 3 --directions 64 --bounces 2");
    let allocations = job.make("whole.npy", &[]).number("allocations") as u32;
    let (mut survived, mut same) = (0, 0);
    for at in 1..=allocations {
        let run = job.run(&["-o", "short.npy"], &[("FAULTY_MEMORY_ENDS_AT", at.into())]);
        if run.code == 0 {
            survived += 1;
            same += u32::from(job.bytes("short.npy") == job.bytes("whole.npy"));
            let difference = job.most_difference("short.npy", "whole.npy");
            assert!(difference < LAYER_ROUNDING, "{at} of {allocations}: {difference}");
        } else {
            run.check_refusal(&["the GL device is out of memory"]);
        }
    }
    eprintln!("| bake | each of {allocations} allocations fails once | {survived} go on, {same} to the same bits |");
    assert!(same > 30, "{same} of {allocations}");

    // Most of the memory is for points: they take turns.
    let job = Job::new("bake", "--to camera --size 128 --what sh --order 5 --directions 16");
    let peak = job.make("whole.npy", &[]).number("peak");
    for share in [0.8, 0.6] {
        let run = job.run(&["-o", "short.npy", "--checkpoint", "short.checkpoint"], &[("FAULTY_MEMORY", share * peak)]);
        assert_eq!(run.code, 0, "{}", run.said);
        let difference = job.most_difference("short.npy", "whole.npy");
        eprintln!(
            "| bake --to camera | {share} of the memory it takes | same within {difference:.1e}; {} refused |",
            run.number("refused")
        );
        assert!(run.number("refused") > 0.0 && difference < LAYER_ROUNDING, "{share}: {difference}");
        // What was summed a part of the points at a time is gone on from so.
        let again = job.run(&["-o", "again.npy", "--checkpoint", "short.checkpoint", "--resume"], &[]);
        assert_eq!(again.code, 0, "{}", again.said);
        assert!(job.bytes("again.npy") == job.bytes("short.npy"), "{share}: other bits after --resume");
        fs::remove_file(job.folder.path().join("short.checkpoint")).unwrap();
    }
}

#[test]
fn limits_that_are_less_than_they_are_said_to_be() {
    // Eight layers side by side are 2048 texels wide.
    let job = Job::new("render", "--size 24 --directions 256 --pipeline fused --layer-size 256");
    job.make("whole.exr", &[]);
    job.make("narrow.exr", &[("FAULTY_TEXTURE_SIZE", 1024.0)]);
    let [difference, _] = job.difference("narrow.exr", "whole.exr");
    assert!(difference < ROUNDING, "{difference}");
    let run = job.run(&["-o", "none.exr", "--layer-size", "2048"], &[("FAULTY_TEXTURE_SIZE", 1024.0)]);
    run.check_refusal(&["the GL device has no room for 8 layers of 2048x2048 texels"]);
    assert!(run.said.contains("use --layer-size 1024,"), "{}", run.said);
    let run = job.run(&["-o", "none.exr", "--size", "2000x10"], &[("FAULTY_TEXTURE_SIZE", 1024.0)]);
    run.check_refusal(&["making a texture of 2000x10x1 texels, 0.3 MiB"]);
    eprintln!(
        "| render | 16384 are promised, 1024 are kept | layers same within {difference:.1e}; --size 2000x10: {} |",
        run.said.trim()
    );
}

#[test]
fn images_that_are_promised_and_do_not_work() {
    let job = Job::new("render", "--size 24 --directions 64 --pipeline fused");
    job.make("whole.exr", &[]);
    // Errors; nothing at all, for bound images are not; and, on softpipe, a version of which nothing compiles.
    for (name, number) in [("FAULTY_IMAGES_FAIL", 1.0), ("FAULTY_IMAGES_VANISH", 1.0), ("FAULTY_VERSION", 4.5)] {
        job.make(&format!("{name}.exr"), &[(name, number)]);
        let [difference, _] = job.difference(&format!("{name}.exr"), "whole.exr");
        eprintln!("| render | {name} | same within {difference:.1e} |");
        assert!(difference < ROUNDING, "{name}: {difference}");
    }
    assert!(job.bytes("FAULTY_IMAGES_FAIL.exr") == job.bytes("FAULTY_IMAGES_VANISH.exr"), "two ways to peel");
}

#[test]
fn no_submission_is_long_enough_for_a_watchdog() {
    // A pass over all points takes a second on this device, and half of that is too long for its watchdog.
    let job = Job::new("render", "--size 512x256 --directions 2 --pipeline fused");
    job.make("whole.exr", &[]);
    let slow = ("FAULTY_SECONDS_A_TEXEL", 8e-6);
    let run = job.make("slow.exr", &[slow, ("FAULTY_WATCHDOG", 0.5)]);
    eprintln!(
        "| render | a pass takes 1.05 s, the watchdog waits 0.5 | same bits; longest submission {:.3} s |",
        run.number("longest")
    );
    assert!(job.bytes("slow.exr") == job.bytes("whole.exr"), "other bits in parts");
    // It does bite.
    job.run(&["-o", "lost.exr"], &[slow, ("FAULTY_WATCHDOG", 0.05)]).check_refusal(&["the OpenGL context is lost"]);
}
