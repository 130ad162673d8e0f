//! Light from outside the scene, in every pipeline and in whole pictures, compared with closed forms.

mod common;

use std::f32::consts::PI;
use std::path::Path;

use common::{
    Model, directions, form_factor_of_polygon, gather, gather_early, gather_fused, gather_rays, gpu, irradiance, points_on,
    sized, vectors,
};
use finalgather::Environment;
use finalgather::bake::{Bake, Plan, RadianceCache};
use finalgather::geometry::Geometry;
use finalgather::gpu::Gpu;
use finalgather::image::Image;
use finalgather::image::compare::{Selection, compare};
use finalgather::photon::{PhotonGrid, PhotonTexture, PhotonTracer};
use finalgather::points::GatherPoint;
use finalgather::prepared::Prepared;
use finalgather::quantity::Quantity;
use finalgather::reference::Reference;
use finalgather::render::Render;
use finalgather::scene::{Bvh, Camera, Lights, Loaded, Scene, World};
use finalgather::settings::{LayerSize, Pipeline, Sequence, Settings};
use glam::{Vec3, vec3};

/// Of radiance 1 + y: bright above, black below.
fn gradient() -> Environment {
    let (width, height) = (256, 128);
    let row = |row: usize| 1.0 + (PI * (row as f32 + 0.5) / height as f32).cos();
    Environment::from_texels([width, height], (0..width * height).map(|i| Vec3::splat(row(i / width))).collect()).unwrap()
}

/// Irradiance at points, by every way to gather. Both ends of the directions where one end is all that counts.
fn by_all(gpu: &Gpu, scene: &Scene, grid: &PhotonGrid, points: &[GatherPoint], count: u32) -> [(&'static str, Vec<Vec3>); 5] {
    let size = sized(gpu, 256, 96);
    let photons = &PhotonTexture::upload(gpu, grid).unwrap();
    let directions = directions(Sequence::R2, count);
    let both = common::both_ends(&directions);
    let rays = Reference::new(scene, &Bvh::new(&scene.mesh), grid).gather(points, &vectors(&both));
    [
        ("rays", rays),
        ("kill", gather(gpu, scene, photons, points, &both, size)),
        ("early KILL", gather_early(gpu, scene, photons, points, &both, size)),
        ("fused", gather_fused(gpu, scene, photons, points, &directions, size).0),
        ("rays on the GL side", gather_rays(gpu, scene, photons, points, &directions)),
    ]
    .map(|(way, sums)| (way, irradiance(&sums)))
}

/// Points of a convex body see the sky alone: E = π(1 + 2/3 n·y) under a radiance of 1 + y, to the error of directions (measured 0.6 % of π at
/// most with 1024 of them, 1.3 % with 64).
#[test]
fn a_block_under_a_gradient() {
    let gpu = gpu();
    let (count, spread, limit) = sized(&gpu, (1024, 512, 0.008), (64, 64, 0.03));
    let mut model = Model::new();
    model.cuboid(Vec3::ZERO, vec3(1.0, 0.5, 0.7), 0.4, false, 0);
    let mut scene = model.finish();
    scene.environment = Some(gradient());
    let points = points_on(&scene, spread);
    let dark = PhotonGrid::new(&scene.mesh, 4);
    for (way, found) in by_all(&gpu, &scene, &dark, &points, count) {
        let error = |(found, point): (&Vec3, &GatherPoint)| found.x / PI - (1.0 + 2.0 / 3.0 * point.normal.y);
        let worst = found.iter().zip(&points).map(error).fold(0.0, |worst: f32, error| worst.max(error.abs()));
        eprintln!("gradient by {way}: at most {:.2} % of π off", 100.0 * worst);
        assert!(worst < limit, "by {way}: {worst}");
    }
}

/// A black wall takes its form factor from a constant sky: E = π(1 - F), in the mean over points (measured within 0.03 % with 1024
/// directions, 0.2 % with 64).
#[test]
fn a_floor_beside_a_black_wall() {
    let gpu = gpu();
    let (count, spread, limit) = sized(&gpu, (512, 1024, 0.002), (64, 128, 0.01));
    let mut model = Model::new();
    model.plate(vec3(-0.5, 0.6, 0.1), 0.6 * Vec3::Y, 0.9 * Vec3::Z, 0);
    model.plate(vec3(0.25, 0.0, 0.0), Vec3::Z, 0.75 * Vec3::X, 0);
    let mut scene = model.finish();
    let radiance = vec3(3.0, 2.0, 1.0);
    scene.environment = Some(Environment::constant(radiance).unwrap());
    let mut points = points_on(&scene, spread);
    points.retain(|point| point.normal.y > 0.9);
    let wall = |point: &GatherPoint| form_factor_of_polygon(&scene.mesh.positions[..4], point.position, point.normal);
    let open: f64 = points.iter().map(|point| 1.0 - wall(point)).sum();
    assert!(open < 0.9 * points.len() as f64, "the wall takes a tenth of the light: {open} of {}", points.len());
    let dark = PhotonGrid::new(&scene.mesh, 4);
    for (way, found) in by_all(&gpu, &scene, &dark, &points, count) {
        let sum = found.iter().map(|e| (e / PI / radiance).as_dvec3()).sum::<glam::DVec3>();
        eprintln!("wall by {way}: {:+.3} %", 100.0 * (sum.x / open - 1.0));
        assert!((sum / open - 1.0).abs().max_element() < limit, "by {way}: {sum} for {open}");
    }
}

/// A hemispherical bowl under a constant sky of radiance L: half of what each point of its inside sees is the bowl, of the same radiance everywhere, so
/// that E = πL/2 + ρE/2, or E = πL / (2 - ρ). Once around: photons from the sky, their flights
/// between the walls, and the gather of both (measured within 0.3 %).
#[test]
fn a_bowl_lights_itself() {
    let gpu = gpu();
    let (count, spread, photons, limit) = sized(&gpu, (256, 512, 1_000_000, 0.01), (64, 128, 200_000, 0.03));
    let albedo = vec3(0.2, 0.5, 0.9);
    let mut model = Model::new();
    let material = model.material(albedo, Vec3::ZERO);
    // Softpipe numbers vertices wrongly in meshes of thousands.
    model.sphere(Vec3::ZERO, 1.0, 16, true, material);
    let positions = model.scene.mesh.positions.clone();
    model.scene.mesh.triangles.retain(|triangle| triangle.vertices.iter().all(|&vertex| positions[vertex as usize].y < 1e-4));
    // Vertices without a triangle would count for the scene's size.
    let used: Vec<u32> = model.scene.mesh.triangles.iter().flat_map(|triangle| triangle.vertices).collect();
    for (vertex, position) in model.scene.mesh.positions.iter_mut().enumerate() {
        *position = if used.contains(&(vertex as u32)) { *position } else { Vec3::NEG_Y };
    }
    let mut scene = model.finish();
    let radiance = vec3(2.0, 1.0, 0.5);
    scene.environment = Some(Environment::constant(radiance).unwrap());
    let points = points_on(&scene, spread);
    // Softpipe filters wrongly between its tiles of 32 texels, see gl_photons.rs.
    let (bvh, mut grid) = (Bvh::new(&scene.mesh), PhotonGrid::new(&scene.mesh, sized(&gpu, 32, 8)));
    PhotonTracer::new(&scene, &bvh, &Lights::new(&scene), 0, 16).trace(0..photons, &mut grid);
    grid.add_area(&scene, &bvh, 0);
    let expected = PI * radiance / (2.0 - albedo);
    for (way, found) in by_all(&gpu, &scene, &grid, &points, count) {
        let mean = found.iter().sum::<Vec3>() / points.len() as f32 / expected;
        eprintln!("bowl by {way}: {mean} of the closed form");
        assert!((mean - 1.0).abs().max_element() < limit, "by {way}: {mean} of the closed form");
    }
}

fn picture(gpu: &Gpu, world: &World, settings: &Settings) -> Image {
    let mut render = Render::new(gpu, world, settings).unwrap_or_else(|error| panic!("{error}"));
    while !render.is_done() {
        render.step().unwrap();
    }
    render.picture()
}

const PIPELINES: [Pipeline; 5] = [Pipeline::Fused, Pipeline::Kill, Pipeline::EarlyKill, Pipeline::RaycastGl, Pipeline::Raycast];

/// A grey block in a furnace of radiance 1 shows its albedo, and about it the furnace.
#[test]
fn a_block_in_a_furnace_shows_its_albedo() {
    let gpu = gpu();
    let albedo = vec3(0.8, 0.5, 0.1);
    let mut model = Model::new();
    let material = model.material(albedo, Vec3::ZERO);
    model.cuboid(Vec3::ZERO, vec3(1.0, 0.8, 0.6), 0.3, false, material);
    model.scene.environment = Some(Environment::constant(Vec3::ONE).unwrap());
    let camera = Camera { eye: vec3(1.0, 2.0, 3.0), target: Vec3::ZERO, up: Vec3::Y, fov_y_degrees: 40.0, lens: None };
    model.scene.camera = Some(camera);
    let world = model.world();
    for pipeline in PIPELINES {
        let mut settings = Settings::default();
        (settings.film.size, settings.directions.count, settings.photons.count) = ([24, 20], 64, 20_000);
        (settings.gather.pipeline, settings.gather.layer_size) = (pipeline, LayerSize::Texels(128));
        let image = picture(&gpu, &world, &settings);
        let channel = |name: &str| image.channel(name).unwrap();
        let (coverage, rgb) = (channel("A"), image.rgb().unwrap());
        let emission = ["Emission.R", "Emission.G", "Emission.B"].map(channel);
        let [mut inside, mut outside, mut off] = [0; 3];
        for pixel in 0..coverage.len() {
            let [found, emitted] = [rgb, emission].map(|channels| Vec3::from(channels.map(|samples| samples[pixel])));
            let expected = albedo * coverage[pixel] + (1.0 - coverage[pixel]);
            // Sums of 64 terms round by less than 1e-5. One ray of 30 000 takes the body for the sky, see gl_furnace.rs.
            off += usize::from((found - expected).abs().max_element() > 1e-5);
            assert!((found - expected).abs().max_element() < 0.05, "{pipeline:?}, {pixel}: {found} for {expected}");
            assert!((emitted - (1.0 - coverage[pixel])).abs().max_element() < 1e-6, "{pipeline:?}, {pixel}: emission {emitted}");
            inside += usize::from(coverage[pixel] == 1.0);
            outside += usize::from(coverage[pixel] == 0.0);
        }
        eprintln!("{pipeline:?}: {off} pixels with a ray astray, {inside} of the block alone, {outside} of the sky");
        assert!(off <= 4, "{pipeline:?}: {off} pixels are off");
        assert!(inside > 50 && outside > 50, "{pipeline:?}: {inside} pixels of the block, {outside} of the sky");
    }
}

/// The background is where the camera's rays point: up is up, and right is right.
#[test]
fn the_background_is_what_the_camera_looks_at() {
    let gpu = gpu();
    let texels = |i: usize| vec3((i % 64) as f32, (i / 64) as f32, 0.0) / 64.0;
    let mut model = Model::new();
    model.cuboid(Vec3::ZERO, Vec3::splat(0.1), 0.0, false, 0);
    let environment = Environment::from_texels([64, 32], (0..64 * 32).map(texels).collect()).unwrap();
    model.scene.environment = Some(environment.clone());
    let camera = Camera {
        eye: vec3(0.6, 0.9, 2.0),
        target: vec3(0.3, 0.0, 0.0),
        up: vec3(0.2, 1.0, 0.0),
        fov_y_degrees: 50.0,
        lens: None,
    };
    model.scene.camera = Some(camera);
    let mut settings = Settings::default();
    (settings.film.size, settings.directions.count) = ([30, 20], 32);
    (settings.gather.layer_size, settings.photons.count) = (LayerSize::Texels(16), 1000);
    let image = picture(&gpu, &model.world(), &settings);
    let ([r, g, _], coverage) = (image.rgb().unwrap(), image.channel("A").unwrap());
    let mut seen = 0;
    for pixel in (0..coverage.len()).filter(|&pixel| coverage[pixel] == 0.0) {
        let place = glam::vec2((pixel % 30) as f32 + 0.5, (pixel / 30) as f32 + 0.5) / glam::vec2(30.0, 20.0);
        let expected = environment.radiance(camera.ray(place, 1.5));
        // A pixel is half a texel wide, of which offsets of 32 blocks leave the mean a few hundredths.
        let error = (Vec3::new(r[pixel], g[pixel], 0.0) - expected).abs().max_element();
        assert!(error < 0.1 / 64.0, "pixel {pixel} is {error} off {expected}");
        seen += 1;
    }
    assert!(seen > 400, "{seen} pixels of background");
}

/// What is left between pipelines is the error of layers, and between one end and both that of so few directions.
#[test]
fn pipelines_agree_under_a_sky() {
    let gpu = gpu();
    let Loaded { world, mut settings, .. } = World::load(Path::new("scenes/open.toml")).unwrap();
    (settings.film.size, settings.directions.count) = (sized(&gpu, [48, 48], [24, 24]), 256);
    (settings.gather.layer_size, settings.photons.count) = (LayerSize::Texels(256), 100_000);
    let [fused, kill, early, rays_gl, rays] =
        PIPELINES.map(|pipeline| picture(&gpu, &world, &settings.with(|s| s.gather.pipeline = pipeline)));
    let check = |name: &str, a: &Image, b: &Image, limit: f64| {
        let result = compare(a, b, Selection::default()).unwrap();
        eprintln!("{name}: bias {:+.3} %, relative RMSE {:.3} %", 100.0 * result.bias, 100.0 * result.relative_rmse);
        assert!(result.relative_rmse < limit, "{name}: {result:?}");
    };
    check("fused and rays of both ends", &fused, &rays_gl, 0.01);
    check("kill and rays of one end", &kill, &rays, 0.01);
    check("early KILL and kill", &early, &kill, 0.001);
    check("both ends and one", &rays_gl, &rays, 0.1);
}

/// A dim sky with a square sun of `side` texels, radiance `sun`, behind the default camera and above it.
fn sunny(side: usize, sun: f32) -> Environment {
    let mut texels = vec![vec3(0.1, 0.2, 0.4); 256 * 128];
    for (row, column) in (0..side).flat_map(|row| (0..side).map(move |column| (50 + row, 20 + column))) {
        texels[256 * row + column] = vec3(1.0, 0.8, 0.6) * sun;
    }
    Environment::from_texels([256, 128], texels).unwrap()
}

/// ∫ L `weight` dd over the sphere, by the midpoints of 2048 × 1024 parts of the picture.
fn integral(environment: &Environment, weight: impl Fn(Vec3) -> f32) -> Vec3 {
    let mut sum = glam::DVec3::ZERO;
    for row in 0..1024 {
        let (sin, cos) = (PI * (row as f32 + 0.5) / 1024.0).sin_cos();
        for column in 0..2048 {
            let (x, z) = (2.0 * PI * ((column as f32 + 0.5) / 2048.0 - 0.5)).sin_cos();
            let direction = vec3(sin * x, cos, -sin * z);
            sum += (environment.radiance(direction) * weight(direction) * sin).as_dvec3();
        }
    }
    (sum * f64::from(PI / 1024.0) * f64::from(PI / 1024.0)).as_vec3()
}

/// A plate that faces the camera, and its points.
fn plate_under(environment: Environment) -> (World, Vec<GatherPoint>) {
    let mut model = Model::new();
    let material = model.material(Vec3::splat(0.5), Vec3::ZERO);
    model.plate(Vec3::ZERO, 1.5 * Vec3::X, 1.5 * Vec3::Y, material);
    model.scene.environment = Some(environment);
    let world = model.world();
    let points = points_on(&world.flatten(), 64);
    (world, points)
}

fn baked(gpu: &Gpu, world: &World, points: &[GatherPoint], settings: &Settings) -> Vec<finalgather::image::Channel> {
    let what = vec![Quantity::Irradiance, Quantity::Sh];
    let radiance_cache = RadianceCache::Photons;
    let plan = Plan { what, order: 1, gather_bounces: 0, ao_distance: None, radiance_cache, memory: 256 };
    let prepared = Prepared::without_glass(world).unwrap();
    let geometry = Geometry::upload(gpu, &prepared.scene).unwrap();
    let mut bake = Bake::new(gpu, prepared, geometry, points.to_vec(), settings, &plan).unwrap();
    while !bake.is_done() {
        bake.step().unwrap();
    }
    bake.columns().unwrap().0
}

/// A sun of one texel, which one of 5000 directions meets, lights a bake and a render as it should, with the default number of samples.
#[test]
fn a_small_sun_lights_bakes_and_renders() {
    let gpu = gpu();
    let environment = sunny(1, 2e4);
    let expected = integral(&environment, |direction| direction.z.max(0.0));
    let of_sky = PI * vec3(0.1, 0.2, 0.4);
    assert!(expected.x > 10.0 * of_sky.x, "the sun is most of the light: {expected}");
    let (world, points) = plate_under(environment);
    let settings = Settings::default().with(|s| (s.film.size, s.directions.count, s.photons.count) = ([16, 16], 256, 20_000));
    let columns = baked(&gpu, &world, &points, &settings);
    let of = |name: &str| &columns.iter().find(|column| column.name == name).unwrap().samples;
    let mut worst: f32 = 0.0;
    for (k, channel) in ["R", "G", "B"].into_iter().enumerate() {
        for i in 0..points.len() {
            // The sky and its sun are direct light.
            let [total, direct] =
                ["Irradiance", "IrradianceDirect"].map(|name| of(&format!("{name}.{channel}"))[i] / expected[k]);
            assert!((total - 1.0).abs() < 0.01 && (direct - total).abs() < 1e-5, "{channel}, {i}: {total} {direct}");
            worst = worst.max((total - 1.0).abs());
        }
    }
    let image = picture(&gpu, &world, &settings);
    let (coverage, rgb) = (image.channel("A").unwrap(), image.rgb().unwrap());
    for pixel in 0..coverage.len() {
        assert_eq!(coverage[pixel], 1.0, "the plate fills the picture");
        let found = Vec3::from(rgb.map(|samples| samples[pixel])) * PI / 0.5;
        assert!((found / expected - 1.0).abs().max_element() < 0.01, "{pixel}: {found} for {expected}");
        worst = worst.max((found / expected - 1.0).abs().max_element());
    }
    eprintln!("the sun: at most {:.2} % off", 100.0 * worst);
}

/// Spherical harmonics have no direct light apart: shared directions bring them all of the environment.
#[test]
fn harmonics_have_the_bright_parts() {
    let gpu = gpu();
    let environment = sunny(24, 40.0);
    let hemisphere = |direction: Vec3| if direction.z > 0.0 { 0.282_094_8 } else { 0.0 };
    let expected = integral(&environment, hemisphere);
    let gathered = environment.power() - environment.bright_power();
    assert!(gathered < 0.8 * environment.power(), "a fifth is bright");
    let (world, points) = plate_under(environment);
    let settings = Settings::default().with(|s| (s.directions.count, s.photons.count) = (2048, 20_000));
    let columns = baked(&gpu, &world, &points[..8], &settings);
    for (k, channel) in ["R", "G", "B"].into_iter().enumerate() {
        let name = format!("SH.00.{channel}");
        let found = columns.iter().find(|column| column.name == name).unwrap().samples[3];
        assert!((found / expected[k] - 1.0).abs() < 0.03, "{name}: {found} for {}", expected[k]);
    }
}
