//! Direct light compared with the closed form for irradiance under a polygon of uniform radiance, and with integration over the lamp.

mod common;

use std::f32::consts::PI;

use common::{Model, direct_light_of, form_factor_of_disc, form_factor_of_polygon, gpu, points_on, sized};
use finalgather::Environment;
use finalgather::direct::SampleShare;
use finalgather::points::GatherPoint;
use finalgather::scene::Scene;
use glam::{DVec3, Vec3, dvec3, vec3};

/// Radiance of the lamp.
const RADIANCE: f32 = 2.0;
const SAMPLES: u32 = 512;

/// A model and its lamp, a square of half side 0.25 at height 0.5 that faces down.
fn lit() -> Model {
    lit_by(vec3(0.0, 0.5, 0.0), 0.25 * Vec3::X, 0.25 * Vec3::Z)
}

/// A model and its lamp, a parallelogram.
fn lit_by(center: Vec3, half_u: Vec3, half_v: Vec3) -> Model {
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, Vec3::splat(RADIANCE));
    model.plate(center, half_u, half_v, lamp);
    model
}

/// Irradiance at each point, red, by all samples or a part of them.
fn direct_of(scene: &Scene, points: &[GatherPoint], share: SampleShare) -> Vec<f32> {
    direct_light_of(&gpu(), scene, points, share).into_iter().map(|irradiance| irradiance.x).collect()
}

/// Points on a scene: so many, or on softpipe a quarter of them.
fn spread(scene: &Scene, count: usize) -> Vec<GatherPoint> {
    points_on(scene, sized(&gpu(), count, count / 4))
}

fn direct(scene: &Scene, points: &[GatherPoint]) -> Vec<f32> {
    direct_of(scene, points, SampleShare::whole(SAMPLES))
}

/// Irradiance from the square lamp, the model's first four vertices, all of it above the point's horizon.
fn under_square(scene: &Scene) -> impl Fn(&GatherPoint) -> f32 {
    |point| RADIANCE * PI * form_factor_of_polygon(&scene.mesh.positions[..4], point.position, point.normal) as f32
}

fn sees_whole_lamp(scene: &Scene, point: &GatherPoint) -> bool {
    let above = |corner: &Vec3| (*corner - point.position).dot(point.normal) > 0.0;
    let before = point.position.y < scene.mesh.positions[0].y;
    before && scene.mesh.positions[..4].iter().all(above)
}

/// Fails where the irradiance is more than 0.3 % off. That is what 512 samples of a low-discrepancy sequence leave of the lamp's extent at these
/// distances, two of its sides and more (measured 0.12 % at most). Nothing is in the way.
fn check(name: &str, scene: &Scene, points: &[GatherPoint], closed_form: impl Fn(&GatherPoint) -> f32) {
    assert!(points.len() > 20, "{name}: only {} points", points.len());
    let found = direct(scene, points);
    let errors = points.iter().zip(&found).map(|(point, found)| found / closed_form(point) - 1.0);
    let worst = errors.clone().map(f32::abs).fold(0.0, f32::max);
    eprintln!("{name}: worst of {} points {:.3} %", points.len(), 100.0 * worst);
    for ((point, found), error) in points.iter().zip(&found).zip(errors) {
        assert!(error.abs() < 0.003, "{name}: {found} for {} at {point:?}", closed_form(point));
    }
}

#[test]
fn open_floor_and_walls() {
    let mut model = lit();
    model.plate(vec3(0.0, -0.5, 0.0), Vec3::Z, Vec3::X, 0);
    model.plate(vec3(-1.0, 0.0, 0.0), 0.5 * Vec3::Y, Vec3::Z, 0);
    model.plate(vec3(0.0, 0.0, -1.0), Vec3::X, 0.5 * Vec3::Y, 0);
    let scene = model.finish();
    let points: Vec<_> = spread(&scene, 500).into_iter().filter(|point| sees_whole_lamp(&scene, point)).collect();
    check("floor and walls", &scene, &points, under_square(&scene));
}

/// A lamp of 32 triangles, which the samples share in proportion to area.
#[test]
fn disc_lamp() {
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, Vec3::splat(RADIANCE));
    model.disc(vec3(0.1, 0.5, 0.0), 0.3, Vec3::NEG_Y, 32, lamp);
    model.plate(vec3(0.0, -0.5, 0.0), Vec3::Z, Vec3::X, 0);
    let scene = model.finish();
    let (center, area) = (scene.mesh.positions[0], (0..32).map(|triangle| scene.mesh.area(triangle)).sum::<f32>());
    let points: Vec<_> = spread(&scene, 500).into_iter().filter(|point| point.position.y < center.y - 0.1).collect();
    check("disc", &scene, &points, |point| {
        RADIANCE * PI * form_factor_of_disc(center - point.position, f64::from(area / PI), point.normal) as f32
    });
}

#[test]
fn a_surface_does_not_shadow_itself() {
    // A convex ball is before nothing that it faces; its faces meet at all angles.
    let mut model = lit();
    model.sphere(vec3(0.1, -0.5, 0.2), 0.4, 16, false, 0);
    let scene = model.finish();
    let points: Vec<_> = spread(&scene, 2000).into_iter().filter(|point| sees_whole_lamp(&scene, point)).collect();
    check("ball", &scene, &points, under_square(&scene));
}

#[test]
fn full_shadow_is_black_and_ends_where_it_should() {
    // The lamp is 1 above the floor, the occluder half way: full shadow where |x| < 0.35, none where |x| > 0.85, likewise z.
    let mut model = lit();
    model.plate(Vec3::ZERO, 0.3 * Vec3::X, 0.3 * Vec3::Z, 0);
    model.plate(vec3(0.0, -0.5, 0.0), 1.2 * Vec3::Z, 1.2 * Vec3::X, 0);
    let scene = model.finish();
    // In unit space the lamp's half side of 0.25 has another length.
    let scale = (scene.mesh.positions[1] - scene.mesh.positions[0]).length() / 0.5;
    let floor: Vec<_> = spread(&scene, 4000).into_iter().filter(|point| point.normal.y > 0.9).collect();
    let reach = |point: &GatherPoint| (point.position.x.abs().max(point.position.z.abs())) / scale;
    let shadowed: Vec<_> = floor.iter().copied().filter(|point| reach(point) < 0.3499).collect();
    assert!(shadowed.len() > 20);
    assert!(direct(&scene, &shadowed).iter().all(|&irradiance| irradiance == 0.0));
    let clear: Vec<_> = floor.iter().copied().filter(|point| reach(point) > 0.8501).collect();
    check("beyond the shadow", &scene, &clear, under_square(&scene));
}

/// A box between two corners, in the model's own coordinates.
type Block = [DVec3; 2];

/// Whether the way from `a` to `b` passes through the box.
fn blocks([low, high]: Block, a: DVec3, b: DVec3) -> bool {
    let way = b - a;
    let (near, far) = ((low - a) / way, (high - a) / way);
    let enter = near.min(far).max_element().max(0.0);
    enter < near.max(far).min_element().min(1.0)
}

fn add(model: &mut Model, [low, high]: Block) {
    model.cuboid(low.midpoint(high).as_vec3(), (0.5 * (high - low)).as_vec3(), 0.0, false, 0);
}

/// Irradiance from the lamp, the model's first four vertices, by the midpoints of 128 × 128 parts of it, among `boxes`.
fn by_integration(scene: &Scene, point: &GatherPoint, boxes: &[Block]) -> f64 {
    const PARTS: u32 = 128;
    let world = |position: Vec3| scene.space.to_world(position);
    let [a, b, _, d] = [0, 1, 2, 3].map(|vertex| world(scene.mesh.positions[vertex]));
    let (u, v) = (b - a, d - a);
    let at = world(point.position + 1e-5 * point.normal);
    let mut sum = 0.0;
    for (i, j) in (0..PARTS).flat_map(|i| (0..PARTS).map(move |j| (i, j))) {
        let [s, t] = [i, j].map(|part| (f64::from(part) + 0.5) / f64::from(PARTS));
        let way = a + s * u + t * v - at;
        let receives = point.normal.as_dvec3().dot(way).max(0.0) * -u.cross(v).dot(way).min(0.0) / way.length_squared().powi(2);
        if receives > 0.0 && !boxes.iter().any(|&block| blocks(block, at, at + way)) {
            sum += receives;
        }
    }
    f64::from(RADIANCE) * sum / f64::from(PARTS * PARTS)
}

/// Fails where samples and integration differ by more than `limit` of what an open lamp gives at the brightest point, or where the sums over all
/// points differ by more than 0.2 %.
fn check_shadows(name: &str, scene: &Scene, points: &[GatherPoint], boxes: &[Block], limit: f64) {
    // Close to the lamp its parts are too coarse.
    let center = 0.5 * (scene.mesh.positions[0] + scene.mesh.positions[2]);
    let far = |point: &&GatherPoint| scene.space.length_to_world(point.position.distance(center)) > 0.45;
    let points = &points.iter().filter(far).copied().collect::<Vec<_>>();
    let found = direct(scene, points);
    let expected: Vec<f64> = points.iter().map(|point| by_integration(scene, point, boxes)).collect();
    let open: Vec<f64> = points.iter().map(|point| by_integration(scene, point, &[])).collect();
    let brightest = open.iter().copied().fold(0.0, f64::max);
    let partial = open.iter().zip(&expected).filter(|&(&open, part)| (0.02 * open..0.98 * open).contains(part));
    let (partial, lit) = (partial.count(), expected.iter().filter(|&&irradiance| irradiance > 0.0).count());
    let errors = found.iter().zip(&expected).map(|(found, expected)| f64::from(*found) - expected);
    let worst = errors.clone().map(f64::abs).fold(0.0, f64::max) / brightest;
    let bias = errors.sum::<f64>() / expected.iter().sum::<f64>();
    let leaks = found.iter().zip(&expected).filter(|(found, expected)| **expected == 0.0 && **found > 0.0).count();
    eprintln!(
        "{name}: {} points, {lit} lit, {partial} in part: worst {:.2} %, bias {:+.3} %, {leaks} leaks",
        points.len(),
        100.0 * worst,
        100.0 * bias
    );
    assert!(worst < limit && bias.abs() < 0.002 && leaks == 0, "{name}");
    assert!(lit < points.len() && partial > sized(&gpu(), 50, 12), "{name}: no shadow to test");
}

/// The lamp lies in the very plane of the ceiling, which lies under a slab. Below, it is as bright as if it hung there alone. Above, all is dark.
#[test]
fn a_lamp_flush_with_a_slab() {
    let mut model = lit();
    add(&mut model, [dvec3(-1.0, 0.5, -1.0), dvec3(1.0, 0.6, 1.0)]);
    model.plate(vec3(0.0, -0.5, 0.0), Vec3::Z, Vec3::X, 0);
    // The ceiling of the storey above.
    model.plate(vec3(0.0, 1.5, 0.0), 1.5 * Vec3::X, 1.5 * Vec3::Z, 0);
    let scene = model.finish();
    let level = scene.mesh.positions[0].y;
    let (above, below): (Vec<_>, Vec<_>) = spread(&scene, 4000).into_iter().partition(|point| point.position.y > level - 1e-5);
    assert!(above.len() > 250);
    assert_eq!(direct(&scene, &above).iter().filter(|&&irradiance| irradiance != 0.0).count(), 0);
    let below: Vec<_> = below.into_iter().filter(|point| sees_whole_lamp(&scene, point)).collect();
    check("below a flush lamp", &scene, &below, under_square(&scene));
}

/// An upright lamp whose upper half is in a slab, and whose lower half hangs out of it.
#[test]
fn a_lamp_half_in_a_slab() {
    let mut model = lit_by(vec3(0.0, 0.5, 0.0), 0.25 * Vec3::Y, 0.25 * Vec3::Z);
    let slab = [dvec3(-1.0, 0.5, -1.0), dvec3(1.0, 1.0, 1.0)];
    add(&mut model, slab);
    model.plate(vec3(0.0, -0.5, 0.0), Vec3::Z, Vec3::X, 0);
    model.plate(vec3(1.2, 0.5, 0.0), Vec3::Z, Vec3::Y, 0);
    model.plate(vec3(0.0, 1.5, 0.0), 1.5 * Vec3::X, 1.5 * Vec3::Z, 0);
    let scene = model.finish();
    check_shadows("half in a slab", &scene, &points_on(&scene, 4000), &[slab], 0.02);
}

/// A lamp at the bottom of a shaft through a slab shines out of it, and nowhere else.
#[test]
fn a_lamp_let_into_a_slab() {
    let mut model = lit();
    let slab = |low: [f64; 2], high: [f64; 2]| [dvec3(low[0], 0.3, low[1]), dvec3(high[0], 0.6, high[1])];
    let lid = [dvec3(-0.25, 0.5, -0.25), dvec3(0.25, 0.6, 0.25)];
    let boxes = [
        slab([-1.0, -1.0], [-0.25, 1.0]),
        slab([0.25, -1.0], [1.0, 1.0]),
        slab([-0.25, -1.0], [0.25, -0.25]),
        slab([-0.25, 0.25], [0.25, 1.0]),
    ];
    [&boxes[..], &[lid]].concat().into_iter().for_each(|block| add(&mut model, block));
    model.plate(vec3(0.0, -0.5, 0.0), Vec3::Z, Vec3::X, 0);
    model.plate(vec3(0.0, 1.5, 0.0), 1.5 * Vec3::X, 1.5 * Vec3::Z, 0);
    let scene = model.finish();
    // Points on what the boxes have in common are in no room.
    let inside = |point: &GatherPoint| {
        let at = scene.space.to_world(point.position + 1e-4 * point.normal);
        boxes.iter().any(|[low, high]| at.cmpge(*low).all() && at.cmple(*high).all())
    };
    let points: Vec<_> = spread(&scene, 4000).into_iter().filter(|point| !inside(point)).collect();
    check_shadows("let into a slab", &scene, &points, &boxes, 0.02);
}

/// A leg much thinner than the lamp: its shadow is soft all around, and begins at its foot.
#[test]
fn the_leg_of_a_table() {
    let mut model = lit();
    let leg = [dvec3(0.2, -0.5, 0.1), dvec3(0.22, 0.0, 0.12)];
    let top = [dvec3(0.1, 0.0, 0.0), dvec3(0.6, 0.02, 0.5)];
    add(&mut model, leg);
    add(&mut model, top);
    model.plate(vec3(0.15, -0.5, 0.05), 0.3 * Vec3::Z, 0.3 * Vec3::X, 0);
    let scene = model.finish();
    let points: Vec<_> =
        spread(&scene, 8000).into_iter().filter(|point| point.position.y < scene.mesh.positions[0].y - 1.0).collect();
    check_shadows("leg of a table", &scene, &points, &[leg, top], 0.02);
}

/// The sun shines from +x, half way up, and a wall of no thickness stands in its way.
#[test]
fn a_thin_wall_hides_the_sun() {
    let mut texels = vec![Vec3::ONE; 256 * 128];
    texels[32 * 256 + 192] = Vec3::splat(1e5);
    let mut model = Model::new();
    model.plate(Vec3::ZERO, Vec3::Z, Vec3::X, 0);
    model.plate(vec3(0.0, 0.25, 0.0), 0.25 * Vec3::Y, 0.9 * Vec3::Z, 0);
    let mut scene = model.finish();
    scene.environment = Some(Environment::from_texels([256, 128], texels).unwrap());
    let sun = scene.environment.as_ref().unwrap().bright_power() as f32 / 3.0;
    let at = |x: f32, y: f32, z: f32, normal: Vec3| GatherPoint::flat(scene.space.enter_point(vec3(x, y, z)), normal);
    let spread = |low: f32, high: f32| (0..40).map(move |i| low + (high - low) * i as f32 / 39.0);
    // The sun is 2.8 degrees wide where it is not black.
    let floor = spread(-0.47, -1e-4).map(|x| at(x, 0.0, 0.7 * (9.0 * x).sin(), Vec3::Y));
    let dark: Vec<_> = floor.chain(spread(1e-4, 0.49).map(|y| at(0.0, y, y, Vec3::NEG_X))).collect();
    assert!(direct(&scene, &dark).iter().all(|&irradiance| irradiance == 0.0));
    let floor = spread(-0.55, -0.9).chain(spread(1e-4, 0.9)).map(|x| at(x, 0.0, 0.7 * (9.0 * x).sin(), Vec3::Y));
    let lit: Vec<_> = floor.chain(spread(1e-4, 0.49).map(|y| at(0.0, y, y, Vec3::X))).collect();
    // The sun's middle is half a texel from half way: 0.5 % more on the wall than on the floor.
    let expected = sun * 0.5_f32.sqrt();
    for (point, found) in lit.iter().zip(direct(&scene, &lit)) {
        assert!((found / expected - 1.0).abs() < 0.015, "{found} for {expected} at {point:?}");
    }
}

/// The parts of the samples have the mean of the whole, and neighbours have different samples.
#[test]
fn parts_of_the_samples_are_the_whole() {
    let mut model = lit();
    model.plate(vec3(0.1, 0.0, 0.0), 0.2 * Vec3::X, 0.2 * Vec3::Z, 0);
    model.plate(vec3(0.0, -0.5, 0.0), Vec3::Z, Vec3::X, 0);
    let scene = model.finish();
    let points = vec![GatherPoint::flat(points_on(&scene, 500).last().unwrap().position, Vec3::Y); 16];
    let whole = direct_of(&scene, &points, SampleShare { samples: 64, part: 0, parts: 1 });
    let mut sums = vec![0.0; 16];
    for part in 0..8 {
        let found = direct_of(&scene, &points, SampleShare { samples: 64, part, parts: 8 });
        sums.iter_mut().zip(found).for_each(|(sum, value)| *sum += value / 8.0);
    }
    assert!(whole.iter().zip(&sums).all(|(whole, sum)| (whole / sum - 1.0).abs() < 1e-5), "{whole:?} {sums:?}");
    // A list has four points of a row in each square.
    assert!((0..16).all(|i| (whole[i] == whole[i % 4]) && (i % 4 == 0 || whole[i] != whole[0])), "{whole:?}");
}

/// Many lamps in a closed room, with and without a sun outside, against the closed form of each lamp.
#[test]
fn many_lamps_and_a_sun_that_walls_hide() {
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, Vec3::splat(RADIANCE));
    let centers: Vec<Vec3> = (0..16).map(|i| vec3((i % 4) as f32 * 0.5 - 0.75, 0.9, (i / 4) as f32 * 0.5 - 0.75)).collect();
    centers.iter().for_each(|&center| model.plate(center, 0.06 * Vec3::X, 0.06 * Vec3::Z, lamp));
    model.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, 0);
    let mut scene = model.finish();
    let points: Vec<_> =
        spread(&scene, 1000).into_iter().filter(|point| point.normal.y > 0.9 && point.position.y < 0.0).collect();
    let corners = |lamp: usize| &scene.mesh.positions[4 * lamp..4 * lamp + 4];
    let of_lamps = |point: &GatherPoint| -> f64 {
        (0..16).map(|lamp| form_factor_of_polygon(corners(lamp), point.position, point.normal)).sum::<f64>()
            * f64::from(RADIANCE * PI)
    };
    let expected: Vec<f64> = points.iter().map(of_lamps).collect();
    let mut sun = vec![Vec3::ZERO; 64 * 32];
    sun[6 * 64 + 20] = Vec3::splat(1e4);
    for sky in [None, Some(Environment::from_texels([64, 32], sun).unwrap())] {
        let has_sun = sky.is_some();
        scene.environment = sky;
        let found = direct(&scene, &points);
        let errors: Vec<f64> = found.iter().zip(&expected).map(|(&found, expected)| f64::from(found) / expected - 1.0).collect();
        let rms = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
        eprintln!("{} points, sun {has_sun}: RMS {:.3} %", points.len(), 100.0 * rms);
        assert!(points.len() > 25 && rms < 0.01, "with a sun {has_sun}: {rms}");
    }
}
