//! Nodes: transforms, instances, scenes, skins, cameras, lights.

use std::f64::consts::FRAC_1_SQRT_2;

use finalgather::scene::{GltfPart, LoadOptions, PunctualKind, WorldCamera};
use glam::{DAffine3, DVec3, Vec3, dvec3, vec3};
use serde_json::json;

use crate::build::{I8, Model, U8, assert_near, le, only, options, placed};

/// As the sample `SimpleMeshes`: two nodes share a mesh, one below another.
#[test]
fn nodes_place_one_mesh_twice() {
    let mut model = Model::triangle();
    let half_turn = json!([0.0, 0.0, 1.0, 0.0]);
    model.json["nodes"] = json!([
        { "mesh": 0, "name": "here", "translation": [0.0, 0.0, 5.0], "children": [1] },
        { "mesh": 0, "translation": [1.0, 2.0, 3.0], "rotation": half_turn, "scale": [2.0, 3.0, 1.0] },
    ]);
    let world = model.world();
    assert_eq!((world.meshes.len(), world.instances.len()), (1, 2));
    assert_near(&placed(&world, 0), &[[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]], 0.0);
    assert_near(&placed(&world, 1), &[[1.0, 2.0, 8.0], [-1.0, 2.0, 8.0], [1.0, -1.0, 8.0]], 1e-12);
    let found: Vec<_> = world.instances.iter().map(|instance| (instance.name.as_str(), instance.part)).collect();
    let part = |node| Some(GltfPart { node, primitive: 0, copy: 0 });
    assert_eq!(found, [("here", part(0)), ("node 1", part(1))]);
}

/// A node's matrix keeps all its digits, though the crate's types have 32 bits.
#[test]
fn georeferenced_nodes_keep_their_place() {
    let mut model = Model::triangle();
    let place = [4_500_000.123, 5_400_000.456, 100.789];
    model.json["nodes"][0]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, place[0], place[1], place[2], 1]);
    let world = model.world();
    let expected = [place, [place[0] + 1.0, place[1], place[2]], [place[0], place[1] + 1.0, place[2]]];
    assert_near(&placed(&world, 0), &expected, 1e-9);
    model.json["nodes"][0]["matrix"] = json!(null);
    model.json["nodes"][0]["translation"] = json!(place);
    assert_near(&placed(&model.world(), 0), &expected, 1e-9);
}

/// As the sample `NegativeScaleTest`: a mirrored node keeps the fronts of its mesh.
#[test]
fn negative_scales_keep_fronts() {
    for (scale, normal) in
        [([1.0, 1.0, 1.0], Vec3::Z), ([-1.0, 1.0, 1.0], Vec3::Z), ([1.0, 1.0, -1.0], Vec3::NEG_Z), ([-1.0; 3], Vec3::NEG_Z)]
    {
        let mut model = Model::triangle();
        model.json["nodes"][0]["scale"] = json!(scale);
        let scene = model.world().flatten();
        assert_eq!(scene.mesh.geometric_normal(0), normal, "{scale:?}");
    }
    // A plane may be flattened along its normal, but not to a line.
    let mut model = Model::triangle();
    model.push("nodes", json!({ "mesh": 0, "scale": [1.0, 1.0, 0.0] }));
    model.push("nodes", json!({ "mesh": 0, "scale": [1.0, 0.0, 1.0] }));
    let (world, warnings) = model.load();
    assert_eq!(world.instances.len(), 2);
    assert_eq!(warnings, ["m.glb: nodes[2] scales node 2 down to nothing; it is left out"]);
}

/// As the sample `SimpleInstancing`.
#[test]
fn copies_by_gpu_instancing() {
    let mut model = Model::triangle();
    model.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let translations = model.floats(3, &[1.0, 0.0, 0.0, 0.0, 2.0, 0.0]);
    // A quarter about z in signed bytes, and none.
    let rotations = model.accessor(I8, "VEC4", &[0, 0, 90, 90, 0, 0, 0, 127]);
    model.json["accessors"][rotations]["normalized"] = json!(true);
    let scales = model.floats(3, &[2.0, 2.0, 2.0, 1.0, 1.0, 1.0]);
    let attributes = json!({ "TRANSLATION": translations, "ROTATION": rotations, "SCALE": scales });
    model.json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
    model.json["nodes"][0]["translation"] = json!([0.0, 0.0, 1.0]);
    let world = model.world();
    assert_eq!((world.meshes.len(), world.instances.len()), (1, 2));
    assert_near(&placed(&world, 0), &[[1.0, 0.0, 1.0], [1.0, 2.0, 1.0], [-1.0, 0.0, 1.0]], 1e-6);
    assert_near(&placed(&world, 1), &[[0.0, 2.0, 1.0], [1.0, 2.0, 1.0], [0.0, 3.0, 1.0]], 1e-6);
    assert_eq!(world.instances[1].part, Some(GltfPart { node: 0, primitive: 0, copy: 1 }));
    model.json["accessors"][scales]["count"] = json!(1);
    assert!(model.refusal().contains("its attributes differ in number"));
}

#[test]
fn one_of_several_scenes() {
    let mut model = Model::triangle();
    model.push("nodes", json!({ "mesh": 0, "name": "second" }));
    model.push("nodes", json!({ "mesh": 0, "name": "third" }));
    model.json["scenes"] =
        json!([{ "nodes": [0] }, { "name": "b", "nodes": [1] }, { "name": "c", "nodes": [2] }, { "name": "empty" }]);
    let chosen = |model: &Model, scene: Option<&str>| {
        let options = LoadOptions { scene: scene.map(str::to_owned), ..options() };
        model
            .load_with(options)
            .map(|loaded| loaded.world.instances.into_iter().map(|instance| instance.name).collect::<Vec<_>>())
    };
    assert_eq!(chosen(&model, None).unwrap(), ["node 0"]);
    model.json["scene"] = json!(1);
    assert_eq!(chosen(&model, None).unwrap(), ["second"]);
    assert_eq!(chosen(&model, Some("c")).unwrap(), ["third"]);
    assert_eq!(chosen(&model, Some("2")).unwrap(), ["third"]);
    let refusal = chosen(&model, Some("d")).unwrap_err().to_string();
    assert!(refusal.contains("there is no scene \"d\"") && refusal.contains("0, b, c, empty"), "{refusal}");
    let refusal = chosen(&model, Some("empty")).unwrap_err().to_string();
    assert!(refusal.contains("no mesh in its scene"), "{refusal}");
    // Without scenes all nodes are shown that are no child.
    model.json.as_object_mut().unwrap().remove("scenes");
    assert_eq!(chosen(&model, None).unwrap(), ["node 0", "second", "third"]);
}

#[test]
fn nodes_in_a_circle_are_refused() {
    let mut model = Model::triangle();
    model.json["scenes"] = json!([{ "nodes": [0] }]);
    model.json["nodes"][0]["children"] = json!([1]);
    model.push("nodes", json!({ "children": [0] }));
    let refusal = model.refusal();
    assert!(refusal.contains("nodes[0]: it is below itself"), "{refusal}");
    model.json["nodes"][1]["children"] = json!([7]);
    assert!(model.refusal().contains("refers to nodes[7], but has 2 nodes"));
    // A child of two nodes is shown under each, as long as that does not double again and again.
    let mut model = Model::triangle();
    model.push("nodes", json!({ "children": [0] }));
    model.push("nodes", json!({ "children": [0], "translation": [1, 0, 0] }));
    let (world, warnings) = model.load();
    assert_eq!(warnings, ["m.glb: nodes[0] is a child of several nodes; it is shown under each"]);
    let parts: Vec<_> = world.instances.iter().map(|instance| (instance.transform.translation.x, instance.part)).collect();
    let part = |copy| Some(GltfPart { node: 0, primitive: 0, copy });
    assert_eq!(parts, [(0.0, part(0)), (1.0, part(1))]);
    model.json["nodes"] = (0..40).map(|node| json!({ "children": [node + 1, node + 1] })).collect();
    model.push("nodes", json!({ "mesh": 0 }));
    assert!(model.refusal().contains("too many nodes are children of several"));
    // Nor may hidden nodes be met again and again.
    model.json["nodes"] = json!([{ "children": vec![1; 1000] }, { "children": vec![2; 1000] }]);
    model.push("nodes", json!({ "mesh": 0, "extensions": { "KHR_node_visibility": { "visible": false } } }));
    assert!(model.refusal().contains("too many nodes are children of several"));
    // A chain as deep as this overflows no stack.
    let mut model = Model::triangle();
    let last = 200_000;
    let link = |node: usize| if node < last { json!({ "children": [node + 1] }) } else { json!({ "mesh": 0 }) };
    model.json["nodes"] = (0..=last).map(link).collect();
    assert_eq!(model.world().instances[0].part.unwrap().node, last);
}

/// `KHR_node_visibility` hides a node and its children.
#[test]
fn hidden_nodes_are_not_there() {
    let mut model = Model::triangle();
    model.push("nodes", json!({ "children": [2], "extensions": { "KHR_node_visibility": { "visible": false } } }));
    model.push("nodes", json!({ "mesh": 0 }));
    assert_eq!(model.world().instances.len(), 1);
    model.json["nodes"][1]["extensions"]["KHR_node_visibility"]["visible"] = json!(true);
    assert_eq!(model.world().instances.len(), 2);
}

/// As the sample `Cameras`.
#[test]
fn cameras_of_nodes() {
    let mut model = Model::triangle();
    model.push("cameras", json!({ "type": "perspective", "name": "lens", "perspective": { "yfov": 0.7, "znear": 0.01 } }));
    model.push("cameras", json!({ "type": "orthographic", "orthographic": { "xmag": 1, "ymag": 1, "znear": 0.01, "zfar": 9 } }));
    let s = FRAC_1_SQRT_2;
    model.push("nodes", json!({ "camera": 1, "name": "flat" }));
    model.push("nodes", json!({ "camera": 0, "translation": [1, 2, 3], "scale": [5, 5, 5] }));
    // A quarter about x looks up.
    model.push("nodes", json!({ "camera": 0, "name": "up", "rotation": [s, 0, 0, s] }));
    let (world, warnings) = model.load();
    let names: Vec<_> = world.cameras.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["lens", "up"]);
    let WorldCamera { eye, target, up, fov_y_degrees, lens } = world.cameras[0].1;
    assert_eq!((eye, target, up, lens), (dvec3(1.0, 2.0, 3.0), dvec3(1.0, 2.0, 2.0), Vec3::Y, None));
    assert!((fov_y_degrees - 40.107).abs() < 1e-3, "{fov_y_degrees}");
    let WorldCamera { target, up, .. } = world.cameras[1].1;
    assert!(target.distance(DVec3::Y) < 1e-9 && up.distance(Vec3::Z) < 1e-6, "{target} {up}");
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].contains("camera flat is left out: it is orthographic"), "{warnings:?}");
    let chosen = model.load_with(LoadOptions { camera: Some("up".into()), ..options() }).unwrap();
    assert_eq!(chosen.world.cameras[0].0, "up");
}

/// As the sample `LightsPunctualLamp`: the three kinds, along the -z of nodes that are turned, scaled and below others.
#[test]
fn punctual_lights_of_nodes() {
    let mut model = Model::triangle();
    model.json["extensionsRequired"] = json!(["KHR_lights_punctual"]);
    let spot = json!({ "innerConeAngle": 0.25, "outerConeAngle": 0.5 });
    let lights = json!([
        { "type": "point", "name": "bulb", "color": [1, 0.5, 0.25], "intensity": 8, "range": 3 },
        { "type": "directional" },
        { "type": "spot", "name": "lamp", "intensity": 40, "spot": spot },
        { "type": "spot", "spot": { "outerConeAngle": 2 } },
    ]);
    model.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
    let light = |light: u32| json!({ "KHR_lights_punctual": { "light": light } });
    let s = FRAC_1_SQRT_2;
    // A quarter about x looks up; below it, a quarter about y turns -z to -x.
    let child = model.push("nodes", json!({ "extensions": light(2), "translation": [0, 0, -1], "rotation": [0, s, 0, s] }));
    model.push("nodes", json!({ "extensions": light(0), "translation": [1, 2, 3], "rotation": [s, 0, 0, s], "scale": [5, 5, 5], "children": [child] }));
    model.push("nodes", json!({ "extensions": light(1), "name": "sun" }));
    let (world, warnings) = model.load();
    let [bulb, lamp, sun] = &world.lights[..] else { panic!("{:?}", world.lights) };
    assert_eq!((bulb.name.as_str(), bulb.kind), ("bulb", PunctualKind::Point { radius: 0.0 }));
    assert_eq!((bulb.position, bulb.strength), (dvec3(1.0, 2.0, 3.0), vec3(8.0, 4.0, 2.0)));
    assert_eq!((lamp.name.as_str(), lamp.kind), ("lamp", PunctualKind::Spot { radius: 0.0, inner: 0.25, outer: 0.5 }));
    assert!(lamp.position.distance(dvec3(1.0, 7.0, 3.0)) < 1e-6, "{lamp:?}");
    assert!(lamp.direction.distance(Vec3::NEG_X) < 1e-6 && lamp.strength == Vec3::splat(40.0), "{lamp:?}");
    assert_eq!((sun.name.as_str(), sun.kind), ("sun", PunctualKind::Directional { angle: 0.0 }));
    assert_eq!((sun.direction, sun.strength), (Vec3::NEG_Z, Vec3::ONE));
    assert_eq!(
        warnings,
        ["m.glb: light bulb reaches beyond its range of 3: its light falls by the square of the distance alone"]
    );
    // Lights that cannot be are left out.
    model.push("nodes", json!({ "extensions": light(3), "name": "wide" }));
    model.push("nodes", json!({ "extensions": light(4) }));
    let (world, warnings) = model.load();
    assert_eq!(world.lights.len(), 3);
    assert!(
        warnings[1].contains("light wide: the cone reaches from 0 to 114.59") && warnings[1].contains("and 1 more like it"),
        "{warnings:?}"
    );
}

/// As the sample `SimpleSkin`: joints stand where their nodes do, and the node of the mesh has no say.
#[test]
fn skins_at_rest() {
    let mut model = Model::new();
    let positions = model.floats(3, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0]);
    let normals = model.floats(3, &[0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    let joints = model.accessor(U8, "VEC4", &[0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0]);
    let weights = model.floats(4, &[1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    let attributes = json!({ "POSITION": positions, "NORMAL": normals, "JOINTS_0": joints, "WEIGHTS_0": weights });
    let node = model.mesh(json!({ "attributes": attributes }));
    let identity = DAffine3::IDENTITY;
    let lowered = DAffine3::from_translation(dvec3(0.0, -1.0, 0.0));
    let matrix = |transform: DAffine3| glam::DMat4::from(transform).as_mat4().to_cols_array();
    let inverse = model.accessor(crate::build::F32, "MAT4", &le(&[matrix(identity), matrix(lowered)].concat()));
    // The second joint is bound at height 1, and turned by a quarter about x.
    let s = FRAC_1_SQRT_2;
    let first = model.push("nodes", json!({ "translation": [10, 0, 0], "children": [2] }));
    model.push("nodes", json!({ "translation": [0, 1, 0], "rotation": [s, 0, 0, s] }));
    model.push("skins", json!({ "joints": [first, 2], "inverseBindMatrices": inverse }));
    model.json["nodes"][node]["skin"] = json!(0);
    model.json["nodes"][node]["translation"] = json!([100, 100, 100]);
    let (world, warnings) = model.load();
    // The second vertex is half way between (11, 0, 0) and (11, 1, -1).
    assert_near(&placed(&world, 0), &[[10.0, 0.0, 0.0], [11.0, 0.5, -0.5], [10.0, 1.0, 1.0]], 1e-6);
    let normals = &only(&world).normals;
    assert!(normals[0].distance(Vec3::Y) < 1e-6 && normals[2].distance(Vec3::Z) < 1e-6, "{normals:?}");
    assert!(normals[1].distance(vec3(0.0, 1.0, 1.0).normalize()) < 1e-6, "{normals:?}");
    assert_eq!(warnings, ["1 skinned mesh is shown at rest, with joints where their nodes stand"]);
    // A joint that is not in the scene leaves the mesh where its node is.
    model.json["skins"][0]["joints"] = json!([first, 7]);
    let (world, warnings) = model.load();
    assert_near(&placed(&world, 0)[..1], &[[100.0, 100.0, 100.0]], 0.0);
    assert_eq!(warnings, ["m.glb: skins[0] has joints that are not in the scene; its mesh is not bent"]);
}
