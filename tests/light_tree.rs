//! Many lamps: the tree by which a point chooses one, on the CPU and in direct light.

mod common;

use std::f32::consts::TAU;

use common::{Difference, Model, direct_light, gpu, points_on, sized};
use finalgather::points::GatherPoint;
use finalgather::random::{Random, Recurrence};
use finalgather::scene::{Bvh, ImageTexture, Lamp, Lights, RAY_OFFSET, Sampler, Scene};
use glam::{Vec2, Vec3, vec3};

/// A hall of box lamps of several sizes and colours, with blocks on its floor, in unit space.
fn hall(lamps: u32) -> Scene {
    let mut model = Model::new();
    model.cuboid(Vec3::ZERO, vec3(10.0, 2.0, 10.0), 0.0, true, 0);
    let mut random = Random::new(3, 0);
    let colors = [vec3(40.0, 30.0, 20.0), vec3(5.0, 5.0, 60.0), Vec3::splat(20.0)];
    let materials = colors.map(|color| model.material(Vec3::splat(0.5), color));
    for lamp in 0..lamps {
        let at = vec3(19.0 * random.uniform() - 9.5, 0.8 + random.uniform(), 19.0 * random.uniform() - 9.5);
        let half = vec3(0.1, 0.02, 0.05) + 0.1 * random.uniform();
        model.cuboid(at, half, TAU * random.uniform(), false, materials[lamp as usize % 3]);
        if lamp % 4 == 0 {
            model.cuboid(vec3(at.x, -1.5, at.z), vec3(0.4, 0.5, 0.2), TAU * random.uniform(), false, 0);
        }
    }
    model.finish()
}

fn receivers(scene: &Scene, count: usize) -> Vec<GatherPoint> {
    let lamp = |point: &GatherPoint| point.position.y > scene.space.enter_point(vec3(0.0, 0.7, 0.0)).y;
    points_on(scene, count).into_iter().filter(|point| !lamp(point)).collect()
}

/// The irradiance that a sample brings, without shadows.
fn light(lights: &Lights, point: &GatherPoint, numbers: [f32; 2]) -> Vec3 {
    lights.sample_tree(point.position, point.normal, numbers).map_or(Vec3::ZERO, |sample| {
        let (direction, _, irradiance) = sample.seen_from(point.position);
        irradiance * point.normal.dot(direction).max(0.0)
    })
}

/// The same from all of a lamp, by the middles of its parts.
fn whole(lamp: &Lamp, point: &GatherPoint) -> Vec3 {
    const PARTS: u32 = 8;
    let [a, b, c] = lamp.corners;
    let at = |i: u32, j: u32, shift: f32| {
        let way = a + (i as f32 + shift) / PARTS as f32 * (b - a) + (j as f32 + shift) / PARTS as f32 * (c - a) - point.position;
        point.normal.dot(way).max(0.0) * -lamp.normal.dot(way).min(0.0) / way.length_squared().powi(2)
    };
    let up = (0..PARTS).flat_map(|i| (0..PARTS - i).map(move |j| (i, j))).map(|(i, j)| at(i, j, 1.0 / 3.0));
    let down = (0..PARTS).flat_map(|i| (1..PARTS - i).map(move |j| (i, j - 1))).map(|(i, j)| at(i, j, 2.0 / 3.0));
    lamp.flux * (up.sum::<f32>() + down.sum::<f32>()) / (PARTS * PARTS) as f32
}

#[test]
fn probabilities_are_those_of_a_descent() {
    const NUMBERS: u32 = 1 << 16;
    let scene = hall(200);
    let lights = Lights::new(&scene);
    let (tree, lamps) = (lights.tree().unwrap(), lights.lamps().count());
    assert_eq!(lamps, 200 * 12);
    for point in receivers(&scene, 20) {
        let (mut counts, mut chances) = (vec![0; lamps], vec![0.0; lamps]);
        let mut rests = 0.0;
        for number in 0..NUMBERS {
            let number = (number as f32 + 0.5) / NUMBERS as f32;
            let Some((lamp, probability, rest)) = tree.descend(point.position, point.normal, number) else { continue };
            assert!((0.0..1.0).contains(&rest) && probability > 0.0);
            counts[lamp] += 1;
            chances[lamp] = probability;
            rests += rest;
        }
        // A lamp has an interval of numbers as long as its probability. Those of less than a number may have none.
        for (count, chance) in counts.iter().zip(&chances) {
            assert!((*count as f32 - chance * NUMBERS as f32).abs() < 2.5, "{count} of {NUMBERS} for {chance}");
        }
        let found: u32 = counts.iter().sum();
        assert!((chances.iter().sum::<f32>() - found as f32 / NUMBERS as f32).abs() < 2e-3);
        assert!((rests / found as f32 - 0.5).abs() < 0.02);
    }
}

#[test]
fn a_descent_ends_nowhere_only_where_nothing_shines() {
    let scene = hall(200);
    let lights = Lights::new(&scene);
    for point in receivers(&scene, 60) {
        let all: Vec3 = lights.lamps().map(|lamp| whole(&lamp, &point)).sum();
        let numbers = Recurrence::<2>::new(5);
        const SAMPLES: u64 = 1 << 14;
        let sum: Vec3 = (0..SAMPLES).map(|sample| light(&lights, &point, numbers.point(sample))).sum();
        let mean = sum / SAMPLES as f32;
        assert!((mean - all).abs().max_element() < 0.02 * all.max_element().max(1e-6), "{mean} of {all} at {point:?}");
    }
}

#[test]
fn a_sum_over_all_points_is_that_of_all_lamps() {
    let scene = hall(200);
    let lights = Lights::new(&scene);
    let points = receivers(&scene, 400);
    let all: Vec3 = points.iter().flat_map(|point| lights.lamps().map(move |lamp| whole(&lamp, point))).sum();
    let numbers = Recurrence::<2>::new(6);
    let mean = |point: &GatherPoint| (0..4096).map(|sample| light(&lights, point, numbers.point(sample))).sum::<Vec3>() / 4096.0;
    let found: Vec3 = points.iter().map(mean).sum();
    let error = (found / all - 1.0).abs().max_element();
    assert!(error < 0.002, "{found} of {all}: {error}");
}

/// The same light by samples by power on the CPU, with its shadow rays.
fn by_power(scene: &Scene, points: &[GatherPoint], samples: u64) -> Vec<Vec3> {
    let (lights, bvh) = (Lights::new(scene), Bvh::new(&scene.mesh));
    let at = |point: &GatherPoint, numbers: [f32; 2]| {
        let origin = point.position + RAY_OFFSET * point.normal;
        let (direction, reach, irradiance) = lights.sample(numbers).seen_from(origin);
        let received = irradiance * point.normal.dot(direction).max(0.0);
        let hidden = || bvh.nearest(origin, direction, None).is_some_and(|hit| hit.distance < reach);
        if received == Vec3::ZERO || hidden() { Vec3::ZERO } else { received }
    };
    let numbers = |index: usize| Recurrence::<2>::new(index as u64);
    let mean = |(index, point)| {
        let numbers = numbers(index);
        (0..samples).map(|sample| at(point, numbers.point(sample)).as_dvec3()).sum::<glam::DVec3>() / samples as f64
    };
    points.iter().enumerate().map(mean).map(|mean| mean.as_vec3()).collect()
}

#[test]
fn a_thousand_lamps_light_as_all_of_them() {
    let scene = hall(1000);
    assert!(Lights::new(&scene).tree().is_some());
    let count = sized(&gpu(), 300, 60);
    let points: Vec<_> = receivers(&scene, 4 * count).into_iter().step_by(2).take(count).collect();
    let difference = Difference::between(&direct_light(&scene, &points, 1024), &by_power(&scene, &points, 1 << 14));
    eprintln!("{difference:?}");
    assert!(difference.mean < 0.05 && difference.bias.abs() < 0.005, "{difference:?}");
}

/// A screen of many pieces beside lamps without pictures.
#[test]
fn pictures_shine_by_the_tree() {
    let mut model = Model::new();
    let screen = model.material(Vec3::ZERO, vec3(3.0, 2.0, 1.0));
    model.plate(vec3(0.0, 0.9, 0.0), 0.5 * Vec3::X, 0.5 * Vec3::Z, screen);
    for (uv, place) in model.scene.mesh.uvs.iter_mut().zip([Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]) {
        *uv = place;
    }
    model.plate(Vec3::ZERO, Vec3::Z, Vec3::X, 0);
    let lamp = model.material(Vec3::ZERO, Vec3::splat(5.0));
    let mut random = Random::new(4, 0);
    for _ in 0..200 {
        let at = vec3(2.0 * random.uniform() - 1.0, 1.0 + random.uniform(), 2.0 * random.uniform() - 1.0);
        model.cuboid(at, Vec3::splat(0.01), TAU * random.uniform(), false, lamp);
    }
    let texels = (0..64).map(|i| [(i * 4) as u8, 255 - 3 * i as u8, if i % 8 < 4 { 0 } else { 200 }, 255]).collect();
    model.scene.textures.push(ImageTexture { width: 8, height: 8, texels, sampler: Sampler::default() });
    model.scene.materials[screen as usize].emission_texture = Some(0);
    let scene = model.finish();
    let points: Vec<_> = points_on(&scene, 400).into_iter().filter(|point| point.normal == Vec3::Y).take(80).collect();
    let difference = Difference::between(&direct_light(&scene, &points, 1024), &by_power(&scene, &points, 1 << 14));
    let lights = Lights::new(&scene);
    eprintln!("{difference:?}, {} pieces", lights.pieces());
    assert!(lights.tree().is_some() && difference.mean < 0.03 && difference.bias.abs() < 0.002, "{difference:?}");
}
