//! Smooth normals for models without: `--smooth-angle` and `smooth_angle` in a scene file.

mod common;

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use common::{Model, gpu};
use finalgather::error::Error;
use finalgather::render::Render;
use finalgather::scene::{Files, LoadOptions, Mesh, Triangle, World};
use finalgather::settings::{Pipeline, Settings};
use glam::{Vec3, vec3};

/// A ball of radius 1 about the origin, in rings of flat faces, as a model of no file.
fn ball() -> World {
    let mut model = Model::new();
    model.sphere(Vec3::ZERO, 1.0, 16, false, 0);
    model.world()
}

/// Angles in degrees between the normals at corners and what `of` says of their positions and faces.
fn angles(mesh: &Mesh, of: impl Fn(Vec3, Vec3) -> Vec3) -> Vec<f32> {
    let corners =
        (0..mesh.triangles.len()).flat_map(|triangle| mesh.triangles[triangle].vertices.map(|vertex| (triangle, vertex)));
    let angle = |(triangle, vertex): (usize, u32)| {
        let (position, normal) = (mesh.positions[vertex as usize], mesh.normals[vertex as usize]);
        of(position, mesh.geometric_normal(triangle)).angle_between(normal).to_degrees()
    };
    corners.map(angle).collect()
}

fn most(angles: &[f32]) -> f32 {
    angles.iter().copied().fold(0.0, f32::max)
}

#[test]
fn a_ball_gets_the_normals_of_a_sphere() {
    let mut world = ball();
    let before = world.meshes[0].clone();
    world.smooth(40.0);
    let mesh = &world.meshes[0];
    assert_eq!(mesh.positions.len(), before.positions.len(), "no edge of the ball is a crease");
    assert_eq!(mesh.triangles, before.triangles);
    // Weights by angles take a ring's unequal faces into account. Faces are 11 degrees wide.
    let off = most(&angles(mesh, |position, _| position.normalize()));
    assert!(off < 1.0, "{off} degrees");
}

#[test]
fn edges_of_a_cube_stay_sharp_unless_they_are_asked_for() {
    let cube = || {
        // One vertex for each corner.
        let mut mesh = Mesh::default();
        for corner in 0..8u32 {
            mesh.positions.push(Vec3::from_array([0, 1, 2].map(|axis| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 })));
            mesh.normals.push(Vec3::ZERO);
            mesh.uvs.push(glam::Vec2::new(corner as f32, 0.0));
        }
        for quad in [[0u32, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
            for vertices in [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]] {
                mesh.triangles.push(Triangle { vertices, material: 0 });
            }
        }
        mesh
    };
    let mut sharp = cube();
    sharp.smooth(60.0);
    assert_eq!(sharp.positions.len(), 24, "each corner has three normals");
    assert!(most(&angles(&sharp, |_, face| face)) < 0.01);
    // What belongs to a vertex goes with its copies.
    let of: HashMap<[u32; 3], f32> = (0..8).map(|i| (cube().positions[i].to_array().map(f32::to_bits), i as f32)).collect();
    for (position, uv) in sharp.positions.iter().zip(&sharp.uvs) {
        assert_eq!(of[&position.to_array().map(f32::to_bits)], uv.x);
    }
    let mut all_sharp = cube();
    all_sharp.smooth(0.0);
    assert_eq!(all_sharp.positions.len(), 24);
    assert!(most(&angles(&all_sharp, |_, face| face)) < 0.01);
    let mut round = cube();
    round.smooth(100.0);
    assert_eq!(round.positions.len(), 8);
    assert!(most(&angles(&round, |position, _| position.normalize())) < 0.01);
}

/// Two faces back to back have no mean.
#[test]
fn leaves_with_two_faces_have_the_normals_of_both() {
    let mut model = Model::new();
    let corners = [vec3(0.1, 0.2, 0.3), vec3(0.9, 0.35, 0.1), vec3(0.4, 0.8, 0.7)];
    for vertices in [[0u32, 1, 2], [0, 2, 1]] {
        let vertices = vertices.map(|corner| model.vertex(corners[corner as usize]));
        model.scene.mesh.triangles.push(Triangle { vertices, material: 0 });
    }
    let mut mesh = model.scene.mesh;
    mesh.smooth(180.0);
    assert!(most(&angles(&mesh, |_, face| face)) < 0.1, "{:?}", mesh.normals);
}

#[test]
fn normals_of_the_file_stay() {
    let mut world = ball();
    let given = vec3(0.6, 0.0, 0.8);
    let vertex = world.meshes[0].triangles[3].vertices[1] as usize;
    world.meshes[0].normals[vertex] = given;
    world.smooth(40.0);
    assert_eq!(world.meshes[0].normals[vertex], given);
    let mesh = &world.meshes[0];
    let used = mesh.triangles.iter().flat_map(|triangle| triangle.vertices);
    assert_eq!(used.filter(|&vertex| mesh.normals[vertex as usize] == Vec3::ZERO).count(), 0);
}

const ROOF: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 -0.3\nv 2 1 -0.3\nf 1 2 3 4\nf 2 5 6 3\n";

fn load(scene: &str, smooth_angle: Option<f32>) -> Result<World, Error> {
    let files = [("roof.obj", ROOF), ("scene.toml", scene)];
    let files: BTreeMap<PathBuf, Vec<u8>> =
        files.into_iter().map(|(name, text)| (PathBuf::from(name), text.as_bytes().to_vec())).collect();
    let options = LoadOptions { files: Files::Memory(files), smooth_angle, unlit: true, ..LoadOptions::default() };
    World::load_with(Path::new("scene.toml"), options).map(|loaded| loaded.world)
}

/// Number of vertices with normals, of all.
fn smooth_vertices(world: &World) -> [usize; 2] {
    let normals = &world.meshes[0].normals;
    [normals.iter().filter(|normal| **normal != Vec3::ZERO).count(), normals.len()]
}

#[test]
fn scene_files_and_options_ask_for_it() {
    let plain = "mesh = \"roof.obj\"\n";
    let asked = "mesh = \"roof.obj\"\nsmooth_angle = 30\n";
    assert_eq!(smooth_vertices(&load(plain, None).unwrap()), [0, 6], "without a word surfaces are flat");
    // The two faces meet at 17 degrees.
    assert_eq!(smooth_vertices(&load(asked, None).unwrap()), [6, 6]);
    assert_eq!(smooth_vertices(&load(plain, Some(30.0)).unwrap()), [6, 6]);
    assert_eq!(smooth_vertices(&load(asked, Some(10.0)).unwrap()), [8, 8], "the option goes before the scene file");
    for wrong in ["-1", "181", "nan"] {
        let error = load(&format!("mesh = \"roof.obj\"\nsmooth_angle = {wrong}\n"), None).unwrap_err().to_string();
        assert!(error.contains("scene.toml:2") && error.contains("0, all edges sharp"), "{error}");
    }
}

/// A lamp within a closed ball of coarse, smooth faces: no light comes out, whatever the shading normals say.
#[test]
fn smooth_surfaces_do_not_see_through_themselves() {
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, Vec3::splat(100.0));
    model.sphere(Vec3::ZERO, 1.0, 6, false, 0);
    model.sphere(Vec3::ZERO, 0.5, 4, false, lamp);
    let mut world = model.world();
    world.smooth(180.0);
    let gpu = gpu();
    for pipeline in [Pipeline::Fused, Pipeline::Kill, Pipeline::EarlyKill, Pipeline::Raycast, Pipeline::RaycastGl] {
        let settings = Settings::default().with(|s| {
            (s.film.size, s.directions.count, s.direct.light_samples, s.photons.count) = ([24, 24], 64, 16, 10_000);
            s.gather.pipeline = pipeline;
        });
        let mut render = Render::new(&gpu, &world, &settings).unwrap();
        while !render.is_done() {
            render.step().unwrap();
        }
        let picture = render.picture();
        let covered: f32 = picture.channel("A").unwrap().iter().sum();
        assert!(covered > 100.0, "the ball is seen: {covered}");
        // Beside edges one ray in a thousand of layers meets the inside, with smooth normals or without.
        let parts = if pipeline.has_layers() { &["Direct"][..] } else { &["Direct", "Indirect"] };
        let brightest = |part: &str| picture.channel(&format!("{part}.R")).unwrap().iter().copied().fold(0.0, f32::max);
        let lit = parts.iter().filter(|part| brightest(part) > 0.0).count();
        assert_eq!(lit, 0, "{pipeline:?}");
    }
}
