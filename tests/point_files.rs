//! Files of points. Every format gives the same points. All other contents are refused with the place and a cure.

use std::fs;
use std::path::Path;

use finalgather::error::{Error, Result};
use finalgather::points::file::{OrientedPoint, read};
use finalgather::random::Random;
use glam::{DVec3, Vec3, vec3};

/// Numbers that every type of float holds exactly.
const ROWS: [[f64; 6]; 3] = [[1.5, -2.0, 0.25, 0.0, 0.0, 1.0], [0.0, 7.0, -8.0, -1.0, 0.0, 0.0], [3.0, 4.0, 5.0, 0.0, 1.0, 0.0]];
const NAMES: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

fn expected() -> Vec<OrientedPoint> {
    let vec3 = |row: &[f64]| vec3(row[0] as f32, row[1] as f32, row[2] as f32);
    ROWS.iter().map(|row| OrientedPoint { position: DVec3::from_slice(&row[..3]), normal: vec3(&row[3..]) }).collect()
}

fn read_bytes(name: &str, bytes: &[u8]) -> Result<Vec<OrientedPoint>> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    read(&path)
}

/// Faces stand before the vertices, a list and a colour between their coordinates, and another element behind.
fn ply(format: &str) -> Vec<u8> {
    let header = format!(
        "ply\nformat {format} 1.0\ncomment made by hand\nelement face 1\nproperty list uchar int vertex_indices\nelement vertex 3\n\
         property double x\nproperty float y\nproperty float z\nproperty list uchar ushort seen_by\nproperty uchar red\n\
         property char nx\nproperty short ny\nproperty int nz\nelement camera 1\nproperty float fov\nend_header\n"
    );
    let mut bytes = header.into_bytes();
    if format == "ascii" {
        bytes.extend(b"3 0 1 2\n");
        for [x, y, z, nx, ny, nz] in ROWS {
            bytes.extend(format!("{x} {y} {z} 2 300 4 255 {nx} {ny} {nz}\n").bytes());
        }
        bytes.extend(b"45\n");
        return bytes;
    }
    // Each number in the order of little endian, turned round for big.
    let mut put = |little: &[u8]| match format {
        "binary_big_endian" => bytes.extend(little.iter().rev()),
        _ => bytes.extend(little),
    };
    put(&[3]);
    (0..3_i32).for_each(|index| put(&index.to_le_bytes()));
    for [x, y, z, nx, ny, nz] in ROWS {
        put(&x.to_le_bytes());
        put(&(y as f32).to_le_bytes());
        put(&(z as f32).to_le_bytes());
        put(&[2]);
        [300_u16, 4].iter().for_each(|seen| put(&seen.to_le_bytes()));
        put(&[255]);
        put(&(nx as i8).to_le_bytes());
        put(&(ny as i16).to_le_bytes());
        put(&(nz as i32).to_le_bytes());
    }
    put(&45_f32.to_le_bytes());
    bytes
}

/// An array in which `at(i)` stands in the `i`th place of the file.
fn npy(version: u8, kind: &str, fortran: &str, shape: &str, numbers: impl Iterator<Item = f64>) -> Vec<u8> {
    let header = format!("{{'descr': '{kind}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
    let mut bytes = [b"\x93NUMPY".as_slice(), &[version, 0]].concat();
    match version {
        1 => bytes.extend((header.len() as u16).to_le_bytes()),
        _ => bytes.extend((header.len() as u32).to_le_bytes()),
    }
    bytes.extend(header.bytes());
    for number in numbers {
        match kind {
            "<f4" => bytes.extend((number as f32).to_le_bytes()),
            ">f4" => bytes.extend((number as f32).to_be_bytes()),
            "<f8" => bytes.extend(number.to_le_bytes()),
            _ => bytes.extend(number.to_be_bytes()),
        }
    }
    bytes
}

fn rows() -> impl Iterator<Item = f64> {
    ROWS.into_iter().flatten()
}

/// One sound file of each kind.
fn samples() -> Vec<(&'static str, Vec<u8>)> {
    let columns = (0..6).flat_map(|column| ROWS.map(|row| row[column]));
    let line = |order: [usize; 6], row: [f64; 6]| order.map(|column| row[column].to_string()).join(",");
    let plain = ROWS.map(|row| line([0, 1, 2, 3, 4, 5], row)).join("\n");
    let turned = [5, 1, 0, 4, 2, 3];
    let names = turned.map(|column| NAMES[column]).join(" , ");
    let named =
        format!("\u{feff}# points\n{names},area\r\n{}\r\n", ROWS.map(|row| format!("{},9", line(turned, row))).join("\r\n"));
    vec![
        ("ascii.ply", ply("ascii")),
        ("little.ply", ply("binary_little_endian")),
        ("big.PLY", ply("binary_big_endian")),
        ("f4.npy", npy(1, "<f4", "False", "(3, 6)", rows())),
        ("f4_big.npy", npy(3, ">f4", "False", "(3, 6)", rows())),
        ("f8.npy", npy(2, "<f8", "False", "(3, 6)", rows())),
        ("fortran.npy", npy(1, ">f8", "True", "(3, 6)", columns)),
        ("plain.csv", plain.into_bytes()),
        ("named.csv", named.into_bytes()),
    ]
}

#[test]
fn every_format_says_the_same() {
    for (name, bytes) in samples() {
        assert_eq!(read_bytes(name, &bytes).unwrap_or_else(|error| panic!("{name}: {error}")), expected(), "{name}");
    }
}

#[test]
fn normals_become_unit_vectors_and_those_that_are_keep_their_bits() {
    let csv = b"0,0,0,0,0,1e300\n0,0,0,3e-310,0,4e-310\n0,0,0,0,-2,0\n";
    let normals: Vec<_> = read_bytes("a.csv", csv).unwrap().iter().map(|point| point.normal).collect();
    assert_eq!(normals, [Vec3::Z, vec3(0.6, 0.0, 0.8), Vec3::NEG_Y]);
    // Unit vectors as 32 bits have them, most of which another division would change.
    let mut random = Random::new(1, 0);
    let unit: Vec<Vec3> =
        (0..1000).map(|_| (vec3(random.uniform(), random.uniform(), random.uniform()) - 0.5).normalize()).collect();
    let again = unit.iter().filter(|normal| normal.as_dvec3().normalize().as_vec3() != **normal).count();
    assert!(again > 10, "only {again} would change");
    let numbers = unit.iter().flat_map(|normal| [0.0, 0.0, 0.0].into_iter().chain(normal.as_dvec3().to_array()));
    let points = read_bytes("a.npy", &npy(1, "<f4", "False", "(1000, 6)", numbers)).unwrap();
    assert!(points.iter().zip(&unit).all(|(point, normal)| point.normal == *normal));
}

/// A place such as `a.csv:7`, without a number where the whole file is meant.
fn place(error: &Error) -> String {
    let Error::Input { path, line, .. } = error else { panic!("not an input error: {error:?}") };
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    line.map_or(name.to_string(), |line| format!("{name}:{line}"))
}

#[test]
fn what_is_wrong_is_said() {
    let with = |format: &str, from: &str, to: &str| {
        let bytes = ply(format);
        let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).unwrap_or_else(|| panic!("no {from}"));
        [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()
    };
    let ascii = |from, to| ("a.ply", with("ascii", from, to));
    let binary = |from, to| ("a.ply", with("binary_little_endian", from, to));
    let csv = |text: &str| ("a.csv", text.as_bytes().to_vec());
    let array = |kind, shape, numbers: &[f64]| ("a.npy", npy(1, kind, "False", shape, numbers.iter().copied()));
    let cases = [
        (csv(""), "a.csv", "the file is empty"),
        (csv("\n\n"), "a.csv", "no points"),
        (csv("x,y,z,nx,ny,nz\n"), "a.csv", "no points"),
        (csv("x,y,z\n1,2,3\n"), "a.csv", "no normals"),
        (csv("1,2,3\n"), "a.csv", "no normals"),
        (csv("1;2;3;0;0;1\n"), "a.csv:1", "neither numbers nor the name x"),
        (csv("1,2,3,4\n"), "a.csv:1", "4 numbers and no names"),
        (csv("1,2,3,0,0,1\n\n1,2,3,0,0\n"), "a.csv:3", "nz is missing, with 5 fields"),
        (csv("x,y,z,nx,ny,nz\n1,2,3,0,0,1\n1,2,here,0,0,1\n"), "a.csv:3", "z is \"here\""),
        (csv("1,2,3,0,0,1\n1,nan,3,0,0,1\n"), "a.csv:2", "y of point 2 is NaN"),
        (csv("1,2,3,0,-inf,1\n"), "a.csv:1", "ny of point 1 is -inf"),
        (csv("1,2,3,0,0,1\n1,1e39,3,0,0,1\n"), "a.csv:2", "32 bits"),
        (csv("1,2,3,0,0,1\n0,0,0,0,0,0\n1,2,3,-0,0,0\n"), "a.csv:2", "zero at 2 of 3 points, first at point 2"),
        (("a.csv", vec![0xff, 0xfe, 0x00, 0x0a]), "a.csv:1", "neither numbers nor the name x"),
        (array("<f4", "(2, 6)", &[0.0; 11]), "a.npy", "44 bytes follow"),
        (array("<f4", "(2, 6)", &[0.0; 13]), "a.npy", "52 bytes follow"),
        (array("<f4", "(4611686018427387904, 6)", &[0.0; 12]), "a.npy", "48 bytes follow"),
        (array("<f4", "(0, 6)", &[]), "a.npy", "no points"),
        (array("<f4", "(2, 3)", &[0.0; 6]), "a.npy", "no normals"),
        (array("<f4", "(12,)", &[0.0; 12]), "a.npy", "shape [12]"),
        (array("<f8", "(1, 6)", &[0.0, 0.0, f64::NAN, 0.0, 0.0, 1.0]), "a.npy", "z of point 1 is NaN"),
        (array("<i8", "(1, 6)", &[0.0; 6]), "a.npy", "type '<i8'"),
        (array("<f4", "(1, -6)", &[0.0; 6]), "a.npy", "not a NumPy array"),
        (("a.npy", b"\x93NUMPY\x02\x00\xff\xff\xff\xff{".to_vec()), "a.npy", "not a NumPy array"),
        (("a.npy", b"PK\x03\x04".to_vec()), "a.npy", "not a NumPy array"),
        (ascii("1.5", "nan"), "a.ply:19", "x of point 1 is NaN"),
        (ascii("1.5", "1,5"), "a.ply:19", "not a sound PLY"),
        (ascii("-8 2 300", "-8 1 300"), "a.ply:20", "more numbers"),
        (ascii("7 -8 2", "7 -8"), "a.ply:20", "not a sound PLY"),
        (ascii("element vertex 3", "element vertex 0"), "a.ply", "no points"),
        (ascii("element vertex 3", "element vertex 4000000000"), "a.ply", "4000000000 of vertex, but"),
        (ascii("element vertex", "element point"), "a.ply", "no points"),
        (ascii("property char nx", "property char mx"), "a.ply", "no normals"),
        (ascii("property double x", "property list uchar double x"), "a.ply", "vertex has no x, y and z"),
        (ascii("property float z", "property float y"), "a.ply:9", "a property twice"),
        (ascii("end_header", "end"), "a.ply:17", "not a sound PLY"),
        (binary("element vertex 3", "element vertex 4611686018427387904"), "a.ply", "4611686018427387904 of vertex, but"),
        (binary("element vertex 3", "element vertex 4"), "a.ply", "4 of vertex, but 91 bytes"),
        (binary("element face 1", "element face 18446744073709551615"), "a.ply", "18446744073709551615 of face, but"),
        (("a.ply", b"solid cube".to_vec()), "a.ply:1", "not a sound PLY"),
        (("a.ply", vec![0xff; 64]), "a.ply:1", "not a sound PLY"),
    ];
    for ((name, bytes), expected_place, fragment) in cases {
        let shown = String::from_utf8_lossy(&bytes).escape_debug().to_string();
        let Err(error) = read_bytes(name, &bytes) else { panic!("read: {shown}") };
        let message = error.to_string();
        assert_eq!(place(&error), expected_place, "{message}\n{shown}");
        assert!(message.contains(fragment), "has no \"{fragment}\": {message}\n{shown}");
        let (_, cure) = message.split_once("\n  cure: ").unwrap();
        assert!(cure.len() > 10, "{message}");
    }
    assert!(matches!(read(Path::new("points.xyz")), Err(Error::Usage { .. })));
    assert!(matches!(read(Path::new("absent.csv")), Err(Error::Input { .. })));
}

#[test]
fn no_bytes_at_all_do_harm() {
    let mut random = Random::new(7, 0);
    let mut below = |limit: usize| (random.uniform() * limit as f32) as usize % limit;
    let mut refused = 0;
    for (name, sound) in samples() {
        for turn in 0..400 {
            let mut bytes = sound.clone();
            for _ in 0..=below(3) {
                let at = below(bytes.len());
                match turn % 5 {
                    0 => bytes.truncate(at.max(1)),
                    1 => bytes[at] = below(256) as u8,
                    // What numbers and structure are made of.
                    2 => bytes[at] = b"0919-e.,()'\n "[below(13)],
                    3 => drop(bytes.splice(at..at, b"99999999999".iter().copied())),
                    _ => drop(bytes.splice(at..(at + below(8)).min(bytes.len()), [])),
                }
                if bytes.is_empty() {
                    break;
                }
            }
            match read_bytes(name, &bytes) {
                Ok(points) => {
                    let sound = |point: &OrientedPoint| point.position.is_finite() && (point.normal.length() - 1.0).abs() < 1e-5;
                    assert!(!points.is_empty() && points.iter().all(sound), "{name}, turn {turn}: {points:?}");
                }
                Err(error) => {
                    refused += 1;
                    assert!(matches!(error, Error::Input { .. }), "{name}, turn {turn}: {error}");
                }
            }
        }
    }
    assert!(refused > 500, "only {refused} were refused");
}
