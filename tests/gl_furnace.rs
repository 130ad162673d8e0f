//! The white furnace: where every surface sends out radiance 1, every point of a closed scene receives irradiance π, whatever the geometry
//! and the directions.

mod common;

use std::f32::consts::PI;

use common::{Model, directions, gather, gpu, irradiance, points_on, sized};
use finalgather::photon::{PhotonGrid, PhotonTexture};
use finalgather::scene::Scene;
use finalgather::settings::Sequence;
use glam::{Vec3, vec3};

/// Every point: not one ray of a closed scene may be lost, and one in 64 directions shows as more than 0.1 %.
const LIMIT: f32 = 1e-3;

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
        let errors = found.iter().map(|e| (e / PI - 1.0).abs().max_element());
        let (worst, point) = errors.zip(&points).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        eprintln!("{name}, {sequence:?}: worst {worst:e}");
        assert!(worst <= LIMIT, "{name}, {sequence:?}: off by {worst} at {point:?}");
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
