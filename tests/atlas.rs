//! The photon map on surfaces: true areas, sides, rooms and hidden surfaces apart, and irradiance against closed forms.

mod common;

use std::f32::consts::PI;

use common::{Model, form_factor_of_polygon, points_on};
use finalgather::photon::{PhotonAtlas, PhotonStore, PhotonTracer};
use finalgather::points::GatherPoint;
use finalgather::scene::{Bvh, Environment, LANES, Lights, NO_TRIANGLE, PacketHits, Scene, of_lane};
use glam::{Vec3, vec3};

/// An atlas with the light of photons.
struct Lit {
    scene: Scene,
    bvh: Bvh,
    atlas: PhotonAtlas,
}

impl Lit {
    fn new(scene: Scene, photons: u64, depth: u32) -> Self {
        let (bvh, lights) = (Bvh::new(&scene.mesh), Lights::new(&scene));
        let tracer = PhotonTracer::new(&scene, &bvh, &lights, 0, depth);
        let mut atlas = PhotonAtlas::new(&scene, &bvh, None, |groups, count| tracer.arrivals(photons, groups, count));
        tracer.trace(0..photons, &mut atlas);
        Self { scene, bvh, atlas }
    }

    /// The irradiance at a point of a surface, on the side of its normal.
    fn at(&self, point: &GatherPoint) -> Vec3 {
        let origin = point.position + 1e-4 * point.normal;
        let hit = self.bvh.nearest(origin, -point.normal, None).expect("the point lies on a surface");
        self.atlas.irradiance(&self.scene.mesh, hit.triangle, point.position, point.normal)
    }

    /// Points on the fronts of all surfaces that face along `normal`.
    fn facing(&self, normal: Vec3, count: usize) -> Vec<GatherPoint> {
        points_on(&self.scene, count).into_iter().filter(|point| point.normal.dot(normal) > 0.9).collect()
    }
}

/// A closed room 2 wide whose lamp, of half side 0.2 and radiance 1, hangs near its ceiling. The lamp's corners are the first four vertices.
fn room(albedo: f32) -> Model {
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, Vec3::ONE);
    let wall = model.material(Vec3::splat(albedo), Vec3::ZERO);
    model.plate(vec3(0.0, 0.9, 0.0), 0.2 * Vec3::X, 0.2 * Vec3::Z, lamp);
    model.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, wall);
    model
}

fn of_lamp(scene: &Scene, point: &GatherPoint) -> f32 {
    PI * form_factor_of_polygon(&scene.mesh.positions[..4], point.position, point.normal) as f32
}

#[test]
fn areas_are_those_of_the_surfaces() {
    // Bent and flat surfaces that nothing touches.
    let mut model = Model::new();
    model.sphere(vec3(-0.4, -0.3, 0.2), 0.3, 24, false, 0);
    model.plate(vec3(0.5, 0.05, -0.1), vec3(0.5, 0.3, 0.1), vec3(-0.2, 0.4, 0.3), 0);
    model.cuboid(vec3(0.2, -0.8, 0.5), Vec3::splat(0.1), 0.7, false, 0);
    let scene = model.finish();
    let mesh = &scene.mesh;
    let many = |_: &[u32], charts| vec![1e5; charts];
    let found: f64 = PhotonAtlas::new(&scene, &Bvh::new(mesh), None, many).areas().iter().map(|&area| f64::from(area)).sum();
    let expected: f64 = (0..mesh.triangles.len()).map(|triangle| f64::from(mesh.area(triangle))).sum();
    eprintln!("area {found} of {expected}");
    // Corners of clipped polygons are rounded to 6e-8 of the scene, some 1e-5 of a page.
    assert!((found / expected - 1.0).abs() < 1e-5, "{found} of {expected}");
}

/// Look-ups of packets are those of single hits, to the bit: on pages that contacts divide, on both sides.
#[test]
fn packets_look_up_the_same_irradiance() {
    let mut model = room(0.5);
    model.cuboid(vec3(0.1, -0.7, 0.2), Vec3::splat(0.3), 0.4, false, 1);
    model.sphere(vec3(-0.5, -0.4, -0.3), 0.3, 12, false, 1);
    let Lit { scene, bvh, atlas } = Lit::new(model.finish(), 200_000, 8);
    let mesh = &scene.mesh;
    let (mut lit, mut missed) = (0, 0);
    for points in points_on(&scene, 4000).chunks_exact(LANES) {
        let mut hits = PacketHits::NONE;
        let mut positions = [[0.0; LANES]; 3];
        for (lane, point) in points.iter().enumerate() {
            let direction = (point.normal + 0.3 * Vec3::from([point.position.y, point.position.z, point.position.x])).normalize();
            let Some(hit) = bvh.nearest(point.position + 1e-5 * point.normal, direction, None) else { continue };
            let position = point.position + hit.distance * direction;
            (0..3).for_each(|axis| positions[axis][lane] = position[axis]);
            hits.triangles[lane] = hit.triangle as u32;
            hits.fronts |= u32::from(mesh.meets_front(hit.triangle, direction)) << lane;
        }
        let found = atlas.irradiance_of_packet(mesh, &hits, &positions);
        for lane in 0..LANES {
            let position = Vec3::from(of_lane(&positions, lane));
            let (triangle, front) = (hits.triangles[lane], hits.fronts >> lane & 1 == 1);
            let is_hit = triangle != NO_TRIANGLE;
            let single = || atlas.irradiance_of_hit(mesh, triangle as usize, position, front);
            let found = if is_hit { Vec3::from(of_lane(&found, lane)) } else { Vec3::ZERO };
            assert_eq!(found, if is_hit { single() } else { Vec3::ZERO }, "triangle {triangle} at {position}");
            lit += usize::from(found != Vec3::ZERO);
            missed += usize::from(!is_hit);
        }
    }
    assert!(lit > 2000, "{lit} hits are lit, {missed} rays miss");
}

#[test]
fn flux_at_the_first_surface_is_what_was_emitted() {
    let lit = Lit::new(room(0.5).finish(), 100_000, 1);
    let emitted = PI * (lit.scene.mesh.area(0) + lit.scene.mesh.area(1));
    let [all, seams] = lit.atlas.total_flux();
    assert!((all.x / emitted - 1.0).abs() < 1e-5, "{all} of {emitted}");
    assert_eq!(seams, Vec3::ZERO, "nothing stands in the room");
}

#[test]
fn irradiance_is_that_under_the_lamp_up_to_the_corners() {
    let lit = Lit::new(room(0.5).finish(), 1_000_000, 1);
    let points = lit.facing(Vec3::Y, 30_000);
    let errors: Vec<f32> = points.iter().map(|point| lit.at(point).x / of_lamp(&lit.scene, point) - 1.0).collect();
    let mean = errors.iter().sum::<f32>() / errors.len() as f32;
    let rms = (errors.iter().map(|error| error * error).sum::<f32>() / errors.len() as f32).sqrt();
    let extent = lit.scene.mesh.bounds().extent().x;
    let in_corner = |point: &GatherPoint| point.position.x.abs().min(point.position.z.abs()) > 0.46 * extent;
    let corner: Vec<f32> = points.iter().zip(&errors).filter(|(point, _)| in_corner(point)).map(|(_, &error)| error).collect();
    let of_corner = corner.iter().sum::<f32>() / corner.len() as f32;
    eprintln!("{} points: mean {mean:+.4}, RMS {rms:.4}; {} in corners: {of_corner:+.4}", points.len(), corner.len());
    // About 150 photons count for a page with its neighbours, fewer far from the lamp.
    assert!(points.len() > 300 && corner.len() > 5);
    assert!(mean.abs() < 0.01, "{mean}");
    assert!(rms < 0.12, "{rms}");
    assert!(of_corner.abs() < 0.06, "{of_corner}");
}

/// One floor runs through a bright and a dark room, which a wall divides. It is two hundredths of the room thick.
#[test]
fn a_wall_on_a_floor_keeps_two_rooms_apart() {
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, Vec3::ONE);
    let white = model.material(Vec3::splat(0.8), Vec3::ZERO);
    model.plate(vec3(-1.0, 0.9, 0.0), 0.3 * Vec3::X, 0.3 * Vec3::Z, lamp);
    model.cuboid(Vec3::ZERO, vec3(2.0, 1.0, 1.0), 0.0, true, white);
    // Through floor, ceiling and walls, as builders make them.
    model.cuboid(vec3(0.013, 0.0, 0.0), vec3(0.01, 1.001, 1.001), 0.0, false, white);
    let lit = Lit::new(model.finish(), 500_000, 16);
    let wall = 0.013 / lit.scene.space.length_to_world(1.0);
    let (mut dark, mut bright) = (0, 0);
    for point in
        points_on(&lit.scene, 20_000).iter().filter(|point| point.position.x.abs() < 0.95 * lit.scene.mesh.bounds().extent().x)
    {
        let outer = point.position.abs().max_element() > 0.999 * lit.scene.mesh.bounds().max.x;
        if outer {
            continue;
        }
        let found = lit.at(point);
        if point.position.x > wall + 1e-3 {
            dark += 1;
            assert_eq!(found, Vec3::ZERO, "the dark room at {}", point.position);
        } else if point.position.x < -0.05 {
            bright += 1;
            assert!(found.min_element() > 0.0, "the bright room at {}", point.position);
        }
    }
    assert!(dark > 1000 && bright > 1000, "{dark} {bright}");
}

/// A flat block stands on the floor and hides a part of it. What it hides must not darken what is beside it.
#[test]
fn hidden_floor_does_not_darken_the_floor_beside_it() {
    let mut model = room(0.5);
    let black = model.material(Vec3::ZERO, Vec3::ZERO);
    model.cuboid(vec3(0.3, -0.99, 0.2), vec3(0.31, 0.01, 0.27), 0.4, false, black);
    let lit = Lit::new(model.finish(), 1_000_000, 1);
    let floor = lit.scene.mesh.bounds().min.y;
    let points: Vec<_> = lit.facing(Vec3::Y, 60_000).into_iter().filter(|point| point.position.y < floor + 1e-4).collect();
    let block = |point: &GatherPoint| {
        // In the block's frame, in half sides.
        let from = point.position * lit.scene.space.length_to_world(1.0) - vec3(0.3, 0.0, 0.2);
        let (sin, cos) = 0.4f32.sin_cos();
        vec3(cos * from.x - sin * from.z, 0.0, sin * from.x + cos * from.z).abs() / vec3(0.31, 1.0, 0.27)
    };
    let beside = points.iter().filter(|point| (1.06..1.2).contains(&block(point).max_element()));
    let errors: Vec<f32> = beside.map(|point| lit.at(point).x / of_lamp(&lit.scene, point) - 1.0).collect();
    let mean = errors.iter().sum::<f32>() / errors.len() as f32;
    eprintln!("{} points beside the block: {mean:+.4}", errors.len());
    // The block is so flat that it takes little of the lamp's light away, 1 % or so close to it.
    assert!(errors.len() > 200);
    assert!(mean.abs() < 0.03, "{mean}");
    let below = points.iter().filter(|point| block(point).max_element() < 0.9);
    assert!(below.filter(|point| lit.at(point) != Vec3::ZERO).count() == 0);
}

/// A ramp that turns twice about an axis is connected, and almost flat everywhere. Light on its upper turn must not show on the lower one.
#[test]
fn turns_of_a_ramp_stay_apart() {
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, Vec3::ONE);
    let black = model.material(Vec3::ZERO, Vec3::ZERO);
    model.plate(vec3(0.0, 0.6, 0.0), Vec3::X, Vec3::Z, lamp);
    let at = |step: u32, radius: f32| {
        let (sin, cos) = (step as f32 * 0.2).sin_cos();
        vec3(radius * cos, 0.008 * step as f32, radius * sin)
    };
    for step in 0..63 {
        model.quad([at(step, 0.4), at(step + 1, 0.4), at(step + 1, 0.9), at(step, 0.9)], black);
    }
    let lit = Lit::new(model.finish(), 400_000, 4);
    let ramp = points_on(&lit.scene, 20_000).into_iter().filter(|point| point.normal.y.abs() > 0.8 && point.position.y < 0.3);
    let (mut low, mut high) = (Vec::new(), Vec::new());
    for point in ramp {
        // In steps of the ramp, from its foot.
        let height = (point.position.y - lit.scene.mesh.bounds().min.y) * lit.scene.space.length_to_world(1.0) / 0.008;
        let up = GatherPoint::flat(point.position, Vec3::Y);
        let found = lit.at(&up).x;
        match height {
            5.0..25.0 => low.push(found),
            40.0..60.0 => high.push(found),
            _ => {}
        }
    }
    let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len() as f32;
    eprintln!("{} low {:.4}, {} high {:.4}", low.len(), mean(&low), high.len(), mean(&high));
    assert!(low.len() > 500 && high.len() > 500);
    // The black turn above leaves the lower one the light that comes in from the side.
    assert!(mean(&low) < 0.3 * mean(&high), "{} for {}", mean(&low), mean(&high));
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let lit = pool.install(|| {
            let mut model = room(0.5);
            model.cuboid(vec3(0.3, -0.8, 0.2), Vec3::splat(0.2), 0.4, false, 0);
            Lit::new(model.finish(), 50_000, 8)
        });
        let points = points_on(&lit.scene, 2000);
        points.iter().map(|point| lit.at(point).to_array().map(f32::to_bits)).collect::<Vec<_>>()
    };
    assert!(with(1) == with(4));
}

/// A furnished room in a square kilometre of ground takes little memory.
#[test]
fn memory_follows_surfaces_not_volume() {
    let mut model = Model::new();
    let grey = model.material(Vec3::splat(0.5), Vec3::ZERO);
    model.plate(Vec3::ZERO, 500.0 * Vec3::Z, 500.0 * Vec3::X, grey);
    model.cuboid(vec3(20.0, 1.5, 30.0), vec3(3.0, 1.5, 2.5), 0.3, false, grey);
    model.cuboid(vec3(20.0, 1.5, 30.0), vec3(2.9, 1.4, 2.4), 0.3, true, grey);
    for i in 0..200 {
        let (column, row) = ((i % 20) as f32, (i / 20) as f32);
        model.cuboid(vec3(17.6 + 0.25 * column, 0.3, 28.2 + 0.35 * row), vec3(0.02, 0.2, 0.02), 0.1 * column, false, grey);
    }
    let mut scene = model.finish();
    scene.environment = Some(Environment::constant(Vec3::ONE).unwrap());
    let lit = Lit::new(scene, 1_000_000, 8);
    let mebibytes = lit.atlas.size() as f64 / f64::from(1 << 20);
    eprintln!("{mebibytes:.1} MiB");
    assert!(mebibytes < 32.0, "{mebibytes} MiB on the CPU, and about as much again on the GL side");
}
