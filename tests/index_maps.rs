//! Values at vertices name the vertices of the model's file, and `--per source` gives one row for each of these, in their order.
#![cfg(unix)]

mod common;

use std::collections::BTreeMap;
use std::fs;
use std::process::Command;

use common::tool::{bytes, folder, json, stderr, success, tool};
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Ply, Property};
use serde_json::{Value, json};
use tempfile::TempDir;

/// A slanted box without a lid, seen from inside, whose corners have different angles. Vertex 1 and the last one are not used.
const MODEL: &str = "ply\nformat ascii 1.0\nelement vertex 10\nproperty float x\nproperty float y\nproperty float z\nelement face 6\n\
    property list uchar int vertex_indices\nend_header\n0 0 0\n9 9 9\n2 0 0\n2 1 0\n0 1 0\n1 0 1\n3 0 1\n3 1 1\n1 1 1\n-5 0 0\n\
    4 0 2 3 4\n4 0 5 6 2\n4 2 6 7 3\n4 3 7 8 4\n3 4 8 5\n3 4 5 0\n";
const ROWS: usize = 10;

fn bake(folder: &TempDir, args: &[&str]) -> Command {
    let mut command = tool(folder);
    command.args(["bake", "m.ply", "--to", "vertices", "--directions", "64", "--layer-size", "64"]).args(args);
    command
}

fn with_model() -> TempDir {
    let folder = folder();
    fs::write(folder.path().join("m.ply"), MODEL).unwrap();
    folder
}

fn read_ply(folder: &TempDir, name: &str) -> Ply<DefaultElement> {
    Parser::<DefaultElement>::new().read_ply(&mut &bytes(folder, name)[..]).unwrap()
}

fn float(row: &DefaultElement, name: &str) -> f32 {
    if let Property::Float(value) = row[name] { value } else { panic!("{name} is no float") }
}

fn place(row: &DefaultElement) -> [f32; 3] {
    ["x", "y", "z"].map(|name| float(row, name))
}

/// The object and the index in the file of each vertex.
fn sources(ply: &Ply<DefaultElement>) -> Vec<[u32; 2]> {
    let whole = |row: &DefaultElement, name: &str| if let Property::UInt(value) = row[name] { value } else { panic!("{name}") };
    ply.payload["vertex"].iter().map(|row| ["source_object", "source_index"].map(|name| whole(row, name))).collect()
}

fn faces(ply: &Ply<DefaultElement>) -> Vec<Vec<u32>> {
    ply.payload["face"].iter().map(|face| face["vertex_indices"].to_u32_list().unwrap()).collect()
}

/// The positions in the model's file.
fn places() -> Vec<[f32; 3]> {
    let lines = MODEL.split_once("end_header\n").unwrap().1.lines().take(ROWS);
    lines.map(|line| line.split(' ').map(|word| word.parse().unwrap()).collect::<Vec<f32>>().try_into().unwrap()).collect()
}

/// But for the rounding of unit space.
fn are_near(a: [f32; 3], b: [f32; 3]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6)
}

/// The words of an array after its header.
fn words(folder: &TempDir, name: &str, kind: &str, shape: &str) -> Vec<u32> {
    let bytes = bytes(folder, name);
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = std::str::from_utf8(&bytes[10..10 + length]).unwrap();
    assert!(header.contains(&format!("'descr': '{kind}'")) && header.contains(&format!("'shape': ({shape}")), "{header}");
    bytes[10 + length..].as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect()
}

fn description(folder: &TempDir, name: &str) -> Value {
    serde_json::from_slice(&bytes(folder, name)).unwrap()
}

#[test]
fn rows_name_their_vertices() {
    let folder = with_model();
    success(&mut bake(&folder, &["--what", "ao", "-o", "v.ply", "-o", "v.npy"]));
    let ply = read_ply(&folder, "v.ply");
    let sources = sources(&ply);
    // Eight vertices are used, each by two or three sides.
    let mut count = [0; ROWS];
    sources.iter().for_each(|&[object, index]| count[index as usize] += 1 - object);
    assert_eq!(count, [3, 0, 3, 3, 3, 2, 2, 2, 2, 0]);
    for (row, [_, index]) in ply.payload["vertex"].iter().zip(&sources) {
        assert!(are_near(place(row), places()[*index as usize]), "vertex {index} is at {:?}", place(row));
    }
    assert!(ply.header.comments.ends_with(&["file m.ply".to_owned(), "object 0 m".to_owned()]), "{:?}", ply.header.comments);
    let map = words(&folder, "v.sources.npy", "<u4", "20, 2");
    assert_eq!(map, sources.concat());
    let about = &description(&folder, "v.json")["sources"];
    assert_eq!((&about["file"], &about["objects"], &about["array"]), (&json!("m.ply"), &json!(["m"]), &json!("v.sources.npy")));
    // A user's file of that name is not written over.
    fs::write(folder.path().join("w.sources.npy"), "mine").unwrap();
    let output = bake(&folder, &["--what", "ao", "-o", "w.npy"]).output().unwrap();
    assert!(output.status.code() == Some(2) && stderr(&output).contains("w.sources.npy"), "{}", stderr(&output));
    assert_eq!(bytes(&folder, "w.sources.npy"), b"mine");
}

#[test]
fn sources_have_the_mean_of_their_rows_by_angle() {
    let folder = with_model();
    let what = ["--what", "ao,bent-normal"];
    success(&mut bake(&folder, &[&what[..], &["-o", "v.ply"]].concat()));
    let report = json(&mut bake(&folder, &[&what[..], &["--per", "source", "--json", "-o", "s.ply", "-o", "s.npy"]].concat()));
    assert_eq!(
        (&report["receivers"][0]["counts"]["sources"], &report["receivers"][0]["counts"]["unused"]),
        (&json!(10), &json!(2))
    );
    let (rows, means) = (read_ply(&folder, "v.ply"), read_ply(&folder, "s.ply"));

    let vertices = &rows.payload["vertex"];
    let mut sums: BTreeMap<u32, ([f64; 4], f64)> = BTreeMap::new();
    for face in faces(&rows) {
        for corner in 0..3 {
            let [here, next, last] = [0, 1, 2].map(|step| place(&vertices[face[(corner + step) % 3] as usize]).map(f64::from));
            let way = |to: [f64; 3]| [0, 1, 2].map(|axis| to[axis] - here[axis]);
            let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            let (a, b) = (way(next), way(last));
            let angle = (dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()).acos();
            let row = &vertices[face[corner] as usize];
            let (sum, weight) = sums.entry(sources(&rows)[face[corner] as usize][1]).or_default();
            for (k, name) in ["ao", "bent_normal_x", "bent_normal_y", "bent_normal_z"].into_iter().enumerate() {
                sum[k] += angle * f64::from(float(row, name));
            }
            *weight += angle;
        }
    }
    let mut uneven = 0;
    for (index, row) in means.payload["vertex"].iter().enumerate() {
        let found = ["ao", "bent_normal_x", "bent_normal_y", "bent_normal_z"].map(|name| f64::from(float(row, name)));
        let Some(([ao, x, y, z], weight)) = sums.get(&(index as u32)) else {
            assert!(found.iter().all(|value| value.is_nan()), "vertex {index} is not used, and has {found:?}");
            assert_eq!(place(row), [0.0; 3], "vertex {index} lies at the origin of its object");
            continue;
        };
        let length = (x * x + y * y + z * z).sqrt();
        let expected = [ao / weight, x / length, y / length, z / length];
        found
            .iter()
            .zip(expected)
            .for_each(|(found, expected)| assert!((found - expected).abs() < 2e-6, "vertex {index}: {found} {expected}"));
        assert!(are_near(place(row), places()[index]), "vertex {index} is at {:?}", place(row));
        let plain: Vec<f64> = sources(&rows)
            .iter()
            .zip(vertices)
            .filter(|([_, at], _)| *at as usize == index)
            .map(|(_, row)| f64::from(float(row, "ao")))
            .collect();
        uneven += usize::from((plain.iter().sum::<f64>() / plain.len() as f64 - expected[0]).abs() > 1e-3);
    }
    assert!(uneven > 0, "weights do not matter here");
    // Faces, and the array, are in the file's own order.
    assert_eq!(faces(&means)[..2], [[0, 2, 3], [0, 3, 4]]);
    assert_eq!(sources(&means), std::array::from_fn::<_, ROWS, _>(|index| [0, index as u32]));
    let ao: Vec<u32> = words(&folder, "s.npy", "<f4", "10, 4").chunks(4).map(|row| row[0]).collect();
    let expected: Vec<u32> = means.payload["vertex"].iter().map(|row| float(row, "ao").to_bits()).collect();
    assert_eq!(ao, expected);
}

/// The rows are made when files are written: parts and checkpoints are the same.
#[test]
fn parts_know_their_rows() {
    let folder = with_model();
    let what = ["--what", "ao", "--per", "source"];
    success(&mut bake(&folder, &[&what[..], &["-o", "s.npy"]].concat()));
    for shard in ["1/2", "2/2"] {
        success(&mut bake(&folder, &[&what[..], &["--shard", shard, "-o", "{shard}.part"]].concat()));
    }
    success(tool(&folder).args(["merge", "1.part", "2.part", "-o", "m.npy"]));
    assert!(bytes(&folder, "s.npy") == bytes(&folder, "m.npy"));
    // A finished file of the other rows is not taken for done.
    success(&mut bake(&folder, &["--what", "ao", "--resume", "-o", "s.npy"]));
    assert_eq!(words(&folder, "s.npy", "<f4", "20,").len(), 20);
}

/// The objects of an OBJ share one list, which begins before the first of them.
#[test]
fn the_vertices_of_an_obj_come_once() {
    let folder = folder();
    let obj = "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\no one\nf 2 3 4\nv 1 1 0\no two\nf -2 3 -1\nv 5 5 5\n";
    fs::write(folder.path().join("two.obj"), obj).unwrap();
    let bake = |more: &[&str]| {
        let mut command = tool(&folder);
        command
            .args(["bake", "two.obj", "--to", "vertices", "--what", "ao", "--directions", "32", "--layer-size", "64"])
            .args(more);
        success(&mut command);
    };
    bake(&["-o", "v.ply"]);
    let rows = read_ply(&folder, "v.ply");
    assert_eq!(sources(&rows), [[0, 1], [0, 2], [0, 3], [1, 3], [1, 2], [1, 4]]);
    assert!(rows.header.comments.ends_with(&["file two.obj".into(), "object 0 one".into(), "object 1 two".into()]));
    bake(&["--per", "source", "-o", "s.ply", "-o", "s.npy"]);
    let means = read_ply(&folder, "s.ply");
    assert_eq!(sources(&means), [[0, 0], [0, 1], [0, 2], [0, 3], [1, 4], [0, 5]]);
    assert_eq!(faces(&means), [[1, 2, 3], [3, 2, 4]]);
    let is_known = |row: &DefaultElement| !float(row, "ao").is_nan();
    assert_eq!(means.payload["vertex"].iter().map(is_known).collect::<Vec<_>>(), [false, true, true, true, true, false]);
    assert_eq!(description(&folder, "s.json")["sources"]["objects"], json!(["one", "two"]));
}

/// Each instance of a glTF mesh has its own light.
#[test]
fn the_vertices_of_instances_come_one_instance_after_the_other() {
    let folder = folder();
    let gltf = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [{ "name": "low", "mesh": 0 }, { "name": "high", "mesh": 0, "translation": [0, 0, 1] }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "buffers": [{ "byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA" }],
    });
    fs::write(folder.path().join("m.gltf"), gltf.to_string()).unwrap();
    let args = ["--to", "vertices", "--what", "ao", "--directions", "256", "--per", "source", "-o", "s.ply", "-o", "s.glb"];
    success(tool(&folder).args(["bake", "m.gltf"]).args(args));
    let means = read_ply(&folder, "s.ply");
    assert_eq!(sources(&means), [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2]]);
    let openness: Vec<f32> = means.payload["vertex"].iter().map(|row| float(row, "ao")).collect();
    assert!(openness[0] < 0.95 && openness[3] == 1.0, "the triangle above covers the one below: {openness:?}");
}

#[test]
fn what_has_no_vertices_is_said() {
    let folder = with_model();
    let output = success(tool(&folder).args([
        "bake",
        "m.ply",
        "--to",
        "lightmap",
        "--what",
        "ao",
        "--per",
        "source",
        "--resolution",
        "16",
        "--directions",
        "8",
        "--layer-size",
        "64",
        "-o",
        "m.exr",
    ]));
    assert!(stderr(&output).contains("--per has no effect"), "{}", stderr(&output));
    let output = bake(&folder, &["--what", "ao", "--per", "source", "-o", "s.glb"]).output().unwrap();
    assert!(output.status.code() == Some(2) && stderr(&output).contains("AO is not finite"), "{}", stderr(&output));
}
