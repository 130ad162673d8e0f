//! PLY and STL models: all encodings give the same mesh, faults are mended with a warning or refused with a cure, colours and sources are right.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use finalgather::error::{Error, Result};
use finalgather::export::{ExportMesh, PointValues, Positions};
use finalgather::image::{Channel, WriteOptions};
use finalgather::scene::{Files, LoadOptions, Loaded, Mesh, Source, World};
use glam::{DVec3, Vec2, Vec3, dvec3, vec3};

fn load_with(name: &str, files: &[(&str, &[u8])], strict: bool) -> Result<Loaded> {
    let files: BTreeMap<PathBuf, Vec<u8>> = files.iter().map(|(name, bytes)| ((*name).into(), bytes.to_vec())).collect();
    let options = LoadOptions { files: Files::Memory(files), strict, unlit: true, ..LoadOptions::default() };
    World::load_with(Path::new(name), options)
}

fn load(name: &str, bytes: &[u8]) -> Result<Loaded> {
    load_with(name, &[(name, bytes)], false)
}

/// The mesh of a sound model, which loads without a word.
fn mesh_of(name: &str, bytes: &[u8]) -> Mesh {
    let Loaded { world, report, .. } = load_with(name, &[(name, bytes)], true).unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_eq!(report.warnings, [""; 0], "{name}");
    assert_eq!((world.meshes.len(), world.instances.len(), world.instances[0].name.as_str()), (1, 1, "m"));
    world.meshes[0].clone()
}

/// The message of the error of a model that is refused.
fn refused(name: &str, bytes: &[u8]) -> String {
    let Err(error) = load(name, bytes) else { panic!("{name} was read: {}", String::from_utf8_lossy(bytes)) };
    assert!(matches!(&error, Error::Input { cure, .. } if cure.len() > 10), "{error}");
    error.to_string()
}

/// The indices in the file of the corners of all triangles.
fn corners(mesh: &Mesh) -> Vec<[u32; 3]> {
    mesh.triangles.iter().map(|triangle| triangle.vertices.map(|vertex| mesh.sources[vertex as usize].index)).collect()
}

/// A number of a PLY, with its type.
enum Item {
    Char(u8),
    Int(i32),
    Float(f32),
    Double(f64),
}
use Item::{Char, Double, Float, Int};

/// The rows of a PLY in one of its encodings.
fn encoded(format: &str, header: &str, rows: &[Vec<Item>]) -> Vec<u8> {
    let mut bytes = format!("ply\nformat {format} 1.0\n{header}end_header\n").into_bytes();
    for row in rows {
        for item in row {
            let (text, little) = match item {
                Char(number) => (number.to_string(), number.to_le_bytes().to_vec()),
                Int(number) => (number.to_string(), number.to_le_bytes().to_vec()),
                Float(number) => (number.to_string(), number.to_le_bytes().to_vec()),
                Double(number) => (number.to_string(), number.to_le_bytes().to_vec()),
            };
            match format {
                "ascii" => bytes.extend(format!("{text} ").bytes()),
                "binary_big_endian" => bytes.extend(little.iter().rev()),
                _ => bytes.extend(&little),
            }
        }
        if format == "ascii" {
            bytes.push(b'\n');
        }
    }
    bytes
}

const FORMATS: [&str; 3] = ["ascii", "binary_little_endian", "binary_big_endian"];

#[test]
fn every_encoding_of_ply_gives_the_same_mesh() {
    let header = "comment by hand\nelement vertex 6\nproperty double x\nproperty float y\nproperty float z\n\
                  property float nx\nproperty float ny\nproperty float nz\nproperty float s\nproperty float t\n\
                  property uchar red\nproperty uchar green\nproperty uchar blue\nproperty list uchar int seen\n\
                  element face 3\nproperty int flags\nproperty list uchar int vertex_indices\n\
                  element edge 1\nproperty int vertex1\n";
    // A pentagon that needs ears and a vertex beside it, of which no face makes use.
    let places = [[0.0, 0.0], [9.0, 9.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0]];
    let vertex = |[x, y]: [f64; 2]| {
        let floats = [y as f32, 0.0, 0.0, 0.0, 2.0, x as f32, 0.25].map(Float);
        let color = [255, 188, 0].map(Char);
        [Double(x)].into_iter().chain(floats).chain(color).chain([Char(2), Int(7), Int(-7)]).collect::<Vec<_>>()
    };
    let face = |corners: &[i32]| {
        [Int(1), Char(corners.len() as u8)].into_iter().chain(corners.iter().map(|&corner| Int(corner))).collect::<Vec<_>>()
    };
    let rows = || {
        let vertices = places.map(vertex);
        vertices.into_iter().chain([face(&[0, 2, 3, 4, 5]), face(&[5, 4, 3]), face(&[0, 4, 2]), vec![Int(9)]]).collect::<Vec<_>>()
    };
    for format in FORMATS {
        let mesh = mesh_of("m.ply", &encoded(format, header, &rows()));
        assert_eq!(mesh.triangles.len(), 5, "{format}");
        let area: f32 = (0..3).map(|triangle| mesh.area(triangle)).sum();
        assert!((area - 10.0).abs() < 1e-6, "{format}: the pentagon has the area {area}");
        assert_eq!(corners(&mesh)[3..], [[5, 4, 3], [0, 4, 2]], "{format}");
        assert_eq!(mesh.positions.len(), 5, "{format}: the unused vertex is left out");
        assert_eq!(mesh.source_count, 6, "{format}: and counted");
        for (i, source) in mesh.sources.iter().enumerate() {
            let [x, y] = places[source.index as usize].map(|number| number as f32);
            assert_eq!(mesh.positions[i], vec3(x, y, 0.0), "{format}");
            assert_eq!(mesh.uvs[i], Vec2::new(x, 0.25), "{format}");
        }
        assert!(mesh.normals.iter().all(|&normal| normal == Vec3::Z), "{format}");
        // 188 of 255 in sRGB is half of the light.
        let expected = vec3(1.0, 0.502_886, 0.0);
        assert!(mesh.colors.iter().all(|color| (*color - expected).length() < 1e-5), "{format}: {}", mesh.colors[0]);
    }
}

/// A square of the corners 0 to 3, with more properties of its vertices and other words after them.
fn square(properties: &str, more: [&str; 4], rest: &str) -> Vec<u8> {
    let [a, b, c, d] = more;
    format!(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n{properties}{}\
         0 0 0 {a}\n1 0 0 {b}\n1 1 0 {c}\n0 1 0 {d}\n{}",
        rest.split_once("end_header\n").map_or("", |(header, _)| header).to_owned() + "end_header\n",
        rest.split_once("end_header\n").unwrap().1
    )
    .into_bytes()
}

const FACE: &str = "element face 1\nproperty list uchar uint vertex_index\nend_header\n4 0 1 2 3\n";

#[test]
fn colours_show_on_white_and_float_colours_are_linear() {
    let grey = load("m.ply", &square("", [""; 4], FACE)).unwrap().world;
    assert_eq!((grey.materials[0].albedo, grey.meshes[0].colors.len()), (Vec3::splat(0.5), 0));
    let floats = "property float red\nproperty float green\nproperty float blue\n";
    let colors = ["1 0.5 0", "0 0 0", "2 0.5 nan", "-1 1 1"];
    let Loaded { world, report, .. } = load("m.ply", &square(floats, colors, FACE)).unwrap();
    assert_eq!(world.materials[0].albedo, Vec3::ONE);
    let expected = [vec3(1.0, 0.5, 0.0), Vec3::ZERO, vec3(1.0, 0.5, 0.0), vec3(0.0, 1.0, 1.0)];
    assert_eq!(world.meshes[0].colors, expected);
    assert_eq!(report.warnings.len(), 1, "{:?}", report.warnings);
    assert!(report.warnings[0].contains("m.ply:15: vertex 2 has the colour") && report.warnings[0].contains("1 more"));
    assert!(world.materials[0].unshaded.is_empty());
    let clear = "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n";
    let Loaded { world, report, .. } =
        load("m.ply", &square(clear, ["0 0 0 255", "0 0 0 255", "0 0 0 254", "0 0 0 255"], FACE)).unwrap();
    assert_eq!(world.materials[0].unshaded, ["alpha of vertices"]);
    assert!(report.warnings[0].contains("default (alpha of vertices)"), "{:?}", report.warnings);
    let words = "property ushort diffuse_red\nproperty ushort diffuse_green\nproperty ushort diffuse_blue\n";
    let world = load("m.ply", &square(words, ["65535 0 0"; 4], FACE)).unwrap().world;
    assert_eq!(world.meshes[0].colors, [Vec3::X; 4]);
}

#[test]
fn a_ply_of_ours_comes_back() {
    let mesh = mesh_of("m.ply", &square("property float nx\nproperty float ny\nproperty float nz\n", ["0 0 1"; 4], FACE));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.ply");
    let world: Vec<DVec3> = mesh.positions.iter().map(|position| position.as_dvec3()).collect();
    let positions = Positions::near(&world);
    let columns = [Channel { name: "AO".into(), samples: vec![0.0, 0.25, 0.5, 1.0] }];
    let surface = ExportMesh { mesh: &mesh, positions, materials: &[], textures: &[], source: None };
    let values = PointValues { positions, normals: &mesh.normals, columns: &columns, surface: Some(surface), sources: None };
    values.write(&path, &WriteOptions::default()).unwrap();
    let back = mesh_of("m.ply", &std::fs::read(&path).unwrap());
    assert_eq!((&back.positions, &back.normals, &back.triangles), (&mesh.positions, &mesh.normals, &mesh.triangles));
    // Eight bits of sRGB.
    for (color, openness) in back.colors.iter().zip([0.0, 0.25, 0.5, 1.0]) {
        assert!((color.x - openness).abs() < 0.005 && color.x == color.y, "{color} for {openness}");
    }
}

#[test]
fn textures_of_meshlab_show() {
    let rest = "comment TextureFile t.png\nelement face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n\
                end_header\n3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0.5 0 1 1 0 1\n";
    let bytes = square("", [""; 4], rest);
    let png = include_bytes!("../fuzz/seeds/texture/rgb.png");
    let Loaded { world, report, .. } = load_with("m.ply", &[("m.ply", &bytes), ("t.png", png)], true).unwrap();
    assert_eq!(report.warnings, [""; 0]);
    let mesh = &world.meshes[0];
    assert_eq!((world.materials[0].albedo_texture, world.materials[0].albedo), (Some(0), Vec3::ONE));
    // Corner 0 has two coordinates, corner 2 one.
    assert_eq!(mesh.sources.iter().map(|source| source.index).collect::<Vec<_>>(), [0, 1, 2, 0, 3]);
    assert_eq!(mesh.uvs[3], Vec2::new(0.5, 0.0));
    let Loaded { world, report, .. } = load("m.ply", &bytes).unwrap();
    assert_eq!((world.materials[0].albedo_texture, world.materials[0].albedo), (None, Vec3::splat(0.5)));
    assert!(report.warnings[0].contains("t.png") && report.warnings[0].contains("none"), "{:?}", report.warnings);
}

#[test]
fn strips_become_triangles() {
    let rest = "element tristrips 1\nproperty list int int vertex_indices\nend_header\n7 0 1 3 2 -1 0 1\n";
    let mesh = mesh_of("m.ply", &square("", [""; 4], rest));
    assert_eq!(corners(&mesh), [[0, 1, 3], [3, 1, 2]]);
    assert!((0..2).all(|triangle| mesh.geometric_normal(triangle) == Vec3::Z));
}

#[test]
fn far_models_keep_their_millimetres() {
    let far = dvec3(4_500_000.0, 5_300_000.25, 120.5);
    let header = "element vertex 3\nproperty double x\nproperty double y\nproperty double z\nelement face 1\n\
                  property list uchar int vertex_indices\n";
    let places = [far, far + dvec3(0.001, 0.0, 0.0), far + dvec3(0.0, 1.0, 0.0)];
    let mut rows: Vec<Vec<Item>> = places.iter().map(|place| place.to_array().map(Double).into()).collect();
    rows.push(vec![Char(3), Int(0), Int(1), Int(2)]);
    for format in FORMATS {
        let world = load("m.ply", &encoded(format, header, &rows)).unwrap().world;
        let placed = |i: usize| world.instances[0].transform.transform_point3(world.meshes[0].positions[i].as_dvec3());
        (0..3).for_each(|i| assert!((placed(i) - places[i]).length() < 1e-6, "{format}: {} for {}", placed(i), places[i]));
    }
}

#[test]
fn faults_of_ply_are_mended_with_a_word() {
    let face = |faces: &str| format!("element face 9\nproperty list uchar int vertex_indices\nend_header\n3 0 1 2\n{faces}");
    let rest = face("3 0 1 4\n2 0 1\n3 0 2 -1\n0\n3 0 0 1\n3 0 2 here\n3 0 2 3 7\n");
    let bytes = square(
        "property float nx\nproperty float ny\nproperty float nz\n",
        ["0 0 1", "nan 0 1", "0 0 0", "0 0 -nan(ind)"],
        &rest,
    );
    let Loaded { world, report, .. } = load("m.ply", &bytes).unwrap();
    assert_eq!(corners(&world.meshes[0]), [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(world.meshes[0].normals, [Vec3::Z, Vec3::ZERO, Vec3::ZERO, Vec3::ZERO]);
    let said = report.warnings.join("\n");
    for fragment in [
        "m.ply:14: vertex 1 has the normal",
        "m.ply:18: face 1 refers to vertex 4 of 4, counted from 0; the face is left out (and 1 more like it)",
        "m.ply:19: face 2 has 2 corners, and 3 to 5000 can be drawn; the face is left out (and 1 more like it)",
        "m.ply:23: \"here\" for a number in face; the line is left out",
        "m.ply:24: there are more numbers than the header says; they are ignored",
        "the file ends in face, after 8 of 9 rows; the others are missing",
        "1 of 3 triangles has no area",
    ] {
        assert!(said.contains(fragment), "nothing says {fragment}:\n{said}");
    }
    assert_eq!(report.warnings.len(), 7, "{said}");
    // Each of them is refused where the file must be exact.
    assert!(load_with("m.ply", &[("m.ply", &bytes)], true).unwrap_err().to_string().contains("m.ply:14: vertex 1"));
    // A vertex that is nowhere takes its faces with it. The others keep their numbers.
    let nowhere = String::from_utf8(square(
        "",
        [""; 4],
        "element face 2\nproperty list uchar int vertex_indices\nend_header\n3 0 1 2\n3 0 1 3\n",
    ));
    for (word, fragment) in
        [("nan", "vertex 2 is at"), ("1.#QNAN", "vertex 2 is at"), ("2e9", "vertex 2 is farther"), ("x", "\"x\" for a number")]
    {
        let bytes = nowhere.as_ref().unwrap().replace("1 1 0", &format!("1 {word} 0"));
        let Loaded { world, report, .. } = load("m.ply", bytes.as_bytes()).unwrap();
        assert_eq!(corners(&world.meshes[0]), [[0, 1, 3]], "{word}");
        assert!(report.warnings[0].contains(fragment), "{:?}", report.warnings);
    }
    // Some programs leave out the word `comment`.
    let bytes = nowhere.as_ref().unwrap().replacen("element", "Created by a program\nelement", 1);
    let Loaded { world, report, .. } = load("m.ply", bytes.as_bytes()).unwrap();
    assert_eq!(world.meshes[0].triangles.len(), 2);
    assert_eq!(report.warnings, ["m.ply:3: \"Created by a program\" is no statement of a header; the line is ignored"]);
    let without_line_feeds = nowhere.unwrap().replace('\n', "\r");
    assert_eq!(mesh_of("m.ply", without_line_feeds.as_bytes()).triangles.len(), 2);
}

#[test]
fn other_ply_is_refused() {
    let text = |rest: &str| String::from_utf8(square("", [""; 4], rest)).unwrap();
    let sound = text(FACE);
    let with = |from: &str, to: &str| sound.replace(from, to).into_bytes();
    for (bytes, fragment) in [
        (b"".to_vec(), "m.ply:1: this is not a sound PLY"),
        (b"solid x\n".to_vec(), "does not begin with \"ply\""),
        (with("element face 1\nproperty list uchar uint vertex_index\n", ""), "a cloud of points"),
        (with("element face 1", "element face 0"), "--to points:FILE"),
        (with("element vertex 4", "element vertex 0"), "no vertex"),
        (with("float z", "float depth"), "vertex has no x, y and z"),
        (with("float z", "list uchar float z"), "vertex has no x, y and z"),
        (with("uint vertex_index", "uint corners"), "face has no list vertex_indices"),
        (with("list uchar uint vertex_index", "uint vertex_index"), "face has no list vertex_indices"),
        (with("format ascii", "format words"), "m.ply:2: this is not a sound PLY: \"words\" is no format"),
        (with("format ascii 1.0\n", ""), "names no format"),
        (with("float y", "real y"), "m.ply:5: this is not a sound PLY: \"real\" is no type"),
        (with("float y", "float x"), "twice"),
        (with("element vertex 4", "element vertex -4"), "\"-4\" is no number of rows"),
        (with("end_header", "end"), "\"end\" is no statement"),
        (with("4 0 1 2 3", "4 0 0 0 0"), "none of the 2 triangles has an area"),
        (with("4 0 1 2 3", "4 0 1 2 9"), "no face can be drawn"),
        (with("4 0 1 2 3", "999 0 1 2 3"), "a list of 999 numbers"),
        (with("4 0 1 2 3", "-4 0 1 2 3"), "a list of -4 numbers"),
    ] {
        let message = refused("m.ply", &bytes);
        assert!(message.contains(fragment), "has no \"{fragment}\": {message}");
    }
}

/// A tetrahedron.
const CORNERS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

fn binary_stl(header: &[u8], count: u32) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, 0);
    bytes.extend(count.to_le_bytes());
    for face in FACES {
        bytes.extend([0; 12]);
        bytes.extend(face.iter().flat_map(|&corner| CORNERS[corner]).flat_map(f32::to_le_bytes));
        // A colour, as some programs write it.
        bytes.extend([0xff, 0xff]);
    }
    bytes
}

fn text_stl(faces: &[[usize; 3]], name: &str) -> String {
    let vertex = |&corner: &usize| {
        let [x, y, z] = CORNERS[corner];
        format!("      vertex {x:e} {y:.3} -{z}\n").replace("--", "").replace("-0\n", "0\n").replace("-1\n", "1\n")
    };
    let facet = |face: &[usize; 3]| {
        format!("  facet normal 0 0 0\n    outer loop\n{}    endloop\n  endfacet\n", face.iter().map(vertex).collect::<String>())
    };
    format!("solid {name}\n{}endsolid {name}\n", faces.iter().map(facet).collect::<String>())
}

#[test]
fn every_encoding_of_stl_gives_the_same_mesh() {
    let solids = text_stl(&FACES[..2], "one") + &text_stl(&[], "none") + &text_stl(&FACES[2..], "two");
    for (what, bytes) in [
        ("binary", binary_stl(b"exported", 4)),
        ("binary that begins as text does", binary_stl(b"solid cube", 4)),
        ("text", text_stl(&FACES, "cube").into_bytes()),
        ("text without a name", text_stl(&FACES, "").replace("solid \n", "solid\n").into_bytes()),
        ("text of three solids", solids.into_bytes()),
        ("text of DOS, in capitals", text_stl(&FACES, "cube").replace('\n', "\r\n").to_uppercase().into_bytes()),
    ] {
        let mesh = mesh_of("m.STL", &bytes);
        assert_eq!((mesh.positions.len(), mesh.triangles.len(), mesh.source_count), (4, 4, 4), "{what}");
        for (triangle, face) in FACES.iter().enumerate() {
            assert_eq!(mesh.corners(triangle), face.map(|corner| Vec3::from(CORNERS[corner])), "{what}");
        }
        assert!(mesh.normals.iter().all(|&normal| normal == Vec3::ZERO), "{what}");
        // In the order in which they come first.
        assert_eq!(mesh.sources, [0, 1, 2, 3].map(|index| Source { instance: 0, index }), "{what}");
    }
}

#[test]
fn faults_of_stl_are_mended_or_refused() {
    let trailing = [binary_stl(b"solid", 4), vec![0; 7]].concat();
    let text = text_stl(&FACES, "cube");
    let cut = &text[..text.rfind("endloop").unwrap()];
    for (bytes, triangles, fragment) in [
        (binary_stl(b"", 0), 4, "the header says 0 triangles, and there are bytes for 4; 4 are read"),
        (binary_stl(b"", 3), 3, "the header says 3 triangles, and there are bytes for 4; 3 are read"),
        (binary_stl(b"solid", u32::MAX), 4, "the header says 4294967295 triangles, and there are bytes for 4; 4 are read"),
        (trailing, 4, "there are bytes for 4; 4 are read"),
        (cut.as_bytes().to_vec(), 3, "the file ends within a facet; it is left out"),
        (text.as_bytes()[..text.rfind("facet normal").unwrap()].to_vec(), 3, "the file ends before endsolid"),
        (text.replacen("vertex 1e0", "vertex nan", 1).into_bytes(), 3, "m.STL:6: corner 2 is at"),
        (text.replacen("vertex 1e0", "vertex one", 1).into_bytes(), 3, "m.STL:6: corner 2 is at"),
        (text.replacen("vertex 1e0", "vertex 1e10", 1).into_bytes(), 3, "farther than"),
        (text.replacen("      vertex 1e0 0.000 0\n", "", 1).into_bytes(), 3, "m.STL:6: face 0 has 2 corners"),
        (text.replacen("vertex 1e0", "vertex 0e0", 1).into_bytes(), 3, "1 of 4 triangles has no area"),
    ] {
        let Loaded { world, report, .. } = load("m.STL", &bytes).unwrap_or_else(|error| panic!("{fragment}: {error}"));
        assert_eq!(world.meshes[0].triangles.len(), triangles, "{fragment}");
        assert_eq!(report.warnings.len(), 1, "{:?}", report.warnings);
        assert!(report.warnings[0].contains(fragment), "has no \"{fragment}\": {:?}", report.warnings);
    }
    for (bytes, fragment) in [
        (b"".to_vec(), "neither text nor long enough"),
        (b"v 0 0 0\n".to_vec(), "neither text nor long enough"),
        (b"solid nothing\nendsolid\n".to_vec(), "no triangle"),
        ("v 0.5 0.25 0.125\n".repeat(20).into_bytes(), "does not begin with \"solid\""),
        (binary_stl(b"", 4)[..84].to_vec(), "no triangle"),
        (text.replace("1e0", "0e0").replace("1.000", "0").into_bytes(), "none of the 4 triangles has an area"),
    ] {
        let message = refused("m.stl", &bytes);
        assert!(message.contains(fragment), "has no \"{fragment}\": {message}");
    }
}
