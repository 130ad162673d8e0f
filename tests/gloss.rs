//! The reflection of glossy surfaces: its integrals, its samples, and photons that it reflects.

mod common;

use std::f32::consts::{FRAC_1_PI, TAU};

use common::Model;
use finalgather::photon::{PhotonStore, PhotonTracer};
use finalgather::random::{Random, sobol};
use finalgather::scene::{Brdf, Bvh, Gloss, ImageTexture, Lights, Mesh, NormalMap, Sampler, Scene, facing};
use glam::{Vec3, vec2, vec3};

const COSINES: [f32; 4] = [0.97, 0.7, 0.3, 0.1];

fn eye_at(cosine: f32) -> Vec3 {
    vec3((1.0 - cosine * cosine).sqrt(), 0.0, cosine)
}

/// The integral of `of` over the upper hemisphere, on a grid that is even in solid angle.
fn over_hemisphere(of: impl Fn(Vec3) -> f32) -> f32 {
    const SIDE: usize = 1024;
    let at = |i: usize| {
        let (z, phi) = (((i / SIDE) as f32 + 0.5) / SIDE as f32, TAU * ((i % SIDE) as f32 + 0.5) / SIDE as f32);
        let (sin, cos) = phi.sin_cos();
        f64::from(of(vec3((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)))
    };
    ((0..SIDE * SIDE).map(at).sum::<f64>() / (SIDE * SIDE) as f64) as f32 * TAU
}

fn metal(roughness: f32) -> Brdf {
    Brdf::new(Vec3::ONE, 1.0, roughness, Vec3::splat(0.04))
}

fn varnish(roughness: f32) -> Brdf {
    Brdf::new(vec3(0.5, 0.6, 0.1), 0.0, roughness, Vec3::splat(0.04))
}

#[test]
fn reflection_is_reciprocal() {
    let mut random = Random::new(1, 0);
    for brdf in [metal(0.4), varnish(0.2), Brdf::new(vec3(0.9, 0.5, 0.2), 0.6, 0.7, Vec3::splat(0.08))] {
        for _ in 0..100 {
            let mut direction = || eye_at(0.05 + 0.9 * random.uniform()).rotate_z(TAU * random.uniform());
            let (one, other) = (direction(), direction());
            let [there, back] = [brdf.evaluate(Vec3::Z, one, other), brdf.evaluate(Vec3::Z, other, one)];
            assert!((there - back).abs().max_element() <= 1e-5 * there.max_element(), "{there} and {back}");
        }
    }
}

/// The tables, integrals on a grid, the mean weight of samples, and the share of samples that leave upwards: all of one function.
#[test]
fn integrals_tables_and_samples_agree() {
    for roughness in [0.3, 0.5, 0.75, 1.0] {
        for cosine in COSINES {
            let (brdf, eye) = (varnish(roughness), eye_at(cosine));
            let shares = brdf.shares(cosine);
            let whole = over_hemisphere(|light| (brdf.evaluate(Vec3::Z, eye, light) * light.z).x);
            let passing = over_hemisphere(|light| brdf.weights(Vec3::Z, eye, light).base * light.z * FRAC_1_PI);
            let sampled = |i: u32| brdf.sample_lobe(Vec3::Z, eye, sobol(i, 3));
            let count = 4096;
            let mean = (0..count).filter_map(|i| Some(sampled(i)?.1.x)).sum::<f32>() / count as f32;
            let upwards = (0..count).filter(|&i| sampled(i).is_some()).count() as f32 / count as f32;
            let density = over_hemisphere(|light| brdf.lobe_density(Vec3::Z, eye, light));
            let all = [(shares.base + shares.lobe).x / whole, shares.passing / passing, shares.lobe.x / mean, density / upwards];
            eprintln!("roughness {roughness}, cosine {cosine}: {all:?}");
            assert!(all.iter().all(|ratio| (ratio - 1.0).abs() < 4e-3), "roughness {roughness}, cosine {cosine}: {all:?}");
        }
        // Over all eyes.
        let brdf = varnish(roughness);
        let steps = 2000;
        let at = |i: usize| (i as f32 + 0.5) / steps as f32;
        let mean =
            (0..steps).map(|i| 2.0 * at(i) * (brdf.shares(at(i)).base + brdf.shares(at(i)).lobe)).sum::<Vec3>() / steps as f32;
        assert!((mean - brdf.reflectance()).abs().max_element() < 5e-4, "{mean} and {}", brdf.reflectance());
    }
}

#[test]
fn a_sharp_lobe_is_a_mirror_and_loses_nothing() {
    for cosine in COSINES {
        let (brdf, eye) = (metal(0.0), eye_at(cosine));
        for i in 0..64 {
            let (light, weight) = brdf.sample_lobe(Vec3::Z, eye, sobol(i, 0)).unwrap();
            assert!(
                (light - (2.0 * eye.z * Vec3::Z - eye)).length() < 0.1 && (weight - 1.0).abs().max_element() < 1e-3,
                "{light}"
            );
        }
        assert!((brdf.shares(cosine).lobe - 1.0).abs().max_element() < 1e-3, "{:?}", brdf.shares(cosine));
    }
    assert!((metal(0.0).reflectance() - 1.0).abs().max_element() < 1e-3);
}

#[test]
fn normals_turn_to_the_eye_only_where_they_face_away() {
    let eye = eye_at(0.5);
    assert_eq!(facing(Vec3::Z, eye), Vec3::Z);
    let turned = facing(vec3(-0.9, 0.0, 0.1).normalize(), eye);
    assert!(turned.is_normalized() && turned.dot(eye) > 0.0 && turned.dot(eye) < 0.05, "{turned}");
}

/// A plate whose texture coordinates are turned, and as its mirror image.
fn mapped(texel: [u8; 4], scale: f32, mirrored: bool) -> Scene {
    let mut model = Model::new();
    model.plate(Vec3::ZERO, Vec3::X, Vec3::Y, 0);
    model.scene.mesh.uvs = [vec2(0.0, 0.0), vec2(0.0, 2.0), vec2(-1.0, 2.0), vec2(-1.0, 0.0)].to_vec();
    if mirrored {
        model.scene.mesh.uvs.iter_mut().for_each(|uv| uv.x = -uv.x);
    }
    model.scene.textures.push(ImageTexture { width: 1, height: 1, texels: vec![texel], sampler: Sampler::default() });
    model.scene.materials[0].normal_map = Some(NormalMap { texture: 0, scale });
    model.finish()
}

#[test]
fn normal_maps_turn_normals_along_the_textures_axes() {
    // u runs against y, v along x. The map leans to +u by its red, to +v by its green.
    let lean = |x: f32, y: f32| vec3(y, -x, (1.0 - x * x - y * y).sqrt());
    let byte = |value: f32| ((value + 1.0) * 127.5).round() as u8;
    for (x, y) in [(0.4, 0.0), (0.0, 0.4), (-0.3, 0.5)] {
        let texel = [byte(x), byte(y), byte((1.0 - x * x - y * y).sqrt()), 255];
        for mirrored in [false, true] {
            let scene = mapped(texel, 1.0, mirrored);
            let expected = lean(if mirrored { -x } else { x }, y);
            let found = scene.mapped_normal(0, Vec3::splat(1.0 / 3.0), Vec3::Z, Vec3::Z);
            assert!((found - expected).length() < 0.01, "{found}, expected {expected}");
            // The back has the same bumps, seen from behind.
            let behind = scene.mapped_normal(0, Vec3::splat(1.0 / 3.0), -Vec3::Z, -Vec3::Z);
            assert!((behind + found).length() < 1e-6, "{behind} behind {found}");
        }
    }
    let flat = mapped([255, 128, 255, 255], 0.0, false);
    assert!((flat.mapped_normal(0, Vec3::splat(1.0 / 3.0), Vec3::Z, Vec3::Z) - Vec3::Z).length() < 1e-6);
}

/// The flux that each triangle stores.
struct Tally(Vec<Vec3>);

impl PhotonStore for Tally {
    fn index_of_hit(&self, _: &Mesh, triangle: usize, _: Vec3, _: Vec3) -> usize {
        triangle
    }

    fn add_flux(&mut self, index: usize, flux: Vec3) {
        self.0[index] += flux;
    }

    fn clear_flux(&mut self) {
        self.0.fill(Vec3::ZERO);
    }

    fn irradiance_of_hit(&self, _: &Mesh, _: usize, _: Vec3, _: bool) -> Vec3 {
        Vec3::ZERO
    }
}

/// A lamp above a plate in a closed black room. What the plate sends out is what the walls get beyond what comes from the lamp.
#[test]
fn photons_keep_the_energy_of_lobes() {
    let build = |gloss: Option<Gloss>| {
        let mut model = Model::new();
        let lamp = model.material(Vec3::ZERO, Vec3::ONE);
        let plate = model.material(vec3(0.9, 0.6, 0.3), Vec3::ZERO);
        let black = model.material(Vec3::ZERO, Vec3::ZERO);
        model.scene.materials[plate as usize].gloss = gloss;
        model.plate(vec3(0.0, 0.3, 0.4), 0.1 * Vec3::X, 0.1 * Vec3::Z, lamp);
        model.plate(vec3(0.0, -0.9, 0.0), 0.9 * Vec3::Z, 0.9 * Vec3::X, plate);
        model.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, black);
        model.finish()
    };
    const PHOTONS: u64 = 200_000;
    let trace = |scene: &Scene| {
        let (bvh, lights) = (Bvh::new(&scene.mesh), Lights::new(scene));
        let tracer = PhotonTracer::new(scene, &bvh, &lights, 0, 8);
        let mut tally = Tally(vec![Vec3::ZERO; scene.mesh.triangles.len()]);
        let counts = tracer.trace(0..PHOTONS, &mut tally);
        assert_eq!(counts.emitted, counts.absorbed + counts.escaped + counts.cut, "{counts:?}");
        let caustics: Vec3 = tracer.caustics(0..PHOTONS).iter().map(|photon| photon.flux).sum();
        (tally.0[2..4].iter().sum::<Vec3>(), tally.0[4..].iter().sum::<Vec3>(), caustics)
    };
    let lambertian = build(None);
    let (on_plate, on_walls, none) = trace(&lambertian);
    let from_lamp = on_walls - lambertian.materials[2].albedo * on_plate;
    assert_eq!(none, Vec3::ZERO);
    for (roughness, metallic) in [(0.2, 1.0), (0.2, 0.0), (0.6, 1.0), (0.6, 0.5), (1.0, 0.0)] {
        let scene = build(Some(Gloss { roughness, metallic, ..Gloss::default() }));
        let (stored, on_walls, caustics) = trace(&scene);
        let reflectance = scene.albedo(2, Vec3::splat(1.0 / 3.0));
        let (sent, reflected) = (stored * reflectance + caustics, on_walls - from_lamp);
        eprintln!("roughness {roughness}, metallic {metallic}: {sent} stored and in caustics, {reflected} on the walls");
        // The noise of 200 000 photons, of which a few percent of a channel may survive.
        assert!(((sent - reflected) / reflected).abs().max_element() < 0.02, "{sent} and {reflected}");
        assert_eq!(caustics != Vec3::ZERO, roughness < 0.5, "narrow lobes make caustics");
    }
}
