//! The white furnace: where every surface sends out radiance 1, every point of a closed scene receives irradiance π, whatever the geometry
//! and the directions.

mod common;

use std::f32::consts::PI;

use common::{Model, directions, gather, gpu, irradiance, points_on, sized};
use finalgather::photon::{PhotonGrid, PhotonTexture};
use finalgather::scene::Scene;
use finalgather::settings::Sequence;
use glam::{Vec3, vec3};

/// A lost ray shows as more than this, unless it grazes.
const LIMIT: f32 = 1e-3;
/// One in so many points may lose rays: in the corner of three faces, a texel and its neighbour can both lie off the scene (measured at most 6
/// of 4096 on llvmpipe and 2 of 256 on softpipe, none in the sphere).
const ONE_IN: usize = 500;

fn check(name: &str, scene: &Scene) {
    let gpu = gpu();
    let (count, size, points) = sized(&gpu, (64, 512, 4096), (16, 128, 256));
    let points = points_on(scene, points);
    for sequence in [Sequence::Random, Sequence::R2, Sequence::Sobol] {
        // Irradiance π in every cell: flux is π times any area.
        let mut grid = PhotonGrid::new(&scene.mesh, 8);
        grid.sums.fill([PI, PI, PI, 1.0]);
        let photons = PhotonTexture::upload(&gpu, &grid).unwrap();
        let found = irradiance(&gather(&gpu, scene, &photons, &points, &directions(sequence, count), size));
        let errors: Vec<f32> = found.iter().map(|e| (e / PI - 1.0).abs().max_element()).collect();
        let beyond = errors.iter().filter(|&&error| error > LIMIT).count();
        let mean = errors.iter().sum::<f32>() / errors.len() as f32;
        eprintln!("{name}, {sequence:?}: {beyond} points beyond, mean {mean:e}");
        assert!(beyond <= 2 + points.len() / ONE_IN, "{name}, {sequence:?}: {beyond} of {} points lose rays", points.len());
        // No point can see more than everything; sums of 64 terms round by less than 1e-5.
        let brightest = found.iter().map(|e| e.max_element()).fold(0.0, f32::max) / PI;
        assert!(brightest < 1.0 + 1e-5, "{name}, {sequence:?}: {brightest}");
    }
}

#[test]
fn room() {
    let mut model = Model::new();
    model.cuboid(Vec3::ZERO, vec3(1.0, 0.8, 0.6), 0.0, true, 0);
    check("room", &model.finish());
}

#[test]
fn room_with_blocks() {
    let mut model = Model::new();
    model.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, 0);
    model.cuboid(vec3(-0.4, -0.5, -0.3), vec3(0.3, 0.3, 0.3), 0.3, false, 0);
    model.cuboid(vec3(0.4, -0.2, 0.3), vec3(0.2, 0.5, 0.25), -0.4, false, 0);
    check("room with blocks", &model.finish());
}

#[test]
fn hollow_sphere() {
    let mut model = Model::new();
    model.sphere(Vec3::ZERO, 1.0, 16, true, 0);
    check("hollow sphere", &model.finish());
}

/// From outside, a convex body sees nothing of itself. At an edge whose faces both reach a texel, a ray may take one for the other: one point of
/// 4096 does (mean 5e-6 of a furnace's light), and without the rule for grown texels thousands do (5e-5).
#[test]
fn convex_bodies_see_nothing_of_themselves() {
    let gpu = gpu();
    let (count, size, points) = sized(&gpu, (64, 256, 4096), (16, 64, 256));
    let mut model = Model::new();
    model.cuboid(Vec3::ZERO, vec3(1.0, 0.8, 0.6), 0.3, false, 0);
    let scene = model.finish();
    let mut grid = PhotonGrid::new(&scene.mesh, 8);
    grid.sums.fill([PI, PI, PI, 1.0]);
    let photons = PhotonTexture::upload(&gpu, &grid).unwrap();
    let points = points_on(&scene, points);
    let found = irradiance(&gather(&gpu, &scene, &photons, &points, &directions(Sequence::R2, count), size));
    let lit = found.iter().filter(|e| e.max_element() > 0.0).count();
    let mean = found.iter().map(|e| e.max_element()).sum::<f32>() / found.len() as f32 / PI;
    eprintln!("convex body: {lit} of {} points see light, mean {mean:e} of a furnace's", found.len());
    assert!(mean < 2e-5, "the body sees itself: {lit} points, mean {mean}");
}
