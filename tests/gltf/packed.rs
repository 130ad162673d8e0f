//! Packed meshes: meshopt and draco.

use draco_core::{
    DataType, EncoderBuffer, EncoderOptions, FaceIndex, GeometryAttributeType, Mesh as DracoMesh, MeshEncoder, PointAttribute,
    PointIndex,
};
use glam::Vec3;
use meshopt::{
    EncodeExpMode, encode_filter_exp, encode_filter_oct, encode_index_buffer, encode_index_sequence, encode_vertex_buffer,
};
use serde_json::json;

use crate::build::{F32, I8, Model, U8, U16, U32, only};

/// The corners and faces of a cube with side 2.
fn cube() -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let side = |bit: u32, i: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
    let corners = (0..8).map(|i| [side(0, i), side(1, i), side(2, i)]).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    (corners, quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

/// Area vectors point outwards, and the volume is that of a cube with side 2.
fn assert_cube(world: &finalgather::scene::World, tolerance: f32) {
    let mesh = only(world);
    assert_eq!(mesh.triangles.len(), 12);
    let volume: f32 = (0..12).map(|triangle| mesh.corners(triangle)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
    assert!((volume - 8.0).abs() < tolerance, "{volume}");
    let far = mesh.positions.iter().map(|position| (position.abs() - Vec3::ONE).abs().max_element()).fold(0.0, f32::max);
    assert!(far < tolerance, "{:?}", mesh.positions);
}

/// Adds a view of packed bytes. Its own buffer is empty, as exporters write it.
pub fn packed(model: &mut Model, name: &str, bytes: &[u8], mut extension: serde_json::Value) -> usize {
    let offset = model.bytes(bytes);
    extension["buffer"] = json!(0);
    extension["byteOffset"] = json!(offset);
    extension["byteLength"] = json!(bytes.len());
    model.push("bufferViews", json!({ "buffer": 1, "byteLength": 1, "extensions": { name: extension } }))
}

/// As the sample `MeshoptCubeTest`: triangles and sequences, each filter, both names of the extension.
pub fn meshopt_cube(name: &str, filter: &str, sequence: bool) -> Model {
    let mut model = Model::new();
    let (corners, faces) = cube();
    let indices =
        if sequence { encode_index_sequence(faces.as_flattened(), 8) } else { encode_index_buffer(faces.as_flattened(), 8) };
    let mode = if sequence { "INDICES" } else { "TRIANGLES" };
    let (stride, component) = if sequence { (4, U32) } else { (2, U16) };
    let extension = json!({ "byteStride": stride, "count": 36, "mode": mode });
    let view = packed(&mut model, name, &indices.unwrap(), extension);
    let indices =
        model.push("accessors", json!({ "bufferView": view, "componentType": component, "type": "SCALAR", "count": 36 }));
    let positions = match filter {
        "EXPONENTIAL" => encode_vertex_buffer(&encode_filter_exp(&corners, 16, EncodeExpMode::Separate)),
        _ => encode_vertex_buffer(&corners),
    };
    let plain = if filter == "EXPONENTIAL" { filter } else { "NONE" };
    let extension = json!({ "byteStride": 12, "count": 8, "mode": "ATTRIBUTES", "filter": plain });
    let view = packed(&mut model, name, &positions.unwrap(), extension);
    let positions = model.push("accessors", json!({ "bufferView": view, "componentType": F32, "type": "VEC3", "count": 8 }));
    let unit = corners.iter().map(|&corner| Vec3::from(corner).normalize().extend(0.0).to_array()).collect::<Vec<_>>();
    let normals = encode_vertex_buffer(&encode_filter_oct::<i8>(&unit, 8)).unwrap();
    let view =
        packed(&mut model, name, &normals, json!({ "byteStride": 4, "count": 8, "mode": "ATTRIBUTES", "filter": "OCTAHEDRAL" }));
    let accessor = json!({ "bufferView": view, "componentType": I8, "normalized": true, "type": "VEC3", "count": 8 });
    let normals = model.push("accessors", accessor);
    model.mesh(json!({ "attributes": { "POSITION": positions, "NORMAL": normals }, "indices": indices }));
    model.json["extensionsRequired"] = json!([name]);
    model.json["buffers"] = json!([{ "byteLength": model.bin.len() }, { "byteLength": 1 }]);
    model
}

#[test]
fn meshopt_views() {
    for name in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        for (filter, sequence) in [("NONE", false), ("EXPONENTIAL", true)] {
            let world = meshopt_cube(name, filter, sequence).world();
            assert_cube(&world, 1e-3);
            let mesh = only(&world);
            let near =
                mesh.normals.iter().zip(&mesh.positions).all(|(normal, position)| normal.distance(position.normalize()) < 0.02);
            assert!(near, "{:?}", mesh.normals);
        }
    }
}

#[test]
fn meshopt_sizes_are_checked() {
    let sound = meshopt_cube("EXT_meshopt_compression", "NONE", false);
    let changes = [
        (0, "count", json!(35), "35 indices are no whole triangles"),
        (0, "count", json!(3_000_000), "cannot hold 3000000 of 2 bytes"),
        (0, "byteStride", json!(3), "its packed indices have 3 bytes"),
        (0, "count", json!(3000), "its packed bytes are corrupt"),
        (1, "byteStride", json!(260), "no multiple of 4 up to 256"),
        (1, "byteStride", json!(16), "its packed bytes are corrupt"),
        (1, "count", json!(u64::MAX), "cannot hold"),
        (1, "filter", json!("QUATERNION"), "its filter does not fit vertices of 12 bytes"),
        (1, "mode", json!("OTHER"), "its meshopt compression is malformed"),
        (1, "byteLength", json!(1_000_000), "lie outside of buffers[0]"),
    ];
    for (view, key, value, fragment) in changes {
        let mut model = sound.clone();
        model.json["bufferViews"][view]["extensions"]["EXT_meshopt_compression"][key] = value;
        let refusal = model.refusal();
        assert!(refusal.contains(&format!("bufferViews[{view}]: ")) && refusal.contains(fragment), "{key}: {refusal}");
    }
}

/// A cube packed by draco: edge breaker or sequential, with quantised positions and colours of bytes.
pub fn draco_cube(method: i32) -> Model {
    let mut model = Model::new();
    let (corners, faces) = cube();
    let mut mesh = DracoMesh::new();
    let mut positions = PointAttribute::new();
    positions.init(GeometryAttributeType::Position, 3, DataType::Float32, false, 8);
    positions.buffer_mut().write(0, &crate::build::le(corners.as_flattened()));
    let positions = mesh.add_attribute(positions);
    let mut colors = PointAttribute::new();
    colors.init(GeometryAttributeType::Color, 3, DataType::Uint8, true, 8);
    // The colour of a corner tells which one it is.
    let bytes: Vec<u8> = corners.iter().flat_map(|corner| corner.map(|side| if side > 0.0 { 255 } else { 0 })).collect();
    colors.buffer_mut().write(0, &bytes);
    let colors = mesh.add_attribute(colors);
    mesh.set_num_points(8);
    mesh.set_num_faces(faces.len());
    for (face, corners) in (0..).zip(&faces) {
        mesh.set_face(FaceIndex(face), corners.map(PointIndex));
    }
    let ids = [positions, colors].map(|attribute| mesh.attribute(attribute).unique_id());
    let mut encoder = MeshEncoder::new();
    encoder.set_mesh(mesh);
    let mut options = EncoderOptions::new();
    options.set_encoding_method(method);
    options.set_attribute_quantization(positions, 11);
    let mut bytes = EncoderBuffer::new();
    encoder.encode(&options, &mut bytes).unwrap();
    let view = model.view(bytes.data());
    let positions = model.push("accessors", json!({ "componentType": F32, "type": "VEC3", "count": 8 }));
    let colors = model.push("accessors", json!({ "componentType": U8, "normalized": true, "type": "VEC3", "count": 8 }));
    let indices = model.push("accessors", json!({ "componentType": U16, "type": "SCALAR", "count": 36 }));
    let extension = json!({ "bufferView": view, "attributes": { "POSITION": ids[0], "COLOR_0": ids[1] } });
    model.mesh(json!({
        "attributes": { "POSITION": positions, "COLOR_0": colors },
        "indices": indices,
        "extensions": { "KHR_draco_mesh_compression": extension },
    }));
    model.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    model
}

/// As the samples with a variant `glTF-Draco`, such as `Box`.
#[test]
fn draco_meshes() {
    for method in [0, 1] {
        let world = draco_cube(method).world();
        assert_cube(&world, 1e-2);
        let mesh = only(&world);
        for (color, position) in mesh.colors.iter().zip(&mesh.positions) {
            assert_eq!(*color, (0.5 * (position.signum() + 1.0)).round(), "{position}");
        }
        assert_eq!((mesh.sources.len(), mesh.colors.len()), (mesh.positions.len(), mesh.positions.len()));
    }
}

#[test]
fn broken_draco_is_refused_with_its_place() {
    let mut model = draco_cube(1);
    model.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["bufferView"] = json!(4);
    assert!(model.refusal().contains("refers to bufferViews[4], but has 1 bufferViews"));
    let mut model = draco_cube(1);
    let length = model.json["bufferViews"][0]["byteLength"].as_u64().unwrap();
    model.json["bufferViews"][0]["byteLength"] = json!(length - 8);
    let refusal = model.refusal();
    assert!(refusal.contains("meshes[0].primitives[0]: its draco compression cannot be unpacked"), "{refusal}");
}
