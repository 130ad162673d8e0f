//! Results in a glTF file: all else in it stays, and other programs read what was added.

use std::fs;
use std::path::Path;

use finalgather::export::{ExportMesh, ExportSource, Lightmap, PointValues, Positions};
use finalgather::image::{Channel, Image, WriteOptions};
use finalgather::points::{LightMap, LightMapOptions, Resolution, UvSource, Vertices};
use finalgather::scene::{Mesh, Scene, World};
use glam::DVec3;
use serde_json::{Value, json};

use crate::build::{F32, Model, U8, U16, le, png};
use crate::common::khronos;
use crate::packed::{draco_cube, meshopt_cube, packed};

/// Two nodes that share a folded strip with a texture, extras and a morph target; lines; a camera; an animation.
fn furnished() -> Model {
    let mut model = Model::new();
    let picture = png(2, &[[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]]);
    let texture = model.texture(&picture, json!({ "wrapS": 33071 }));
    let pbr = json!({ "baseColorTexture": { "index": texture }, "metallicFactor": 0.0 });
    model.push("materials", json!({ "name": "tiles", "pbrMetallicRoughness": pbr, "extras": { "number": 7 } }));
    // Over an edge of ninety degrees.
    let positions = model.floats(3, &[0., 0., 0., 0., 1., 0., 1., 0., 0., 1., 1., 0., 1., 0., -1., 1., 1., -1.]);
    bounds(&mut model, positions, [0.0, 0.0, -1.0], [1.0, 1.0, 0.0]);
    let most = u16::MAX;
    let uvs = [0, 0, 0, most, 32767, 0, 32767, most, most, 0, most, most].map(u16::to_le_bytes).concat();
    let uvs = model.accessor(U16, "VEC2", &uvs);
    model.json["accessors"][uvs]["normalized"] = json!(true);
    let moved = model.floats(3, &[0.5; 18]);
    bounds(&mut model, moved, [0.5; 3], [0.5; 3]);
    let moved_uvs = model.floats(2, &[0.25; 12]);
    // The third and fourth triangle have no area. They stay in the file.
    let indices = model.accessor(U8, "SCALAR", &[0, 2, 1, 3, 3, 2, 5, 4]);
    let strip = json!({
        "attributes": { "POSITION": positions, "TEXCOORD_0": uvs }, "indices": indices, "mode": 5, "material": 0,
        "targets": [{ "POSITION": moved, "TEXCOORD_0": moved_uvs }],
    });
    let lines = json!({ "attributes": { "POSITION": positions }, "mode": 3, "targets": [{ "POSITION": moved }] });
    let mesh = model.push("meshes", json!({ "name": "fold", "primitives": [strip, lines], "weights": [0.0] }));
    model.push("nodes", json!({ "name": "left", "mesh": mesh, "extras": "kept" }));
    model.push("nodes", json!({ "name": "right", "mesh": mesh, "translation": [3, 0, 0] }));
    model.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }));
    model.push("nodes", json!({ "name": "eye", "camera": 0, "translation": [2, 1, 9] }));
    model.push("scenes", json!({ "nodes": [0, 1, 2] }));
    model.json["scene"] = json!(0);
    let times = model.accessor(F32, "SCALAR", &le(&[0.0, 1.0]));
    model.json["accessors"][times]["min"] = json!([0.0]);
    model.json["accessors"][times]["max"] = json!([1.0]);
    let places = model.floats(3, &[3.0, 0.0, 0.0, 3.0, 2.0, 0.0]);
    let channel = json!({ "sampler": 0, "target": { "node": 1, "path": "translation" } });
    model.push("animations", json!({ "name": "up", "channels": [channel], "samplers": [{ "input": times, "output": places }] }));
    model
}

fn bounds(model: &mut Model, accessor: usize, min: [f32; 3], max: [f32; 3]) {
    model.json["accessors"][accessor]["min"] = json!(min);
    model.json["accessors"][accessor]["max"] = json!(max);
}

/// A square with light-map coordinates of its own in the left half of a map.
fn mapped() -> Model {
    let mut model = Model::square(json!({ "name": "wall", "occlusionTexture": { "index": 0 } }));
    model.texture(&png(1, &[[255; 3]]), json!({}));
    let own = model.floats(2, &[0.1, 0.9, 0.4, 0.9, 0.4, 0.1, 0.1, 0.1]);
    model.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(own);
    let positions = model.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap();
    bounds(&mut model, positions as usize, [0.0; 3], [1.0, 1.0, 0.0]);
    model
}

/// A loaded file, and what an export of it needs.
struct Source {
    folder: tempfile::TempDir,
    scene: Scene,
}

impl Source {
    fn new(model: &Model) -> Self {
        Self::of("in.glb", &[("in.glb", &model.glb())])
    }

    fn of(name: &str, files: &[(&str, &[u8])]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        files.iter().for_each(|(name, bytes)| fs::write(folder.path().join(name), bytes).unwrap());
        let scene = World::load(&folder.path().join(name)).unwrap().world.flatten();
        Self { folder, scene }
    }

    /// Writes `out.glb` with a light map of this irradiance and openness in every texel. Returns its JSON and the layout of the map.
    fn write_lightmap(&self, irradiance: Option<f32>, openness: Option<f32>) -> (Value, &'static str) {
        let options =
            LightMapOptions { resolution: Resolution::Pixels(64), uvs: UvSource::Auto, padding: 2, samples_per_texel: 1 };
        let map = LightMap::new(&self.scene.mesh, &options).unwrap();
        let [width, height] = [map.counts().width, map.counts().height].map(|side| side as usize);
        let image = |names: &[&str], value: f32| {
            let channel = |name: &&str| Channel { name: (*name).into(), samples: vec![value; width * height] };
            Image { width, height, channels: names.iter().map(channel).collect() }
        };
        let irradiance = irradiance.map(|value| image(&["R", "G", "B"], value));
        let openness = openness.map(|value| image(&["AO"], value));
        let positions = self.world(map.mesh());
        let uvs = &map.mesh().lightmap_uvs;
        let surface = self.surface(map.mesh(), &positions);
        let lightmap = Lightmap { surface, uvs, irradiance: irradiance.as_ref(), openness: openness.as_ref() };
        lightmap.write(&self.out(), &WriteOptions::default()).unwrap();
        khronos::check(&self.out());
        (json_of(&self.out()), map.counts().layout)
    }

    /// Writes `out.glb` with an openness at vertices that is a quarter more than half their y.
    fn write_values(&self) -> Value {
        let vertices = Vertices::new(&self.scene.mesh, 0.0);
        let positions = self.world(vertices.mesh());
        let samples = positions.iter().map(|position| 0.25 + 0.5 * position.y as f32).collect();
        let columns = [Channel { name: "AO".into(), samples }];
        let normals = &vertices.mesh().normals;
        let surface = Some(self.surface(vertices.mesh(), &positions));
        let values = PointValues { positions: Positions::near(&positions), normals, columns: &columns, surface, sources: None };
        values.write(&self.out(), &WriteOptions::default()).unwrap();
        khronos::check(&self.out());
        json_of(&self.out())
    }

    /// Asserts that all vertices of all primitives have the openness of [`Self::write_values`], also as their colour.
    fn assert_values(&self) {
        let gltf::Gltf { document, blob } = gltf::Gltf::open(self.out()).unwrap();
        let blob = blob.unwrap();
        for primitive in document.meshes().flat_map(|mesh| mesh.primitives()) {
            let reader = primitive.reader(|_| Some(&blob[..]));
            let expected: Vec<f32> = reader.read_positions().unwrap().map(|position| 0.25 + 0.5 * position[1]).collect();
            let openness = primitive.get(&gltf::Semantic::Extras("AO".into())).unwrap();
            let found: Vec<f32> = gltf::accessor::Iter::<f32>::new(openness, |_| Some(&blob[..])).unwrap().collect();
            let shown: Vec<f32> = reader.read_colors(0).unwrap().into_rgba_f32().map(|color| color[0]).collect();
            for values in [found, shown] {
                let near = values.iter().zip(&expected).all(|(found, expected)| (found - expected).abs() < 1e-4);
                assert!(near && values.len() == expected.len(), "{values:?} is not {expected:?}");
            }
        }
    }

    fn world(&self, mesh: &Mesh) -> Vec<DVec3> {
        mesh.positions.iter().map(|&position| self.scene.space.to_world(position)).collect()
    }

    fn surface<'a>(&'a self, mesh: &'a Mesh, positions: &'a [DVec3]) -> ExportMesh<'a> {
        let Scene { materials, textures, .. } = &self.scene;
        ExportMesh { mesh, positions: Positions::near(positions), materials, textures, source: ExportSource::of(&self.scene) }
    }

    fn out(&self) -> std::path::PathBuf {
        self.folder.path().join("out.glb")
    }
}

fn json_of(path: &Path) -> Value {
    let gltf::Glb { json, .. } = gltf::Glb::from_reader(fs::File::open(path).unwrap()).unwrap();
    serde_json::from_slice(&json).unwrap()
}

/// The places of what is in `before` and is not in `after`, or is another there.
fn lost(before: &Value, after: &Value) -> Vec<String> {
    fn collect(before: &Value, after: &Value, place: &str, lost: &mut Vec<String>) {
        match (before, after) {
            (Value::Object(before), Value::Object(_)) => {
                before.iter().for_each(|(key, value)| collect(value, &after[key], &format!("{place}/{key}"), lost));
            }
            (Value::Array(before), Value::Array(_)) => {
                before
                    .iter()
                    .enumerate()
                    .for_each(|(index, value)| collect(value, &after[index], &format!("{place}/{index}"), lost));
            }
            _ if before != after => lost.push(place.to_owned()),
            _ => {}
        }
    }
    let mut all = Vec::new();
    collect(before, after, "", &mut all);
    all
}

/// World positions of the corners of all triangles, in the order of the file, and the albedo there.
fn corners(path: &Path) -> Vec<(DVec3, glam::Vec3)> {
    let scene = World::load(path).unwrap().world.flatten();
    let corner = |triangle: usize, corner: usize| {
        let position = scene.mesh.corners(triangle)[corner];
        (scene.space.to_world(position), scene.base_color(triangle, glam::Vec3::AXES[corner]))
    };
    (0..scene.mesh.triangles.len()).flat_map(|triangle| [0, 1, 2].map(|k| corner(triangle, k))).collect()
}

#[test]
fn a_light_map_is_added_and_all_else_stays() {
    let model = furnished();
    let source = Source::new(&model);
    let (after, layout) = source.write_lightmap(Some(2.0), Some(0.25));
    // The nodes lie on each other in the texture, so that the map has a layout of its own.
    assert_eq!(layout, "atlas");
    let before = model.root(None);
    let strip = "/meshes/0/primitives/0";
    let renewed =
        ["/attributes/POSITION", "/attributes/TEXCOORD_0", "/indices", "/mode", "/targets/0/POSITION", "/targets/0/TEXCOORD_0"];
    let mut expected: Vec<_> = renewed.iter().map(|place| format!("{strip}{place}")).collect();
    // The second node gets a mesh of its own, because its light is another.
    expected.extend(["/nodes/1/mesh".to_owned(), "/buffers/0/byteLength".to_owned()]);
    let (mut found, mut expected) = (lost(&before, &after), expected);
    found.sort_unstable();
    expected.sort_unstable();
    assert_eq!(found, expected);

    let [left, right] = [0, 1].map(|node| &after["meshes"][after["nodes"][node]["mesh"].as_u64().unwrap() as usize]);
    assert_eq!((&left["name"], &right["name"]), (&json!("fold"), &json!("fold")));
    for mesh in [left, right] {
        let [strip, lines] = [0, 1].map(|primitive| &mesh["primitives"][primitive]);
        assert!(strip["attributes"]["TEXCOORD_1"].is_u64() && strip["mode"] == 4, "{mesh:#}");
        assert!(lines["attributes"]["TEXCOORD_1"].is_null() && lines["mode"] == 3, "{mesh:#}");
        let of = |accessor: &Value| &after["accessors"][accessor.as_u64().unwrap() as usize];
        assert_eq!(of(&strip["indices"])["count"], 18, "six triangles, two of them without area");
        // The types of the file, at the vertices on both sides of the fold.
        let uvs = of(&strip["attributes"]["TEXCOORD_0"]);
        assert_eq!((&uvs["componentType"], &uvs["normalized"], &uvs["count"]), (&json!(U16), &json!(true), &json!(8)));
        for name in ["POSITION", "TEXCOORD_0"] {
            assert_eq!(of(&strip["targets"][0][name])["count"], 8);
        }
    }
    assert_ne!(left["primitives"][0]["attributes"]["TEXCOORD_1"], right["primitives"][0]["attributes"]["TEXCOORD_1"]);
    let tiles = &after["materials"][0];
    assert_eq!(tiles["extensions"]["MOZ_lightmap"]["texCoord"], 1);
    assert_eq!(tiles["extensions"]["MOZ_lightmap"]["intensity"], 2.0);
    assert_eq!(tiles["occlusionTexture"]["texCoord"], 1);
    assert_eq!(after["extensions"]["KHR_materials_variants"]["variants"][0]["name"], "lit");
    assert_eq!(corners(&source.out()), corners(&source.folder.path().join("in.glb")));
}

#[test]
fn a_map_layout_that_is_there_is_used() {
    let model = mapped();
    let source = Source::new(&model);
    let (after, layout) = source.write_lightmap(Some(1.0), None);
    assert_eq!(layout, "own");
    assert_eq!(lost(&model.root(None), &after), ["/buffers/0/byteLength"]);
    assert_eq!(after["accessors"], model.json["accessors"], "nothing but maps is added");
    assert_eq!(after["materials"][0]["extensions"]["MOZ_lightmap"]["texCoord"], 1);
}

#[test]
fn openness_becomes_the_occlusion_texture() {
    let model = mapped();
    let source = Source::new(&model);
    let (after, _) = source.write_lightmap(None, Some(0.5));
    // It takes the place of the one that is there.
    assert_eq!(lost(&model.root(None), &after), ["/materials/0/occlusionTexture/index", "/buffers/0/byteLength"]);
    assert_eq!(after["materials"][0]["occlusionTexture"]["texCoord"], 1);
    assert_eq!(after["extensions"], Value::Null, "no light, no variant of it");
}

#[test]
fn a_second_round_adds_no_layout() {
    let first = Source::new(&furnished());
    let (once, _) = first.write_lightmap(Some(1.0), None);
    let again = Source::of("in.glb", &[("in.glb", &fs::read(first.out()).unwrap())]);
    let (twice, layout) = again.write_lightmap(Some(3.0), None);
    assert_eq!(layout, "own");
    assert_eq!(once["accessors"], twice["accessors"]);
    // It takes the places of what the first has added.
    assert_eq!(once["extensions"], twice["extensions"]);
    assert_eq!(once["meshes"], twice["meshes"]);
    for list in ["materials", "textures", "images"] {
        let count = |json: &Value| json[list].as_array().unwrap().len();
        assert_eq!(count(&once), count(&twice), "{list}");
    }
}

#[test]
fn files_in_pieces_become_one() {
    let model = mapped();
    let text = model.root(Some("data.bin")).to_string();
    let source = Source::of("in.gltf", &[("in.gltf", text.as_bytes()), ("data.bin", &model.bin)]);
    let (after, _) = source.write_lightmap(Some(1.0), None);
    let at_places = ["/byteLength", "/uri"].map(|key| format!("/buffers/0{key}"));
    let lost = lost(&model.root(Some("data.bin")), &after);
    assert!(lost.iter().all(|place| at_places.contains(place)), "{lost:?}");
    assert_eq!(corners(&source.out()), corners(&source.folder.path().join("in.gltf")));
}

#[test]
fn values_at_vertices_are_added() {
    let model = mapped();
    let source = Source::new(&model);
    let after = source.write_values();
    assert_eq!(lost(&model.root(None), &after), ["/buffers/0/byteLength"]);
    source.assert_values();
    // A second round replaces the colours of the first, which are not the model's.
    let again = Source::of("in.glb", &[("in.glb", &fs::read(source.out()).unwrap())]);
    assert!(again.scene.mesh.colors.is_empty(), "the light of a bake is no colour of the surface");
    let twice = again.write_values();
    let colours = |json: &Value| json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"].clone();
    assert_ne!(colours(&after), colours(&twice));
    again.assert_values();
}

/// Backs of two-sided exports have vertices of their own.
#[test]
fn doubles_have_the_values_of_their_twins() {
    let mut model = Model::new();
    let square = [0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.];
    let positions = model.floats(3, &[square, square].concat());
    bounds(&mut model, positions, [0.0; 3], [1.0, 1.0, 0.0]);
    let normals = model.floats(3, &[[0., 0., 1.].repeat(4), [0., 0., -1.].repeat(4)].concat());
    let indices = model.accessor(U8, "SCALAR", &[0, 1, 2, 0, 2, 3, 4, 6, 5, 4, 7, 6]);
    let attributes = json!({ "POSITION": positions, "NORMAL": normals });
    model.mesh(json!({ "attributes": attributes, "indices": indices }));
    // A whole primitive of doubles.
    let alone = model.floats(3, &square);
    bounds(&mut model, alone, [0.0; 3], [1.0, 1.0, 0.0]);
    let indices = model.accessor(U8, "SCALAR", &[0, 2, 1, 0, 3, 2]);
    model.mesh(json!({ "attributes": { "POSITION": alone }, "indices": indices }));
    let source = Source::new(&model);
    assert_eq!(source.scene.mesh.triangles.len(), 2);
    source.write_values();
    source.assert_values();
    let (after, _) = source.write_lightmap(Some(1.0), None);
    for mesh in 0..2 {
        assert!(after["meshes"][mesh]["primitives"][0]["attributes"]["TEXCOORD_1"].is_u64(), "{after:#}");
    }
}

#[test]
fn a_material_of_other_primitives_stays_without_maps() {
    let mut model = furnished();
    let attributes = model.json["meshes"][0]["primitives"][0]["attributes"].clone();
    let lines = &mut model.json["meshes"][0]["primitives"][1];
    lines["material"] = json!(0);
    lines["attributes"] = attributes;
    let (after, _) = Source::new(&model).write_lightmap(Some(1.0), Some(0.5));
    assert_eq!(after["materials"][0], model.json["materials"][0]);
    let [strip, lines] = [0, 1].map(|primitive| &after["meshes"][0]["primitives"][primitive]);
    assert_eq!(lines["material"], 0);
    let copy = &after["materials"][strip["material"].as_u64().unwrap() as usize];
    assert_eq!((&copy["name"], &copy["extensions"]["MOZ_lightmap"]["texCoord"]), (&json!("tiles"), &json!(1)));
    let right = after["nodes"][1]["mesh"].as_u64().unwrap() as usize;
    assert_eq!(after["meshes"][right]["primitives"][0]["material"], strip["material"]);
}

#[test]
fn the_variant_keeps_the_alpha_of_the_material() {
    let pbr = json!({ "baseColorFactor": [1.0, 1.0, 1.0, 0.5] });
    let mut model = Model::square(json!({ "pbrMetallicRoughness": pbr, "alphaMode": "MASK", "alphaCutoff": 0.25 }));
    bounds(&mut model, 0, [0.0; 3], [1.0, 1.0, 0.0]);
    let (after, _) = Source::new(&model).write_lightmap(Some(1.0), None);
    let lit = &after["materials"][1];
    assert_eq!((&lit["alphaMode"], &lit["alphaCutoff"]), (&json!("MASK"), &json!(0.25)));
    assert_eq!(lit["pbrMetallicRoughness"]["baseColorFactor"][3], 0.5);
}

#[test]
fn unpacked_animations_have_no_stride() {
    let name = "EXT_meshopt_compression";
    let mut model = meshopt_cube(name, "NONE", false);
    model.json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("NORMAL");
    let positions = model.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize;
    bounds(&mut model, positions, [-1.0; 3], [1.0; 3]);
    let attributes = |stride: usize| json!({ "byteStride": stride, "count": 2, "mode": "ATTRIBUTES" });
    let times = packed(&mut model, name, &meshopt::encode_vertex_buffer(&[[0.0_f32], [1.0]]).unwrap(), attributes(4));
    let scalars = json!({ "bufferView": times, "componentType": F32, "type": "SCALAR", "count": 2, "min": [0.0], "max": [1.0] });
    let times = model.push("accessors", scalars);
    // With four bytes of padding at each.
    let places = [[0.0_f32, 1.0, 2.0, 0.0], [3.0, 4.0, 5.0, 0.0]];
    let places = packed(&mut model, name, &meshopt::encode_vertex_buffer(&places).unwrap(), attributes(16));
    let vectors = json!({ "bufferView": places, "componentType": F32, "type": "VEC3", "count": 2 });
    let places = model.push("accessors", vectors);
    let channel = json!({ "sampler": 0, "target": { "node": 0, "path": "translation" } });
    model.push("animations", json!({ "channels": [channel], "samplers": [{ "input": times, "output": places }] }));
    model.json["buffers"] = json!([{ "byteLength": model.bin.len(), "name": "all" }, { "byteLength": 1 }]);
    let source = Source::new(&model);
    let (after, _) = source.write_lightmap(Some(1.0), None);
    assert_eq!((&after["buffers"][0]["name"], after["buffers"].as_array().unwrap().len()), (&json!("all"), 1));
    for accessor in [times, places] {
        let view = after["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize;
        assert_eq!(after["bufferViews"][view]["byteStride"], Value::Null);
    }
    let gltf::Gltf { document, blob } = gltf::Gltf::open(source.out()).unwrap();
    let places = document.accessors().nth(places).unwrap();
    let found: Vec<[f32; 3]> = gltf::accessor::Iter::new(places, |_| blob.as_deref()).unwrap().collect();
    assert_eq!(found, [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]);
    assert_eq!(corners(&source.out()), corners(&source.folder.path().join("in.glb")));
}

#[test]
fn unpacked_draco_is_a_list_with_bounds_of_its_own() {
    let mut model = draco_cube(1);
    let primitive = model.json["meshes"][0]["primitives"][0].as_object_mut().unwrap();
    // Packed triangles are a list, whatever else is said.
    primitive.remove("indices");
    primitive.insert("mode".into(), json!(5));
    let positions = primitive["attributes"]["POSITION"].as_u64().unwrap() as usize;
    bounds(&mut model, positions, [-2.0; 3], [2.0; 3]);
    let source = Source::new(&model);
    let (after, _) = source.write_lightmap(Some(1.0), None);
    let primitive = &after["meshes"][0]["primitives"][0];
    assert_eq!((&primitive["mode"], primitive["indices"].is_u64()), (&json!(4), true));
    let positions = &after["accessors"][primitive["attributes"]["POSITION"].as_u64().unwrap() as usize];
    let least = positions["min"].as_array().unwrap().iter().map(|number| number.as_f64().unwrap());
    assert!(least.clone().count() == 3 && least.clone().all(|least| (least + 1.0).abs() < 1e-2), "{positions}");
    assert_eq!(corners(&source.out()).len(), 36);
}

/// A set of coordinates that is there may not be taken for the map, and sets have no gap afterwards.
#[test]
fn the_map_has_a_set_of_its_own() {
    let mut model = mapped();
    let positions = model.floats(3, &[2.0, 0.0, 0.0, 3.0, 0.0, 0.0, 2.0, 1.0, 0.0]);
    bounds(&mut model, positions, [2.0, 0.0, 0.0], [3.0, 1.0, 0.0]);
    let uvs = model.floats(2, &[0.0; 6]);
    model.mesh(json!({ "attributes": { "POSITION": positions, "TEXCOORD_0": uvs, "TEXCOORD_2": uvs }, "material": 0 }));
    let (after, _) = Source::new(&model).write_lightmap(Some(1.0), None);
    assert_eq!(after["materials"][0]["extensions"]["MOZ_lightmap"]["texCoord"], 3);
    let attributes = [0, 1].map(|mesh| &after["meshes"][mesh]["primitives"][0]["attributes"]);
    for attributes in attributes {
        assert!((0..4).all(|set| attributes[format!("TEXCOORD_{set}")].is_u64()), "{attributes}");
    }
    assert_eq!(attributes[1]["TEXCOORD_2"], uvs);
    assert_ne!(attributes[1]["TEXCOORD_3"], uvs);
}

#[test]
fn unusual_json_makes_no_panic() {
    // Whole numbers as floats.
    let mut model = mapped();
    model.json["nodes"][0]["mesh"] = json!(0.0);
    model.json["meshes"][0]["primitives"][0]["material"] = json!(0.0);
    let (after, _) = Source::new(&model).write_lightmap(Some(1.0), None);
    assert_eq!(after["materials"][0]["extensions"]["MOZ_lightmap"]["texCoord"], 1);
    // A list where an object belongs.
    let mut model = mapped();
    model.json["meshes"][0]["primitives"][0]["extensions"] = json!({ "KHR_materials_variants": [[]] });
    let (after, _) = Source::new(&model).write_lightmap(Some(1.0), None);
    let mappings = &after["meshes"][0]["primitives"][0]["extensions"]["KHR_materials_variants"]["mappings"];
    assert_eq!(mappings.as_array().unwrap().len(), 1);
    let mut model = mapped();
    model.json["materials"] = json!([[]]);
    let source = Source::new(&model);
    let refusal = ExportSource::of(&source.scene).unwrap().check(&source.out()).unwrap_err().to_string();
    assert!(refusal.contains("materials[0]"), "{refusal}");
}

#[test]
fn copies_are_refused_before_the_work() {
    let mut model = mapped();
    let parents = [0.0, 2.0].map(|x| model.push("nodes", json!({ "children": [0], "translation": [x, 0.0, 0.0] })));
    model.push("scenes", json!({ "nodes": parents }));
    let source = Source::new(&model);
    let refusal = ExportSource::of(&source.scene).unwrap().check(&source.out()).unwrap_err().to_string();
    assert!(refusal.contains("placed several times"), "{refusal}");
    let source = Source::new(&mapped());
    ExportSource::of(&source.scene).unwrap().check(&source.out()).unwrap();
}

/// Many views of the same bytes, and many pictures of one file, are stored once.
#[test]
fn shared_bytes_are_stored_once() {
    let mut model = mapped();
    let whole = json!({ "buffer": 0, "byteOffset": 2, "byteLength": model.bin.len() - 2 });
    model.json["bufferViews"].as_array_mut().unwrap().extend(std::iter::repeat_n(whole, 50));
    let picture = png(1, &[[0, 0, 255]]);
    for _ in 0..50 {
        let image = model.push("images", json!({ "uri": "blue.png" }));
        model.push("textures", json!({ "source": image }));
    }
    let text = model.root(Some("data.bin")).to_string();
    let source = Source::of("in.gltf", &[("in.gltf", text.as_bytes()), ("data.bin", &model.bin), ("blue.png", &picture)]);
    let files = ExportSource::of(&source.scene).unwrap().check(&source.out()).unwrap();
    assert!(files.iter().any(|file| file.ends_with("blue.png")), "{files:?}");
    let (after, _) = source.write_lightmap(Some(1.0), None);
    let length = after["buffers"][0]["byteLength"].as_u64().unwrap() as usize;
    // Two maps of a few hundred bytes are added.
    assert!(length < model.bin.len() + picture.len() + 2000, "{length}");
    assert_eq!(corners(&source.out()), corners(&source.folder.path().join("in.gltf")));
}

/// The rows of vertices that no triangle uses have no values.
#[test]
fn only_used_values_must_be_finite() {
    let source = Source::new(&mapped());
    let vertices = Vertices::new(&source.scene.mesh, 0.0);
    let mut mesh = vertices.mesh().clone();
    mesh.push_vertex_of(vertices.mesh(), 0);
    let positions = source.world(&mesh);
    let write = |samples: [f32; 5]| {
        let columns = [Channel { name: "AO".into(), samples: samples.into() }];
        let surface = Some(source.surface(&mesh, &positions));
        let positions = Positions::near(&positions);
        let values = PointValues { positions, normals: &mesh.normals, columns: &columns, surface, sources: None };
        values.write(&source.out(), &WriteOptions::default())
    };
    write([0.0, 1.0, 2.0, 3.0, f32::NAN]).unwrap();
    assert!(write([0.0, f32::NAN, 2.0, 3.0, 4.0]).unwrap_err().to_string().contains("AO is not finite"));
}
