//! Ray-traced pixels in whole renders. Without specular surfaces they show the camera's points. The white furnace holds with mirrors and glass.

mod common;

use common::{Model, cornell, gpu, sized};
use finalgather::geometry::Geometry;
use finalgather::points::{CameraPoints, EyeRays, GatherPoint};
use finalgather::render::Render;
use finalgather::scene::{Bvh, Camera, Surface};
use finalgather::settings::{LayerSize, PointSource, Settings};
use glam::{Vec2, Vec3, Vec4, vec3};

#[test]
fn without_mirrors_and_glass_the_points_are_the_cameras() {
    const SIZE: [u32; 2] = [160, 120];
    let (gpu, scene) = (gpu(), cornell());
    let (geometry, bvh) = (Geometry::upload(&gpu, &scene).unwrap(), Bvh::new(&scene.mesh));
    let camera = &scene.camera(SIZE);
    let rasterised = CameraPoints::new(&gpu, SIZE).unwrap();
    for offset in [Vec2::splat(0.5), Vec2::new(0.1, 0.8)] {
        let drawn = rasterised.see(&geometry, camera, offset, 3);
        let cast = EyeRays { scene: &scene, bvh: &bvh, camera, size: SIZE, seed: 0, ground: None }.see(offset, 3);
        let same = |a: GatherPoint, b: GatherPoint| {
            // Positions of a rasteriser, to some tens of roundings of numbers up to 1, seen from three times as far.
            (a.position - b.position).length() < 1e-5 && (a.normal - b.normal).length() < 1e-6
        };
        let near = |a: &[Vec4], b: &[Vec4], i: usize| (a[i] - b[i]).truncate().length() < 1e-5 && (a[i].w - b[i].w).abs() < 1e-5;
        let (mut off, mut seen) = (0, 0);
        for (i, points) in drawn.pixels().into_iter().zip(cast.pixels()).enumerate() {
            let agrees = match points {
                (Some(a), Some(b)) => {
                    same(a, b) && near(&drawn.albedo, &cast.albedo, i) && near(&drawn.emission, &cast.emission, i)
                }
                (None, None) => true,
                _ => false,
            };
            off += usize::from(!agrees);
            seen += usize::from(points.0.is_some());
        }
        eprintln!("{off} of {seen} pixels off");
        // Those on outlines, where a pixel's centre is within a rounding of an edge.
        assert!(seen > 8000 && off <= 8, "{off} of {seen} pixels are not the camera's");
        assert_eq!((drawn.count.abs_diff(cast.count) <= 8, cast.cut), (true, 0));
    }
}

/// Walls that emit 1 and reflect half send out 2 everywhere, and 2 is what comes back from a perfect mirror and through clear glass: directly, by
/// caustics and gathered, whatever way light takes. Nothing may count twice, and nothing be lost.
#[test]
fn furnace_with_mirror_and_glass() {
    let gpu = gpu();
    let mut model = Model::new();
    let wall = model.material(Vec3::splat(0.5), Vec3::ONE);
    let [mirror, glass] = [Surface::Mirror, Surface::Glass { index: 1.5, filter: Vec3::ONE }].map(|surface| {
        let material = model.material(Vec3::ONE, Vec3::ZERO);
        model.scene.materials[material as usize].surface = surface;
        material
    });
    model.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, wall);
    model.cuboid(vec3(-0.4, -0.4, -0.4), vec3(0.25, 0.4, 0.3), 0.4, false, mirror);
    model.sphere(vec3(0.35, -0.2, 0.1), 0.4, 24, false, glass);
    let camera =
        Camera { eye: vec3(0.1, 0.6, 0.95), target: vec3(0.0, -0.4, -0.5), up: Vec3::Y, fov_y_degrees: 80.0, lens: None };
    model.scene.camera = Some(camera);
    let world = model.world();
    let (size, directions, photons) = sized(&gpu, (96, 256, 400_000), (24, 64, 400_000));
    let mut settings = Settings::default();
    (settings.film.size, settings.film.points) = ([size; 2], PointSource::Traced);
    (settings.directions.count, settings.gather.layer_size) = (directions, LayerSize::Texels(128));
    (settings.photons.count, settings.direct.light_samples) = (photons, 1024);
    let mut render = Render::new(&gpu, &world, &settings).unwrap();
    while !render.is_done() {
        render.step().unwrap();
    }
    let image = render.picture();
    let mean = |name: &str| {
        let samples = &image.channels.iter().find(|channel| channel.name == name).unwrap().samples;
        samples.iter().map(|&sample| f64::from(sample)).sum::<f64>() / samples.len() as f64
    };
    let all = mean("R");
    let parts = ["Emission.R", "Direct.R", "Caustics.R", "Indirect.R"].map(mean);
    eprintln!("{all} of 2: {parts:?}");
    assert!(parts[2] > 0.05, "caustics do their part");
    assert!((all / 2.0 - 1.0).abs() < 0.01, "{all} of 2: {parts:?}");
}
