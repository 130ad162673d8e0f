//! Vertices and triangles: accessors of all kinds, modes, coordinates, colours.

use finalgather::scene::{Source, Triangle};
use glam::{Vec2, Vec3, vec2, vec3};
use serde_json::json;

use crate::build::{F32, I16, Model, U8, U16, U32, assert_near, le, only, placed};

const CORNERS: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// As the sample `TriangleWithoutIndices`.
#[test]
fn triangle_without_indices() {
    let world = Model::triangle().world();
    let mesh = only(&world);
    assert_eq!(mesh.triangles, [Triangle { vertices: [0, 1, 2], material: 0 }]);
    assert_eq!((&mesh.normals[..], &mesh.uvs[..]), (&[Vec3::ZERO; 3][..], &[Vec2::ZERO; 3][..]));
    assert!(mesh.colors.is_empty() && mesh.lightmap_uvs.is_empty());
    assert_eq!(mesh.sources, [0, 1, 2].map(|index| Source { instance: 0, index }));
    // White is what glTF gives a primitive without a material.
    assert_eq!((world.materials.len(), world.materials[0].albedo), (1, Vec3::ONE));
    assert_near(&placed(&world, 0), &CORNERS, 0.0);
}

/// As the sample `Triangle`, with each type of index.
#[test]
fn indices_of_all_types() {
    let bytes: [(u32, Vec<u8>); 3] = [
        (U8, vec![3, 0, 1]),
        (U16, [3_u16, 0, 1].iter().flat_map(|index| index.to_le_bytes()).collect()),
        (U32, [3_u32, 0, 1].iter().flat_map(|index| index.to_le_bytes()).collect()),
    ];
    for (component, bytes) in bytes {
        let mut model = Model::new();
        let positions = model.floats(3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 9.0, 9.0, 9.0, 0.0, 0.0, 0.0]);
        let indices = model.accessor(component, "SCALAR", &bytes);
        model.mesh(json!({ "attributes": { "POSITION": positions }, "indices": indices }));
        let world = model.world();
        assert_near(&placed(&world, 0), &CORNERS, 0.0);
        // The vertex that no triangle uses is left out, and the others know their places in the file.
        assert_eq!(only(&world).sources.iter().map(|source| source.index).collect::<Vec<_>>(), [0, 1, 3], "{component}");
        assert_eq!(only(&world).triangles[0].vertices, [2, 0, 1]);
    }
}

/// As the sample `BoxInterleaved`: positions and normals in one view, 24 bytes apart.
#[test]
fn interleaved_vertices() {
    let mut model = Model::new();
    let vertex = |x: f32, y: f32| [x, y, 0.0, 0.0, 0.0, 2.0];
    let view = model.view(&le(&[vertex(0.0, 0.0), vertex(1.0, 0.0), vertex(0.0, 1.0)].concat()));
    model.json["bufferViews"][view]["byteStride"] = json!(24);
    let accessor =
        |offset: u32| json!({ "bufferView": view, "byteOffset": offset, "componentType": F32, "type": "VEC3", "count": 3 });
    let [positions, normals] = [0, 12].map(|offset| model.push("accessors", accessor(offset)));
    model.mesh(json!({ "attributes": { "POSITION": positions, "NORMAL": normals } }));
    let world = model.world();
    assert_near(&placed(&world, 0), &CORNERS, 0.0);
    // The file's normals are too long.
    assert_eq!(only(&world).normals, [Vec3::Z; 3]);
    model.json["accessors"][normals]["byteOffset"] = json!(16);
    let (world, warnings) = model.load();
    assert_eq!((only(&world).normals[0], warnings.len()), (Vec3::ZERO, 1));
    assert!(
        warnings[0].contains("meshes[0].primitives[0] NORMAL: accessors[1]: 3 elements of 12 bytes, 24 apart"),
        "{warnings:?}"
    );
}

/// As the sample `SimpleSparseAccessor`, over a view and over nothing, which is zero.
#[test]
fn sparse_accessors() {
    for base in [true, false] {
        let mut model = Model::new();
        let positions = model.floats(3, &[0.0, 0.0, 0.0, 7.0, 7.0, 7.0, 0.0, 7.0, 0.0]);
        if !base {
            model.json["accessors"][positions].as_object_mut().unwrap().remove("bufferView");
        }
        let indices = model.view(&[1, 0, 2, 0]);
        let values = model.view(&le(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]));
        model.json["accessors"][positions]["sparse"] = json!({
            "count": 2,
            "indices": { "bufferView": indices, "componentType": U16 },
            "values": { "bufferView": values },
        });
        model.mesh(json!({ "attributes": { "POSITION": positions } }));
        assert_near(&placed(&model.world(), 0), &CORNERS, 0.0);
    }
}

/// As the sample `MeshPrimitiveModes`.
#[test]
fn strips_and_fans() {
    let grid = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 2.0, 0.0];
    let cases: [(u32, &[[u32; 3]]); 3] =
        [(4, &[[0, 1, 2]]), (5, &[[0, 1, 2], [1, 3, 2], [2, 3, 4]]), (6, &[[1, 2, 0], [2, 3, 0], [3, 4, 0]])];
    for (mode, expected) in cases {
        let mut model = Model::new();
        let positions = model.floats(3, &grid);
        model.mesh(json!({ "attributes": { "POSITION": positions }, "mode": mode }));
        let (world, warnings) = model.load();
        let mesh = only(&world);
        let corners = mesh.triangles.iter().map(|triangle| triangle.vertices.map(|vertex| mesh.sources[vertex as usize].index));
        assert_eq!(corners.collect::<Vec<_>>(), expected, "mode {mode}");
        // Five corners are no whole triangles of a list.
        assert_eq!(warnings.iter().any(|warning| warning.contains("has 5 corners")), mode == 4, "{warnings:?}");
    }
    // Lines and points are told, and alone they are nothing to render.
    let mut model = Model::triangle();
    for mode in [0, 1, 2, 3] {
        model.mesh(json!({ "attributes": { "POSITION": 0 }, "mode": mode }));
    }
    let (world, warnings) = model.load();
    assert_eq!((world.meshes.len(), world.instances.len()), (1, 1));
    assert_eq!(warnings, ["4 primitives of points or lines are not shown"]);
    model.json["meshes"][0]["primitives"][0]["mode"] = json!(1);
    assert!(model.refusal().contains("points or lines alone"));
}

/// As the sample `MultiUVTest`.
#[test]
fn coordinates_of_the_set_of_the_texture() {
    let mut model = Model::square(json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "texCoord": 1 } } }));
    let texture = model.texture(&crate::build::png(1, &[[255, 0, 0]]), json!({}));
    // Sixteen-bit coordinates, normalised.
    let second: Vec<u8> = [0_u16, 0, 65535, 0, 65535, 13107, 0, 13107].iter().flat_map(|value| value.to_le_bytes()).collect();
    let second = model.accessor(U16, "VEC2", &second);
    model.json["accessors"][second]["normalized"] = json!(true);
    model.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(second);
    let world = model.world();
    assert_eq!((texture, world.textures.len()), (0, 1));
    // v points up.
    let expected = [vec2(0.0, 1.0), vec2(1.0, 1.0), vec2(1.0, 0.8), vec2(0.0, 0.8)];
    let mesh = only(&world);
    assert!(mesh.uvs.iter().zip(expected).all(|(&uv, expected)| uv.distance(expected) < 1e-6), "{:?}", mesh.uvs);
    assert_eq!(mesh.lightmap_uvs, mesh.uvs);
    model.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = json!(0);
    let world = model.world();
    assert_eq!(only(&world).uvs, [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
    assert_ne!(only(&world).lightmap_uvs, only(&world).uvs);
}

/// As the sample `VertexColorTest`.
#[test]
fn vertex_colors() {
    let mut model = Model::triangle();
    let bytes = model.accessor(U8, "VEC4", &[255, 0, 51, 255, 0, 255, 0, 0, 0, 0, 255, 9]);
    model.json["accessors"][bytes]["normalized"] = json!(true);
    model.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(bytes);
    assert_eq!(only(&model.world()).colors, [vec3(1.0, 0.0, 0.2), Vec3::Y, Vec3::Z]);
    let floats = model.floats(3, &[2.0, -1.0, 0.5, f32::NAN, 0.0, 0.0, 0.25, 0.25, 0.25]);
    model.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(floats);
    assert_eq!(only(&model.world()).colors, [vec3(1.0, 0.0, 0.5), Vec3::ONE, Vec3::splat(0.25)]);
}

/// `KHR_mesh_quantization`: whole numbers that the node scales, and normalised ones.
#[test]
fn quantized_vertices() {
    for normalized in [false, true] {
        let mut model = Model::new();
        model.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        let most = if normalized { 32767 } else { 100 };
        // Eight bytes for each vertex, of which six are used.
        let vertices = [0_i16, 0, 0, 0, most, 0, 0, 0, 0, -most, 0, 0];
        let view = model.view(&vertices.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>());
        model.json["bufferViews"][view]["byteStride"] = json!(8);
        let accessor = json!({ "bufferView": view, "componentType": I16, "normalized": normalized, "type": "VEC3", "count": 3 });
        let positions = model.push("accessors", accessor);
        let normals = model.accessor(crate::build::I8, "VEC4", &[0, 0, 129, 0, 0, 0, 129, 0, 127, 0, 129, 0]);
        model.json["accessors"][normals]["type"] = json!("VEC3");
        model.json["accessors"][normals]["normalized"] = json!(true);
        model.json["bufferViews"][1]["byteStride"] = json!(4);
        let node = model.mesh(json!({ "attributes": { "POSITION": positions, "NORMAL": normals } }));
        let scale = if normalized { 2.0 } else { 0.02 };
        model.json["nodes"][node]["scale"] = json!([scale, scale, scale]);
        let world = model.world();
        assert_near(&placed(&world, 0), &[[0.0; 3], [2.0, 0.0, 0.0], [0.0, -2.0, 0.0]], 1e-6);
        let normals = &only(&world).normals;
        assert!(normals[..2] == [Vec3::NEG_Z; 2] && normals[2].distance(vec3(1.0, 0.0, -1.0).normalize()) < 1e-6, "{normals:?}");
    }
}

#[test]
fn bad_vertices_lose_their_triangles() {
    let mut model = Model::new();
    let far = [f32::NAN, 2e9, f32::INFINITY];
    let corners =
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, far[0], 0.0, 0.0, far[1], 0.0, 0.0, 0.0, 0.0, far[2], 0.5, 0.0, 0.0];
    let positions = model.floats(3, &corners);
    // One sound, three with bad positions, one out of range, one without area.
    let indices = model.accessor(U8, "SCALAR", &[0, 1, 2, 0, 1, 3, 0, 4, 2, 5, 1, 2, 0, 1, 7, 0, 6, 1]);
    model.mesh(json!({ "attributes": { "POSITION": positions }, "indices": indices }));
    let (world, warnings) = model.load();
    assert_near(&placed(&world, 0), &CORNERS, 0.0);
    assert_eq!(only(&world).positions.len(), 3, "no vertex stays that only a bad triangle used");
    let told = [
        "m.glb: 1 of 6 triangles of meshes[0].primitives[0] refer to vertices that it does not have; they are left out",
        "m.glb: 3 of 6 triangles of meshes[0].primitives[0] have corners that are not finite or beyond 1e9; they are left out",
        "m.glb: 1 of 6 triangles has no area and was skipped",
    ];
    assert_eq!(warnings, told);
    let strict = finalgather::scene::LoadOptions { strict: true, ..crate::build::options() };
    assert!(model.load_with(strict).unwrap_err().to_string().contains("refer to vertices"));
    // Nothing is left.
    let flat = model.accessor(U8, "SCALAR", &[0, 6, 1]);
    model.json["meshes"][0]["primitives"][0]["indices"] = json!(flat);
    assert!(model.refusal().contains("none of the 1 triangles has an area"));
}

/// As the samples `AnimatedMorphCube` and `MorphPrimitivesTest`, at the weights of the file.
#[test]
fn morphs_at_rest() {
    let mut model = Model::triangle();
    let deltas = model.floats(3, &[0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 0.0, 0.0, 4.0]);
    model.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": deltas }]);
    let (world, warnings) = model.load();
    assert_near(&placed(&world, 0), &CORNERS, 0.0);
    assert_eq!(warnings, ["1 mesh with morph targets is shown with the weights of the file"]);
    model.json["meshes"][0]["weights"] = json!([0.5]);
    // A second node has weights of its own.
    model.push("nodes", json!({ "mesh": 0, "weights": [1.0] }));
    let (world, _) = model.load();
    assert_near(&placed(&world, 0), &[[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 2.0]], 0.0);
    assert_near(&placed(&world, 1), &[[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 4.0]], 0.0);
}
