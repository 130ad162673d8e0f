//! `.npz` files: what numpy finds in them, and that the tool knows its own.

mod common;

use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Read};
use std::path::Path;

use common::gpu;
use common::tool::{folder, scene, stderr, success, tool};
use finalgather::export::metadata_of;
use finalgather::npy::{Array, is_u32, parse_text};
use serde_json::Value;
use zip::ZipArchive;

/// The arrays of a file by name.
fn arrays(path: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut zip = ZipArchive::new(Cursor::new(fs::read(path).unwrap())).unwrap();
    let names: Vec<_> = zip.file_names().map(|name| name.unwrap().into_owned()).collect();
    let mut read = |name: String| {
        let mut bytes = Vec::new();
        zip.by_name(&name).unwrap().read_to_end(&mut bytes).unwrap();
        (name.strip_suffix(".npy").expect("all are arrays").to_owned(), bytes)
    };
    names.into_iter().map(&mut read).collect()
}

fn about(arrays: &BTreeMap<String, Vec<u8>>) -> Value {
    serde_json::from_str(&parse_text(&arrays["about"]).unwrap()).unwrap()
}

fn shape(arrays: &BTreeMap<String, Vec<u8>>, name: &str) -> Vec<usize> {
    Array::parse(name.as_ref(), &arrays[name]).unwrap_or_else(|error| panic!("{name}: {error}")).shape
}

#[test]
fn vertices_have_the_numbers_of_npy() {
    let _turn = gpu();
    let folder = folder();
    let bake = ["bake", scene("cornell.toml").to_str().unwrap(), "--to", "vertices", "--order", "2", "--directions", "32"]
        .map(str::to_owned);
    let what = ["--photons", "1000", "--what", "ao,prt,bent-normal", "-o", "a.npz", "-o", "a.npy"];
    success(tool(&folder).args(&bake).args(what));
    let arrays = arrays(&folder.path().join("a.npz"));
    let names: Vec<_> = arrays.keys().map(String::as_str).collect();
    assert_eq!(names, ["about", "ao", "bent_normal", "faces", "normals", "positions", "prt", "sources"]);

    let bytes = fs::read(folder.path().join("a.npy")).unwrap();
    let rows = Array::parse("a.npy".as_ref(), &bytes).unwrap();
    let [points, 16] = rows.shape[..] else { panic!("{:?}", rows.shape) };
    assert_eq!(shape(&arrays, "ao"), [points]);
    assert_eq!(shape(&arrays, "prt"), [points, 4, 3]);
    assert_eq!([shape(&arrays, "bent_normal"), shape(&arrays, "normals"), shape(&arrays, "positions")], [[points, 3]; 3]);
    let [ao, prt] = ["ao", "prt"].map(|name| Array::parse(name.as_ref(), &arrays[name]).unwrap());
    for point in 0..points {
        assert_eq!(ao.at(&[point]), rows.at(&[point, 0]), "AO of {point}");
        assert_eq!(prt.at(&[point, 3, 1]), rows.at(&[point, 11]), "PRT.03.G of {point}");
    }
    // The second array of the .npy maps its rows, and so do these.
    assert_eq!(arrays["sources"], fs::read(folder.path().join("a.sources.npy")).unwrap());
    assert!(is_u32(&arrays["faces"]));
    let about = about(&arrays);
    assert_eq!(about["quantities"].as_object().unwrap().len(), 3);
    assert_eq!(about["finalgather"]["receiver"], "vertices");
    assert!(about["basis"].as_str().unwrap().contains("spherical harmonics") && about["sources"]["array"] == "sources");
}

#[test]
fn pixels_and_texels_have_the_shape_of_pictures() {
    let _turn = gpu();
    let folder = folder();
    let options =
        ["--to", "camera", "--to", "lightmap", "--what", "sky,ao", "--size", "24x16", "--resolution", "20", "--directions", "16"];
    let outputs = ["-o", "camera:c.npz", "-o", "lightmap:l.npz", "-o", "lightmap:l.glb"];
    success(tool(&folder).arg("bake").arg(scene("cornell.toml")).args(options).args(outputs));
    let map = arrays(&folder.path().join("l.npz"));
    assert_eq!([shape(&map, "sky"), shape(&map, "ao"), shape(&map, "mask")], [[20, 20]; 3]);
    let vertices = shape(&map, "positions")[0];
    assert_eq!([shape(&map, "uv"), shape(&map, "normals")], [[vertices, 2], [vertices, 3]]);
    // One row for each pixel that sees a surface, as in a .npy.
    let pixels = arrays(&folder.path().join("c.npz"));
    assert_eq!(shape(&pixels, "ao"), shape(&pixels, "positions")[..1]);
    assert!(!pixels.contains_key("faces"));
}

#[test]
fn the_tool_knows_a_finished_file() {
    let _turn = gpu();
    let folder = folder();
    let run = |options: &[&str]| {
        let bake = ["--to", "vertices", "--what", "ao", "--directions", "16", "-o", "a.npz"];
        stderr(&success(tool(&folder).arg("bake").arg(scene("cornell.toml")).args(bake).args(options)))
    };
    run(&[]);
    let path = folder.path().join("a.npz");
    let first = fs::read(&path).unwrap();
    assert_eq!(metadata_of(&path).unwrap()["complete"], true);
    assert!(run(&["--resume"]).contains("finished by an earlier run"));
    run(&[]);
    assert!(fs::read(&path).unwrap() == first, "equal jobs give other bytes");

    let mut damaged = first.clone();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    for bytes in [&damaged[..], &first[..middle], b"PK"] {
        fs::write(&path, bytes).unwrap();
        assert_eq!(metadata_of(&path), None);
    }
    assert!(!run(&["--resume"]).contains("finished by an earlier run"));
    assert!(fs::read(&path).unwrap() == first, "it was not made again");
}

#[test]
fn relight_reads_its_own_points_alone() {
    let _turn = gpu();
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    for (name, size) in [("a", 1), ("b", 2)] {
        fs::write(path(&format!("{name}.obj")), format!("v 0 0 0\nv {size} 0 0\nv 0 0 -{size}\nf 1 2 3\n")).unwrap();
    }
    let sky = finalgather::image::Channel { name: String::new(), samples: vec![1.0; 2] };
    let channels = ["R", "G", "B"].map(|name| finalgather::image::Channel { name: name.into(), ..sky.clone() }).into();
    finalgather::Image { width: 2, height: 1, channels }.write(&path("sky.exr"), &Default::default()).unwrap();
    for output in ["prt.npz", "prt.npy"] {
        success(tool(&folder).args(["bake", "a.obj", "--to", "vertices", "--what", "prt", "--directions", "16", "-o", output]));
    }
    let relight = |transfer: &str, more: &[&str]| {
        tool(&folder).args(["relight", transfer, "--env", "sky.exr"]).args(more).output().unwrap()
    };
    for (transfer, output) in [("prt.npz", "x.npz"), ("prt.npy", "y.npy")] {
        assert!(relight(transfer, &["-o", output]).status.success());
    }
    let light = arrays(&path("x.npz"));
    let bytes = fs::read(path("y.npy")).unwrap();
    let [x, y] = [Array::parse("x".as_ref(), &light["irradiance"]).unwrap(), Array::parse("y".as_ref(), &bytes).unwrap()];
    assert!((0..3).all(|point| x.at(&[point, 0]) == y.at(&[point, 0]) && x.at(&[point, 0]) > 3.0));

    // A description of another array lies beside it, and says nothing about it.
    fs::write(path("prt.json"), "{\"positions_sha256\": \"0\"}").unwrap();
    assert!(relight("prt.npz", &["--scene", "a.obj", "-o", "a.ply"]).status.success());
    let other = relight("prt.npz", &["--scene", "b.obj", "-o", "b.ply"]);
    assert_eq!(other.status.code(), Some(65), "{}", stderr(&other));
    assert!(stderr(&other).contains("transfer of other points"), "{}", stderr(&other));

    // What no bake writes: more bands than there are, and no points of any width.
    for shape in ["(1, 36, 3)", "(0, 900000000000, 3)"] {
        let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}");
        header += &" ".repeat(117 - header.len());
        header.push('\n');
        let numbers = if shape.starts_with("(1") { vec![0; 4 * 36 * 3] } else { Vec::new() };
        let array = [b"\x93NUMPY\x01\0\x76\0", header.as_bytes(), &numbers].concat();
        let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
        let stored = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        zip.start_file("prt.npy", stored).unwrap();
        std::io::Write::write_all(&mut zip, &array).unwrap();
        fs::write(path("odd.npz"), zip.finish().unwrap().into_inner()).unwrap();
        let refused = relight("odd.npz", &["-o", "z.npy"]);
        assert_eq!(refused.status.code(), Some(65), "{}", stderr(&refused));
        assert!(stderr(&refused).contains("prt has the shape"), "{}", stderr(&refused));
    }
}
