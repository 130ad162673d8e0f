//! Scenes of any size, made in code, to measure how cost grows with triangles and with layers; and points on surfaces.

use std::f32::consts::TAU;

use finalgather::points::GatherPoint;
use finalgather::random::Random;
use finalgather::scene::{Instance, Material, Mesh, Scene, Triangle, World, WorldCamera};
use glam::{DVec3, Vec2, Vec3, dvec3, vec3};

/// Materials of both scenes.
const GREY: u32 = 0;
const LAMP: u32 = 1;

/// A closed room with hills for a floor, seen from inside, of about this many triangles. More triangles divide the same low hills more
/// finely, so that depth complexity stays that of a room.
pub fn hills(triangles: u32) -> Scene {
    let cells = (((triangles.max(30) - 12) as f32 / 2.0).sqrt().round() as u32).max(1);
    let mut mesh = Mesh::default();
    // Walls and ceiling; the lamp hangs a little below.
    plate(&mut mesh, Vec3::Y, Vec3::Z, Vec3::X, -Vec3::Y, GREY);
    for [out, along] in [[Vec3::X, Vec3::Z], [-Vec3::X, Vec3::Z], [Vec3::Z, Vec3::X], [-Vec3::Z, Vec3::X]] {
        plate(&mut mesh, out, along, Vec3::Y, -out, GREY);
    }
    plate(&mut mesh, 0.99 * Vec3::Y, 0.3 * Vec3::X, 0.3 * Vec3::Z, -Vec3::Y, LAMP);

    let first = mesh.positions.len() as u32;
    let side = cells + 1;
    for k in 0..side * side {
        let [u, v] = [k % side, k / side].map(|step| step as f32 / cells as f32);
        let height = 0.03 * (3.0 * TAU * u).sin() * (3.0 * TAU * v).sin();
        vertex(&mut mesh, vec3(2.0 * u - 1.0, height - 1.0, 2.0 * v - 1.0));
    }
    for k in 0..cells * cells {
        let at = first + k / cells * side + k % cells;
        for vertices in [[at, at + side, at + 1], [at + 1, at + side, at + side + 1]] {
            mesh.triangles.push(Triangle { vertices, material: GREY });
        }
    }
    let camera =
        WorldCamera { eye: dvec3(0.0, 0.5, 0.95), target: dvec3(0.0, -0.6, -0.3), up: Vec3::Y, fov_y_degrees: 70.0, lens: None };
    scene(mesh, camera)
}

/// A pile of this many square plates, half as high as it is wide, with the lamp on top. Most directions have as many layers as plates.
pub fn plates(layers: u32) -> Scene {
    let mut mesh = Mesh::default();
    for layer in 0..layers {
        let height = layer as f32 / (layers - 1).max(1) as f32;
        let material = if layer + 1 == layers { LAMP } else { GREY };
        plate(&mut mesh, height * Vec3::Y, Vec3::X, Vec3::Z, -Vec3::Y, material);
    }
    let (eye, target) = (dvec3(0.0, 2.0, 4.0), DVec3::ZERO);
    scene(mesh, WorldCamera { eye, target, up: Vec3::Y, fov_y_degrees: 40.0, lens: None })
}

/// Points spread evenly over these triangles of a scene in unit space, on their fronts or on both sides.
pub fn points_on(scene: &Scene, count: u32, both_sides: bool, triangles: &[usize]) -> Vec<GatherPoint> {
    let mesh = &scene.mesh;
    let total: f32 = triangles.iter().map(|&triangle| mesh.area(triangle)).sum();
    let mut random = Random::new(1, 0);
    let (mut points, mut area) = (Vec::new(), 0.0);
    for &triangle in triangles {
        area += mesh.area(triangle);
        let [a, b, c] = mesh.corners(triangle);
        let front = mesh.geometric_normal(triangle);
        while (points.len() as f32) < count as f32 * area / total {
            let (u, v) = (random.uniform(), random.uniform());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let is_back = both_sides && random.uniform() >= 0.5;
            points.push(GatherPoint::flat(a + u * (b - a) + v * (c - a), if is_back { -front } else { front }));
        }
    }
    points
}

/// In unit space.
fn scene(mesh: Mesh, camera: WorldCamera) -> Scene {
    let material = |name: &str, albedo, emission| Material { name: name.into(), albedo, emission, ..Material::default() };
    let world = World {
        meshes: vec![mesh],
        instances: vec![Instance::default()],
        materials: vec![material("grey", vec3(0.7, 0.7, 0.7), Vec3::ZERO), material("lamp", Vec3::ZERO, Vec3::splat(10.0))],
        cameras: vec![("camera".into(), camera)],
        ..World::default()
    };
    world.flatten()
}

fn vertex(mesh: &mut Mesh, position: Vec3) -> u32 {
    mesh.positions.push(position);
    mesh.normals.push(Vec3::ZERO);
    mesh.uvs.push(Vec2::ZERO);
    mesh.positions.len() as u32 - 1
}

/// A parallelogram about `center` with its front on the side of `front`.
fn plate(mesh: &mut Mesh, center: Vec3, half_u: Vec3, half_v: Vec3, front: Vec3, material: u32) {
    let (u, v) = if half_u.cross(half_v).dot(front) > 0.0 { (half_u, half_v) } else { (half_v, half_u) };
    let [a, b, c, d] = [-u - v, u - v, u + v, v - u].map(|corner| vertex(mesh, center + corner));
    for vertices in [[a, b, c], [a, c, d]] {
        mesh.triangles.push(Triangle { vertices, material });
    }
}

#[cfg(test)]
mod tests {
    use finalgather::scene::Bvh;

    use super::*;

    #[test]
    fn hills_have_about_as_many_triangles_as_asked_for() {
        for triangles in [30, 1000, 32_000] {
            let found = hills(triangles).mesh.triangles.len() as f64;
            assert!((found / f64::from(triangles) - 1.0).abs() < 0.1, "{found} for {triangles}");
        }
    }

    #[test]
    fn a_room_is_closed_to_rays_from_its_camera() {
        let scene = hills(1000);
        let bvh = Bvh::new(&scene.mesh);
        let mut random = Random::new(0, 0);
        for _ in 0..1000 {
            let direction = vec3(random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5).normalize();
            assert!(bvh.nearest(scene.camera([1; 2]).eye, direction, None).is_some(), "nothing along {direction}");
        }
    }

    #[test]
    fn a_pile_has_as_many_layers_as_plates() {
        let scene = plates(5);
        let bvh = Bvh::new(&scene.mesh);
        let (mut origin, mut layers) = (vec3(0.1, 2.0, 0.1), 0);
        while let Some(hit) = bvh.nearest(origin, Vec3::NEG_Y, None) {
            origin.y -= hit.distance + 1e-3;
            layers += 1;
        }
        assert_eq!(layers, 5);
    }
}
