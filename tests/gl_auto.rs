//! The pipeline `auto`: what it chooses, and that its results are right and do not depend on how a job is run.

mod common;

use std::path::Path;

use common::{
    Model, both_ends, cornell, directions, gather_fused, gpu, irradiance, photon_grid, points_on, sized, vectors, world_of,
};
use finalgather::gather::{chosen_for_bake, chosen_for_picture};
use finalgather::photon::PhotonTexture;
use finalgather::points::GatherPoint;
use finalgather::reference::Reference;
use finalgather::render::{Render, RenderMerge};
use finalgather::scene::{Bvh, Environment, Scene};
use finalgather::settings::{LayerSize, PhotonSettings, Pipeline, Sequence, Settings};
use glam::{Vec3, vec3};

/// What a bake of points on the scene's surfaces chooses on a GPU.
fn for_bake(scene: &Scene, points: &[GatherPoint]) -> Pipeline {
    chosen_for_bake(false, &Settings::default(), &scene.mesh, &Bvh::new(&scene.mesh), points)
}

/// Points of a room whose walls, floor and ceiling are `thickness` thick. Half the points look into the room.
fn room(thickness: f32) -> Pipeline {
    let mut model = Model::new();
    model.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, 0);
    model.cuboid(Vec3::ZERO, Vec3::splat(1.0 + thickness), 0.0, false, 0);
    let scene = model.finish();
    for_bake(&scene, &points_on(&scene, 20_000))
}

#[test]
fn layers_serve_large_surfaces_and_many_points() {
    let scene = cornell();
    let points = points_on(&scene, 20_000);
    assert_eq!(for_bake(&scene, &points), Pipeline::Fused);
    assert_eq!(for_bake(&scene, &points[..1000]), Pipeline::RaycastGl, "peeling does not pay for few points");
    let bvh = Bvh::new(&scene.mesh);
    assert_eq!(chosen_for_picture(false, &Settings::default(), &scene, &bvh, &points), Pipeline::Fused);
    // Texels of 3 % of the room.
    let coarse = Settings::default().with(|s| s.gather.layer_size = LayerSize::Texels(32));
    assert_eq!(chosen_for_picture(false, &coarse, &scene, &bvh, &points), Pipeline::RaycastGl);
}

/// Whatever the points and the scene.
#[test]
fn software_drivers_need_no_rule() {
    let scene = cornell();
    let (bvh, points) = (Bvh::new(&scene.mesh), points_on(&scene, 20_000));
    for points in [&points[..], &points[..100]] {
        assert_eq!(chosen_for_bake(true, &Settings::default(), &scene.mesh, &bvh, points), Pipeline::Raycast);
        assert_eq!(chosen_for_picture(true, &Settings::default(), &scene, &bvh, points), Pipeline::Raycast);
    }
}

#[test]
fn thin_walls_and_fine_surfaces_need_rays() {
    assert_eq!([0.01, 0.2].map(room), [Pipeline::RaycastGl, Pipeline::Fused]);
    // A sheet without thickness between two rooms.
    let mut model = Model::new();
    model.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, 0);
    model.plate(Vec3::ZERO, Vec3::Y, Vec3::Z, 0);
    let scene = model.finish();
    assert_eq!(for_bake(&scene, &points_on(&scene, 20_000)), Pipeline::RaycastGl);
    // The inside of a ball, of triangles as wide as two texels of 128²: each point's neighbours rise above its tangent plane.
    let mut model = Model::new();
    model.sphere(Vec3::ZERO, 1.0, 64, true, 0);
    let scene = model.finish();
    assert_eq!(for_bake(&scene, &points_on(&scene, 20_000)), Pipeline::RaycastGl);
}

#[test]
fn what_is_small_in_a_large_scene_needs_rays_only_where_points_see_it() {
    let mut model = Model::new();
    model.plate(Vec3::ZERO, 500.0 * Vec3::Z, 500.0 * Vec3::X, 0);
    model.cuboid(vec3(0.0, 0.5, 0.0), Vec3::splat(0.5), 0.0, false, 0);
    let scene = model.finish();
    let scale = scene.mesh.bounds().extent().x / 1000.0;
    let around = |distance: f32| -> Vec<GatherPoint> {
        let at = |i: usize| scale * (0.52 + distance * (i as f32 + 0.5) / 20_000.0);
        let middle = scene.mesh.positions[0].y;
        (0..20_000).map(|i| GatherPoint::flat(vec3(at(i), middle, at(i * 7919 % 20_000)), Vec3::Y)).collect()
    };
    // Layers that fit the points resolve the block; over the whole ground, few points lie at its foot.
    assert_eq!([around(3.0), around(400.0)].map(|points| for_bake(&scene, &points)), [Pipeline::Fused; 2]);
    // All points within a texel of the block, but for one far away.
    let mut near = around(0.5);
    near[0].position.x = scale * 400.0;
    assert_eq!(for_bake(&scene, &near), Pipeline::RaycastGl);
}

#[test]
fn bundles_that_fit_their_receivers_find_the_hits_of_rays() {
    // A patch of floor beside a block, in a room a hundred times as wide. Layers of the whole room would have two texels on the patch.
    let gpu = gpu();
    let (count, number) = sized(&gpu, (4096, 64), (256, 16));
    let mut model = Model::new();
    let wall = model.material(Vec3::splat(0.5), Vec3::ZERO);
    let lamp = model.material(Vec3::ZERO, Vec3::splat(10.0));
    model.cuboid(Vec3::ZERO, Vec3::splat(100.0), 0.0, true, wall);
    model.cuboid(vec3(0.0, -98.0, 0.0), vec3(1.0, 2.0, 1.0), 0.3, false, wall);
    model.plate(vec3(0.0, 99.0, 0.0), 60.0 * Vec3::X, 60.0 * Vec3::Z, lamp);
    let scene = model.finish();
    let scale = scene.mesh.bounds().extent().x / 200.0;
    let at = |i: usize| vec3(1.5 + (i % 64) as f32 / 32.0, -100.0, (i / 64) as f32 / 32.0 - 1.0);
    let points: Vec<_> = (0..4096).step_by(4096 / count).map(|i| GatherPoint::flat(scale * at(i), Vec3::Y)).collect();
    let directions = directions(Sequence::R2, number);
    let bvh = Bvh::new(&scene.mesh);
    let grid = photon_grid(&scene, &bvh, 200_000);
    let rays = irradiance(&Reference::new(&scene, &bvh, &grid).gather(&points, &vectors(&both_ends(&directions))));
    let photons = PhotonTexture::upload(&gpu, &grid).unwrap();
    let layers = irradiance(&gather_fused(&gpu, &scene, &photons, &points, &directions, 128).0);
    let difference = common::Difference::between(&layers, &rays);
    eprintln!("fitted to a patch: mean {:.3} %, bias {:+.3} %", 100.0 * difference.mean, 100.0 * difference.bias);
    // Measured 0.07 %.
    assert!(difference.mean < 0.005 && difference.bias.abs() < 0.002, "{difference:?}");
}

#[test]
fn neighbours_with_different_directions_merge_and_resume_to_the_same_bits() {
    let gpu = gpu();
    let mut scene = cornell();
    scene.environment = Some(Environment::constant(Vec3::ONE).unwrap());
    let world = world_of(scene);
    let mut settings = Settings::default();
    (settings.film.size, settings.directions.count) = ([45, 37], 72);
    (settings.photons, settings.direct.light_samples) = (PhotonSettings { count: 10_000, ..settings.photons }, 16);
    let begin = || Render::new(&gpu, &world, &settings).unwrap();
    let run = |mut render: Render| {
        while !render.is_done() {
            render.step().unwrap();
        }
        render
    };
    let whole = run(begin());
    let expected = if gpu.is_software() { Pipeline::Raycast } else { Pipeline::RaycastGl };
    assert_eq!(whole.settings().gather.pipeline, expected, "it sees an environment");
    let counts = whole.statistics().gather;
    assert_eq!((whole.directions_done(), counts.directions, counts.distinct_directions), (72, 72, 8 * 72));
    assert_eq!(counts.rays_per_point, 36.0);

    let path = Path::new("part");
    let blocks = finalgather::render::blocks_of(&settings).count();
    let parts = [0..blocks / 3, blocks / 3..blocks].map(|shard| {
        let mut render = begin();
        render.only(shard);
        run(render)
    });
    let mut merge = RenderMerge::new(path, &parts[0].save()).unwrap();
    parts.iter().for_each(|part| merge.add(path, &part.save()).unwrap());
    assert!(merge.picture().unwrap() == whole.picture(), "shards differ from the whole");

    let mut resumed = begin();
    resumed.resume(path, &parts[0].save()).unwrap();
    assert!(run(resumed).picture() == whole.picture(), "a resumed render differs from the whole");

    let named = settings.with(|s| s.gather.pipeline = expected);
    let named = Render::new(&gpu, &world, &named).unwrap();
    assert!(named.job() != whole.job(), "a named pipeline does not interleave by itself");
}
