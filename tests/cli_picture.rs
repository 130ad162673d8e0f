//! What makes a picture please at once: camera, exposure, background, ground and clay.

mod common;

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use finalgather::image::Image;
use finalgather::job::SceneRequest;
use finalgather::scene::{CameraChange, WorldCamera};
use glam::{DVec3, Vec3, dvec3};
use image::DynamicImage;
use serde_json::{Value, json};
use tempfile::TempDir;

use common::tool::{self, bytes, cornell_with, folder, refusal, scene, stderr, success, tool};

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
    let points = |args: &[&str]| tool::json(tool(&folder).args(bench).args(args))["settings"]["points"].clone();
    assert!(points(&["--fov", "60", "--target", "0,3,0", "--eye", "1,2,9"]).as_u64() < points(&[]).as_u64());
}

/// Renders `scene` small, with these further arguments.
fn render(folder: &TempDir, scene: &str, args: &[&str]) -> Command {
    let mut command = tool(folder);
    command.args(["render", scene, "--size", "32", "--directions", "64", "--photons", "1e4"]).args(args);
    command
}

fn rgba(folder: &TempDir, name: &str) -> DynamicImage {
    image::open(folder.path().join(name)).unwrap()
}

/// A bare model under the soft sky has what a picture needs to please; what scene files say stays.
#[test]
fn bare_models_please_and_scene_files_stay() {
    let folder = folder();
    model(&folder);
    fs::write(folder.path().join("scene.toml"), "mesh = 'model.obj'").unwrap();
    let report = tool::json(&mut render(&folder, "model.obj", &["-o", "a.png", "-o", "a.exr", "--json"]));
    let stops = report["exposure"].as_f64().unwrap() as f32;
    assert_eq!(
        [&report["settings"]["exposure"], &report["settings"]["background"], &report["settings"]["ground"]],
        [&json!("auto"), &json!("transparent"), &json!(true)]
    );
    let image = Image::read(&folder.path().join("a.exr")).unwrap();
    assert_eq!(image.automatic_exposure(), stops);
    // Alpha is the coverage and the shadow.
    let seen = image.channel("A").unwrap().iter().zip(image.channel("Shadow").unwrap());
    let alpha: Vec<u8> = seen.map(|(cover, shadow)| (255.0 * (cover + shadow)).round() as u8).collect();
    assert!(alpha.contains(&255) && alpha.iter().any(|&alpha| (20..200).contains(&alpha)));
    let DynamicImage::ImageRgba8(picture) = rgba(&folder, "a.png") else { panic!("no alpha channel") };
    assert_eq!(picture.pixels().map(|pixel| pixel[3]).collect::<Vec<_>>(), alpha);

    let report = tool::json(&mut render(&folder, "scene.toml", &["-o", "b.png", "-o", "b.exr", "--json"]));
    assert_eq!((&report["exposure"], &report["settings"]["ground"]), (&json!(0.0), &json!(false)));
    assert!(matches!(rgba(&folder, "b.png"), DynamicImage::ImageRgb8(_)));
    // The surfaces are the same: the ground takes no light.
    let plain = Image::read(&folder.path().join("b.exr")).unwrap();
    for name in ["R", "G", "B", "A", "Direct.R", "Indirect.G", "Environment.B", "P.X"] {
        assert!(plain.channel(name) == image.channel(name), "{name}");
    }
    assert!(plain.channel("Shadow").is_none());
    // The options repeat it, with a number for the exposure.
    let stops = stops.to_string();
    let same = ["--exposure", &stops, "--background", "transparent", "--ground", "on", "-o", "c.png"];
    success(&mut render(&folder, "scene.toml", &same));
    assert!(bytes(&folder, "a.png") == bytes(&folder, "c.png"));
}

/// What a plate hides of an even sky is a form factor.
#[test]
fn the_ground_catches_what_is_taken_of_its_light() {
    let folder = folder();
    // A small triangle at the foot makes the ground lie 1 below the plate.
    let plate = "v -1 1 -1\nv 1 1 -1\nv 1 1 1\nv -1 1 1\nf 1 2 3\nf 1 3 4\nv 5 0 -5\nv 5.01 0 -5\nv 5 .01 -5\nf 5 6 7\n";
    fs::write(folder.path().join("plate.obj"), format!("mtllib plate.mtl\nusemtl black\n{plate}")).unwrap();
    fs::write(folder.path().join("plate.mtl"), "newmtl black\nKd 0 0 0\n").unwrap();
    let scene =
        "mesh = 'plate.obj'\nenvironment = { radiance = [2, 2, 2] }\ncamera = { eye = [0, 0.6, 9], target = [0, 0, 0] }\n";
    fs::write(folder.path().join("plate.toml"), scene).unwrap();
    // A point under a corner of a rectangle a x b at height 1.
    let corner = |a: f64, b: f64| {
        let part = |a: f64, b: f64| a / (1.0 + a * a).sqrt() * (b / (1.0 + a * a).sqrt()).atan();
        (part(a, b) + part(b, a)) / std::f64::consts::TAU
    };
    let hidden = |x: f64, z: f64| {
        let sides = |at: f64| [(1.0 - at).abs().copysign(1.0 - at), (1.0 + at).abs().copysign(1.0 + at)];
        let parts = sides(x).into_iter().flat_map(|a| sides(z).map(|b| corner(a.abs(), b.abs()) * a.signum() * b.signum()));
        parts.sum::<f64>()
    };
    // Layers show outlines half a texel too large.
    for (how, bias) in [(&["--pipeline", "fused"][..], 0.02), (&["--pipeline", "raycast-gl", "--interleave", "2"], 0.005)] {
        let args = ["--ground", "on", "--size", "33", "--directions", "2048", "--fov", "4", "-o", "plate.exr"];
        success(&mut render(&folder, "plate.toml", &[&args[..], how].concat()));
        let image = Image::read(&folder.path().join("plate.exr")).unwrap();
        let shadow = image.channel("Shadow").unwrap();
        let (mut most, mut sum, mut count) = (0.0_f64, 0.0, 0);
        for (pixel, &caught) in shadow.iter().enumerate() {
            // The middle of the pixel on the ground, 9 from the eye.
            let [across, up] = [pixel % 33, pixel / 33].map(|at| (at as f64 - 16.0) / 16.5 * 2_f64.to_radians().tan());
            let (forward, right) = (dvec3(0.0, -0.6, -9.0).normalize(), DVec3::X);
            let ray = forward + across * right - up * right.cross(forward);
            let place = dvec3(0.0, 0.6, 9.0) - ray * (0.6 / ray.y);
            if ray.y < -0.02 && place.z > -2.0 && image.channel("A").unwrap()[pixel] == 0.0 {
                let expected = ((hidden(place.x, place.z) - 0.01) / 0.99).max(0.0);
                let off = f64::from(caught) - expected;
                (most, sum, count) = (most.max(off.abs()), sum + off, count + 1);
            }
        }
        let mean = sum / f64::from(count);
        assert!(count > 200 && most < 0.05 && mean.abs() < bias, "{how:?}: off by {most}, mean {mean}, in {count} pixels");
        assert!(shadow.iter().any(|&shadow| shadow > 0.5), "{how:?}");
    }
}

#[test]
fn backgrounds_stand_where_there_is_no_surface() {
    let folder = folder();
    model(&folder);
    let first = |args: &[&str]| {
        let all = ["--ground", "off", "-o", "a.png"];
        let said = stderr(&success(&mut render(&folder, "model.obj", &[&all[..], args].concat())));
        assert!(said.contains("soft sky"), "{said}");
        rgba(&folder, "a.png").into_rgba8().get_pixel(0, 0).0
    };
    assert_eq!(first(&[])[3], 0);
    assert_eq!(first(&["--background", "#336699"]), [0x33, 0x66, 0x99, 255]);
    assert_eq!(first(&["--background", "1,0,0.2140411"]), [255, 0, 127, 255]);
    // The sky itself, brighter with more exposure.
    let dark = first(&["--background", "environment", "--exposure", "-2"]);
    let bright = first(&["--background", "environment", "--exposure", "0"]);
    assert!(dark[0] < bright[0] && dark[3] == 255, "{dark:?} {bright:?}");
    for (args, problem) in
        [(["--background", "blue"], "#rrggbb"), (["--ground", "yes"], "not on or off"), (["--exposure", "bright"], "nor auto")]
    {
        let said = refusal(&mut render(&folder, "model.obj", &args), 2);
        assert!(said.contains(problem), "{args:?}: {said}");
    }
    fs::write(folder.path().join("wrong.toml"), "mesh = 'model.obj'\nsettings.background = 'blue'").unwrap();
    assert!(refusal(&mut render(&folder, "wrong.toml", &[]), 65).contains("is no background"));
}

/// A shadow of what lamps do not light would be wrong, so it is told.
#[test]
fn the_ground_tells_what_it_cannot_catch() {
    let folder = folder();
    let cornell = cornell_with(folder.path(), "box.toml", "photons = 1000\ndirections = 16\nsize = [16, 16]\n");
    let said = |args: &[&str]| {
        let mut command = tool(&folder);
        command.arg("render").arg(&cornell).args(["--ground", "on", "-o", "a.png"]).args(args);
        stderr(&success(&mut command))
    };
    assert!(said(&[]).contains("--ground has no effect"));
    fs::copy(scene("open_sky.hdr"), folder.path().join("sky.hdr")).unwrap();
    assert!(said(&["--env", "sky.hdr"]).contains("lamps light the ground too"));
}

#[test]
fn clay_is_grey_and_lamps_shine() {
    let folder = folder();
    success(tool(&folder).arg("render").arg(scene("cornell_textured.toml")).args([
        "--clay",
        "--size",
        "32",
        "--directions",
        "32",
        "--photons",
        "1e4",
        "-o",
        "a.exr",
    ]));
    let image = Image::read(&folder.path().join("a.exr")).unwrap();
    let channel = |name: &str| image.channel(name).unwrap();
    assert!(channel("Albedo.R").iter().zip(channel("A")).all(|(albedo, cover)| (albedo - 0.8 * cover).abs() < 1e-4));
    assert!(channel("Direct.R").iter().any(|&light| light > 0.1));
}

/// A merge shows what one run shows, or what it is asked for.
#[test]
fn merged_pictures_have_exposure_background_and_shadow() {
    let folder = folder();
    model(&folder);
    success(&mut render(&folder, "model.obj", &["-o", "whole.png", "-o", "whole.exr"]));
    success(&mut render(&folder, "model.obj", &["--shard", "1/2", "-o", "1.part"]));
    success(&mut render(&folder, "model.obj", &["--shard", "2/2", "-o", "2.part"]));
    let merge = |args: &[&str]| success(tool(&folder).args(["merge", "1.part", "2.part"]).args(args));
    merge(&["-o", "merged.png", "-o", "merged.exr"]);
    for ending in ["png", "exr"] {
        assert!(bytes(&folder, &format!("whole.{ending}")) == bytes(&folder, &format!("merged.{ending}")), "{ending}");
    }
    merge(&["--exposure", "0", "--background", "#ffffff", "-o", "white.png"]);
    assert_eq!(rgba(&folder, "white.png").into_rgba8().get_pixel(0, 0).0, [255; 4]);
}

/// A bare model in the light of a day: the sun and its sky are in the picture and in `info`, and `init` has a place for them.
#[test]
fn a_sun_and_its_sky_light_a_bare_model() {
    let folder = folder();
    model(&folder);
    let render = |args: &[&str]| {
        let mut command = tool(&folder);
        command.args(["render", "model.obj", "-o", "m.exr", "--size", "16", "--directions", "16", "--photons", "1e4"]).args(args);
        command
    };
    assert!(refusal(&mut render(&["--sky"]), 64).contains("a sky needs a sun"));
    assert!(refusal(&mut render(&["--sky=1", "--sun", "0,30"]), 64).contains("turbidity"));
    assert!(refusal(&mut render(&["--sun", "0,100"]), 64).contains("height"));
    let lit = |args: &[&str]| {
        success(&mut render(args));
        let image = Image::read(&folder.path().join("m.exr")).unwrap();
        let mean = |name: &str| image.channel(name).map(|samples| samples.iter().sum::<f32>() / samples.len() as f32);
        [mean("Direct.R").unwrap(), mean("Environment.R").unwrap_or_default()]
    };
    // Lux in place of 1e5 of the real sun, and the sky's nits.
    let [direct, sky] = lit(&["--sun", "20,30,7"]);
    assert!((0.05..3.0).contains(&direct) && sky == 0.0, "{direct} {sky}");
    let [direct, sky] = lit(&["--sun=-160,30", "--sky=2.5"]);
    assert!((500.0..5e4).contains(&direct) && (500.0..5e4).contains(&sky), "{direct} {sky}");
    fs::write(
        folder.path().join("s.toml"),
        "mesh = \"model.obj\"\n[sun]\ndirection = [0, 1, 1]\nilluminance = 3\n[[lights]]\nkind = \"spot\"\nposition = [0, 9, 0]\n\
         direction = [0, -1, 0]\nintensity = 50\n",
    )
    .unwrap();
    let info = tool::json(&success(tool(&folder).args(["info", "s.toml", "--json"])));
    let lights = info["punctual_lights"].as_array().unwrap();
    assert_eq!((&info["lights"], lights.len(), &lights[0]["kind"]), (&json!(0), 2, &json!("spot")));
    assert_eq!((&lights[1]["kind"], &lights[1]["illuminance"]), (&json!("directional"), &json!([3.0, 3.0, 3.0])));
    let text = success(tool(&folder).args(["info", "s.toml"])).stdout;
    let text = String::from_utf8(text).unwrap();
    assert!(text.contains("light 0: spot at 0 9 0 towards 0 -1 0, 50 50 50 cd, 0 to 45 degrees from its axis"), "{text}");
    assert!(text.contains("lights: 2 lights without a surface"), "{text}");
    success(tool(&folder).args(["init", "model.obj", "-o", "i.toml"]));
    let written = fs::read_to_string(folder.path().join("i.toml")).unwrap();
    assert!(written.contains("# [sun]") && written.contains("# [sky]") && written.contains("# [[lights]]"), "{written}");
    // With the marks taken away it is a scene in that light.
    let day: String = written
        .lines()
        .map(|line| format!("{}\n", line.strip_prefix("# ").filter(|rest| is_daylight(rest)).unwrap_or(line)))
        .collect();
    fs::write(folder.path().join("i.toml"), day).unwrap();
    let info = tool::json(&success(tool(&folder).args(["info", "i.toml", "--json"])));
    assert_eq!(info["punctual_lights"].as_array().unwrap().len(), 2, "{info}");
}

fn is_daylight(line: &str) -> bool {
    ["[sun]", "azimuth", "height", "illuminance", "[[lights]]", "kind = \"point", "position", "intensity", "radius"]
        .iter()
        .any(|start| line.starts_with(start))
}
