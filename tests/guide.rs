//! Photons guided to what points see bring the same light, with less noise there.

mod common;

use std::f32::consts::PI;

use common::Model;
use finalgather::photon::{Guide, PhotonStore, PhotonTracer};
use finalgather::random::Recurrence;
use finalgather::scene::{Bvh, Chance, Environment, Focus, Lights, Mesh, Rays, Scene};
use glam::{DVec3, Vec3, vec3};

/// Sums the flux that arrives in each of some boxes.
struct Boxes(Vec<[Vec3; 2]>, Vec<DVec3>);

impl PhotonStore for Boxes {
    fn index_of_hit(&self, _: &Mesh, _: usize, position: Vec3, _: Vec3) -> usize {
        let inside = |[low, high]: &[Vec3; 2]| position.cmpge(*low).all() && position.cmple(*high).all();
        self.0.iter().position(inside).unwrap_or(self.0.len())
    }

    fn add_flux(&mut self, index: usize, flux: Vec3) {
        self.1[index] += flux.as_dvec3();
    }

    fn clear_flux(&mut self) {
        self.1.fill(DVec3::ZERO);
    }

    fn irradiance_of_hit(&self, _: &Mesh, _: usize, _: Vec3, _: bool) -> Vec3 {
        Vec3::ZERO
    }
}

/// A room of a thousandth of the ground's area, open to one side, with a lamp; under a sky.
fn landscape() -> Scene {
    let mut model = Model::new();
    let grey = model.material(Vec3::splat(0.5), Vec3::ZERO);
    let lamp = model.material(Vec3::ZERO, vec3(2000.0, 0.0, 0.0));
    model.plate(Vec3::ZERO, Vec3::Z, Vec3::X, grey);
    let (half, height) = (0.02, 0.03);
    model.plate(vec3(0.1, height, 0.2), half * Vec3::X, half * Vec3::Z, grey);
    model.plate(vec3(0.1 - half, 0.5 * height, 0.2), 0.5 * height * Vec3::Y, half * Vec3::Z, grey);
    model.plate(vec3(0.1, 0.5 * height, 0.2 - half), half * Vec3::X, 0.5 * height * Vec3::Y, grey);
    model.plate(vec3(0.1, 0.5 * height, 0.2 + half), 0.5 * height * Vec3::Y, half * Vec3::X, grey);
    model.plate(vec3(0.1, 0.9 * height, 0.2), 0.002 * Vec3::X, 0.002 * Vec3::Z, lamp);
    let mut scene = model.finish();
    scene.environment = Some(Environment::constant(vec3(0.0, 1.0, 1.0)).unwrap());
    scene
}

#[test]
fn guided_photons_bring_the_same_light() {
    let scene = landscape();
    let (bvh, lights) = (Bvh::new(&scene.mesh), Lights::new(&scene));
    let unit = |position: Vec3| scene.space.enter_point(position.as_dvec3());
    let floor = unit(Vec3::ZERO).y;
    let around = |center: Vec3, half: f32| {
        let half = half / scene.space.length_to_world(1.0);
        [unit(center) - half, unit(center) + half]
    };
    // What the room holds, the ground before it, and the rest.
    let boxes = vec![around(vec3(0.1, 0.0, 0.2), 0.0401), around(vec3(0.2, 0.0, 0.2), 0.06)];
    let of = |photons: u64, guide: Option<&Guide>, seed: u64| {
        let mut sums = Boxes(boxes.clone(), vec![DVec3::ZERO; boxes.len() + 1]);
        PhotonTracer::new(&scene, &bvh, &lights, seed, 64).guided(guide).trace(0..photons, &mut sums);
        sums.1
    };
    let points: Vec<(Vec3, Vec3)> = (0..64)
        .map(|i| (unit(vec3(0.085 + 0.004 * (i % 8) as f32, 0.0, 0.185 + 0.004 * (i / 8) as f32)).with_y(floor), Vec3::Y))
        .collect();
    let tracer = PhotonTracer::new(&scene, &bvh, &lights, 0, 64);
    let guide = Guide::new(&tracer, &scene, &bvh, &points);
    let expected = of(8_000_000, None, 1);
    let even: Vec<_> = (0..8).map(|seed| of(200_000, None, seed)).collect();
    let guided: Vec<_> = (0..8).map(|seed| of(200_000, Some(&guide), seed)).collect();
    let mean = |runs: &[Vec<DVec3>], region: usize| runs.iter().map(|run| run[region] / expected[region]).sum::<DVec3>() / 8.0;
    let spread = |runs: &[Vec<DVec3>], region: usize| {
        let mean = mean(runs, region);
        (runs.iter().map(|run| (run[region] / expected[region] - mean).powf(2.0)).sum::<DVec3>() / 7.0).powf(0.5)
    };
    for (region, flux) in expected.iter().enumerate() {
        let (found, noise) = (mean(&guided, region), spread(&guided, region));
        eprintln!("{region}: {found:.4} of {flux:.5}, noise {noise:.4} for {:.4}", spread(&even, region));
        // Green is the sky's. Four standard errors of the mean of eight runs, and what the expected value may be off.
        assert!((found.y - 1.0).abs() < 4.0 * noise.y / 8f64.sqrt() + 0.01, "{region}: {found}");
    }
    // Red is the lamp's, of which even photons know little.
    assert!((mean(&guided, 0).x - 1.0).abs() < 0.05, "{}", mean(&guided, 0));
    for channel in [0, 1] {
        let [of_even, of_guided] = [&even, &guided].map(|runs| spread(runs, 0)[channel]);
        assert!(of_guided < 0.4 * of_even, "in the room, channel {channel}: noise {of_guided} for {of_even}");
    }
}

/// Every place has the light of the sky, inside of all spheres, between them and outside.
#[test]
fn spheres_of_a_focus_send_the_light_of_a_sky_evenly() {
    const PHOTONS: u64 = 1 << 20;
    let mut model = Model::new();
    let black = model.material(Vec3::ZERO, Vec3::ZERO);
    model.plate(Vec3::ZERO, Vec3::Z, Vec3::X, black);
    let mut scene = model.finish();
    scene.environment = Some(Environment::constant(Vec3::ONE).unwrap());
    let (bvh, lights, starts) = (Bvh::new(&scene.mesh), Lights::new(&scene), Recurrence::<5>::new(0));
    let (rays, focus) = (Rays::new(&scene, &bvh), Focus::around(vec3(0.2, 0.0, 0.1), 0.02));
    let rings = [0.0f32, 0.03, 0.1, 0.3, 0.5];
    let mut flux = vec![0.0f64; rings.len() - 1];
    for photon in 0..PHOTONS {
        let (mut path, of_one) = lights.emit_at(starts.point(photon), &focus);
        if path.advance(&rays, Chance::of_direction(0)).is_some() {
            let from = (path.origin - vec3(0.2, 0.0, 0.1)).length();
            if let Some(ring) = (0..flux.len()).find(|&ring| (rings[ring]..rings[ring + 1]).contains(&from)) {
                flux[ring] += f64::from(of_one.x) / PHOTONS as f64;
            }
        }
    }
    for (ring, flux) in flux.iter().enumerate() {
        // Both sides of the plate receive π.
        let area = PI * (rings[ring + 1].powi(2) - rings[ring].powi(2));
        let share = flux / f64::from(2.0 * PI * area);
        eprintln!("from {} to {}: {share:.4}", rings[ring], rings[ring + 1]);
        assert!((share - 1.0).abs() < 0.01, "from {} to {}: {share}", rings[ring], rings[ring + 1]);
    }
}
