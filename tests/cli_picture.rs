//! What makes a picture please at once: the camera.

mod common;

use std::fs;
use std::path::PathBuf;

use finalgather::image::Image;
use finalgather::job::SceneRequest;
use finalgather::scene::{CameraChange, WorldCamera};
use glam::{DVec3, Vec3, dvec3};
use serde_json::Value;
use tempfile::TempDir;

use common::tool::{bytes, cornell_with, folder, json, refusal, stderr, success, tool};

/// A roof over a corner: no two of its sides are equally far from its middle.
const MODEL: &str = "v 0 0 0\nv 5 0 1\nv 1 3 0\nv 0 1 -2\nf 1 2 3\nf 1 3 4\nf 2 3 4\n";

fn model(folder: &TempDir) -> PathBuf {
    let path = folder.path().join("model.obj");
    fs::write(&path, MODEL).unwrap();
    path
}

/// The camera of a scene of this size, with these changes.
fn camera(path: PathBuf, size: [u32; 2], view: CameraChange) -> WorldCamera {
    let settings = [("size".to_owned(), Value::from(size.to_vec()))].into_iter().collect();
    SceneRequest { path, view, settings, ..SceneRequest::default() }.load(true).unwrap().world.camera(size)
}

/// Least and greatest place of the model's vertices in the picture, from -1 to 1.
fn extent(camera: &WorldCamera, size: [u32; 2]) -> [[f64; 2]; 2] {
    let axes = camera.axes().as_dmat3();
    let half = f64::from(camera.fov_y_degrees / 2.0).to_radians().tan();
    let halves = [half * f64::from(size[0]) / f64::from(size[1]), half];
    let mut extent = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for vertex in [dvec3(0.0, 0.0, 0.0), dvec3(5.0, 0.0, 1.0), dvec3(1.0, 3.0, 0.0), dvec3(0.0, 1.0, -2.0)] {
        let place = axes.transpose() * (vertex - camera.eye);
        for axis in 0..2 {
            let at = place[axis] / (-place.z * halves[axis]);
            extent[axis] = [extent[axis][0].min(at), extent[axis][1].max(at)];
        }
    }
    extent
}

#[test]
fn a_bare_model_fills_the_picture() {
    let folder = folder();
    let z_up = CameraChange { up: Some(Vec3::Z), ..CameraChange::default() };
    let narrow = CameraChange { fov_y_degrees: Some(10.0), ..CameraChange::default() };
    for (size, change) in [([100, 100], CameraChange::default()), ([300, 100], narrow), ([100, 300], z_up)] {
        let extent = extent(&camera(model(&folder), size, change), size);
        // The margin is 5 % of each side, so 0.9 is the most.
        let touches = |axis: usize| (extent[axis][0] + 0.9).abs() < 1e-5 && (extent[axis][1] - 0.9).abs() < 1e-5;
        let most = extent.as_flattened().iter().fold(0.0, |most: f64, place| most.max(place.abs()));
        assert!((touches(0) || touches(1)) && most < 0.9 + 1e-5, "{size:?}: {extent:?}");
        // The other axis has more room, and on both sides.
        assert!(extent.iter().all(|[least, most]| *least < 0.0 && *most > 0.0), "{size:?}: {extent:?}");
    }
    // A model with z up is seen from its front, -y.
    let seen = camera(model(&folder), [100, 100], z_up);
    let back = (seen.eye - seen.target).normalize();
    assert!(back.y < -0.8 && back.z > 0.1 && seen.up == Vec3::Z, "{back}");
}

/// Each option replaces its part of the camera of a file, or of the one that shows the whole model.
#[test]
fn each_part_of_the_camera_can_be_given() {
    let folder = folder();
    let eye = CameraChange { eye: Some(dvec3(-9.0, 1.0, 0.0)), ..CameraChange::default() };
    let seen = camera(model(&folder), [64, 64], eye);
    assert_eq!((seen.eye, seen.target), (dvec3(-9.0, 1.0, 0.0), dvec3(2.5, 1.5, -0.5)));
    let aimed = CameraChange { target: Some(DVec3::ZERO), fov_y_degrees: Some(20.0), ..CameraChange::default() };
    let seen = camera(model(&folder), [64, 64], aimed);
    assert_eq!((seen.target, seen.fov_y_degrees, seen.up), (DVec3::ZERO, 20.0, Vec3::Y));

    let cornell = cornell_with(folder.path(), "box.toml", "size = [24, 24]\ndirections = 8\nphotons = 1000\n");
    let picture = |args: &[&str]| {
        success(tool(&folder).arg("render").arg(&cornell).args(["-o", "box.exr"]).args(args));
        let image = Image::read(&folder.path().join("box.exr")).unwrap();
        ["R", "P.X", "P.Y", "P.Z"].map(|name| image.channel(name).unwrap().to_vec())
    };
    let own = picture(&[]);
    let same = ["--eye", "278,273,-800", "--target=278,273,0", "--fov", "39.3077", "--up", "0,1e0,-0"];
    assert!(picture(&same) == own);
    let above = picture(&["--eye", "278,273.5,279", "--target", "278,0,279", "--up", "0,0,1"]);
    assert!(above[2].iter().all(|height| *height < 340.0), "it looks at the floor and the blocks");
}

#[test]
fn an_unusable_camera_is_refused() {
    let folder = folder();
    let model = model(&folder);
    for (args, problem) in [
        (&["--eye", "1,2"][..], "three numbers"),
        (&["--eye=1,2,x"], "three numbers"),
        (&["--fov", "0"], "fov_y_degrees is 0"),
        (&["--fov", "180"], "fov_y_degrees is 180"),
        (&["--fov", "nan"], "fov is NaN"),
        (&["--up", "0,0,0"], "up is zero"),
        (&["--eye", "1,1,1", "--target", "1,1,1"], "both"),
        (&["--eye", "0,9,0", "--target", "0,-1,0"], "parallel to the direction of view"),
        (&["--eye", "1e10,0,0"], "none beyond 1e9"),
    ] {
        let said = refusal(tool(&folder).arg("render").arg(&model).args(args), 2);
        assert!(said.contains(problem), "{args:?}: {said}");
    }
    let bake = ["--to", "vertices", "--what", "ao", "--directions", "4", "--fov", "20", "-o", "a.ply"];
    assert!(stderr(&success(tool(&folder).arg("bake").arg(&model).args(bake))).contains("are for --to camera"));
}

/// Shards look through the same camera, and so does their merge.
#[test]
fn shards_have_the_camera() {
    let folder = folder();
    let model = model(&folder);
    let view = ["--eye", "2,9,8", "--up", "0,0,-1", "--size", "16", "--directions", "32"];
    let bake = ["--to", "camera", "--what", "ao"];
    let run = |args: &[&str]| success(tool(&folder).arg("bake").arg(&model).args(bake).args(view).args(args));
    run(&["-o", "whole.exr"]);
    run(&["--shard", "1/2", "-o", "1.part"]);
    run(&["--shard", "2/2", "-o", "2.part"]);
    success(tool(&folder).args(["merge", "1.part", "2.part", "-o", "merged.exr"]));
    assert!(bytes(&folder, "whole.exr") == bytes(&folder, "merged.exr"));
    let bench = ["bench", "model.obj", "--size", "8", "--directions", "4", "--rounds", "1", "--pipelines", "raycast", "--json"];
    let points = |args: &[&str]| json(tool(&folder).args(bench).args(args))["settings"]["points"].clone();
    assert!(points(&["--fov", "60", "--target", "0,3,0", "--eye", "1,2,9"]).as_u64() < points(&[]).as_u64());
}
