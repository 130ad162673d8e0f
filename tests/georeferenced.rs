//! Models far from the origin, as maps give them: nothing rounds to 32 bits before the origin has moved, nor on the way back into files.
#![cfg(unix)]

mod common;

use std::fs;
use std::path::Path;

use common::tool::{bytes, folder, stderr, success, tool};
use finalgather::export::metadata_of;
use finalgather::image::Image;
use finalgather::points::file;
use finalgather::scene::World;
use glam::{DAffine3, DVec3, Vec3, dvec3};
use serde_json::Value;

/// Not representable in 32 bits, where neighbours lie half a unit apart.
const AWAY: DVec3 = dvec3(500_000.13, 120.0, 5_400_000.11);

/// A square on the ground with a smaller one above it, moved by `away`. The first line is a stray vertex that no face has.
fn model(away: DVec3) -> String {
    let mut obj = String::from("v 0 0 0\n");
    for (side, height) in [(10.0, 0.0), (0.4, 1.0)] {
        for (x, z) in [(0.0, 0.0), (0.0, side), (side, side), (side, 0.0)] {
            let DVec3 { x, y, z } = away + dvec3(x, height, z);
            obj += &format!("v {x} {y} {z}\n");
        }
        obj += "f -4 -3 -2 -1\n";
    }
    obj
}

fn write_scene(folder: &Path, name: &str, away: DVec3) {
    fs::write(folder.join(format!("{name}.obj")), model(away)).unwrap();
    let [eye, target] = [dvec3(3.0, 4.0, 9.0), dvec3(3.0, 0.0, 3.0)].map(|point| (away + point).to_array());
    let camera = format!("[camera]\neye = {eye:?}\ntarget = {target:?}\n");
    let scene = format!("mesh = '{name}.obj'\nenvironment.radiance = [1, 1, 1]\n{camera}");
    fs::write(folder.join(format!("{name}.toml")), scene).unwrap();
}

const SMALL: [&str; 8] = ["--size", "16", "--directions", "16", "--layer-size", "64", "--photons", "1e3"];

fn run(folder: &Path, command: &str, scene: &str, args: &[&str]) -> String {
    stderr(&success(tool(folder).arg(command).arg(scene).args(SMALL).args(args)))
}

#[test]
fn a_model_far_away_has_the_shape_of_the_same_model_nearby() {
    let folder = folder();
    for (name, away) in [("far", AWAY), ("near", DVec3::ZERO)] {
        write_scene(folder.path(), name, away);
    }
    let [far, near] = ["far", "near"].map(|name| World::load(&folder.path().join(format!("{name}.toml"))).unwrap().world);
    // Decimals near 5e6 round to 1e-9 in 64 bits. Unit space is seven units to the side.
    let (far_scene, near_scene) = (far.flatten(), near.flatten());
    for (far, near) in far_scene.mesh.positions.iter().zip(&near_scene.mesh.positions) {
        assert!(far.distance(*near) < 2e-7, "{far}, not {near}");
    }
    let [far_camera, near_camera] = [&far_scene, &near_scene].map(|scene| scene.camera.unwrap());
    assert!(far_camera.eye.distance(near_camera.eye) < 2e-7, "{} and {}", far_camera.eye, near_camera.eye);
    assert!(far_camera.target.distance(near_camera.target) < 2e-7);
    // The mesh keeps its own origin, and one nearby the file's numbers to the bit.
    assert!(far.meshes[0].bounds().diagonal() < 20.0 && far.meshes[0].positions[0].abs().max_element() < 20.0);
    assert!(far.bounds()[0].distance(AWAY) < 1e-6, "{}", far.bounds()[0]);
    assert_eq!(near.instances[0].transform, DAffine3::IDENTITY);
    assert_eq!(near.meshes[0].positions[5], Vec3::new(0.0, 1.0, 0.4));
    assert_eq!(near_scene.space.local_origin(), DVec3::ZERO);
}

/// Halfway between two 32-bit numbers, and a little above in the text alone: through 64 bits it would round down.
#[test]
fn numbers_of_a_model_nearby_round_once() {
    let folder = folder();
    let path = folder.path().join("m.obj");
    fs::write(&path, "v 1.0000000596046448 0 0\nv 2 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    fs::write(folder.path().join("s.toml"), "mesh = 'm.obj'\nenvironment.radiance = [1, 1, 1]").unwrap();
    let world = World::load(&folder.path().join("s.toml")).unwrap().world;
    let expected: f32 = "1.0000000596046448".parse().unwrap();
    assert_eq!(world.meshes[0].positions[0].x, expected);
    assert_ne!(1.0000000596046448_f64 as f32, expected, "the number tells the two ways apart");
}

#[test]
fn files_of_points_hold_64_bits_far_away_and_32_nearby() {
    let folder = folder();
    for (name, away) in [("far", AWAY), ("near", DVec3::ZERO)] {
        write_scene(folder.path(), name, away);
        let DVec3 { x, y, z } = away + dvec3(0.37, 0.0, 0.29);
        fs::write(folder.path().join(format!("{name}.csv")), format!("x,y,z,nx,ny,nz\n{x},{y},{z},0,1,0\n")).unwrap();
        let [points, out] = [format!("points:{name}.csv"), format!("points:{name}_p.ply")];
        let [ply, npy, glb] = ["ply", "npy", "glb"].map(|ending| format!("vertices:{name}.{ending}"));
        let to = ["--to", "vertices", "--to", &points, "--what", "ao"];
        let outputs = ["-o", &ply, "-o", &npy, "-o", &glb, "-o", &out];
        run(folder.path(), "bake", &format!("{name}.toml"), &[&to[..], &outputs].concat());
        let header = String::from_utf8_lossy(&bytes(&folder, &format!("{name}.ply"))).into_owned();
        assert_eq!(header.contains("property double x"), name == "far");
        assert!(header.contains("property float nx"));
        let vertices = file::read(&folder.path().join(format!("{name}.ply"))).unwrap();
        for corner in [DVec3::ZERO, dvec3(10.0, 0.0, 10.0), dvec3(0.4, 1.0, 0.4)] {
            let nearest = vertices.iter().map(|point| point.position.distance(away + corner)).fold(f64::INFINITY, f64::min);
            assert!(nearest < 2e-6, "{name}: {corner} is off by {nearest}");
        }
        let [point] = file::read(&folder.path().join(format!("{name}_p.ply"))).unwrap()[..] else { panic!("one point") };
        let rounding = if name == "far" { 0.0 } else { 2e-8 };
        assert!(point.position.distance(dvec3(x, y, z)) <= rounding, "{name}: {}", point.position);
    }
    // The same surface gives the same values: the positions of the two models round alike in unit space.
    let values = |name: &str| {
        let points = file::read(&folder.path().join(name)).unwrap();
        points.iter().map(|point| point.normal).collect::<Vec<_>>()
    };
    assert_eq!(values("far.ply"), values("near.ply"));

    // glTF has 32 bits at a vertex, and 64 in the node.
    let document = gltf::Gltf::from_slice(&bytes(&folder, "far.glb")).unwrap();
    let glb = bytes(&folder, "far.glb");
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let root: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    let origin: DVec3 = serde_json::from_value::<[f64; 3]>(root["nodes"][0]["translation"].clone()).unwrap().into();
    let blob = document.blob.as_deref();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let positions: Vec<DVec3> =
        primitive.reader(|_| blob).read_positions().unwrap().map(|position| origin + Vec3::from(position).as_dvec3()).collect();
    assert!(positions.iter().any(|position| position.distance(AWAY + dvec3(0.4, 1.0, 0.4)) < 2e-6), "{positions:?}");
    let near = bytes(&folder, "near.glb");
    assert!(!String::from_utf8_lossy(&near).contains("translation"));

    // The points of the transfer are known again.
    run(folder.path(), "bake", "far.toml", &["--to", "vertices", "--what", "prt", "-o", "t.npy"]);
    fs::write(
        folder.path().join("sky.hdr"),
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x82\x80\x80\x80\x82",
    )
    .unwrap();
    let relit = ["relight", "t.npy", "--env", "sky.hdr", "--scene", "far.toml", "-o", "lit.ply"];
    success(tool(&folder).args(relit));
    assert_eq!(file::read(&folder.path().join("lit.ply")).unwrap(), file::read(&folder.path().join("far.ply")).unwrap());
}

#[test]
fn a_light_map_far_away_comes_with_its_model() {
    let folder = folder();
    write_scene(folder.path(), "far", AWAY);
    run(folder.path(), "bake", "far.toml", &["--to", "lightmap", "--what", "irradiance", "--resolution", "32", "-o", "map.obj"]);
    fs::write(folder.path().join("again.toml"), "mesh = 'map.obj'\nenvironment.radiance = [1, 1, 1]").unwrap();
    let [min, max] = World::load(&folder.path().join("again.toml")).unwrap().world.bounds();
    assert!(min.distance(AWAY) < 2e-6 && max.distance(AWAY + dvec3(10.0, 1.0, 10.0)) < 2e-6, "{min} to {max}");
}

#[test]
fn pictures_far_away_have_positions_from_an_origin_that_they_name() {
    let folder = folder();
    for (name, away) in [("far", AWAY), ("near", DVec3::ZERO)] {
        write_scene(folder.path(), name, away);
    }
    let said = run(folder.path(), "render", "near.toml", &["-o", "near.exr"]);
    assert!(!said.contains("origin"), "{said}");
    let said = run(folder.path(), "render", "far.toml", &["-o", "far.exr"]);
    assert!(said.contains("P.X, P.Y and P.Z are relative to"), "{said}");
    let said = run(folder.path(), "render", "far.toml", &["-o", "far.png"]);
    assert!(!said.contains("origin"), "{said}");

    let path = folder.path().join("far.exr");
    let about = metadata_of(&path).unwrap();
    let origin: DVec3 = serde_json::from_value::<[f64; 3]>(about["position_origin"].clone()).unwrap().into();
    let positions = |name: &str| {
        let image = Image::read(&folder.path().join(name)).unwrap();
        let channel = |name: &str| image.channel(name).unwrap().to_vec();
        let ([x, y, z], covered) = (["P.X", "P.Y", "P.Z"].map(channel), channel("A"));
        (0..x.len()).filter(|&i| covered[i] == 1.0).map(|i| Vec3::new(x[i], y[i], z[i]).as_dvec3()).collect::<Vec<_>>()
    };
    let (far, near) = (positions("far.exr"), positions("near.exr"));
    assert!(far.len() > 50 && far.len() == near.len());
    for (far, near) in far.iter().zip(&near) {
        assert!((origin + *far).distance(AWAY + *near) < 2e-5, "{far} from {origin}, not {near} from {AWAY}");
    }
}
