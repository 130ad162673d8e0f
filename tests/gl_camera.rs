//! The camera sees the surfaces that its rays hit, also close to the eye in a scene ten thousand times as large. Tests the near plane, the depth test,
//! and that there is no far plane.

mod common;

use common::{Model, colorful, gpu};
use finalgather::geometry::Geometry;
use finalgather::math::Aabb;
use finalgather::points::CameraPoints;
use finalgather::random::Random;
use finalgather::scene::{Bvh, Camera, Scene};
use glam::{Vec2, Vec3, vec3};

/// Pixels a side.
const SIZE: u32 = 128;

/// Fails where more than one in `one_in` pixels of a scene in unit space has another distance along the view axis than its ray's hit. Returns the
/// nearest and the farthest of these.
fn check(name: &str, scene: &Scene, camera: Camera, one_in: usize) -> [f32; 2] {
    let gpu = gpu();
    let geometry = Geometry::upload(&gpu, scene).unwrap();
    let visible = CameraPoints::new(&gpu, [SIZE; 2]).unwrap().see(&geometry, &camera, Vec2::splat(0.5), 0);
    gpu.check("finding visible points").unwrap();

    let bvh = Bvh::new(&scene.mesh);
    let forward = (camera.target - camera.eye).normalize();
    let right = forward.cross(camera.up).normalize();
    let up = right.cross(forward);
    let half = (camera.fov_y_degrees.to_radians() / 2.0).tan();
    let (mut off, mut range) = (0, [f32::INFINITY, 0.0f32]);
    for (pixel, found) in (0u32..).zip(&visible.emission) {
        let [x, y] = [pixel % SIZE, pixel / SIZE].map(|at| half * (2.0 * (at as f32 + 0.5) / SIZE as f32 - 1.0));
        let direction = (forward + x * right + y * up).normalize();
        let expected = bvh.nearest(camera.eye, direction, None).map_or(0.0, |hit| hit.distance * direction.dot(forward));
        // Coordinates up to 1 are rounded to 6e-8, and a few roundings add up; at grazing angles they count tenfold, and relative to
        // what is 1e-4 away a hundredth is 1e-6.
        if (found.w - expected).abs() > 0.01 * expected {
            off += 1;
        }
        if found.w > 0.0 {
            range = [range[0].min(found.w), range[1].max(found.w)];
        }
    }
    eprintln!("{name}: depths {range:?}, {off} pixels off");
    assert!(off <= (SIZE * SIZE) as usize / one_in, "{name}: {off} pixels see what their rays do not meet");
    range
}

/// Pixels of a plate show the albedo of their rays: vertex colours times a texture with its sampler, magnified.
#[test]
fn colors_and_samplers() {
    let scene = colorful();
    let gpu = gpu();
    let geometry = Geometry::upload(&gpu, &scene).unwrap();
    let camera = scene.camera([SIZE; 2]);
    let visible = CameraPoints::new(&gpu, [SIZE; 2]).unwrap().see(&geometry, &camera, Vec2::splat(0.5), 0);
    gpu.check("finding visible points").unwrap();
    let (mut off, mut seen) = (0, 0);
    for (found, position) in visible.albedo.iter().zip(&visible.position) {
        let Some(triangle) = (found.w as usize).checked_sub(1) else { continue };
        // At grazing angles the picture has mipmaps.
        let to_eye = (camera.eye - position.truncate()).normalize();
        if scene.mesh.geometric_normal(triangle).dot(to_eye).abs() < 0.4 {
            continue;
        }
        let expected = scene.albedo(triangle, scene.mesh.barycentric(triangle, position.truncate()));
        seen += 1;
        // Filters of textures have eight bits for the share of a texel.
        off += usize::from((found.truncate() - expected).abs().max_element() > 0.01);
    }
    assert!(seen > (SIZE * SIZE / 4) as usize, "only {seen} pixels see a surface");
    eprintln!("{off} of {seen} pixels off");
    assert!(off * 200 < seen, "{off} of {seen} pixels show another albedo than their rays meet");
}

/// A wall before the camera at 1e-4 of the room's diameter fills the picture.
#[test]
fn a_wall_close_to_the_eye_in_a_huge_scene() {
    let mut model = Model::new();
    model.cuboid(Vec3::ZERO, Vec3::ONE, 0.3, true, 0);
    model.plate(vec3(0.2, 0.1, 0.3), 0.2 * Vec3::X, 0.2 * Vec3::Y, 0);
    let scene = model.finish();
    let [.., corner, _, opposite, _] = scene.mesh.positions[..] else { panic!("no plate") };
    let wall = (corner + opposite) / 2.0;
    let distance = 1e-4 * scene.mesh.bounds().diagonal();
    for (name, side) in [("head on", Vec3::Z), ("at a slant", vec3(0.6, 0.0, 0.8))] {
        let camera = Camera { eye: wall + distance * side, target: wall, up: Vec3::Y, fov_y_degrees: 40.0, lens: None };
        let [nearest, farthest] = check(name, &scene, camera, 1000);
        assert!(nearest > 0.5 * distance && farthest < 2.0 * distance, "{name}: {nearest} to {farthest}");
    }
}

/// Whoever stands in a closed room sees no sky, whichever way he looks.
#[test]
fn closed_rooms_have_no_holes() {
    let gpu = gpu();
    let points = CameraPoints::new(&gpu, [SIZE; 2]).unwrap();
    let mut random = Random::new(2, 0);
    let mut holes = Vec::new();
    for number in 0..30 {
        let mut place = |low: f32, high: f32| Vec3::from_array([0, 1, 2].map(|_| low + (high - low) * random.uniform()));
        let (half, eye, target) = (place(0.5, 4.0), place(-0.98, 0.98), place(-1.0, 1.0));
        let mut model = Model::new();
        model.cuboid(Vec3::ZERO, half, 0.0, true, 0);
        let scene = model.finish();
        let extent = scene.mesh.bounds().extent() / 2.0;
        let camera = Camera { eye: eye * extent, target: target * extent, up: Vec3::Y, fov_y_degrees: 70.0, lens: None };
        let visible = points.see(&Geometry::upload(&gpu, &scene).unwrap(), &camera, Vec2::splat(0.5), 0);
        if visible.count < SIZE * SIZE {
            holes.push(format!("room {number}: {} pixels see no surface from {eye} to {target}", SIZE * SIZE - visible.count));
        }
    }
    assert!(holes.is_empty(), "{}", holes.join("\n"));
}

/// Ground that rises to ridges far away, seen by an eye a few ten-thousandths above it, with a stone before its feet.
#[test]
fn near_and_far_of_a_terrain() {
    const SIDE: usize = 64;
    let mut random = Random::new(1, 0);
    // Flat where the eye is, at z = 1, and all the rougher and higher towards z = -1.
    let mut height = |z: usize| 0.1 * (1.0 - z as f32 / SIDE as f32).powi(2) * (0.5 + random.uniform());
    let heights: Vec<f32> = (0..(SIDE + 1) * (SIDE + 1)).map(|i| height(i / (SIDE + 1))).collect();
    let at = |x: usize, z: usize| {
        let along = |step: usize| 2.0 * step as f32 / SIDE as f32 - 1.0;
        vec3(along(x), heights[z * (SIDE + 1) + x], along(z))
    };
    let mut model = Model::new();
    for z in 0..SIDE {
        for x in 0..SIDE {
            let [a, b, c, d] = [at(x, z), at(x, z + 1), at(x + 1, z + 1), at(x + 1, z)];
            model.quad([a, b, c, c], 0);
            model.quad([a, c, d, d], 0);
        }
    }
    let foot = vec3(0.005, 0.0, 0.99);
    model.cuboid(foot - vec3(1e-4, 0.0, 1e-3), Vec3::splat(1e-4), 0.5, false, 0);
    let scene = model.finish();
    // The stone's centre says where the foot is in unit space.
    let stone = Aabb::from_points(scene.mesh.positions[scene.mesh.positions.len() - 24..].iter().copied());
    let scale = stone.extent().y / 2e-4;
    let eye = stone.center() + scale * vec3(1e-4, 3e-4, 1e-3);
    let camera = Camera { eye, target: eye - Vec3::Z, up: Vec3::Y, fov_y_degrees: 60.0, lens: None };
    let [nearest, farthest] = check("terrain", &scene, camera, 200);
    assert!(nearest < 1e-3 && farthest > 1.0, "{nearest} to {farthest}");
}
