//! What the reports of render, bake, merge and relight have in common. `docs/report.schema.json` describes them, and `python/tests/extras` checks it.

mod common;

use std::fs;
use std::path::Path;

use common::gpu;
use common::tool::{folder, small_scene, success, text, tool};
use serde_json::{Value, json};
use tempfile::TempDir;

const KEYS: [&str; 9] =
    ["schema", "version", "command", "outputs", "camera", "warnings", "peak_memory_bytes", "interrupted", "seconds"];

/// The report of a command that has all keys.
fn report(folder: &TempDir, line: &str) -> Value {
    let output = success(tool(folder).args(line.split(' ')).arg("--json"));
    let report: Value = serde_json::from_str(&text(&output.stdout)).unwrap();
    for key in KEYS {
        assert!(report.get(key).is_some(), "{line}: no {key}: {report}");
    }
    assert_eq!((&report["schema"], &report["version"]), (&json!(1), &json!(env!("CARGO_PKG_VERSION"))));
    assert_eq!(report["command"], line.split(' ').next().unwrap());
    assert!(report["seconds"]["total"].as_f64().unwrap() > 0.0);
    report
}

/// A triangle without light.
fn bare_model(folder: &Path) {
    fs::write(folder.join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 0 -1\nf 1 2 3\n").unwrap();
}

#[test]
fn a_merge_says_what_one_run_says() {
    let _turn = gpu();
    let folder = folder();
    small_scene(folder.path());
    let options = "render small.toml --size 24x16 --directions 64 --eye 1,1,3";
    let one = report(&folder, &format!("{options} -o one.exr -o one.png"));
    assert_eq!(one["outputs"], json!(["one.exr", "one.png"]));
    assert_eq!(one["camera"]["eye"], json!([1.0, 1.0, 3.0]));
    assert_eq!((&one["interrupted"], &one["warnings"]), (&json!(false), &json!([])));
    for shard in [1, 2] {
        let part = report(&folder, &format!("{options} --shard {shard}/2 -o {shard}.part"));
        assert_eq!(part["outputs"], json!([format!("{shard}.part")]));
    }
    let merged = report(&folder, "merge 1.part 2.part -o two.exr --exposure 1");
    assert_eq!((&merged["outputs"], &merged["parts"], &merged["of"]), (&json!(["two.exr"]), &json!(2), &json!("render")));
    assert_eq!(merged["camera"], one["camera"]);
    assert_eq!((&merged["settings"]["directions"], &merged["settings"]["exposure"]), (&json!(64), &json!(1.0)));
}

#[test]
fn warnings_and_cameras_are_told() {
    let _turn = gpu();
    let folder = folder();
    bare_model(folder.path());
    let says = |report: &Value, text: &str| {
        report["warnings"].as_array().unwrap().iter().any(|line| line.as_str().unwrap().contains(text))
    };
    let lit = report(&folder, "bake a.obj --to vertices --directions 16 -o a.npy");
    assert!(says(&lit, "a soft sky lights it"), "{lit}");
    assert_eq!((&lit["camera"], &lit["outputs"]), (&Value::Null, &json!(["a.npy"])));
    let seen = report(&folder, "bake a.obj --to camera --what ao --size 9 --directions 16 -o a.exr --up 0,0,1");
    assert!(!says(&seen, "soft sky") && seen["camera"]["up"] == json!([0.0, 0.0, 1.0]), "{seen}");

    report(&folder, "bake a.obj --to vertices --what prt --order 2 --directions 16 -o prt.npy");
    let sky = finalgather::Image {
        width: 2,
        height: 1,
        channels: ["R", "G", "B"].map(|name| finalgather::image::Channel { name: name.into(), samples: vec![1.0; 2] }).into(),
    };
    sky.write(&folder.path().join("sky.exr"), &Default::default()).unwrap();
    let relit = report(&folder, "relight prt.npy --env sky.exr --scene a.obj -o relit.png --size 9");
    assert_eq!((&relit["points"], &relit["outputs"]), (&json!(3), &json!(["relit.png"])));
    assert!(relit["camera"]["fov_y_degrees"].as_f64().unwrap() > 0.0);
    let numbers = report(&folder, "relight prt.npy --env sky.exr -o relit.npy");
    assert_eq!(numbers["camera"], Value::Null);
}
