//! `finalgather bake` and `relight`: the files that they read and write, and their refusals.
#![cfg(unix)]

mod common;

use std::fs;
use std::path::Path;
use std::process::Command;

use common::khronos;
use common::tool::{self, bytes, folder, names_in, refusal, scene, success, text, tool};
use finalgather::export::read_prt;
use finalgather::image::{Channel, Image, WriteOptions};
use finalgather::scene::{LoadOptions, Mesh, World};
use glam::Vec3;
use serde_json::{Value, json};
use tempfile::TempDir;

const SMALL: [&str; 8] = ["--size", "24", "--directions", "16", "--layer-size", "64", "--photons", "1e4"];

fn bake(folder: &TempDir, scene: &Path, args: &[&str]) -> Command {
    let mut command = tool(folder);
    command.arg("bake").arg(scene).args(SMALL).args(args);
    command
}

/// What the camera sees, written out and read again, has the same values to the bit, however it was written.
#[test]
fn pixels_given_back_as_points_are_the_same() {
    let folder = folder();
    let cornell = scene("cornell.toml");
    let what = ["--what", "irradiance,ao,bent-normal,sky,sh"];
    success(&mut bake(&folder, &cornell, &[&what[..], &["--to", "camera", "-o", "camera.ply", "-o", "camera.npy"]].concat()));
    success(&mut bake(
        &folder,
        &cornell,
        &[&what[..], &["--to", "points:camera.ply", "-o", "points.ply", "-o", "points.npy"]].concat(),
    ));
    for ending in ["ply", "npy"] {
        let [camera, points] = ["camera", "points"].map(|name| bytes(&folder, &format!("{name}.{ending}")));
        // But for the line of a PLY that says which job it is of.
        let values = |bytes: &[u8]| {
            bytes.split_inclusive(|&b| b == b'\n').filter(|line| !line.starts_with(b"comment")).collect::<Vec<_>>().concat()
        };
        assert!(values(&camera) == values(&points), "{ending} differs");
        assert!(camera.len() > 10_000, "{ending}: {} bytes", camera.len());
    }
}

#[test]
fn all_receivers_and_formats_in_one_run() {
    let folder = folder();
    let points = folder.path().join("some.csv");
    fs::write(&points, "x,y,z,nx,ny,nz\n278,0.5,278,0,1,0\n100,0.5,100,0,1,0\n").unwrap();
    let args = [
        "--to",
        "vertices",
        "--to",
        "lightmap",
        "--to",
        "camera",
        "--to",
        "points:some.csv",
        "--resolution",
        "32",
        "--json",
        "--what",
        "irradiance,ao,bent-normal,sky,sh,prt,ao,prt-unshadowed",
        "--order",
        "2",
        "--bounces",
        "1",
        "-o",
        "vertices:v.ply",
        "-o",
        "vertices:v.npy",
        "-o",
        "vertices:v.glb",
        "-o",
        "lightmap:m.exr",
        "-o",
        "lightmap:m.png",
        "-o",
        "lightmap:box.obj",
        "-o",
        "lightmap:m.glb",
        "-o",
        "camera:c.exr",
        "-o",
        "camera:c.png",
        "-o",
        "points:p.ply",
    ];
    let report = tool::json(&mut bake(&folder, &scene("cornell.toml"), &args));
    let receivers = report["receivers"].as_array().unwrap();
    let names: Vec<_> = receivers.iter().map(|receiver| receiver["to"].as_str().unwrap()).collect();
    assert_eq!(names, ["vertices", "lightmap", "camera", "points"]);
    let count = |i: usize| receivers[i]["points"].as_u64().unwrap();
    assert_eq!((count(0), count(3)), (report["receivers"][0]["counts"]["vertices"].as_u64().unwrap(), 2));
    let total: u64 = (0..4).map(count).sum();
    assert_eq!(report["bake"]["points"], total);
    for file in receivers.iter().flat_map(|receiver| receiver["outputs"].as_array().unwrap()) {
        assert!(fs::metadata(folder.path().join(file.as_str().unwrap())).unwrap().len() > 0, "{file} is empty");
    }
    ["v.glb", "m.glb"].iter().for_each(|name| khronos::check(&folder.path().join(name)));
    // Every column has its channel, and R G B is irradiance.
    let map = Image::read(&folder.path().join("m.exr")).unwrap();
    assert_eq!(map.width, 32);
    for name in ["AO", "BentNormal.Z", "Sky", "SH.03.B", "PRT.00.R", "PRTUnshadowed.03.G", "IrradianceDirect.G", "A"] {
        assert!(map.channel(name).is_some_and(|samples| samples.iter().all(|sample| sample.is_finite())), "{name}");
    }
    // Means of samples, and what is mended along seams, are unit vectors again.
    let [x, y, z] = ["X", "Y", "Z"].map(|axis| map.channel(&format!("BentNormal.{axis}")).unwrap());
    let lengths = x.iter().zip(y).zip(z).map(|((x, y), z)| x.hypot(*y).hypot(*z));
    let lengths: Vec<f32> =
        lengths.zip(map.channel("A").unwrap()).filter(|(_, covered)| **covered > 0.0).map(|(length, _)| length).collect();
    assert!(lengths.len() > 100 && lengths.iter().all(|length| (length - 1.0).abs() < 1e-5), "{lengths:?}");
    assert_eq!(map.channel("R"), map.channel("Irradiance.R"));
    assert!(map.channel("R").unwrap().iter().sum::<f32>() > 0.0, "the map is black");
    let prt = read_prt(&folder.path().join("v.npy")).unwrap();
    assert_eq!((prt.len(), prt[0].samples.len() as u64), (12, count(0)));
}

/// Under a constant sky every front has π times its openness, and a picture shows the albedo times that over π.
#[test]
fn relit_by_a_constant_sky() {
    let folder = folder();
    let cornell = scene("cornell.toml");
    success(&mut bake(
        &folder,
        &cornell,
        &["--to", "vertices", "--what", "prt,sky", "--bounces", "0", "-o", "prt.npy", "-o", "sky.ply"],
    ));
    let white = ["R", "G", "B"].map(|name| Channel { name: name.into(), samples: vec![2.0; 8 * 4] });
    let sky = Image { width: 8, height: 4, channels: white.into() };
    sky.write(&folder.path().join("white.exr"), &WriteOptions::default()).unwrap();
    let relight = |more: &[&str]| {
        let mut command = tool(&folder);
        command.args(["relight", "prt.npy", "--env", "white.exr"]).args(more);
        command
    };
    success(&mut relight(&[
        "--scene",
        cornell.to_str().unwrap(),
        "--size",
        "16",
        "-o",
        "relit.exr",
        "-o",
        "relit.ply",
        "-o",
        "relit.glb",
        "-o",
        "light.npy",
    ]));
    khronos::check(&folder.path().join("relit.glb"));
    success(&mut relight(&["-o", "alone.npy"]));
    let moved = fs::read_to_string(scene("cornell.obj")).unwrap().replacen("552.8", "553.8", 1);
    fs::write(folder.path().join("cornell.obj"), moved).unwrap();
    for name in ["cornell.mtl", "cornell.toml"] {
        fs::copy(scene(name), folder.path().join(name)).unwrap();
    }
    refusal(&mut relight(&["--scene", "cornell.toml", "-o", "other.ply"]), 65);
    let said = refusal(&mut relight(&["-o", "prt.npy"]), 2);
    assert!(said.contains("is an input"), "{said}");
    assert_eq!(bytes(&folder, "light.npy"), bytes(&folder, "alone.npy"));
    // The first coefficient alone counts, and it is openness: 2 π openness = 2 π T / Y.
    let light = bytes(&folder, "light.npy");
    let values = finalgather::npy::Array::parse(Path::new("light.npy"), &light).unwrap();
    let first = &read_prt(&folder.path().join("prt.npy")).unwrap()[0];
    for (i, transfer) in first.samples.iter().enumerate() {
        let expected = 2.0 * std::f64::consts::PI * f64::from(*transfer) / 0.282_094_8;
        assert!((values.at(&[i, 0]) - expected).abs() < 2e-3, "{i}: {}, expected {expected}", values.at(&[i, 0]));
    }
    let picture = Image::read(&folder.path().join("relit.exr")).unwrap();
    assert!(picture.channel("G").unwrap().iter().any(|&sample| sample > 0.1), "the picture is black");
}

/// Bounces of transfer do not change photons, whose depth has an option of its own.
#[test]
fn bounces_of_a_gather_are_not_those_of_photons() {
    let folder = folder();
    let values = |name: &str, args: &[&str]| {
        let file = format!("{name}.exr");
        // With harmonics, other sums are made where the hits for these are: by a pipeline of shaders they have the same bits without.
        let common = ["--to", "camera", "--pipeline", "raycast-gl", "-o", &file];
        success(&mut bake(&folder, &scene("cornell.toml"), &[&common, args].concat()));
        Image::read(&folder.path().join(&file)).unwrap().channel("IrradianceIndirect.G").unwrap().to_vec()
    };
    // Irradiance is the default.
    let alone = values("alone", &[]);
    assert_eq!(alone, values("both", &["--what", "irradiance,prt", "--bounces", "1"]));
    assert_eq!(alone, values("named", &["--what", "irradiance,prt", "--gather-bounces", "1"]));
    assert_ne!(alone, values("photons", &["--what", "irradiance", "--photon-depth", "1"]));
}

/// The error at which a render stops is nothing to a bake, nor to its layers.
#[test]
fn a_bake_takes_all_its_directions() {
    let folder = folder();
    for (name, until) in [("a.npy", "0"), ("b.npy", "0.5")] {
        let args = ["--to", "vertices", "--what", "ao", "--directions", "2048", "--until", until, "-o", name];
        success(tool(&folder).arg("bake").arg(scene("cornell.toml")).args(args));
    }
    assert!(bytes(&folder, "a.npy") == bytes(&folder, "b.npy"));
}

/// What a PNG holds of openness and directions is data: neither a curve nor exposure changes it.
#[test]
fn data_in_a_png_is_as_it_is() {
    let folder = folder();
    fs::write(folder.path().join("plane.obj"), "v 0 0 0\nv 0 0 1\nv 1 0 1\nv 1 0 0\nf 1 2 3 4\n").unwrap();
    for (what, expected) in [("ao", [255, 255, 255]), ("bent-normal,sky", [128, 255, 128])] {
        let args =
            ["--to", "lightmap", "--resolution", "16", "--directions", "256", "--what", what, "--exposure", "-1", "-o", "a.png"];
        success(&mut bake(&folder, Path::new("plane.obj"), &args));
        let picture = image::open(folder.path().join("a.png")).unwrap().into_rgb8();
        let off = |(found, expected): (&u8, u8)| found.abs_diff(expected) > 2;
        let middle = picture.get_pixel(8, 8).0;
        assert!(!middle.iter().zip(expected).any(off), "{what}: {middle:?}");
    }
}

/// What cannot be done is refused with its place and a cure, and leaves no files.
#[test]
fn refusals() {
    let folder = folder();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("empty.csv", "");
    write("package.json", "{}");
    let long = format!("{}.ply", "a".repeat(300));
    write("nan.csv", "0,0,0,0,1,0\n0,nan,0,0,1,0\n");
    write("zero.csv", "0,0,0,0,0,0\n");
    write("bare.csv", "0,0,0\n");
    write("zero.npy", "of somebody");
    write("bare.mtl", "newmtl of_somebody\n");
    write("quad.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 3 0\nvt 3 3\nf 1/1 2/2 3/3\nf 1/1 3/3 4/2\n");
    write("none.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n");
    let before = names_in(&folder);
    let cornell = scene("cornell.toml");
    let [quad, none] = ["quad.obj", "none.obj"].map(|name| folder.path().join(name));
    let cases: &[(&Path, &[&str], i32, &str)] = &[
        (&cornell, &["--to", "walls", "--what", "ao", "-o", "a.ply"], 2, "give vertices, lightmap, camera or points:FILE"),
        (&cornell, &["--to", "vertices", "--what", "dirt", "-o", "a.ply"], 2, "dirt"),
        (&cornell, &["--to", "vertices", "--what", "ao", "-o", "a.exr"], 2, "a.exr"),
        (&cornell, &["--to", "vertices", "--what", "ao", "-o", "nowhere/a.ply"], 2, "mkdir -p nowhere"),
        (&cornell, &["--to", "vertices", "--to", "camera", "--what", "ao", "-o", "a.ply"], 2, "vertices:a.ply or camera:a.ply"),
        (
            &cornell,
            &["--to", "vertices", "--to", "camera", "--what", "ao", "-o", "camera:a.exr"],
            2,
            "no file is named for vertices",
        ),
        (&cornell, &["--to", "vertices", "--what", "ao", "-o", "lightmap:a.exr"], 2, "lightmap was not asked for"),
        (&cornell, &["--to", "lightmap", "--what", "ao", "--resolution", "4", "-o", "a.exr"], 2, "4 texels a side has no room"),
        (&cornell, &["--to", "vertices", "--what", "ao", "--gl-device", "99", "-o", "a.ply"], 69, "no EGL device 99"),
        (&cornell, &["--to", "vertices", "--what", "ao", "--directions", "1e30", "-o", "a.ply"], 2, "too large"),
        (&cornell, &["--to", "vertices", "--what", "ao", "--directions=-3", "-o", "a.ply"], 2, "negative"),
        (&cornell, &["--to", "vertices", "--what", "sh", "--order", "6", "-o", "a.ply"], 2, "from 1 to 5"),
        (&cornell, &["--to", "vertices", "--what", "ao", "--ao-distance", "-1", "-o", "a.ply"], 2, "ao-distance"),
        (&cornell, &["--to", "vertices", "--what", "ao", "--ao-distance", "inf", "-o", "a.ply"], 2, "no length above 0"),
        (&cornell, &["--to", "lightmap", "--what", "ao", "--texels-per-unit", "0", "-o", "a.exr"], 2, "not a number above 0"),
        (&cornell, &["--to", "vertices", "--what", "ao", "--checkpoint-every", "0.5", "-o", "a.ply"], 2, "not whole seconds"),
        (&cornell, &["--to", "vertices", "--what", "ao", "--directions", "_1", "-o", "a.ply"], 2, "not a whole number"),
        (&cornell, &["--to", "vertices", "--what", "ao", "--layer-size", "big", "-o", "a.ply"], 2, "nor auto"),
        (&cornell, &["--to", "vertices", "--what", "ao", "-o", &long], 2, "the name is too long"),
        (&cornell, &["--to", "lightmap", "--what", "ao", "--resolution", "1e6", "-o", "a.exr"], 2, "16384"),
        (&cornell, &["--to", "lightmap", "--what", "sky", "-o", "a.obj"], 2, "add irradiance or ao to --what"),
        (&cornell, &["--to", "points:gone.ply", "--what", "ao", "-o", "a.ply"], 65, "gone.ply"),
        (&cornell, &["--to", "points:empty.csv", "--what", "ao", "-o", "a.ply"], 65, "empty.csv"),
        (&cornell, &["--to", "points:nan.csv", "--what", "ao", "-o", "a.ply"], 65, "nan.csv:2"),
        (&cornell, &["--to", "points:zero.csv", "--what", "ao", "-o", "a.ply"], 65, "zero.csv:1"),
        (&cornell, &["--to", "points:bare.csv", "--what", "ao", "-o", "a.ply"], 65, "bare.csv"),
        (&quad, &["--to", "lightmap", "--uvs", "own", "--what", "ao", "-o", "a.exr"], 2, "cure: "),
        (&none, &["--to", "lightmap", "--uvs", "own", "--what", "ao", "-o", "a.exr"], 2, "cure: "),
        (&none, &["--to", "vertices", "--no-default-light", "-o", "a.ply"], 65, "no light"),
        (&none, &["--to", "points:zero.npy", "--what", "ao", "-o", "./zero.npy"], 2, "zero.npy: is an input"),
        (&none, &["--to", "lightmap", "--what", "irradiance", "-o", "none.obj"], 2, "none.obj: is an input"),
        (&none, &["--to", "vertices", "--what", "ao", "-o", "vertex:a.ply"], 2, "there is no receiver \"vertex\""),
        (
            &none,
            &["--to", "lightmap", "--what", "irradiance", "-o", "m.obj", "-o", "./m.png"],
            2,
            "m.png: is to be written twice",
        ),
        (&none, &["--to", "vertices", "--what", "ao", "-o", "A.NPY", "--checkpoint", "A.json"], 2, "two names"),
        (&none, &["--to", "vertices", "--what", "ao", "-o", ":a.ply"], 2, "there is no receiver \"\""),
        (&none, &["--to", "vertices", "--what", "ao", "-o", "vertices:"], 2, "names no file"),
        (
            &none,
            &["--to", "vertices", "--what", "ao", "-o", "package.npy"],
            2,
            "package.json: is there already, and describes no array",
        ),
        (
            &none,
            &["--to", "lightmap", "--what", "irradiance", "-o", "quad.obj"],
            2,
            "quad.obj: is there already, and not from a bake",
        ),
        (
            &none,
            &["--to", "lightmap", "--what", "irradiance", "-o", "bare.obj"],
            2,
            "bare.mtl: is there already, and not from a bake",
        ),
        (&none, &["--to", "lightmap", "--what", "sh", "-o", "a.png"], 2, "coefficients make no picture"),
        (&none, &["--to", "lightmap", "--what", "ao", "--samples-per-texel", "3", "-o", "a.png"], 2, "square number"),
    ];
    for (scene, args, code, text) in cases {
        let said = refusal(&mut bake(&folder, scene, args), *code);
        assert!(said.contains(text), "{args:?} says {said}");
        assert_eq!(names_in(&folder), before, "{args:?} left files");
    }
    // Openness needs no light.
    success(&mut bake(&folder, &none, &["--to", "vertices", "--what", "ao,prt", "-o", "a.ply"]));
    let said = refusal(tool(&folder).args(["relight", "a.ply", "--env", "gone.hdr", "-o", "b.ply"]), 2);
    assert!(said.contains("--scene"), "{said}");
}

/// Openness is at most 1, also along seams, and a map is as square as asked.
#[test]
fn openness_of_texels_is_a_share() {
    let folder = folder();
    let args = ["--to", "lightmap", "--what", "ao,sky", "--resolution", "96", "--directions", "64", "-o", "map.exr"];
    success(&mut bake(&folder, &scene("cornell.toml"), &args));
    let map = Image::read(&folder.path().join("map.exr")).unwrap();
    assert_eq!((map.width, map.height), (96, 96));
    for name in ["AO", "Sky"] {
        let range = map.channel(name).unwrap().iter().fold([f32::INFINITY, 0.0], |[a, b], x| [x.min(a), x.max(b)]);
        assert!(range[0] >= 0.0 && range[1] <= 1.0 && range[1] > 0.3, "{name}: {range:?}");
    }
}

/// Viewers show openness on white, whatever the colours of the model are.
#[test]
fn openness_is_shown_on_white() {
    let folder = folder();
    let textured = scene("cornell_textured.toml");
    let run = |args: &[&str]| {
        let small = ["--what", "ao", "--directions", "64", "--resolution", "64", "--size", "32", "--layer-size", "64"];
        success(&mut bake(&folder, &textured, &[args, &small].concat()));
    };
    run(&["--to", "vertices", "-o", "v.obj", "-o", "v.glb", "-o", "v.ply"]);
    run(&["--to", "lightmap", "-o", "map.obj"]);
    for name in ["v.obj", "map.obj"] {
        let options = LoadOptions { unlit: true, ..LoadOptions::default() };
        let world = World::load_with(&folder.path().join(name), options).unwrap().world;
        assert!(world.materials.iter().all(|material| material.albedo == Vec3::ONE && !material.is_emissive()), "{name}");
        let colored = world.meshes.iter().all(|mesh| mesh.colors.iter().any(|color| *color != Vec3::ONE) && color_is_grey(mesh));
        let mapped = world.materials.iter().any(|material| material.albedo_texture.is_some());
        assert_eq!((colored, mapped), if name == "v.obj" { (true, false) } else { (false, true) }, "{name}");
    }
    let glb = bytes(&folder, "v.glb");
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let file: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    for material in file["materials"].as_array().unwrap() {
        assert_eq!((&material["pbrMetallicRoughness"], &material["emissiveFactor"]), (&json!({}), &Value::Null), "{material}");
    }
    let ply = text(&bytes(&folder, "v.ply"));
    assert!(ply.contains("property uchar red\n") && ply.contains("property float ao\n"));
}

fn color_is_grey(mesh: &Mesh) -> bool {
    mesh.colors.iter().all(|color| color.max_element() - color.min_element() < 1e-6)
}

/// Pixels that see nothing are white in pictures of openness, and still nothing in numbers.
#[test]
fn nothing_hides_the_sky_from_nothing() {
    let folder = folder();
    fs::write(folder.path().join("leaf.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    for what in ["ao", "sky"] {
        let args = ["--to", "camera", "--what", what, "--size", "16", "--directions", "16", "-o", "a.png", "-o", "a.exr"];
        success(&mut bake(&folder, Path::new("leaf.obj"), &args));
        let picture = image::open(folder.path().join("a.png")).unwrap().into_rgb8();
        assert_eq!(picture.get_pixel(15, 0).0, [255; 3], "{what}");
        let numbers = Image::read(&folder.path().join("a.exr")).unwrap();
        assert_eq!([numbers.channel("R").unwrap()[15], numbers.channel("A").unwrap()[15]], [0.0; 2], "{what}");
    }
}
