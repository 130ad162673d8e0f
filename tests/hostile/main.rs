//! Thousands of malformed inputs. Each is read, or refused with a problem and a cure. No reader panics, hangs, or allocates the memory that a header
//! claims. Seeds and readers are those of the fuzz targets.

#[path = "../common/mod.rs"]
mod common;
mod forged;
mod outside;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use common::tool::{bytes, folder, names_in};
use finalgather::Environment;
use finalgather::blocks::Part;
use finalgather::error::{Error, Result};
use finalgather::export::parse_prt;
use finalgather::image::Image;
use finalgather::points::file::parse;
use finalgather::render::RenderMerge;
use finalgather::scene::{Files, LoadOptions, World};
use finalgather::settings::Settings;
use forged::{bmp, exr, npy, png, seed};
use serde_json::{Value, json};

/// The longest that one input may take.
const PATIENCE: Duration = Duration::from_secs(5);

/// A scene of sound files, but for one of them. First with faults mended; what is returned is for exact files.
fn load(name: &str, bytes: &[u8]) -> Result<()> {
    let sound = [
        ("s.toml", "scene/all.toml"),
        ("m.obj", "obj/room.obj"),
        ("m.mtl", "mtl/all.mtl"),
        ("t.tga", "texture/rgb.png"),
        ("e.hdr", "environment/sky.hdr"),
    ];
    let mut files: BTreeMap<PathBuf, Vec<u8>> = sound.map(|(name, from)| (name.into(), seed(from))).into();
    files.insert(name.into(), bytes.to_vec());
    let load = |strict| {
        let files = Files::Memory(files.clone());
        World::load_with(Path::new("s.toml"), LoadOptions { files, strict, ..LoadOptions::default() }).map(drop)
    };
    if let Err(error) = load(false) {
        let Error::Input { problem, cure, .. } = &error else { panic!("{error}") };
        assert!(!problem.is_empty() && cure.len() > 10, "{error}");
    }
    load(true)
}

/// A model that stands alone, with its texture.
fn load_model(name: &str, bytes: &[u8]) -> Result<()> {
    let files = BTreeMap::from([(name.into(), bytes.to_vec()), ("t.png".into(), seed("texture/rgb.png"))]);
    World::load_with(Path::new(name), LoadOptions { files: Files::Memory(files), ..LoadOptions::default() }).map(drop)
}

/// By the folder of seeds; `name` is one in it.
fn read(format: &str, name: &str, bytes: &[u8]) -> Result<()> {
    let path = Path::new(name);
    match format {
        "obj" => load("m.obj", bytes),
        "gltf" => load_model(name, bytes),
        "mtl" => load("m.mtl", bytes),
        "model" => load_model(name, bytes),
        "scene" => load("s.toml", bytes),
        "texture" => load("t.tga", bytes),
        "environment" => Environment::decode(path, bytes).map(drop),
        "picture" => Image::decode(path, bytes).map(drop),
        "points" => parse(path, bytes).map(drop),
        "transfer" if name.ends_with("json") => parse_prt(path, &seed("transfer/prt.npy"), bytes).map(drop),
        "transfer" => parse_prt(path, bytes, &seed("transfer/prt.json")).map(drop),
        _ => panic!("no reader of {format}"),
    }
}

/// What is made of one seed, each with what was done to it. Nothing here is random.
fn mutants(seed: &[u8]) -> Vec<(String, Vec<u8>)> {
    let mut mutants = Vec::new();
    let mut put = |what: String, bytes: Vec<u8>| mutants.push((what, bytes));
    let replaced = |range: std::ops::Range<usize>, by: &[u8]| [&seed[..range.start], by, &seed[range.end..]].concat();
    for at in 0..seed.len() {
        put(format!("cut at {at}"), seed[..at].to_vec());
        let flip = [0x01, 0x80, 0xff, 0x20][at % 4];
        put(format!("byte {at} xor {flip:#x}"), replaced(at..at + 1, &[seed[at] ^ flip]));
    }
    let text = std::str::from_utf8(seed).ok();
    if text.is_none() {
        // Counts, sizes and offsets of either order.
        for at in 0..seed.len().saturating_sub(3) {
            let by = [[0xff; 4], [0; 4], [0x7f, 0xff, 0xff, 0xff], [0xff, 0xff, 0xff, 0x7f], [0, 0, 0, 0x80]][at % 5];
            put(format!("{by:x?} at {at}"), replaced(at..at + 4, &by));
        }
    }
    let words = "0 -1 -9223372036854775808 999999999999 18446744073709551616 1e39 -1e999 nan inf \u{e9} / [[[[ \\ ../../x";
    let is_in_word = |byte: &u8| byte.is_ascii_alphanumeric() || b".+-_".contains(byte);
    let mut at = 0;
    for word in seed.chunk_by(|a, b| is_in_word(a) == is_in_word(b)) {
        let range = at..at + word.len();
        at = range.end;
        let text = text.is_some() || word.len() > 1;
        if text && is_in_word(&word[0]) {
            put(format!("word at {} dropped", range.start), replaced(range.clone(), b""));
            let number = word.iter().any(u8::is_ascii_digit);
            for by in words.split(' ').filter(|_| number) {
                put(format!("word at {} is {by}", range.start), replaced(range.clone(), by.as_bytes()));
            }
        }
    }
    let lines: Vec<&[u8]> = seed.split_inclusive(|&byte| byte == b'\n').collect();
    for i in 0..lines.len() {
        put(format!("line {} dropped", i + 1), [&lines[..i], &lines[i + 1..]].concat().concat());
        put(format!("line {} a thousand times", i + 1), [&lines[..i], &[lines[i]; 1000], &lines[i + 1..]].concat().concat());
        let mut swapped = lines.clone();
        swapped.swap(i, (i + 1) % lines.len());
        put(format!("line {} behind the next", i + 1), swapped.concat());
        for filler in ["9", "[", "a.", " ", "\u{e9}"] {
            let long = filler.repeat(30_000);
            let lines = [&lines[..i], &[long.as_bytes()], &lines[i..]].concat();
            put(format!("{filler:?} for long before line {}", i + 1), lines.concat());
        }
    }
    mutants
}

/// Reads all of them, in one thread that is given up when it hangs. How many were refused.
fn read_all(format: &'static str, name: &str, inputs: Vec<(String, Vec<u8>)>) -> usize {
    let (sender, receiver) = mpsc::channel();
    let whats: Vec<String> = inputs.iter().map(|(what, _)| what.clone()).collect();
    let own_name = name.to_owned();
    thread::spawn(move || {
        for (_, bytes) in &inputs {
            let outcome = catch_unwind(AssertUnwindSafe(|| read(format, &own_name, bytes)));
            if sender.send(outcome).is_err() {
                break;
            }
        }
    });
    let mut refused = 0;
    for what in whats {
        let outcome = receiver.recv_timeout(PATIENCE).unwrap_or_else(|_| panic!("{format}/{name}, {what}: hangs"));
        match outcome {
            Ok(Ok(())) => {}
            Ok(Err(error)) => {
                let Error::Input { problem, cure, .. } = &error else { panic!("{format}/{name}, {what}: {error}") };
                assert!(!problem.is_empty() && cure.len() > 10, "{format}/{name}, {what}: {error}");
                refused += 1;
            }
            Err(_) => panic!("{format}/{name}, {what}: panics"),
        }
    }
    refused
}

#[test]
fn mutants_are_read_or_refused() {
    let mut total = 0;
    for format in ["obj", "gltf", "mtl", "model", "scene", "texture", "environment", "picture", "points", "transfer"] {
        let names = names_in(Path::new("fuzz/seeds").join(format));
        let (mut count, mut refused) = (0, 0);
        for name in &names {
            let sound = seed(&format!("{format}/{name}"));
            read(format, name, &sound).unwrap_or_else(|error| panic!("{format}/{name}: {error}"));
            let mutants = mutants(&sound);
            count += mutants.len();
            refused += read_all(format, name, mutants);
        }
        eprintln!("{format}: {count} mutants of {} files, {refused} refused", names.len());
        assert!(refused > count / 10 && refused < count, "{format}: {refused} of {count} refused");
        assert!(format != "gltf" || count > 1000, "{format}: only {count} mutants");
        total += count;
    }
    assert!(total > 1000, "only {total} mutants");
}

/// A render of 2x2 pixels along 8 directions, of which these nodes are done.
fn part(change: impl Fn(&mut Value, &mut Value), nodes: &[(&str, usize)]) -> Vec<u8> {
    let settings = Settings::default().with(|s| (s.film.size, s.directions.count) = ([2, 2], 8));
    let space = json!({ "center": [0.0, 0.0, 0.0], "scale": 1.0 });
    let mut job = json!({ "what": "render", "version": env!("CARGO_PKG_VERSION"), "settings": settings, "space": space });
    let mut state = json!({ "display": { "exposure": 0.0 } });
    change(&mut job, &mut state);
    let floats = vec![1.0; 1 << 12];
    let mut part = Part::new(job, state);
    for &(name, length) in nodes {
        part.put(name, &floats[..length]);
        // The planes of what few pictures have are empty.
        let others = name.strip_suffix("/0").filter(|node| node.contains('+') && !node.ends_with("/0"));
        for other in others.into_iter().flat_map(|node| [1, 2].map(|plane| format!("{node}/{plane}"))) {
            if !nodes.iter().any(|(name, _)| *name == other) {
                part.put(other, &[]);
            }
        }
    }
    let folder = folder();
    part.write(&folder.path().join("x.part")).unwrap();
    bytes(&folder, "x.part")
}

fn merged(bytes: &[u8]) -> Result<Image> {
    let path = Path::new("x.part");
    let part = Part::parse(path, bytes)?;
    let mut merge = RenderMerge::new(path, &part)?;
    merge.add(path, &part)?;
    merge.picture()
}

/// Checkpoints and parts: no byte of one can be another, and what one with a true checksum says is not believed either.
#[test]
fn parts_are_sound_or_refused() {
    // Floats of four pixels.
    const WHOLE: usize = 4 * 25;
    let same = |_: &mut Value, _: &mut Value| {};
    let sound = part(same, &[("film/0+4/0", WHOLE), ("film/4+4/0", WHOLE)]);
    assert_eq!(merged(&sound).unwrap().width, 2);
    let mutants = mutants(&sound);
    let about = |bytes: &[u8]| Part::parse(Path::new("x.part"), bytes).map(|part| (part.job, part.state));
    let said = about(&sound).unwrap();
    for (what, bytes) in mutants.iter().filter(|(_, bytes)| *bytes != sound) {
        match catch_unwind(|| about(bytes)).expect(what) {
            Err(error) => assert!(matches!(error, Error::Input { .. }), "{what}: {error}"),
            // The last digit of a number in words may be another and the number the same.
            Ok(found) => assert_eq!(found, said, "{what}"),
        }
    }
    let lies: [&[(&str, usize)]; 12] = [
        &[("film/0+8/0", WHOLE), ("film/2+2/0", WHOLE)],
        &[("film/0+8/0", WHOLE), ("film/8+1/0", WHOLE)],
        &[("film/0+2147483648/0", WHOLE), ("film/2147483648+2147483648/0", WHOLE), ("film/4294967295+1/0", WHOLE)],
        &[("film/0+8/0", WHOLE - 1)],
        &[("film/0+8/0", 2 * WHOLE)],
        &[("film/0+8/0", 0)],
        &[("film/0+8/1", WHOLE)],
        &[("film/0+8/0", WHOLE), ("film/0+8/1", WHOLE)],
        &[("film/1+4/0", WHOLE)],
        &[("film/0+3/0", WHOLE)],
        &[("film/x", 4)],
        &[("film/0+8/0/0", WHOLE)],
    ];
    for nodes in lies {
        let error = merged(&part(same, nodes)).map(drop).expect_err(nodes[0].0);
        assert!(error.to_string().contains("damaged"), "{nodes:?}: {error}");
    }
    // Honest, but not all there is.
    assert!(matches!(merged(&part(same, &[("film/0+4/0", WHOLE)])), Err(Error::Usage { .. })));
    type Change = fn(&mut Value, &mut Value);
    let changes: [Change; 8] = [
        |job, _| *job = Value::Null,
        |job, _| job["settings"] = json!(7),
        |job, _| job["settings"]["directions"] = json!(0),
        |job, _| job["settings"]["directions"] = json!(u64::MAX),
        |job, _| job["settings"]["size"] = json!([4_294_967_295_u32, 4_294_967_295_u32]),
        |job, _| job["space"]["scale"] = json!("1"),
        |job, _| job["version"] = json!("0.0.0"),
        |_, state| *state = json!([]),
    ];
    for (i, change) in changes.into_iter().enumerate() {
        let error = merged(&part(change, &[("film/0+8/0", WHOLE)])).map(drop).expect_err("it is not sound");
        assert!(matches!(error, Error::Input { .. }), "change {i}: {error}");
    }
}

/// One after the other of such pieces.
fn many(count: usize, piece: impl Fn(usize) -> String) -> Vec<u8> {
    (0..count).map(piece).collect::<String>().into_bytes()
}

/// Counts and sizes beyond sense, and much of what is allowed once.
#[test]
fn absurd_inputs_are_refused_in_words() {
    const VERTICES: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl lamp\nf 1 2 3\n";
    let model = |more: Vec<u8>| [VERTICES.as_bytes(), &more].concat();
    let ply = |format: &str, rest: &str| format!("ply\nformat {format} 1.0\n{rest}").into_bytes();
    let vertex = "property float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\nend_header\n";
    let list = "property list uchar int vertex_indices\n";
    let library = |more: Vec<u8>| [&seed("mtl/all.mtl")[..], &more].concat();
    let gltf = |more: &str| format!(r#"{{"asset": {{"version": "2.0"}}, {more}}}"#).into_bytes();
    let toml = |more: String| format!("mesh = 'm.obj'\n{more}").into_bytes();
    let cases: Vec<(&str, &str, Vec<u8>, &str)> = vec![
        ("obj", "a million corners", model([&b"f"[..], &b" 1 2 3".repeat(333_333)].concat()), "a face with 999999 corners"),
        ("obj", "an index of 10^18", model(b"f 1 2 1000000000000000000\n".to_vec()), "refers to v 1000000000000000000"),
        ("obj", "an index far back", model(b"f 1 2 -1000000000000000000\n".to_vec()), "1000000000000000000 v back"),
        ("obj", "a corner of ten million digits", model([&b"f 1 2 "[..], &[b'9'; 10_000_000]].concat()), "not a face corner"),
        ("obj", "libraries without end", many(300_000, |i| format!("mtllib {i}.mtl\n")), "no face"),
        ("obj", "names without end", model([&b"usemtl "[..], &[b'x'; 10_000_000]].concat()), "no material library defines"),
        (
            "gltf",
            "nesting.gltf",
            [&br#"{"asset": {"version": "2.0"}, "extras": "#[..], &b"[".repeat(1_000_000)].concat(),
            "EOF while parsing a list",
        ),
        ("gltf", "long.glb", [&b"glTF\x02\0\0\0\xff\xff\xff\xff"[..], &[0; 100]].concat(), "cut short"),
        ("gltf", "chunk.glb", b"glTF\x02\0\0\0\x14\0\0\0\xff\xff\xff\xffJSON".to_vec(), "cut short"),
        ("gltf", "children.gltf", gltf(r#""nodes": [{"children": [0]}], "scenes": [{"nodes": [0]}]"#), "below itself"),
        ("gltf", "copies.gltf", many_copies(), "far more vertices, triangles or instances"),
        ("gltf", "scene.gltf", gltf(r#""scene": 4294967295, "scenes": [{"nodes": [0]}]"#), "refers to scenes[4294967295]"),
        ("mtl", "names without end", library([&b"newmtl a\nKd "[..], &[b'x'; 10_000_000]].concat()), "Kd has"),
        ("mtl", "what no name has", library(b"newmtl a\nmap_Kd \0\n".to_vec()), "binary"),
        (
            "model",
            "names.ply",
            ply("ascii", &(0..2000).map(|i| format!("element e{i} 1\n")).collect::<String>()),
            "more than 1000 elements",
        ),
        (
            "model",
            "a.ply",
            ply("ascii", &format!("element face 1000000000000\n{list}element vertex 1\n{vertex}0 0 0 0 0 1\n")),
            "the file ends",
        ),
        ("model", "b.ply", ply("binary_big_endian", &format!("element vertex 18446744073709551615\n{vertex}0")), "no face"),
        (
            "model",
            "c.ply",
            ply("binary_little_endian", &format!("element face 1\n{list}element vertex 1000000000000\n{vertex}\u{1}0000")),
            "the file ends",
        ),
        (
            "model",
            "d.ply",
            ply("ascii", &format!("element vertex 1000000000000\nelement face 1\n{list}end_header\n")),
            "vertex has no x",
        ),
        (
            "model",
            "e.ply",
            ply("ascii", &format!("element x 1000000000000\nelement face 1\n{list}element vertex 1\n{vertex}")),
            "the file ends",
        ),
        ("model", "f.ply", [&b"ply\n"[..], &[b'x'; 10_000_000]].concat(), "is no statement"),
        ("model", "a.stl", [&[b' '; 80][..], &[0xff; 4], &[0; 49]].concat(), "no triangle"),
        ("model", "b.stl", [&b"solid "[..], &b"vertex 0 0 0\n".repeat(500_000), b"endloop"].concat(), "no face can be drawn"),
        ("scene", "nesting", toml(format!("materials = {}", "[".repeat(100_000))), "recursion"),
        ("scene", "nested tables", toml(format!("camera = {}", "{a=".repeat(100_000))), "recursion"),
        ("scene", "a key of many parts", toml(format!("{}a = 1", "a.".repeat(100_000))), "recursion"),
        ("scene", "a picture of 10^19 pixels", toml("[settings]\nsize = [4294967295, 4294967295]".into()), "size is 4294967295"),
        ("scene", "other characters", [&b"mesh = '"[..], &[0xff; 1000], b"'"].concat(), "not UTF-8"),
        ("texture", "BMP of 1 GiB", bmp(16384, 16384), "cannot be decoded"),
        ("texture", "BMP beyond", bmp(1 << 30, 1 << 30), "too large"),
        ("texture", "PNG of 1 GiB", png(16384, 16384), "cannot be decoded"),
        ("texture", "PNG beyond", png(1 << 30, 1 << 30), "too large"),
        (
            "environment",
            "a.hdr",
            b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4096 +X 8192\n".to_vec(),
            "too short for 8192 x 4096",
        ),
        ("environment", "a.exr", exr("environment/sky.exr", [3, 1], [8191, 4095]), "too many"),
        ("picture", "a.exr", exr("picture/channels.exr", [1, 3], [1 << 20, 1 << 20]), "too many"),
        ("picture", "b.exr", exr("picture/channels.exr", [1, 3], [i32::MAX - 1, i32::MAX - 1]), "OpenEXR"),
        ("picture", "a.png", png(30_000, 30_000), "too many"),
        ("picture", "b.png", png(i32::MAX as u32, i32::MAX as u32), "not readable as PNG"),
        ("points", "a.ply", ply("ascii", &format!("element vertex 1000000000000\n{vertex}0 0 0 0 0 1\n")), "bytes are left"),
        ("points", "b.ply", ply("binary_little_endian", &format!("element vertex 1000000000000\n{vertex}")), "bytes are left"),
        ("points", "c.ply", ply("ascii", &format!("element vertex 18446744073709551615\n{vertex}")), "bytes are left"),
        (
            "points",
            "d.ply",
            [
                &ply("binary_little_endian", &format!("element face 1\nproperty list uint double i\nelement vertex 1\n{vertex}"))
                    [..],
                &[0xff; 100],
            ]
            .concat(),
            "not a sound PLY",
        ),
        ("points", "a.npy", npy("1000000000000, 6", b""), "bytes follow"),
        ("points", "b.npy", npy("0, 6", b""), "no points"),
        ("points", "c.npy", npy("4294967296, 4294967296, 4294967296, 0", b""), "bytes follow"),
        ("points", "a.csv", vec![b'1'; 10_000_000], "the first line has 1 numbers"),
        ("points", "b.csv", b"1,".repeat(1_000_000), "neither numbers nor the name x"),
        ("points", "c.csv", b"0,0,0,0,0,1e999\n".to_vec(), "nz of point 1 is inf"),
        ("transfer", "a.json", b"[".repeat(1_000_000), "recursion"),
        ("transfer", "b.json", br#"{"columns": 7}"#.to_vec(), "0 columns are named"),
        ("transfer", "a.npy", npy("0, 4, 3", b""), "12 columns are named"),
        ("transfer", "b.npy", npy("4294967296, 4294967296, 4294967296", b""), "bytes follow"),
    ];
    for (format, name, bytes, fragment) in cases {
        let error = read(format, name, &bytes).err().unwrap_or_else(|| panic!("{format}, {name}: was read"));
        let message = error.to_string();
        assert!(matches!(error, Error::Input { .. }) && message.contains(fragment), "{format}, {name}: {message}");
        assert!(message.len() < 4000, "{format}, {name}: a message of {} bytes", message.len());
        read_all(known(format), name, vec![("again".into(), bytes)]);
    }
    // Much, but sound.
    let fans = [&b"f"[..], &b" 1 2 3".repeat(1000), b"\n"].concat().repeat(10);
    let nested = |k: usize| format!("v 0 0 0\nv {k} 0 0\nv 0 {k} 0\n");
    let nested = [many(1000, |k| nested(k + 1)), b"f".to_vec(), many(3000, |i| format!(" {}", i + 4))].concat();
    // A zigzag that comes back over itself.
    let zigzag = |i: usize| format!("v {} {} 0\n", if i < 750 { i } else { 1500 - i }, i * i % 97);
    let crossing = [many(1500, zigzag), b"f".to_vec(), many(1500, |i| format!(" {}", i + 4))].concat();
    let sound = [
        ("obj", "materials in turns", model(many(200_000, |i| format!("usemtl {}\nf 1 2 3\n", ["lamp", "ball"][i % 2])))),
        ("obj", "polygons over themselves", model(fans)),
        ("obj", "triangles in triangles", model(nested)),
        ("obj", "edges that cross", model(crossing)),
        ("mtl", "many materials", library(many(200_000, |i| format!("newmtl {i}\nmap_Kd t.tga\nmap_Ke t.tga\n")))),
        ("scene", "comments", toml("# nothing\n".repeat(1_000_000))),
        ("points", "a.csv", b"0,0,0,0,0,1\n".repeat(200_000)),
    ];
    for (format, name, bytes) in sound {
        assert_eq!(read_all(known(format), name, vec![("once".into(), bytes)]), 0, "{format}, {name}");
    }
}

/// A short glTF with a million copies of 256 triangles.
fn many_copies() -> Vec<u8> {
    let (zero, one) = ("%00%00%00%00", "%00%00%80%3F");
    let positions = [zero, zero, zero, one, zero, zero, zero, one, zero].concat();
    let view = |offset: usize, length: usize| json!({ "buffer": 0, "byteOffset": offset, "byteLength": length });
    let accessor = |view: Option<usize>, component: u32, kind: &str, count: usize| {
        let mut accessor = json!({ "componentType": component, "type": kind, "count": count });
        view.into_iter().for_each(|view| accessor["bufferView"] = view.into());
        accessor
    };
    let copies = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 2 } } });
    let root = json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": 804, "uri": format!("data:,{positions}{}", "%00%01%02".repeat(256)) }],
        "bufferViews": [view(0, 36), view(36, 768)],
        "accessors": [accessor(Some(0), 5126, "VEC3", 3), accessor(Some(1), 5121, "SCALAR", 768), accessor(None, 5126, "VEC3", 1_000_000)],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "nodes": [{ "mesh": 0, "extensions": copies }],
        "scenes": [{ "nodes": [0] }],
    });
    root.to_string().into_bytes()
}

fn known(format: &str) -> &'static str {
    ["obj", "gltf", "mtl", "model", "scene", "texture", "environment", "picture", "points", "transfer"]
        .into_iter()
        .find(|&known| known == format)
        .expect("a reader")
}
