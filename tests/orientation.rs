//! Fronts on the wrong side: what is told, what is not, and the cures.
#![cfg(unix)]

mod common;

use std::fs;
use std::path::Path;

use common::Model;
use common::tool::{folder, json, scene, stderr, success, tool};
use finalgather::image::Image;
use finalgather::prepared::Prepared;
use finalgather::scene::{LoadOptions, Mesh, World};
use glam::{Vec3, vec3};

const LAMP: Vec3 = Vec3::splat(10.0);

/// The material of a grey surface and that of a lamp.
fn materials(model: &mut Model) -> [u32; 2] {
    [model.material(Vec3::splat(0.5), Vec3::ZERO), model.material(Vec3::ZERO, LAMP)]
}

/// A horizontal plate of which the front is above or below.
fn plate(model: &mut Model, center: Vec3, half: f32, up: bool, material: u32) {
    let (u, v) = if up { (Vec3::Z, Vec3::X) } else { (Vec3::X, Vec3::Z) };
    model.plate(center, half * u, half * v, material);
}

fn warnings(model: Model) -> Vec<String> {
    Prepared::without_glass(&model.world()).unwrap().warnings()
}

#[test]
fn lamps_that_shine_away_are_told_by_name() {
    // In a room under the ceiling, over an open model, and beside a lamp of the same material that is right.
    let mut room = Model::new();
    let [grey, lamp] = materials(&mut room);
    room.cuboid(Vec3::Y, Vec3::ONE, 0.0, true, grey);
    plate(&mut room, 1.7 * Vec3::Y, 0.2, true, lamp);
    let mut open = Model::new();
    let [grey, lamp] = materials(&mut open);
    plate(&mut open, Vec3::ZERO, 1.0, true, grey);
    plate(&mut open, Vec3::Y, 0.3, true, lamp);
    let mut globe = Model::new();
    let [grey, lamp] = materials(&mut globe);
    globe.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, grey);
    globe.sphere(Vec3::ZERO, 0.2, 6, true, lamp);
    for (what, model) in [("room", room), ("open", open), ("globe", globe)] {
        let told = warnings(model);
        let [told] = &told[..] else { panic!("{what}: {told:?}") };
        assert!(told.starts_with("the lamps of material 2 shine away from the scene"), "{what}: {told}");
        assert!(told.contains("[materials.2]") && told.contains("--flip"), "{what}: {told}");
    }
    let mut some = Model::new();
    let [grey, lamp] = materials(&mut some);
    plate(&mut some, Vec3::ZERO, 2.0, true, grey);
    for (x, up) in [(-1.0, false), (0.0, true), (1.0, false)] {
        plate(&mut some, vec3(x, 1.0, 0.0), 0.3, up, lamp);
    }
    let told = warnings(some);
    assert!(told.len() == 1 && told[0].starts_with("1 of 3 lamps of material 2"), "{told:?}");
}

#[test]
fn lamps_that_shine_on_something_are_left_alone() {
    for name in ["cornell", "cornell_textured", "open", "glass"] {
        let world = World::load(&scene(&format!("{name}.toml"))).unwrap().world;
        assert_eq!(Prepared::without_glass(&world).unwrap().warnings(), [""; 0], "{name}");
    }
    let mut over = Model::new();
    let [grey, lamp] = materials(&mut over);
    plate(&mut over, Vec3::ZERO, 1.0, true, grey);
    plate(&mut over, Vec3::Y, 0.3, false, lamp);
    // Low over a table, in a room.
    let mut pendant = Model::new();
    let [grey, lamp] = materials(&mut pendant);
    pendant.cuboid(1.3 * Vec3::Y, 1.3 * Vec3::ONE, 0.0, true, grey);
    pendant.cuboid(0.4 * Vec3::Y, vec3(0.5, 0.4, 0.5), 0.0, false, grey);
    plate(&mut pendant, 1.1 * Vec3::Y, 0.3, false, lamp);
    // A window whose pane shines into the room, with a large ground outside.
    let mut window = Model::new();
    let [grey, lamp] = materials(&mut window);
    window.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, grey);
    window.scene.mesh.triangles.drain(0..2);
    window.plate(0.99 * Vec3::X, 0.5 * Vec3::Z, 0.5 * Vec3::Y, lamp);
    plate(&mut window, -Vec3::Y, 50.0, true, grey);
    let mut globe = Model::new();
    let [grey, lamp] = materials(&mut globe);
    globe.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, grey);
    globe.sphere(Vec3::ZERO, 0.2, 6, false, lamp);
    // Two back to back are a lamp that shines both ways.
    let mut both = Model::new();
    let [grey, lamp] = materials(&mut both);
    both.cuboid(Vec3::Y, Vec3::ONE, 0.0, true, grey);
    plate(&mut both, 1.7 * Vec3::Y, 0.2, true, lamp);
    plate(&mut both, 1.7 * Vec3::Y, 0.2, false, lamp);
    let mut two_sided = Model::new();
    let [grey, lamp] = materials(&mut two_sided);
    plate(&mut two_sided, Vec3::ZERO, 1.0, true, grey);
    plate(&mut two_sided, Vec3::Y, 0.3, true, lamp);
    two_sided.scene.materials[lamp as usize].two_sided = true;
    let models = [("over", over), ("pendant", pendant), ("window", window), ("globe", globe), ("both", both)];
    for (what, model) in models.into_iter().chain([("two-sided", two_sided)]) {
        assert_eq!(warnings(model), [""; 0], "{what}");
    }
}

/// A square that winds so that its front is above, with normals up or down at its corners, and a lamp over it that has none.
fn square(normals: &str) -> String {
    format!(
        "mtllib m.mtl\nvn 0 {normals} 0\nv -1 0 -1\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nusemtl grey\nf 1//1 2//1 3//1 4//1\n\
         v -9 3 -9\nv 9 3 -9\nv 9 3 9\nv -9 3 9\nusemtl lamp\nf -4 -3 -2 -1\n"
    )
}

fn write(folder: &Path, obj: &str, toml: &str) {
    fs::write(folder.join("m.mtl"), "newmtl grey\nKd 0.5 0.5 0.5\nnewmtl lamp\nKd 0 0 0\nKe 10 10 10\n").unwrap();
    fs::write(folder.join("m.obj"), obj).unwrap();
    fs::write(folder.join("s.toml"), format!("mesh = 'm.obj'\n{toml}")).unwrap();
}

fn load(obj: &str, toml: &str, flip: bool) -> (Mesh, Vec<String>) {
    let folder = folder();
    write(folder.path(), obj, toml);
    let loaded = World::load_with(&folder.path().join("s.toml"), LoadOptions { flip, ..LoadOptions::default() }).unwrap();
    (loaded.world.meshes[0].clone(), loaded.report.warnings)
}

#[test]
fn turning_follows_the_normals_where_they_are_against_the_winding() {
    let fronts = |mesh: &Mesh| [0, 2].map(|triangle| mesh.geometric_normal(triangle).y);
    let (mesh, told) = load(&square("1"), "", false);
    assert_eq!((fronts(&mesh), mesh.normals[0], told.len()), ([1.0, -1.0], Vec3::Y, 0));
    // All turns, the normals too.
    for (toml, flip) in [("flip = true", false), ("", true), ("flip = true", true)] {
        let (mesh, told) = load(&square("1"), toml, flip);
        assert_eq!((fronts(&mesh), mesh.normals[0], told.len()), ([-1.0, 1.0], Vec3::NEG_Y, 0), "{toml}");
    }
    // One material turns.
    let (mesh, _) = load(&square("1"), "materials.lamp.flip = true", false);
    assert_eq!((fronts(&mesh), mesh.normals[0]), ([1.0, 1.0], Vec3::Y));
    // Normals that point to the backs are told, and decide: the lamp has none and stays.
    let (mesh, told) = load(&square("-1"), "", false);
    assert_eq!(fronts(&mesh), [1.0, -1.0]);
    let [told] = &told[..] else { panic!("{told:?}") };
    assert!(told.contains("normals of m point to the back of 2 of 2 triangles") && told.contains("--flip"), "{told}");
    let (mesh, told) = load(&square("-1"), "flip = true", false);
    assert_eq!((fronts(&mesh), mesh.normals[0], told.len()), ([-1.0, -1.0], Vec3::NEG_Y, 0));
    let (_, told) = load(&square("1"), "materials.grey.two_sided = true", false);
    assert!(told.len() == 1 && told[0].contains("two_sided has no effect: material \"grey\" does not emit"), "{told:?}");
}

const SMALL: [&str; 6] = ["--directions", "256", "--layer-size", "128", "--photons", "1e4"];

/// Says what a bake says, and returns a column of its points.
fn bake(folder: &Path, args: &[&str], column: &str) -> (String, Vec<f64>) {
    let output = success(tool(folder).args(["bake", "s.toml", "-o", "v.ply"]).args(SMALL).args(args));
    let ply = fs::File::open(folder.join("v.ply")).unwrap();
    let parser = ply_rs_bw::parser::Parser::<ply_rs_bw::ply::DefaultElement>::new();
    let ply = parser.read_ply(&mut std::io::BufReader::new(ply)).unwrap();
    let value = |vertex: &ply_rs_bw::ply::DefaultElement| match vertex[column] {
        ply_rs_bw::ply::Property::Float(value) => f64::from(value),
        ref other => panic!("{column} is {other:?}"),
    };
    (stderr(&output), ply.payload["vertex"].iter().map(value).collect())
}

/// A cube whose faces wind so that their fronts are inside.
fn hollow_cube() -> String {
    let corner = |x: i32, y: i32, z: i32| format!("v {x} {y} {z}\n");
    let mut obj = String::from("mtllib m.mtl\nusemtl grey\n");
    for axis in 0..3 {
        for side in [-1, 1] {
            for [u, v] in [[-1, -1], [-side, side], [1, 1], [side, -side]] {
                let mut at = [0; 3];
                (at[axis], at[(axis + 1) % 3], at[(axis + 2) % 3]) = (side, u, v);
                obj += &corner(at[0], at[1], at[2]);
            }
            obj += "f -4 -3 -2 -1\n";
        }
    }
    obj
}

#[test]
fn models_that_are_inside_out_are_told_and_cured() {
    let folder = folder();
    write(folder.path(), &hollow_cube(), "");
    let ao = ["--to", "vertices", "--what", "ao"];
    let (said, values) = bake(folder.path(), &ao, "ao");
    assert!(said.contains("vertices see nothing of the outside") && said.contains("--flip"), "{said}");
    assert!(values.iter().all(|&open| open < 0.02), "{values:?}");
    let (said, values) = bake(folder.path(), &[&ao[..], &["--flip"]].concat(), "ao");
    assert!(!said.contains("warning"), "{said}");
    assert!(values.iter().all(|&open| open > 0.98), "{values:?}");
    // A room that a lamp lights is meant so.
    let room = hollow_cube() + "v -0.3 0.9 -0.3\nv 0.3 0.9 -0.3\nv 0.3 0.9 0.3\nv -0.3 0.9 0.3\nusemtl lamp\nf -4 -3 -2 -1\n";
    write(folder.path(), &room, "");
    let (said, values) = bake(folder.path(), &["--to", "vertices", "--what", "irradiance"], "irradiance_r");
    assert!(!said.contains("warning") && values[0] > 0.1, "{said} {values:?}");
}

/// All warnings that need no points, at no cost.
#[test]
fn info_of_a_scene_tells_what_looks_wrong() {
    let folder = folder();
    write(folder.path(), &square("-1").replace("f -4 -3 -2 -1", "f -1 -2 -3 -4"), "");
    let about = json(tool(&folder).args(["info", "s.toml", "--json"]));
    let [normals, lamps] = [0, 1].map(|i| about["warnings"][i].as_str().unwrap().to_owned());
    assert!(normals.contains("point to the back of 2 of 2"), "{normals}");
    assert!(lamps.contains("the lamps of material lamp shine away"), "{lamps}");
    let [triangles, lights] = ["triangles", "lights"].map(|key| about[key].as_u64());
    assert_eq!((triangles, lights), (Some(4), Some(2)));
    assert_eq!(about["bounds"], serde_json::json!([[-9.0, 0.0, -9.0], [9.0, 3.0, 9.0]]));
    let text = success(tool(&folder).args(["info", "s.toml", "--flip"])).stdout;
    let text = String::from_utf8(text).unwrap();
    let tells = ["4 triangles", "2 sides of triangles emit"].iter().all(|part| text.contains(part));
    assert!(tells && !text.contains("point to the back"), "{text}");
}

#[test]
fn normals_against_the_winding_are_told_and_cured() {
    let folder = folder();
    write(folder.path(), &square("1").replace("f 1//1 2//1 3//1 4//1", "f 4//1 3//1 2//1 1//1"), "settings.light_samples = 2048");
    let what = ["--to", "vertices", "--what", "irradiance"];
    let (said, values) = bake(folder.path(), &what, "irradiance_r");
    assert!(said.contains("point to the back of 2 of 2 triangles"), "{said}");
    assert!(values[0] < 0.1, "{values:?}");
    let (said, values) = bake(folder.path(), &[&what[..], &["--flip"]].concat(), "irradiance_r");
    assert!(!said.contains("warning"), "{said}");
    // Four quarters of the square lamp about the corner; each sends L/2 (X/sqrt(1+X²) atan(Y/sqrt(1+X²)) + the same with X and Y changed).
    let part = |x: f64, y: f64| {
        let half = |x: f64, y: f64| x / (1.0 + x * x).sqrt() * (y / (1.0 + x * x).sqrt()).atan();
        5.0 * (half(x, y) + half(y, x))
    };
    let (near, far) = (8.0 / 3.0, 10.0 / 3.0);
    let expected = part(near, near) + 2.0 * part(near, far) + part(far, far);
    assert!((values[0] / expected - 1.0).abs() < 0.01, "{} for {expected}", values[0]);
}

/// A two-sided lamp lights both sides alike, is seen from both, and counts in what harmonics collect.
#[test]
fn two_sided_lamps_shine_both_ways() {
    let folder = folder();
    let lamp = "mtllib m.mtl\nusemtl lamp\nv -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 1 2 3 4\n\
                usemtl grey\nv -2 -2 -2\nv -2 -2 2\nv 2 -2 2\nv 2 -2 -2\nf 5 6 7 8\n\
                v -2 2 -2\nv 2 2 -2\nv 2 2 2\nv -2 2 2\nf 9 10 11 12\n";
    let points = "x,y,z,nx,ny,nz\n0,-1,0,0,1,0\n0,1,0,0,-1,0\n";
    fs::write(folder.path().join("p.csv"), points).unwrap();
    let to = ["--to", "points:p.csv", "--what", "irradiance,sh"];
    write(folder.path(), lamp, "materials.lamp.two_sided = true");
    let (said, direct) = bake(folder.path(), &to, "irradiance_direct_r");
    assert!(!said.contains("warning"), "{said}");
    let (_, harmonics) = bake(folder.path(), &to, "sh_00_r");
    // A square of half side 1 at distance 1.
    let half = 0.5_f64.sqrt() * 0.5_f64.sqrt().atan();
    let expected = 4.0 * 5.0 * 2.0 * half;
    for (what, values) in [("direct", &direct), ("harmonics", &harmonics)] {
        assert!((values[0] / values[1] - 1.0).abs() < 0.02 && values[0] > 1.0, "{what} {values:?}");
    }
    assert!((direct[0] / expected - 1.0).abs() < 0.01, "{direct:?} for {expected}");
    for points in ["camera", "traced"] {
        for eye in [1.0, -1.0] {
            let camera = format!("[materials]\nlamp.two_sided = true\n[camera]\neye = [0, {eye}, 0.1]\ntarget = [0, 0, 0]\n");
            write(folder.path(), lamp, &camera);
            let size = ["--size", "8", "-o", "p.exr", "--points", points];
            success(tool(&folder).args(["render", "s.toml"]).args(SMALL).args(size));
            let image = Image::read(&folder.path().join("p.exr")).unwrap();
            assert!(image.channel("Emission.R").unwrap().iter().all(|&value| value == 10.0), "{points} from {eye}");
        }
    }
}
