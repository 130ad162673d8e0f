//! Worlds from arrays in memory are those of files: the same mesh, the same mends, the same light.

use std::collections::BTreeMap;
use std::path::PathBuf;

use finalgather::error::{Error, Result};
use finalgather::scene::{Files, ImageTexture, LoadOptions, Loaded, Material, MeshArrays, Sampler, World};
use glam::{DVec3, Vec2, Vec3, dvec3, vec2, vec3};

/// A floor of two triangles and a vertex that no face uses.
fn floor() -> MeshArrays {
    MeshArrays {
        name: "floor".to_owned(),
        positions: vec![
            dvec3(0.0, 0.0, 0.0),
            dvec3(0.0, 0.0, 2.0),
            dvec3(9.0, 9.0, 9.0),
            dvec3(3.0, 0.5, 2.0),
            dvec3(3.0, 0.25, 0.0),
        ],
        faces: vec![0, 1, 3, 0, 3, 4],
        corners: 3,
        materials: vec![Material::default()],
        ..MeshArrays::default()
    }
}

fn load(arrays: MeshArrays, strict: bool) -> Result<Loaded> {
    World::from_arrays(arrays, LoadOptions { unlit: true, strict, ..LoadOptions::default() })
}

/// The error of arrays that do not fit each other.
fn refused(arrays: MeshArrays) -> String {
    match load(arrays, false) {
        Err(Error::Usage { problem, cure }) if cure.len() > 10 => problem,
        other => panic!("not refused: {other:?}"),
    }
}

#[test]
fn a_mesh_is_that_of_a_ply() {
    let arrays = MeshArrays {
        normals: vec![DVec3::Y, dvec3(0.0, 2.0, 0.0), DVec3::Y, dvec3(0.0, 1.0, 1.0), DVec3::ZERO],
        colors: (0..5).map(|i| vec3(0.25, 0.5, i as f32 / 4.0)).collect(),
        materials: vec![Material { albedo: Vec3::ONE, ..Material::default() }],
        ..floor()
    };
    let mut ply = "ply\nformat ascii 1.0\nelement vertex 5\n".to_owned();
    for (kind, names) in [("double", "x y z"), ("double", "nx ny nz"), ("float", "red green blue")] {
        names.split(' ').for_each(|name| ply += &format!("property {kind} {name}\n"));
    }
    ply += "element face 2\nproperty list uchar int vertex_indices\nend_header\n";
    for ((position, normal), color) in arrays.positions.iter().zip(&arrays.normals).zip(&arrays.colors) {
        let numbers = [position.to_array(), normal.to_array(), color.as_dvec3().to_array()].concat();
        ply += &numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
        ply += "\n";
    }
    ply += "3 0 1 3\n3 0 3 4\n";
    let files = BTreeMap::from([(PathBuf::from("floor.ply"), ply.into_bytes())]);
    let options = LoadOptions { files: Files::Memory(files), unlit: true, ..LoadOptions::default() };
    let of_file = World::load_with("floor.ply".as_ref(), options).unwrap();
    let of_arrays = load(arrays, true).unwrap();
    assert_eq!(of_arrays.report.warnings, [""; 0]);
    let [a, b] = [&of_file, &of_arrays].map(|loaded| loaded.world.flatten());
    assert_eq!(a.digest(), b.digest());
    assert_eq!(a.mesh.sources, b.mesh.sources);
    assert_eq!([&of_file, &of_arrays].map(|loaded| loaded.world.meshes[0].source_count), [5, 5]);
    assert_eq!(a.mesh.sources.iter().map(|source| source.index).collect::<Vec<_>>(), [0, 1, 3, 4]);
}

#[test]
fn faces_have_any_number_of_corners() {
    let quad = MeshArrays { faces: vec![0, 1, 3, 4], corners: 4, ..floor() };
    let [quad, pair] = [quad, floor()].map(|arrays| load(arrays, true).unwrap().world.flatten());
    assert_eq!(quad.mesh.triangles.len(), 2);
    let area = |scene: &finalgather::Scene| (0..2).map(|triangle| scene.mesh.area(triangle)).sum::<f32>();
    // A quad that is not flat has one area for each of its diagonals. They differ by less than a hundredth here.
    assert!((area(&quad) / area(&pair) - 1.0).abs() < 0.01, "{} and {}", area(&quad), area(&pair));
}

#[test]
fn faults_are_mended_as_in_files() {
    let mended = |arrays: MeshArrays, text: &str| {
        let loaded = load(arrays.clone(), false).unwrap();
        let [warning] = &loaded.report.warnings[..] else { panic!("{:?}", loaded.report.warnings) };
        assert!(warning.starts_with("floor: ") && warning.contains(text), "{warning}");
        assert!(matches!(load(arrays, true), Err(Error::Input { .. })), "{text}: strict reads it too");
        loaded.world
    };
    let mut arrays = floor();
    arrays.positions[4].y = f64::NAN;
    assert_eq!(mended(arrays, "vertex 4 is at").meshes[0].triangles.len(), 1);
    let world = mended(MeshArrays { faces: vec![0, 1, 3, 0, 3, u32::MAX], ..floor() }, "refers to no vertex");
    assert_eq!(world.meshes[0].triangles.len(), 1);
    let world = mended(MeshArrays { colors: vec![vec3(0.0, 2.0, 0.5); 5], ..floor() }, "has the colour");
    assert_eq!(world.meshes[0].colors[0], vec3(0.0, 1.0, 0.5));
    let world = mended(MeshArrays { uvs: vec![vec2(f32::INFINITY, 0.0); 5], ..floor() }, "texture coordinates");
    assert_eq!(world.meshes[0].uvs[0], Vec2::ZERO);
    let world = mended(MeshArrays { normals: vec![DVec3::NAN; 5], ..floor() }, "has the normal");
    assert_eq!(world.meshes[0].normals[0], Vec3::ZERO);

    for faces in [vec![], vec![0, 0, 0]] {
        assert!(matches!(load(MeshArrays { faces, ..floor() }, false), Err(Error::Input { .. })));
    }
}

#[test]
fn lists_fit_each_other() {
    assert_eq!(refused(MeshArrays { normals: vec![DVec3::Y; 4], ..floor() }), "normals: 4 rows for 5 vertices");
    assert_eq!(refused(MeshArrays { uvs: vec![Vec2::ZERO; 6], ..floor() }), "uv: 6 rows for 5 vertices");
    assert_eq!(refused(MeshArrays { material_of: vec![0; 3], ..floor() }), "materials: 3 rows for 2 faces");
    assert_eq!(refused(MeshArrays { corners: 4, ..floor() }), "faces: 6 indices for faces of 4 corners");
    assert!(refused(MeshArrays { material_of: vec![0, 1], ..floor() }).contains("material that is not there"));
    let textured = Material { albedo_texture: Some(0), ..Material::default() };
    assert!(refused(MeshArrays { materials: vec![textured], ..floor() }).contains("texture that is not there"));
}

#[test]
fn materials_and_textures_are_of_faces() {
    let lamp = Material { emission: Vec3::splat(2.0), ..Material::default() };
    let picture = ImageTexture { width: 1, height: 1, texels: vec![[255, 0, 0, 255]], sampler: Sampler::default() };
    let textured = Material { albedo: Vec3::ONE, albedo_texture: Some(0), ..Material::default() };
    let arrays = MeshArrays {
        uvs: vec![vec2(0.5, 0.5); 5],
        materials: vec![textured, lamp],
        material_of: vec![1, 0],
        textures: vec![picture],
        ..floor()
    };
    let scene = load(arrays, true).unwrap().world.flatten();
    let third = Vec3::splat(1.0 / 3.0);
    let [first, second] = [0, 1].map(|triangle| (scene.emission(triangle, third, true), scene.albedo(triangle, third)));
    assert_eq!((first.0, second.0), (Vec3::splat(2.0), Vec3::ZERO));
    assert_eq!((first.1, second.1), (Material::GREY, vec3(1.0, 0.0, 0.0)));
}

#[test]
fn light_comes_when_it_is_needed() {
    let mut dark = load(floor(), false).unwrap();
    assert!(dark.needs_light() && dark.world.environment.is_none());
    dark.light().unwrap();
    let lit = World::from_arrays(floor(), LoadOptions::default()).unwrap();
    for loaded in [&dark, &lit] {
        assert!(!loaded.needs_light() && loaded.settings == lit.settings);
        assert!(loaded.report.warnings[0].contains("a soft sky lights it"), "{:?}", loaded.report.warnings);
    }
    assert_eq!(dark.world.flatten().digest(), lit.world.flatten().digest());
    dark.light().unwrap();
    assert_eq!(dark.report.warnings.len(), 1, "lit twice");

    let refused = World::from_arrays(floor(), LoadOptions { no_default_light: true, ..LoadOptions::default() });
    assert!(matches!(refused, Err(Error::Input { problem, .. }) if problem.starts_with("no light")));
}
