//! Direct light compared with the closed form for irradiance under a polygon of uniform radiance.

mod common;

use std::f32::consts::PI;

use common::{Model, form_factor_of_disc, form_factor_of_polygon, gpu, points_on, sized};
use finalgather::direct::Direct;
use finalgather::geometry::Geometry;
use finalgather::points::{Accumulator, GatherPoint, PointList};
use finalgather::scene::{Lights, Scene};
use glam::{Vec3, vec3};

/// Radiance of the lamp.
const RADIANCE: f32 = 2.0;

/// A model and its lamp, a square of half side 0.25 at height 0.5 that faces down.
fn lit() -> Model {
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, Vec3::splat(RADIANCE));
    model.plate(vec3(0.0, 0.5, 0.0), 0.25 * Vec3::X, 0.25 * Vec3::Z, lamp);
    model
}

/// Irradiance at each point by shadow maps.
fn direct(scene: &Scene, points: &[GatherPoint]) -> Vec<f32> {
    let gpu = gpu();
    let (samples, size) = sized(&gpu, (512, 256), (512, 64));
    let geometry = Geometry::upload(&gpu, scene).unwrap();
    let lights = Lights::new(scene);
    let list = PointList::upload(&gpu, points).unwrap();
    let sums = Accumulator::new(&gpu, list.points().size()).unwrap();
    let direct = Direct::new(&gpu, size, 0).unwrap();
    sums.clear();
    for sample in 0..samples {
        direct.add(&geometry, &lights, sample, list.points(), &sums);
    }
    gpu.check("direct light").unwrap();
    list.in_order(sums.read()).into_iter().map(|sum| sum.x / samples as f32).collect()
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

/// Fails where the irradiance is more than 1 % off. That is what 512 samples of a low-discrepancy sequence leave of the lamp's extent at these
/// distances, two of its sides and more; the shadow map adds nothing, for nothing is in the way.
fn check(name: &str, scene: &Scene, points: &[GatherPoint], closed_form: impl Fn(&GatherPoint) -> f32) {
    assert!(points.len() > 20, "{name}: only {} points", points.len());
    let found = direct(scene, points);
    let errors = points.iter().zip(&found).map(|(point, found)| found / closed_form(point) - 1.0);
    let worst = errors.clone().map(f32::abs).fold(0.0, f32::max);
    eprintln!("{name}: worst of {} points {:.3} %", points.len(), 100.0 * worst);
    for ((point, found), error) in points.iter().zip(&found).zip(errors) {
        assert!(error.abs() < 0.01, "{name}: {found} for {} at {point:?}", closed_form(point));
    }
}

#[test]
fn open_floor_and_walls() {
    let mut model = lit();
    model.plate(vec3(0.0, -0.5, 0.0), Vec3::Z, Vec3::X, 0);
    model.plate(vec3(-1.0, 0.0, 0.0), 0.5 * Vec3::Y, Vec3::Z, 0);
    model.plate(vec3(0.0, 0.0, -1.0), Vec3::X, 0.5 * Vec3::Y, 0);
    let scene = model.finish();
    let points: Vec<_> = points_on(&scene, 500).into_iter().filter(|point| sees_whole_lamp(&scene, point)).collect();
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
    let points: Vec<_> = points_on(&scene, 500).into_iter().filter(|point| point.position.y < center.y - 0.1).collect();
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
    let points: Vec<_> = points_on(&scene, 2000).into_iter().filter(|point| sees_whole_lamp(&scene, point)).collect();
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
    let floor: Vec<_> = points_on(&scene, 4000).into_iter().filter(|point| point.normal.y > 0.9).collect();
    let reach = |point: &GatherPoint| (point.position.x.abs().max(point.position.z.abs())) / scale;
    // Half a texel of the map, 1/128 of the distance at most, is where the edge may lie instead.
    let shadowed: Vec<_> = floor.iter().copied().filter(|point| reach(point) < 0.33).collect();
    assert!(shadowed.len() > 20);
    assert!(direct(&scene, &shadowed).iter().all(|&irradiance| irradiance == 0.0));
    let clear: Vec<_> = floor.iter().copied().filter(|point| reach(point) > 0.88).collect();
    check("beyond the shadow", &scene, &clear, under_square(&scene));
}
