//! Lamps with pictures: their direct light against closed forms, their photons, and what pictures and bakes show of them.

mod common;

use std::f32::consts::PI;

use common::{Model, direct_light, form_factor_of_polygon, gpu, sized};
use finalgather::bake::{Bake, Plan, RadianceCache};
use finalgather::geometry::Geometry;
use finalgather::points::{CameraPoints, EyeRays, GatherPoint};
use finalgather::prepared::Prepared;
use finalgather::quantity::Quantity;
use finalgather::random::Recurrence;
use finalgather::scene::{Bvh, Camera, ImageTexture, Lights, Sampler, Scene};
use finalgather::settings::{Pipeline, Settings};
use glam::{Vec2, Vec3, Vec4, vec3};

/// Radiance where a picture is white.
const RADIANCE: Vec3 = vec3(2.0, 1.0, 0.5);

/// A screen of half side 0.5 at height 0.5, which faces the floor at -0.5 with a picture that is repeated so often.
fn screen(size: [u32; 2], white: impl Fn(u32, u32) -> bool, repeats: f32, sampler: Sampler) -> Scene {
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, RADIANCE);
    model.plate(vec3(0.0, 0.5, 0.0), 0.5 * Vec3::X, 0.5 * Vec3::Z, lamp);
    // u runs along x, and v along z.
    for (uv, place) in model.scene.mesh.uvs.iter_mut().zip([Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]) {
        *uv = repeats * place;
    }
    model.plate(vec3(0.0, -0.5, 0.0), Vec3::Z, Vec3::X, 0);
    let [width, height] = size;
    let place = (0..width * height).map(|texel| (texel % width, texel / width));
    let texels = place.map(|(x, y)| if white(x, y) { [255; 4] } else { [0, 0, 0, 255] }).collect();
    model.scene.textures.push(ImageTexture { width, height, texels, sampler });
    model.scene.materials[lamp as usize].emission_texture = Some(0);
    model.finish()
}

/// The nearest texel alone, so that a lit part of a picture is a rectangle.
fn nearest() -> Sampler {
    Sampler { nearest: true, ..Sampler::default() }
}

/// Points of the floor, and one on a wall that sees the screen.
fn points(scene: &Scene) -> Vec<GatherPoint> {
    let at = |x: f32, y: f32, z: f32, normal: Vec3| GatherPoint::flat(scene.space.enter_point(vec3(x, y, z)), normal);
    let floor = (0..25).map(|i| at(0.4 * (i % 5) as f32 - 0.8, -0.5, 0.4 * (i / 5) as f32 - 0.8, Vec3::Y));
    floor.chain([at(-0.9, 0.0, 0.1, Vec3::X)]).collect()
}

/// Irradiance from the parts of the screen between these coordinates, each [low u, low v, high u, high v].
fn closed_form(scene: &Scene, point: &GatherPoint, parts: &[[f32; 4]]) -> Vec3 {
    let [a, b, _, d] = [0, 1, 2, 3].map(|vertex| scene.mesh.positions[vertex]);
    let at = |u: f32, v: f32| a + u * (b - a) + v * (d - a);
    let factor = |&[u, v, s, t]: &[f32; 4]| {
        form_factor_of_polygon(&[at(u, v), at(s, v), at(s, t), at(u, t)], point.position, point.normal) as f32
    };
    RADIANCE * PI * parts.iter().map(factor).sum::<f32>()
}

/// Mean flux of photons, and the mean of what they bring.
fn flux(scene: &Scene) -> Vec3 {
    let (lights, numbers) = (Lights::new(scene), Recurrence::new(7));
    const PHOTONS: u64 = 1 << 18;
    let sum: glam::DVec3 = (0..PHOTONS).map(|photon| lights.emit(numbers.point(photon)).1.as_dvec3()).sum();
    (sum / PHOTONS as f64).as_vec3()
}

fn check(name: &str, scene: &Scene, parts: &[[f32; 4]], most: f32) {
    let points = points(scene);
    let (mut worst, mut sums) = (0.0_f32, [Vec3::ZERO; 2]);
    for (point, found) in points.iter().zip(direct_light(scene, &points, 512)) {
        let expected = closed_form(scene, point, parts);
        worst = worst.max((found / expected - 1.0).abs().max_element());
        sums = [sums[0] + found, sums[1] + expected];
    }
    let bias = (sums[0] / sums[1] - 1.0).abs().max_element();
    let area: f32 = parts.iter().map(|[u, v, s, t]| (s - u) * (t - v)).sum::<f32>() * scene.mesh.area(0) * 2.0;
    let lost = (flux(scene) / (RADIANCE * PI * area) - 1.0).abs().max_element();
    let pieces = Lights::new(scene).pieces();
    eprintln!("{name}: {pieces} pieces, worst {:.3} %, bias {:.3} %, flux {:.3} %", 100.0 * worst, 100.0 * bias, 100.0 * lost);
    assert!(worst < most && bias < 0.002 && lost < 0.002, "{name}");
}

#[test]
fn half_of_a_screen() {
    let half = |sampler, repeats| screen([64, 64], |x, _| x < 32, repeats, sampler);
    check("half a screen", &half(nearest(), 1.0), &[[0.0, 0.0, 0.5, 1.0]], 0.004);
    let stripes = [0.0, 1.0, 2.0].map(|stripe| [stripe / 3.0, 0.0, (stripe + 0.5) / 3.0, 1.0]);
    check("three times", &half(nearest(), 3.0), &stripes, 0.004);
}

#[test]
fn one_pixel_of_a_screen() {
    // Row 0 is at v = 1.
    let (x, v) = (20.0 / 64.0, 1.0 - 11.0 / 64.0);
    let scene = screen([64, 64], |x, y| (x, y) == (20, 10), 1.0, nearest());
    check("a pixel", &scene, &[[x, v, x + 1.0 / 64.0, v + 1.0 / 64.0]], 0.004);
}

/// Interpolation spreads a texel over its neighbours, and keeps its light.
#[test]
fn an_interpolated_pixel() {
    let scene = screen([16, 16], |x, y| (x, y) == (5, 10), 1.0, Sampler::default());
    let lost = (flux(&scene) / (RADIANCE * PI * 2.0 * scene.mesh.area(0) / 256.0) - 1.0).abs().max_element();
    assert!(lost < 0.002, "{lost}");
}

/// Far more texels than pieces.
#[test]
fn a_picture_of_a_hundred_times() {
    let scene = screen([8, 8], |x, y| (x + y) % 2 == 0, 100.0, nearest());
    assert!(Lights::new(&scene).pieces() < 10_000);
    let even = [[0.0, 0.0, 1.0, 1.0]];
    let points = points(&scene);
    let sum = |values: &mut dyn Iterator<Item = Vec3>| values.sum::<Vec3>();
    let found = sum(&mut direct_light(&scene, &points, 512).into_iter());
    let expected = sum(&mut points.iter().map(|point| 0.5 * closed_form(&scene, point, &even)));
    let bias = (found / expected - 1.0).abs().max_element();
    assert!(bias < 0.01, "{bias}");
}

/// What is drawn and what eye rays see.
#[test]
fn pictures_show_the_picture() {
    const SIZE: [u32; 2] = [96, 72];
    let mut scene = screen([8, 8], |x, y| (x ^ y) & 2 == 0, 1.0, Sampler::default());
    let at = |x: f32, y: f32, z: f32| scene.space.enter_point(vec3(x, y, z));
    let (eye, target) = (at(0.1, -0.4, 0.2), at(0.0, 0.5, 0.0));
    scene.camera = Some(Camera { eye, target, up: Vec3::Z, fov_y_degrees: 70.0, lens: None });
    let (gpu, bvh, camera) = (gpu(), Bvh::new(&scene.mesh), &scene.camera(SIZE));
    let geometry = Geometry::upload(&gpu, &scene).unwrap();
    let offset = Vec2::splat(0.5);
    let mut drawn = CameraPoints::new(&gpu, SIZE).unwrap().see(&geometry, camera, offset, 0);
    drawn.add_pictures_of_emission(&scene);
    let cast = EyeRays { scene: &scene, bvh: &bvh, camera, size: SIZE, seed: 0, ground: None }.see(offset, 0);
    let apart = |(a, b): (&Vec4, &Vec4)| (*a - *b).truncate().length() > 1e-3;
    let off = drawn.emission.iter().zip(&cast.emission).filter(|pair| apart(*pair)).count();
    let emission = || drawn.emission.iter().map(|emission| emission.truncate());
    let [white, black, between] = [
        emission().filter(|emission| emission.distance(RADIANCE) < 1e-5).count(),
        emission().zip(&drawn.albedo).filter(|(emission, albedo)| *emission == Vec3::ZERO && albedo.w > 0.0).count(),
        emission().filter(|emission| *emission != Vec3::ZERO && emission.distance(RADIANCE) > 0.1).count(),
    ];
    eprintln!("{off} pixels off; {white} white, {black} black, {between} between");
    assert!(off <= 8 && white > 100 && black > 100 && between > 500);
}

/// Spherical harmonics hold the light of lamps that a point sees.
#[test]
fn harmonics_hold_the_picture() {
    const PARTS: u32 = 64;
    let scene = screen([64, 64], |x, _| x < 32, 1.0, nearest());
    let point = points(&scene)[12];
    let [a, b, _, d] = [0, 1, 2, 3].map(|vertex| scene.mesh.positions[vertex]);
    let part = |i: u32, j: u32| {
        let [u, v] = [0.5 * (i as f32 + 0.5) / PARTS as f32, (j as f32 + 0.5) / PARTS as f32];
        let way = a + u * (b - a) + v * (d - a) - point.position;
        way.y / way.length().powi(3)
    };
    let sum: f32 = (0..PARTS).flat_map(|i| (0..PARTS).map(move |j| part(i, j))).sum();
    let solid_angle = sum / (PARTS * PARTS) as f32 * scene.mesh.area(0);
    let gpu = gpu();
    let plan = Plan {
        what: vec![Quantity::Sh],
        order: 1,
        gather_bounces: 0,
        ao_distance: None,
        radiance_cache: RadianceCache::Photons,
        memory: 64,
    };
    let directions = sized(&gpu, 8192, 1024);
    let settings = Settings::default().with(|s| {
        (s.directions.count, s.photons.count, s.gather.pipeline) = (directions, 1000, Pipeline::RaycastGl);
    });
    let geometry = Geometry::upload(&gpu, &scene).unwrap();
    let mut bake = Bake::new(&gpu, Prepared::of(scene), geometry, vec![point], &settings, &plan).unwrap();
    while !bake.is_done() {
        bake.step().unwrap();
    }
    let (columns, _) = bake.columns().unwrap();
    for (column, radiance) in columns.iter().zip(RADIANCE.to_array()) {
        let expected = radiance * solid_angle * (0.25 / PI).sqrt();
        let error = column.samples[0] / expected - 1.0;
        eprintln!("{}: {:+.2} %", column.name, 100.0 * error);
        assert!(error.abs() < 0.03, "{}: {} for {expected}", column.name, column.samples[0]);
    }
}
