//! Gloss in pictures: white furnaces, direct light against integrals, and one picture by bundles and by traced paths.

mod common;

use std::rc::Rc;

use common::{Difference, Model, gpu, sized};
use finalgather::Environment;
use finalgather::direct::{Direct, STRIDE, SampleShare, direct_light_on_cpu};
use finalgather::gather::{GatherInputs, IrradianceGather};
use finalgather::geometry::Geometry;
use finalgather::gpu::Gpu;
use finalgather::image::Image;
use finalgather::photon::PhotonTexture;
use finalgather::points::packets::SubsetPackets;
use finalgather::points::{CameraPoints, GlossTextures, Interleave, PointGloss, PointTextures};
use finalgather::reference::Reference;
use finalgather::render::Render;
use finalgather::scene::{
    Brdf, Bvh, Camera, Gloss, ImageTexture, Lights, NormalMap, PunctualKind, PunctualLight, Rays, Sampler, World,
};
use finalgather::settings::{LayerSize, Pipeline, PointSource, Sequence, Settings};
use glam::{Vec2, Vec3, vec2, vec3};

fn channel<'a>(image: &'a Image, name: &str) -> &'a [f32] {
    &image.channels.iter().find(|channel| channel.name == name).unwrap().samples
}

fn render(gpu: &Gpu, world: &World, settings: &Settings) -> Image {
    let mut render = Render::new(gpu, world, settings).unwrap();
    while !render.is_done() {
        render.step().unwrap();
    }
    render.picture()
}

fn settings(size: u32, directions: u32, points: PointSource) -> Settings {
    let mut settings = Settings::default();
    (settings.film.size, settings.film.points) = ([size; 2], points);
    (settings.directions.count, settings.gather.layer_size) = (directions, LayerSize::Texels(128));
    (settings.photons.count, settings.direct.light_samples) = (20_000, 256);
    settings
}

/// Ten strips of one plate, rougher and rougher, under a sky of radiance 1. What a pixel shows is what its strip reflects of even light.
#[test]
fn furnace_at_ten_roughnesses() {
    let gpu = gpu();
    let (size, directions) = sized(&gpu, (80, 256), (20, 64));
    let roughness = |strip: usize| [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.85, 1.0][strip];
    for (base, metallic) in [(Vec3::ONE, 1.0), (vec3(0.8, 0.5, 0.2), 0.0)] {
        let mut model = Model::new();
        for strip in 0..10 {
            let material = model.material(base, Vec3::ZERO);
            model.scene.materials[material as usize].gloss =
                Some(Gloss { roughness: roughness(strip), metallic, ..Gloss::default() });
            model.plate(vec3(0.2 * strip as f32 - 0.9, 0.0, 0.0), 0.1 * Vec3::X, Vec3::Y, material);
        }
        model.scene.environment = Some(Environment::constant(Vec3::ONE).unwrap());
        let eye = vec3(0.0, -4.0, 1.5);
        model.scene.camera = Some(Camera { eye, target: Vec3::ZERO, up: Vec3::Y, fov_y_degrees: 30.0, lens: None });
        let world = model.world();
        for points in [PointSource::Camera, PointSource::Traced] {
            let image = render(&gpu, &world, &settings(size, directions, points));
            let place = ["P.X", "P.Y", "P.Z"].map(|name| channel(&image, name));
            let coverage = channel(&image, "A");
            for strip in 0..10 {
                let brdf = Brdf::new(base, metallic, roughness(strip), Vec3::splat(0.04));
                let (mut found, mut expected, mut pixels) = (Vec3::ZERO, Vec3::ZERO, 0.0);
                for (pixel, &covered) in coverage.iter().enumerate() {
                    let at = vec3(place[0][pixel], place[1][pixel], place[2][pixel]);
                    let inside = (at.x - (0.2 * strip as f32 - 0.9)).abs() < 0.07 && covered == 1.0;
                    if inside {
                        let shares = brdf.shares((eye - at).normalize().z);
                        found += Vec3::from(["R", "G", "B"].map(|name| channel(&image, name)[pixel]));
                        (expected, pixels) = (expected + shares.base + shares.lobe, pixels + 1.0);
                    }
                }
                let ratio = found / expected;
                eprintln!("metallic {metallic}, roughness {}, {points:?}: {ratio} over {pixels} pixels", roughness(strip));
                assert!(pixels > sized(&gpu, 20.0, 2.0), "the strip is seen: {pixels} pixels");
                // Of choices between lobe and base, and samples that go below the surface, the noise is left.
                let most = sized(&gpu, 0.01, 0.05);
                assert!((ratio - 1.0).abs().max_element() < most, "roughness {}, {points:?}: {ratio}", roughness(strip));
            }
        }
    }
}

/// A glossy floor, coloured blocks and a lamp.
fn still_life(roughness: f32, metallic: f32) -> World {
    let mut model = Model::new();
    let floor = model.material(vec3(0.7, 0.7, 0.7), Vec3::ZERO);
    let [red, green] = [vec3(0.8, 0.2, 0.1), vec3(0.1, 0.7, 0.3)].map(|albedo| model.material(albedo, Vec3::ZERO));
    let lamp = model.material(Vec3::ZERO, Vec3::splat(4.0));
    model.scene.materials[floor as usize].gloss = Some(Gloss { roughness, metallic, ..Gloss::default() });
    model.plate(vec3(0.0, -0.5, 0.0), Vec3::Z, Vec3::X, floor);
    model.plate(vec3(0.0, 0.5, -1.0), Vec3::X, Vec3::Y, red);
    model.cuboid(vec3(-0.3, -0.2, -0.5), vec3(0.2, 0.3, 0.2), 0.3, false, green);
    model.plate(vec3(0.2, 0.9, 0.2), 0.4 * Vec3::X, 0.4 * Vec3::Z, lamp);
    let eye = vec3(0.3, 0.3, 2.2);
    model.scene.camera = Some(Camera { eye, target: vec3(0.0, -0.5, 0.0), up: Vec3::Y, fov_y_degrees: 40.0, lens: None });
    model.world()
}

/// Bundles weigh the lobe, traced paths follow it. Both show the same.
#[test]
fn bundles_and_traced_paths_agree() {
    let gpu = gpu();
    let (size, directions, photons) = sized(&gpu, (48, 512, 500_000), (12, 256, 100_000));
    for metallic in [1.0, 0.0].into_iter().take(sized(&gpu, 2, 1)) {
        // Below the limit, so that paths follow the lobe.
        let world = still_life(0.42, metallic);
        let images = [PointSource::Camera, PointSource::Traced].map(|points| {
            render(&gpu, &world, &settings(size, directions, points).with(|settings| settings.photons.count = photons))
        });
        // The points of paths lie on what the floor reflects, so the first picture tells where it is.
        let [normal, height] = ["N.Y", "P.Y"].map(|name| channel(&images[0], name));
        let floor: Vec<usize> =
            (0..(size * size) as usize).filter(|&pixel| normal[pixel] > 0.99 && height[pixel] < -0.49).collect();
        assert!(floor.len() > 20, "the floor is seen");
        let [bundles, paths] = [0, 1].map(|image| {
            let mean = |name: &str| {
                let samples = channel(&images[image], name);
                floor.iter().map(|&pixel| f64::from(samples[pixel])).sum::<f64>() / floor.len() as f64
            };
            ["R", "G", "B"].map(mean)
        });
        eprintln!("metallic {metallic}: {bundles:?} by bundles, {paths:?} by paths");
        for (bundles, paths) in bundles.iter().zip(paths) {
            let most = sized(&gpu, 0.02, 0.1);
            assert!((bundles / paths - 1.0).abs() < most, "metallic {metallic}: {bundles} and {paths}");
        }
    }
}

/// Rays do not meet a point or the sun. So direct light has their highlights, of narrow lobes too.
#[test]
fn lights_without_a_surface_shine_on_narrow_lobes() {
    let gpu = gpu();
    let (size, directions) = sized(&gpu, (32, 256), (12, 256));
    let light = |kind, position: Vec3, strength: f32| PunctualLight {
        name: String::new(),
        kind,
        position: position.as_dvec3(),
        direction: -position.normalize(),
        strength: Vec3::splat(strength),
    };
    let at = vec3(0.2, 1.0, -0.8);
    let point = light(PunctualKind::Point { radius: 0.0 }, at, 1.0);
    let ball = light(PunctualKind::Point { radius: 0.1 }, at, 1.0);
    let sun = light(PunctualKind::Directional { angle: 0.01 }, at, 1.0);
    for (name, light) in [("point", point), ("ball", ball), ("sun", sun)].into_iter().take(sized(&gpu, 3, 1)) {
        for metallic in [1.0, 0.0] {
            let mut model = Model::new();
            model.scene.materials[0].albedo = Vec3::splat(0.5);
            model.scene.materials[0].gloss = Some(Gloss { roughness: 0.4, metallic, ..Gloss::default() });
            model.plate(Vec3::ZERO, Vec3::Z, Vec3::X, 0);
            model.scene.lights.push(light.clone());
            let eye = vec3(0.1, 1.2, 1.4);
            model.scene.camera = Some(Camera { eye, target: Vec3::ZERO, up: Vec3::Y, fov_y_degrees: 40.0, lens: None });
            let world = model.world();
            let [bundles, paths] = [PointSource::Camera, PointSource::Traced].map(|points| {
                let image = render(&gpu, &world, &settings(size, directions, points));
                channel(&image, "Direct.R").iter().map(|&sample| f64::from(sample)).sum::<f64>()
            });
            eprintln!("{name}, metallic {metallic}: {bundles} and {paths}");
            // Paths choose the base by chance.
            let most = sized(&gpu, 0.02, 0.1);
            assert!((paths / bundles - 1.0).abs() < most, "{name}, metallic {metallic}: {bundles} and {paths}");
        }
    }
}

/// The light of a square lamp on glossy points, against an integral over the lamp.
#[test]
fn lobes_reflect_the_light_of_a_lamp() {
    let gpu = gpu();
    let world = still_life(0.5, 0.0);
    let scene = world.flatten();
    let geometry = Geometry::upload(&gpu, &scene).unwrap();
    let corners = |triangle: usize| scene.mesh.corners(triangle);
    let lamp = (0..scene.mesh.triangles.len()).find(|&triangle| scene.material(triangle).is_emissive()).unwrap();
    let [a, b, c] = corners(lamp);
    let (u, v) = (b - a, c - b);
    let floor = scene.mesh.corners(0)[0].y;
    let (mut position, mut normal, mut gloss) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..64 {
        let at = vec3(0.04 * (i % 8) as f32, floor, 0.2 + 0.04 * (i / 8) as f32);
        let eye = (vec3(0.1, 0.5, 1.0 + 0.1 * (i % 3) as f32) - at).normalize();
        let brdf = Brdf::new(Vec3::splat(0.7), (i % 2) as f32, 0.5 + 0.1 * (i % 5) as f32, Vec3::splat(0.04));
        // +y in octahedral coordinates.
        position.push(at.extend(0.0));
        normal.push(Vec3::Y.extend(1.0));
        gloss.push(PointGloss::new(brdf, Vec3::Y, eye, Vec3::ONE, i % 7 != 0));
    }
    let textures = GlossTextures::upload(&gpu, [8, 8], &gloss).unwrap();
    let points = PointTextures::upload(&gpu, [8, 8], &position, &normal, 64).unwrap().with_gloss(Some(textures));
    let direct = Direct::new(&gpu, 0).unwrap();
    let [base, lobe] = direct.light(&geometry, &Lights::new(&scene), SampleShare::whole(4096), points.points()).unwrap();
    let (bvh, pixels) = (Bvh::new(&scene.mesh), points.points().read());
    let packets = SubsetPackets::of_list(&pixels, [8, 8], STRIDE);
    let share = (SampleShare::whole(4096), 0);
    let on_cpu = direct_light_on_cpu(Rays::new(&scene, &bvh), &Lights::new(&scene), share, &packets, &gloss);
    for (on_cpu, found) in on_cpu.iter().zip([&base, &lobe]) {
        let difference = Difference::between(on_cpu, found);
        assert!(difference.mean < 1e-4, "rays on the CPU bring other light: {difference:?}");
    }
    for i in 0..64 {
        const SIDE: usize = 64;
        let (at, brdf, eye) = (position[i].truncate(), gloss[i].brdf, gloss[i].eye);
        let (mut expected_base, mut expected_lobe) = (0.0, 0.0);
        for k in 0..SIDE * SIDE {
            let place = vec2((k % SIDE) as f32 + 0.5, (k / SIDE) as f32 + 0.5) / SIDE as f32;
            let way = a + place.x * u + place.y * v - at;
            let (light, squared) = (way.normalize(), way.length_squared());
            let received = 4.0 * light.y * light.y / squared * u.length() * v.length() / (SIDE * SIDE) as f32;
            let weights = brdf.weights(Vec3::Y, eye, light);
            expected_base += received * weights.base;
            expected_lobe += received * weights.lobe.x;
        }
        let expected_lobe = if gloss[i].counts { expected_lobe } else { 0.0 };
        let [base, lobe] = [base[i].x, lobe[i].x];
        assert!((base / expected_base - 1.0).abs() < 0.005, "base of {i}: {base}, expected {expected_base}");
        assert!((lobe - expected_lobe).abs() <= 0.01 * expected_lobe, "lobe of {i}: {lobe}, expected {expected_lobe}");
    }
}

/// The sums of lobes on the GL side, by layers and by rays, and on the CPU.
#[test]
fn pipelines_weigh_lobes_alike() {
    let gpu = gpu();
    let world = still_life(0.6, 0.5);
    let scene = world.flatten();
    let (geometry, bvh) = (Geometry::upload(&gpu, &scene).unwrap(), Rc::new(Bvh::new(&scene.mesh)));
    let grid = common::photon_grid(&scene, &bvh, 50_000);
    let photons = PhotonTexture::upload(&gpu, &grid).unwrap();
    const SIZE: [u32; 2] = [24, 24];
    let camera = scene.camera(SIZE);
    let mut seen = CameraPoints::new(&gpu, SIZE).unwrap().see(&geometry, &camera, Vec2::splat(0.5), 0);
    seen.add_gloss(&scene, camera.eye);
    let textures = GlossTextures::upload(&gpu, SIZE, &seen.gloss).unwrap();
    let points = PointTextures::upload(&gpu, SIZE, &seen.position, &seen.normal, seen.count).unwrap().with_gloss(Some(textures));
    let mut directions = common::directions(Sequence::R2, 64);
    // The oracle takes one end of a direction, so all are turned to the floor's side.
    directions.iter_mut().for_each(|direction| direction.vector *= direction.vector.y.signum());
    let sums = |pipeline: Pipeline| {
        let mut settings = Settings::default();
        settings.photons.map = finalgather::settings::PhotonMapKind::Grid;
        (settings.gather.pipeline, settings.gather.layer_size) = (pipeline, LayerSize::Texels(256));
        let interleave = Interleave::new(1, SIZE, 0);
        let mut gather = IrradianceGather::with(&gpu, &settings, (&scene, &bvh), interleave, true).unwrap();
        gather.begin_glossy(&seen.pixels(), &seen.gloss, None);
        for batch in directions.chunks(gather.batch()) {
            let oracle = Reference::new(&scene, &bvh, &grid);
            let inputs = GatherInputs { scene: &scene, geometry: &geometry, photons: &photons, oracle, points: points.points() };
            gather.add(inputs, batch).unwrap();
        }
        let on_floor = |pixel: &usize| seen.normal[*pixel].y > 0.99 && seen.gloss[*pixel].is_glossy();
        let [lobes, weights] = gather.read_lobes().unwrap();
        let pixels: Vec<usize> = (0..lobes.len()).filter(on_floor).collect();
        assert!(pixels.len() > 50);
        let bases = gather.read();
        [bases, lobes, weights].map(|sums| pixels.iter().map(|&pixel| sums[pixel]).sum::<glam::Vec4>())
    };
    let [oracle, rays, fused, kill] = [Pipeline::Raycast, Pipeline::RaycastGl, Pipeline::Fused, Pipeline::Kill].map(sums);
    for (name, found, limit) in [("rays", rays, 1e-3), ("fused", fused, 0.02), ("kill", kill, 0.02)] {
        for (part, (found, oracle)) in found.iter().zip(oracle).enumerate() {
            let ratio = *found / oracle;
            eprintln!("{name}, part {part}: {ratio}");
            let channels = if part == 0 { 4 } else { 3 };
            assert!((0..channels).all(|k| (ratio[k] - 1.0).abs() < limit), "{name}, part {part}: {ratio}");
        }
    }
}

/// A flat plate with a map that leans to one side looks as one whose vertices have that normal.
#[test]
fn a_normal_map_turns_what_a_pixel_gathers() {
    let gpu = gpu();
    let lean = vec3(0.5, 0.25, (1.0f32 - 0.25 - 0.0625).sqrt());
    let texel = lean.to_array().map(|value| ((value + 1.0) * 127.5).round() as u8);
    let lean = (Vec3::from(texel.map(f32::from)) / 127.5 - 1.0).normalize();
    let build = |mapped: bool, gloss: Option<Gloss>| {
        let mut model = Model::new();
        let lamp = model.material(Vec3::ZERO, Vec3::splat(3.0));
        model.scene.materials[0].albedo = Vec3::splat(0.6);
        model.plate(Vec3::ZERO, Vec3::X, Vec3::Y, 0);
        model.plate(vec3(1.2, 0.0, 0.8), vec3(-0.2, 0.0, 0.4), 0.5 * Vec3::Y, lamp);
        let red = model.material(vec3(0.8, 0.1, 0.1), Vec3::ZERO);
        model.plate(vec3(-1.2, 0.0, 0.8), 0.8 * Vec3::Z, Vec3::Y, red);
        model.scene.materials[0].gloss = gloss;
        let mesh = &mut model.scene.mesh;
        mesh.uvs[..4].copy_from_slice(&[vec2(0.0, 0.0), vec2(1.0, 0.0), vec2(1.0, 1.0), vec2(0.0, 1.0)]);
        if mapped {
            let [r, g, b] = texel;
            let picture = ImageTexture { width: 1, height: 1, texels: vec![[r, g, b, 255]], sampler: Sampler::default() };
            model.scene.textures.push(picture);
            model.scene.materials[0].normal_map = Some(NormalMap { texture: 0, scale: 1.0 });
        } else {
            mesh.normals[..4].fill(lean);
        }
        model.world()
    };
    let directions = sized(&gpu, 64, 16);
    for gloss in [None, Some(Gloss { roughness: 0.6, metallic: 1.0, ..Gloss::default() })] {
        for points in [PointSource::Camera, PointSource::Traced] {
            let images = [true, false].map(|mapped| render(&gpu, &build(mapped, gloss), &settings(16, directions, points)));
            for name in ["R", "Direct.R", "Indirect.R"] {
                let [mapped, shaded] = [0, 1].map(|image| channel(&images[image], name));
                let total: f32 = shaded.iter().sum();
                let difference: f32 = mapped.iter().zip(shaded).map(|(a, b)| (a - b).abs()).sum();
                assert!(total > 0.0 && difference < 1e-3 * total, "{name}, {points:?}: {difference} of {total}");
            }
        }
    }
}
