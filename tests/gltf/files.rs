//! Containers and files: binary and text, URIs, versions, extensions, and what a file may ask for.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use finalgather::scene::{LoadOptions, Loaded, World};
use serde_json::json;

use crate::build::{F32, Model, contents, load, options, png};

/// The bytes of a text file.
fn text(model: &Model, uri: &str) -> Vec<u8> {
    serde_json::to_vec_pretty(&model.root(Some(uri))).unwrap()
}

fn refusal(files: BTreeMap<&str, Vec<u8>>, name: &str) -> String {
    load(files, name, options()).expect_err("it is not sound").to_string()
}

/// As the variants `glTF`, `glTF-Embedded` and `glTF-Binary` of the samples.
#[test]
fn one_model_in_three_forms() {
    let model = Model::triangle();
    let expected = contents(model.world());
    let data = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&model.bin));
    let without_padding = data.trim_end_matches('=').to_owned();
    let percent: String = model.bin.iter().map(|byte| format!("%{byte:02x}")).collect();
    let mut cases = vec![
        BTreeMap::from([("m.gltf", text(&model, &data))]),
        BTreeMap::from([("m.gltf", text(&model, &without_padding))]),
        BTreeMap::from([("m.gltf", text(&model, &format!("data:,{percent}")))]),
        BTreeMap::from([("m.gltf", text(&model, "my%20m.bin")), ("my m.bin", model.bin.clone())]),
        BTreeMap::from([("m.gltf", text(&model, "100%25.bin")), ("100%.bin", model.bin.clone())]),
        // Written as it is named, though that encodes something else.
        BTreeMap::from([("m.gltf", text(&model, "a%20b.bin")), ("a%20b.bin", model.bin.clone())]),
        // Named for the other form.
        BTreeMap::from([("m.gltf", model.glb())]),
    ];
    // With a byte order mark.
    cases.push(BTreeMap::from([("m.gltf", [&b"\xef\xbb\xbf"[..], &text(&model, &data)].concat())]));
    for files in cases {
        let Loaded { world, report, .. } = load(files, "m.gltf", options()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(contents(world), expected);
        assert_eq!(report.warnings, [""; 0]);
    }
}

/// Files are read from the folder of the model, and from no other. The report lists them.
#[test]
fn files_of_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("in");
    fs::create_dir(&inside).unwrap();
    let mut model = Model::square(json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }));
    model.push("images", json!({ "uri": "textures/red.png" }));
    model.push("textures", json!({ "source": 0 }));
    fs::create_dir(inside.join("textures")).unwrap();
    fs::write(inside.join("textures/red.png"), png(1, &[[255, 0, 0]])).unwrap();
    fs::write(inside.join("m.bin"), &model.bin).unwrap();
    fs::write(inside.join("m.gltf"), text(&model, "m.bin")).unwrap();
    let Loaded { world, report, .. } = World::load_with(&inside.join("m.gltf"), options()).unwrap();
    assert_eq!((world.textures.len(), report.files.len()), (1, 3));
    fs::rename(inside.join("m.bin"), folder.path().join("m.bin")).unwrap();
    fs::write(inside.join("m.gltf"), text(&model, "../m.bin")).unwrap();
    let refusal = World::load_with(&inside.join("m.gltf"), options()).unwrap_err().to_string();
    assert!(refusal.contains("it lies outside the scene's folder") && refusal.contains("--allow-outside"), "{refusal}");
    let anywhere = LoadOptions { files: finalgather::scene::Files::Anywhere, ..options() };
    World::load_with(&inside.join("m.gltf"), anywhere).unwrap();
}

#[test]
fn missing_buffers_are_named() {
    let model = Model::triangle();
    let message = refusal(BTreeMap::from([("m.gltf", text(&model, "m.bin"))]), "m.gltf");
    assert!(message.contains("m.bin: cannot read this file, named at buffers[0] of m.gltf"), "{message}");
    assert!(message.contains("put the file there"), "{message}");
    let message = refusal(BTreeMap::from([("m.gltf", text(&model, "https://x.org/m.bin"))]), "m.gltf");
    assert!(message.contains("https://x.org/m.bin is not a file beside the model"), "{message}");
    let message = refusal(BTreeMap::from([("m.gltf", text(&model, "data:;base64,?"))]), "m.gltf");
    assert!(message.contains("buffers[0]: its data URI is not base64"), "{message}");
    let message = refusal(BTreeMap::from([("m.gltf", model.root(None).to_string().into_bytes())]), "m.gltf");
    assert!(message.contains("buffers[0]: it has no uri, and there is no binary chunk"), "{message}");
}

#[test]
fn broken_containers_are_refused_with_their_place() {
    let sound = Model::triangle().glb();
    let message = |bytes: Vec<u8>| refusal(BTreeMap::from([("m.glb", bytes)]), "m.glb");
    let cut = message(sound[..sound.len() - 5].to_vec());
    assert!(cut.contains("cut short: what starts at byte 0 needs 5 bytes more"), "{cut}");
    assert!(message(sound[..10].to_vec()).contains("cut short: what starts at byte 8 needs 2 bytes more"));
    let with = |at: usize, word: u32| [&sound[..at], &word.to_le_bytes(), &sound[at + 4..]].concat();
    assert!(message(with(12, u32::MAX)).contains("cut short: what starts at byte 12"));
    assert!(message(with(16, 7)).contains("the first chunk of this binary glTF, at byte 12, is not JSON"));
    let old = message(with(4, 1));
    assert!(old.contains("this is glTF 1, not 2.0") && old.contains("Blender"), "{old}");
    assert!(message(with(20, 0x2020_2020)).contains("not a valid glTF"));
    let text = |text: &str| refusal(BTreeMap::from([("m.gltf", text.as_bytes().to_vec())]), "m.gltf");
    assert!(text("{\n\"asset\": {\"version\": \"2.0\"},\n\"meshes\": 7\n}").starts_with("m.gltf:3: this is not a valid glTF"));
    assert!(text("{}").contains("it has no asset.version"));
    assert!(text(r#"{"asset": {"version": "1.0"}, "meshes": {"a": {}}}"#).contains("this is glTF 1.0, not 2.0"));
    assert!(text(r#"{"asset": {"version": "2.0"}}"#).contains("no mesh in its scene"));
    // What follows the stated end is told and ignored.
    let files = BTreeMap::from([("m.glb", [&sound[..], b"rest"].concat())]);
    let warnings = load(files, "m.glb", options()).unwrap().report.warnings;
    assert_eq!(warnings, ["m.glb: 4 bytes follow the end that the header states; they are ignored"]);
}

#[test]
fn unknown_extensions_are_refused_by_name() {
    let mut model = Model::triangle();
    model.json["extensionsUsed"] = json!(["EXT_of_nobody"]);
    model.world();
    model.json["extensionsRequired"] = json!(["KHR_texture_transform", "EXT_of_nobody"]);
    let refusal = model.refusal();
    assert!(refusal.contains("requires the extension EXT_of_nobody"), "{refusal}");
    assert!(refusal.contains("export the model without this extension"), "{refusal}");
}

/// What the crate's types refuse, and glTF allows.
#[test]
fn json_of_other_writers() {
    let expected = contents(Model::triangle().world());
    let mut model = Model::triangle();
    model.json["accessors"][0]["count"] = json!(3.0);
    assert_eq!(contents(model.world()), expected);
    model.json["scenes"] = json!([{ "name": "empty" }, { "nodes": [0.0] }]);
    model.json["scene"] = json!(1);
    assert_eq!(contents(model.world()), expected);
    let target = json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": "/materials/0" } } });
    let animation = json!({ "samplers": [{ "input": 0, "output": 0 }], "channels": [{ "sampler": 0, "target": target }] });
    model.json["animations"] = json!([animation]);
    assert_eq!(contents(model.world()), expected);
    model.json["accessors"][0]["count"] = json!(3.5);
    assert!(model.refusal().contains("not a valid glTF: invalid type: floating point `3.5`"));
}

/// A scene file changes a glTF model as any other.
#[test]
fn scene_files_name_gltf_models() {
    let mut model = Model::square(json!({ "name": "wall", "pbrMetallicRoughness": { "metallicFactor": 0 } }));
    model.push("materials", json!({ "name": "wall" }));
    let scene = "mesh = 'm.glb'\n[materials.wall]\nalbedo = [0.1, 0.2, 0.3]\nemission = [1, 2, 3]\n";
    let files = BTreeMap::from([("s.toml", scene.as_bytes().to_vec()), ("m.glb", model.glb())]);
    let Loaded { world, report, .. } = load(files, "s.toml", LoadOptions::default()).unwrap();
    // Both materials of the name.
    for material in &world.materials[..2] {
        assert_eq!((material.albedo.to_array(), material.emission.to_array()), ([0.1, 0.2, 0.3], [1.0, 2.0, 3.0]));
    }
    assert_eq!(report.warnings, [""; 0]);
    let quad = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".as_bytes().to_vec();
    let asked = LoadOptions { scene: Some("hall".into()), ..options() };
    let refusal = load(BTreeMap::from([("m.obj", quad)]), "m.obj", asked).unwrap_err().to_string();
    assert!(refusal.contains("there is no scene \"hall\""), "{refusal}");
    let unknown = World::load(Path::new("m.fbx")).unwrap_err().to_string();
    assert!(unknown.contains(".glb") && unknown.contains(".gltf") && unknown.contains(".obj"), "{unknown}");
}

/// A short file may not ask for much.
#[test]
fn short_files_ask_for_little() {
    // Zeros without end.
    let mut model = Model::new();
    let accessor = |count: u64| json!({ "componentType": F32, "type": "VEC3", "count": count });
    let positions = model.push("accessors", accessor(u64::MAX));
    model.mesh(json!({ "attributes": { "POSITION": positions } }));
    for count in [u64::MAX, 1 << 32, 1 << 28] {
        model.json["accessors"][positions] = accessor(count);
        let refusal = model.refusal();
        assert!(refusal.contains("accessors[0]: its count is") && refusal.contains("too small"), "{refusal}");
    }
    // The same triangles again and again, each time as another mesh.
    let mut model = Model::new();
    let strip: Vec<f32> = (0..30_000_u16).flat_map(|i| [f32::from(i), f32::from(i % 2), 0.0]).collect();
    let positions = model.floats(3, &strip);
    for _ in 0..1000 {
        model.mesh(json!({ "attributes": { "POSITION": positions }, "mode": 5 }));
    }
    let refusal = model.refusal();
    assert!(refusal.contains("far more vertices, triangles or instances than a file of its length"), "{refusal}");
    // One mesh in more places than numbers of 32 bits hold.
    let mut model = Model::new();
    let positions = model.floats(3, &strip);
    model.mesh(json!({ "attributes": { "POSITION": positions }, "mode": 5 }));
    for _ in 0..10_000 {
        model.push("nodes", json!({ "mesh": 0 }));
    }
    assert!(model.refusal().contains("its instances have more than 268435456 triangles together"));
    // A long name is not copied for each of many nodes, and no file has a name of such length.
    let mut model = Model::triangle();
    model.json["meshes"][0]["name"] = json!("\u{e9}".repeat(1_000_000));
    assert_eq!(model.world().instances[0].name, "\u{e9}".repeat(128));
    let mut model = Model::triangle();
    model.json["buffers"] = json!([{ "byteLength": 36, "uri": "x".repeat(5000) }]);
    assert!(model.refusal().contains("buffers[0]: its uri has 5000 bytes, more than the name of a file"));
    // Places that are too far apart.
    let mut model = Model::triangle();
    model.json["nodes"][0]["translation"] = json!([2e9, 0, 0]);
    assert!(model.refusal().contains("nodes[0]: node 0 reaches farther than 1e9 from the origin"));
    model.json["nodes"] = (0..10).map(|node| json!({ "children": [node + 1], "scale": [1e38, 1, 1] })).collect();
    model.push("nodes", json!({ "mesh": 0 }));
    assert!(model.refusal().contains("nodes[8]: its place in the world is not finite"));
}
