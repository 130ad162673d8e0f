//! Lights without a surface, on the GL side and by its twin on the CPU, compared with closed forms.

mod common;

use std::f64::consts::PI;

use common::{Model, direct_light_of, gather_rays, gpu, photon_grid, points_on, sized};
use finalgather::bake::{Bake, Plan, RadianceCache};
use finalgather::direct::SampleShare;
use finalgather::direction::Direction;
use finalgather::geometry::Geometry;
use finalgather::gpu::Gpu;
use finalgather::harmonics::basis;
use finalgather::photon::PhotonTexture;
use finalgather::points::GatherPoint;
use finalgather::prepared::Prepared;
use finalgather::quantity::Quantity;
use finalgather::random::sobol;
use finalgather::render::Render;
use finalgather::scene::{Bvh, Lights, PunctualKind, PunctualLight, Scene, World};
use finalgather::settings::{Pipeline, Sequence, Settings};
use glam::{DVec3, Vec3, dvec3, vec3};

/// In the three channels.
const STRENGTH: Vec3 = vec3(7.0, 3.0, 1.0);

/// Irradiance at each point.
fn direct(gpu: &Gpu, scene: &Scene, points: &[GatherPoint], samples: u32) -> Vec<Vec3> {
    direct_light_of(gpu, scene, points, SampleShare::whole(samples))
}

/// The same without shadows, by the twin of the shader.
fn by_twin(lights: &Lights, point: &GatherPoint, samples: u32) -> Vec3 {
    let light = |index| {
        let (direction, _, facing) = lights.sample(sobol(index, 0)).seen_from(point.position);
        point.cosine(direction) * facing
    };
    (0..samples).map(light).sum::<Vec3>() / samples as f32
}

fn light(kind: PunctualKind, position: DVec3, direction: Vec3) -> PunctualLight {
    PunctualLight { name: "light".into(), kind, position, direction, strength: STRENGTH }.check().unwrap()
}

fn point() -> PunctualKind {
    PunctualKind::Point { radius: 0.0 }
}

fn spot(inner: f32, outer: f32) -> PunctualKind {
    PunctualKind::Spot { radius: 0.0, inner: inner.to_radians(), outer: outer.to_radians() }
}

fn sun(angle: f32) -> PunctualKind {
    PunctualKind::Directional { angle: angle.to_radians() }
}

/// A world of this size that has one light, and a plate far off that hides nothing.
fn world_with(light: PunctualLight, size: f32) -> World {
    let mut model = Model::new();
    model.plate(size * vec3(0.0, -3.0, 0.0), size * Vec3::Z, size * Vec3::X, 0);
    let mut world = model.world();
    world.lights = vec![light];
    world
}

/// Irradiance of a light at a distance below it where the light comes from `angle` off the normal, over what its strength brings at a distance of 1.
fn check(gpu: &Gpu, name: &str, light: &PunctualLight, [position, normal]: [DVec3; 2], expected: f64, samples: u32) {
    for size in [1.0, 1000.0] {
        let mut light = PunctualLight { position: f64::from(size) * light.position, ..light.clone() };
        // In a world a thousand times as large a lamp of the same illuminance has a million times the intensity.
        light.kind = match light.kind {
            PunctualKind::Point { radius } => PunctualKind::Point { radius: f64::from(size) * radius },
            PunctualKind::Spot { radius, inner, outer } => PunctualKind::Spot { radius: f64::from(size) * radius, inner, outer },
            sun @ PunctualKind::Directional { .. } => sun,
        };
        light.strength *= if light.is_directional() { 1.0 } else { size * size };
        let scene = world_with(light, size).flatten();
        let at = GatherPoint::flat(scene.space.enter_point(f64::from(size) * position), normal.as_vec3());
        let found = direct(gpu, &scene, &[at], samples)[0];
        let twin = by_twin(&Lights::new(&scene), &at, samples);
        let expected = expected as f32 * STRENGTH;
        eprintln!("{name}, world of {size}: {found:.5} for {expected:.5}");
        for found in [found, twin] {
            let error = (found - expected).abs() / expected.max(Vec3::splat(1e-9));
            assert!(error.max_element() < 2e-3, "{name}, world of {size}: {found} for {expected}");
        }
    }
}

/// Asked: within 0.2 %. Lights without an extent are exact.
#[test]
fn a_table_of_lights() {
    let gpu = gpu();
    let (lamp, below) = (dvec3(0.3, 2.0, -0.2), DVec3::NEG_Y);
    let turned = |degrees: f64| dvec3(degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0);
    for distance in [0.1, 0.5, 2.0, 4.0] {
        let place = [lamp + distance * below, DVec3::Y];
        check(&gpu, &format!("point at {distance}"), &light(point(), lamp, Vec3::NEG_Y), place, 1.0 / (distance * distance), 4);
    }
    for degrees in [0.0f64, 30.0, 60.0, 85.0, 95.0] {
        let cosine = degrees.to_radians().cos().max(0.0);
        let place = [lamp + below, turned(degrees)];
        check(&gpu, &format!("point, {degrees} degrees off"), &light(point(), lamp, Vec3::NEG_Y), place, cosine, 4);
        for angle in [0.0, 0.53, 8.0] {
            let name = format!("sun of {angle} degrees, {degrees} degrees off");
            check(&gpu, &name, &light(sun(angle), DVec3::ZERO, Vec3::NEG_Y), place, cosine, if angle > 0.0 { 1024 } else { 4 });
        }
    }
    // The axis of a spot leads aside. Its cosine goes from 1 to 0 of the ramp between the two angles.
    let axis = dvec3(0.6, -0.8, 0.0);
    let across = dvec3(0.8, 0.6, 0.0);
    let [inner, outer] = [20.0f64, 40.0];
    let ramp = |degrees: f64| {
        let [edge, full, here] = [outer, inner, degrees].map(|angle| angle.to_radians().cos());
        ((here - edge) / (full - edge)).clamp(0.0, 1.0).powi(2)
    };
    let half_way = (0.5 * (inner.to_radians().cos() + outer.to_radians().cos())).acos().to_degrees();
    for (degrees, expected) in [(0.0, 1.0), (19.5, 1.0), (half_way, 0.25), (35.0, ramp(35.0)), (40.5, 0.0), (120.0, 0.0)] {
        let way = degrees.to_radians().cos() * axis + degrees.to_radians().sin() * across;
        let place = [lamp + 1.5 * way, -way];
        let name = format!("spot, {degrees:.1} degrees off its axis");
        let spot = light(spot(inner as f32, outer as f32), lamp, axis.as_vec3());
        check(&gpu, &name, &spot, place, expected / 2.25, 4);
    }
    // A cone without a soft edge, and a narrow one.
    for (outer, degrees, expected) in [(40.0, 39.0, 1.0), (40.0, 40.1, 0.0), (1.0, 0.9, 1.0), (1.0, 1.01, 0.0)] {
        let way = f64::to_radians(degrees).cos() * axis + f64::to_radians(degrees).sin() * across;
        let spot = light(spot(outer, outer), lamp, axis.as_vec3());
        check(&gpu, &format!("sharp spot of {outer} degrees"), &spot, [lamp + way, -way], expected, 4);
    }
    // A diffuse sphere is as bright as a point, near and far. A disc is brighter at its middle than a point would be far off.
    let radius = 0.25;
    for (distance, degrees) in [(0.75f64, 0.0f64), (1.0, 40.0), (1.0, 70.0), (4.0, 0.0)] {
        let place = [lamp + distance * below, turned(degrees)];
        let expected = degrees.to_radians().cos() / (distance * distance);
        let sphere = light(PunctualKind::Point { radius }, lamp, Vec3::NEG_Y);
        check(&gpu, &format!("sphere at {distance}, {degrees} degrees off"), &sphere, place, expected, 4096);
    }
    for distance in [0.5f64, 4.0] {
        let expected = 2.0 / (radius * radius) * (1.0 - distance / distance.hypot(radius));
        let (inner, outer) = (60f32.to_radians(), 80f32.to_radians());
        let disc = light(PunctualKind::Spot { radius, inner, outer }, lamp, Vec3::NEG_Y);
        check(&gpu, &format!("disc at {distance}"), &disc, [lamp + distance * below, DVec3::Y], expected, 4096);
    }
}

/// A lamp in a shade, of which a square is open below, lights what it sees. The shade's plates are thin.
#[test]
fn a_lamp_in_a_shade() {
    let gpu = gpu();
    let mut model = Model::new();
    for (x, z) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
        let out = vec3(x, 0.0, z);
        model.plate(vec3(0.0, 1.0, 0.0) + 0.2 * out, 0.2 * vec3(z, 0.0, x), 0.2 * Vec3::Y, 0);
    }
    model.plate(vec3(0.0, 1.2, 0.0), 0.2 * Vec3::X, 0.2 * Vec3::Z, 0);
    model.plate(Vec3::ZERO, 2.0 * Vec3::Z, 2.0 * Vec3::X, 0);
    let mut world = model.world();
    world.lights = vec![light(point(), DVec3::Y, Vec3::NEG_Y)];
    let scene = world.flatten();
    let at = |x: f32, y: f32, normal| GatherPoint::flat(scene.space.enter_point(vec3(x, y, 0.1)), normal);
    // The edge of the shade is 0.2 below the lamp and 0.2 aside: the light ends 1 aside on the floor.
    let steps = |low: f32, high: f32| (0..40).map(move |i| low + (high - low) * i as f32 / 39.0);
    let lit: Vec<_> = steps(-0.999, 0.999).map(|x| at(x, 0.0, Vec3::Y)).collect();
    for (point, found) in lit.iter().zip(direct(&gpu, &scene, &lit, 2)) {
        let way = DVec3::Y - scene.space.to_world(point.position);
        let expected = STRENGTH * (way.y / way.length().powi(3)) as f32;
        assert!((found / expected - 1.0).abs().max_element() < 1e-4, "{found} for {expected}");
    }
    let dark: Vec<_> =
        steps(1.001, 1.9).map(|x| at(x, 0.0, Vec3::Y)).chain(steps(-0.19, 0.19).map(|x| at(x, 1.25, Vec3::NEG_Y))).collect();
    assert_eq!(direct(&gpu, &scene, &dark, 2).into_iter().sum::<Vec3>(), Vec3::ZERO);
}

/// A lamp in the plane of a ceiling, or of a floor that it does not lie on, is not behind it.
#[test]
fn a_lamp_on_a_ceiling_lights_the_room() {
    let gpu = gpu();
    let mut model = Model::new();
    model.cuboid(vec3(0.1, 0.2, 0.3), vec3(1.0, 0.7, 1.3), 0.4, true, 0);
    let mut world = model.world();
    let at = DVec3::from(vec3(0.13, 0.9, 0.37));
    world.lights = vec![light(point(), at, Vec3::NEG_Y)];
    let scene = world.flatten();
    let points: Vec<_> = points_on(&scene, 2000).into_iter().filter(|point| point.normal.y > -0.5).collect();
    assert!(points.len() > 500);
    for (point, found) in points.iter().zip(direct(&gpu, &scene, &points, 2)) {
        let way = at - scene.space.to_world(point.position);
        let expected = STRENGTH * (way.dot(point.normal.as_dvec3()) / way.length().powi(3)) as f32;
        assert!((found / expected - 1.0).abs().max_element() < 2e-3, "{found} for {expected} at {point:?}");
    }
}

/// The shadow of an edge under a sun of some width: the part of its disc that stands over the edge.
#[test]
fn the_edge_of_a_sun_is_soft() {
    let gpu = gpu();
    let mut model = Model::new();
    model.plate(Vec3::ZERO, 2.0 * Vec3::Z, 2.0 * Vec3::X, 0);
    model.plate(vec3(-1.0, 1.0, 0.0), Vec3::X, 2.0 * Vec3::Z, 0);
    let mut world = model.world();
    let degrees = 10.0f64;
    world.lights = vec![light(sun(degrees as f32), DVec3::ZERO, Vec3::NEG_Y)];
    let scene = world.flatten();
    let reach = (0.5 * degrees).to_radians().sin();
    for share in [-0.9, -0.5, 0.0, 0.4, 0.8, 1.1] {
        // From here the edge is at this sine from the zenith.
        let sine: f64 = share * reach;
        let x = sine / (1.0 - sine * sine).sqrt();
        let point = GatherPoint::flat(scene.space.enter_point(dvec3(x, 0.0, 0.3)), Vec3::Y);
        // A segment of the disc that the sun is when it is projected onto the floor.
        let share = share.min(1.0);
        let expected = 1.0 - (share.acos() - share * (1.0 - share * share).sqrt()) / PI;
        let found = f64::from(direct(&gpu, &scene, &[point], 4096)[0].x / STRENGTH.x);
        eprintln!("edge at {share}: {found:.4} for {expected:.4}");
        assert!((found - expected).abs() < 5e-3, "edge at {share}: {found} for {expected}");
    }
}

/// An integrating sphere: what walls reflect is the same everywhere, ρΦ / (A (1 - ρ)), wherever the lamp hangs.
#[test]
fn an_integrating_sphere() {
    let gpu = gpu();
    let (count, spread, photons, limit) = sized(&gpu, (512, 512, 1_000_000, 0.01), (32, 64, 200_000, 0.03));
    // Photons meet 16 surfaces at most.
    let albedo = vec3(0.2, 0.4, 0.6);
    for (name, kind, solid_angle) in [
        ("point", point(), 4.0 * PI),
        ("sphere", PunctualKind::Point { radius: 0.1 }, 4.0 * PI),
        (
            "spot",
            spot(20.0, 40.0),
            2.0 * PI * ((1.0 - 20f64.to_radians().cos()) + (20f64.to_radians().cos() - 40f64.to_radians().cos()) / 3.0),
        ),
    ] {
        let mut model = Model::new();
        let material = model.material(albedo, Vec3::ZERO);
        model.sphere(Vec3::ZERO, 1.0, 16, true, material);
        let mut world = model.world();
        world.lights = vec![light(kind, dvec3(0.1, 0.3, -0.2), vec3(0.3, -1.0, 0.2))];
        let scene = world.flatten();
        let area: f64 = (0..scene.mesh.triangles.len()).map(|triangle| f64::from(scene.mesh.area(triangle))).sum();
        let world_area = area * f64::from(scene.space.length_to_world(1.0)).powi(2);
        let expected = albedo / (1.0 - albedo) * STRENGTH * (solid_angle / world_area) as f32;
        let points = points_on(&scene, spread);
        let grid = photon_grid(&scene, &Bvh::new(&scene.mesh), photons);
        let texture = PhotonTexture::upload(&gpu, &grid).unwrap();
        let directions: Vec<Direction> = common::directions(Sequence::Sobol, count);
        let found = common::irradiance(&gather_rays(&gpu, &scene, &texture, &points, &directions));
        let mean = found.iter().sum::<Vec3>() / points.len() as f32 / expected;
        eprintln!("{name}: {mean} of the closed form");
        assert!((mean - 1.0).abs().max_element() < limit, "{name}: {mean} of the closed form");
    }
}

/// Two hundred lamps of many powers over a floor: each sample stands for all of them.
#[test]
fn many_lamps_together() {
    let gpu = gpu();
    let mut model = Model::new();
    model.plate(Vec3::ZERO, 4.0 * Vec3::Z, 4.0 * Vec3::X, 0);
    let mut world = model.world();
    world.lights = (0..200)
        .map(|i| {
            let place = dvec3(f64::from(i % 20) * 0.4 - 3.8, 1.0 + 0.1 * f64::from(i % 7), f64::from(i / 20) * 0.8 - 3.6);
            let kind = if i % 2 == 0 { point() } else { spot(20.0, 50.0) };
            PunctualLight { strength: STRENGTH * (0.2 + (i % 5) as f32), ..light(kind, place, Vec3::NEG_Y) }
        })
        .collect();
    let scene = world.flatten();
    let lights = Lights::new(&scene);
    assert_eq!(lights.count(), 200);
    let points = points_on(&scene, sized(&gpu, 400, 150));
    let expected: Vec<Vec3> = points
        .iter()
        .map(|point| {
            let one = |one: &PunctualLight| {
                let mut alone = scene.clone();
                alone.lights = vec![one.clone()];
                by_twin(&Lights::new(&alone), point, 1)
            };
            scene.lights.iter().map(one).sum()
        })
        .collect();
    let found = direct(&gpu, &scene, &points, 128);
    let errors: Vec<f64> = found.iter().zip(&expected).map(|(found, expected)| f64::from(found.x / expected.x) - 1.0).collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let rms = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
    eprintln!("200 lamps: mean {:.3} %, RMS {:.3} %", 100.0 * mean, 100.0 * rms);
    assert!(mean.abs() < 0.003 && rms < 0.03, "mean {mean}, RMS {rms}");
}

/// Two walls and a floor under a sun alone: pictures and bakes have the same light, and spherical harmonics have its direction.
#[test]
fn pictures_and_bakes_have_the_sun() {
    let gpu = gpu();
    let mut model = Model::new();
    let black = model.material(Vec3::ZERO, Vec3::ZERO);
    let grey = model.material(Vec3::splat(0.5), Vec3::ZERO);
    // Seen from +z.
    model.plate(Vec3::ZERO, 1.5 * Vec3::X, 1.5 * Vec3::Y, grey);
    model.plate(vec3(0.0, 0.0, 0.5), 0.2 * Vec3::Y, 0.2 * Vec3::X, black);
    let mut world = model.world();
    let to_sun = vec3(0.48, 0.36, 0.8);
    world.lights = vec![light(sun(0.0), DVec3::ZERO, -to_sun)];
    let lit = 0.8 * STRENGTH;
    let settings = Settings::default().with(|s| (s.film.size, s.directions.count, s.photons.count) = ([16, 16], 64, 20_000));
    // Softpipe takes long to peel.
    let all = [Pipeline::Raycast, Pipeline::RaycastGl, Pipeline::Fused, Pipeline::Kill];
    for &pipeline in sized(&gpu, &all[..], &all[..2]) {
        let settings = settings.with(|s| s.gather.pipeline = pipeline);
        let mut render = Render::new(&gpu, &world, &settings).unwrap();
        while !render.is_done() {
            render.step().unwrap();
        }
        let rgb = render.picture().rgb().unwrap().map(|samples| samples[16]);
        let found = Vec3::from(rgb) * std::f32::consts::PI / 0.5;
        assert!((found / lit - 1.0).abs().max_element() < 2e-3, "{pipeline:?}: {found} for {lit}");
    }
    let prepared = Prepared::without_glass(&world).unwrap();
    let at = |x: f32, y: f32| GatherPoint::flat(prepared.scene.space.enter_point(vec3(x, y, 0.0)), Vec3::Z);
    // The shadow of the small plate is moved against the sun.
    let points = [at(1.2, 1.2), at(-0.3, -0.225), at(-0.8, 0.7)];
    let what = vec![Quantity::Irradiance, Quantity::Sh];
    let plan = Plan { what, order: 3, gather_bounces: 0, ao_distance: None, radiance_cache: RadianceCache::Photons, memory: 256 };
    let geometry = Geometry::upload(&gpu, &prepared.scene).unwrap();
    let mut bake = Bake::new(&gpu, prepared, geometry, points.to_vec(), &settings, &plan).unwrap();
    while !bake.is_done() {
        bake.step().unwrap();
    }
    let (columns, _) = bake.columns().unwrap();
    let of = |name: String| &columns.iter().find(|column| column.name == name).unwrap().samples;
    for (c, channel) in ["R", "G", "B"].into_iter().enumerate() {
        let irradiance = of(format!("IrradianceDirect.{channel}"));
        for (point, sees) in [1.0, 0.0, 1.0].into_iter().enumerate() {
            assert!(
                (irradiance[point] - sees * lit[c]).abs() < 1e-3 * lit[c],
                "{point}: {} for {}",
                irradiance[point],
                sees * lit[c]
            );
            for (k, basis) in basis(to_sun).into_iter().enumerate().take(9) {
                let (found, expected) = (of(format!("SH.{k:02}.{channel}"))[point], sees * basis * STRENGTH[c]);
                // No surface brings light here: the small plate is black.
                assert!((found - expected).abs() < 1e-4 * STRENGTH[c], "{point}, {k}: {found} for {expected}");
            }
        }
    }
}
