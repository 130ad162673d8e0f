//! Folders with an OBJ and an MTL file, and checks of what they open as.
#![allow(dead_code, reason = "each test uses a part")]

use std::fs;

use finalgather::error::Error;
use finalgather::scene::{LoadOptions, Loaded, World};
use glam::{Vec3, vec3};

/// The corners of a quad around the origin.
pub const CORNERS: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n";
pub const QUAD: &str =
    "mtllib m.mtl\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl wall\nf 1/1 2/2 3/3 4/4\n";
pub const WALL: &str = "newmtl wall\nKd 0.8 0.2 0.2\n";
pub const RED: Vec3 = vec3(0.8, 0.2, 0.2);
pub const GREY: Vec3 = Vec3::splat(0.5);

/// Colour of `picture`, linear.
pub const PICTURE: Vec3 = vec3(1.0, 0.0, 0.215_860_5);

pub fn picture() -> Vec<u8> {
    encoded(image::RgbImage::from_pixel(2, 2, image::Rgb([255, 0, 128])).into())
}

pub fn encoded(picture: image::DynamicImage) -> Vec<u8> {
    let mut bytes = Vec::new();
    picture.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
    bytes
}

pub fn load(files: &[(&str, &[u8])], strict: bool) -> Result<Loaded, Error> {
    let folder = tempfile::tempdir().unwrap();
    for (name, contents) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, contents).unwrap();
    }
    World::load_with(&folder.path().join("m.obj"), LoadOptions { strict, unlit: true, ..LoadOptions::default() })
}

pub fn open(files: &[(&str, &[u8])]) -> Loaded {
    load(files, false).unwrap_or_else(|error| panic!("{error}"))
}

/// The albedo at the centre of the first quad.
pub fn centre(world: &World) -> Vec3 {
    world.flatten().albedo(0, vec3(0.5, 0.0, 0.5))
}

pub fn check(obj: &str, mtl: &str, albedo: Vec3, triangles: usize, warning: &str) {
    check_files(&[("m.obj", obj.as_bytes()), ("m.mtl", mtl.as_bytes())], albedo, triangles, warning);
}

/// `warning` is what the only one has, with its place first. Empty: there is none.
pub fn check_files(files: &[(&str, &[u8])], albedo: Vec3, triangles: usize, warning: &str) {
    let shown: String =
        files.iter().map(|(_, contents)| String::from_utf8_lossy(contents).chars().take(300).collect::<String>()).collect();
    let Loaded { world, report, .. } = load(files, false).unwrap_or_else(|error| panic!("{shown}\n{error}"));
    let found = centre(&world);
    assert!((found - albedo).abs().max_element() < 1e-4, "{shown}\nalbedo {found}, not {albedo}\n{:?}", report.warnings);
    assert_eq!(world.meshes.iter().map(|mesh| mesh.triangles.len()).sum::<usize>(), triangles, "{shown}");
    match &report.warnings[..] {
        [] if warning.is_empty() => {}
        [only] if !warning.is_empty() => {
            let (place, fragment) = warning.split_once(' ').unwrap();
            let place = format!("/{}", place.trim_end_matches(':'));
            assert!(only.contains(&place) && only.contains(fragment), "{shown}\nhas no \"{warning}\": {only}");
        }
        other => panic!("{shown}\n{other:#?}\nnot \"{warning}\""),
    }
}
