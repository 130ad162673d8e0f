//! Cut-outs and partial opacity on the GL side: all pipelines find the hits of exact rays, shadows are exact, and the camera sees its share.

mod common;

use std::f32::consts::PI;
use std::rc::Rc;

use common::{Difference, Model, directions, gather, gather_early, gather_fused, gather_rays, gpu, irradiance, points_on, sized};
use finalgather::direct::{Direct, SampleShare};
use finalgather::direction::Direction;
use finalgather::gather::{CpuRayFinder, HitFinder};
use finalgather::geometry::Geometry;
use finalgather::gpu::Gpu;
use finalgather::photon::{PhotonGrid, PhotonTexture};
use finalgather::points::{CameraPoints, EyeRays, GBuffer, GatherPoint, PointList};
use finalgather::random::Random;
use finalgather::reference::Reference;
use finalgather::scene::{Bvh, Camera, Environment, ImageTexture, Lights, Opacity, Sampler, Scene};
use finalgather::settings::Sequence;
use glam::{DVec4, Vec2, Vec3, Vec3Swizzles, Vec4, vec2, vec3};

/// Opaque and clear squares, so many along a side, as on a chess-board.
fn chess(squares: u32) -> ImageTexture {
    let alpha = |i: u32| if (i % squares + i / squares).is_multiple_of(2) { 255 } else { 0 };
    let texels = (0..squares * squares).map(|i| [255, 255, 255, alpha(i)]).collect();
    ImageTexture { width: squares, height: squares, texels, sampler: Sampler { nearest: true, ..Sampler::default() } }
}

/// A material of this opacity.
fn cut_out(model: &mut Model, albedo: f32, opacity: Opacity) -> u32 {
    let material = model.material(Vec3::splat(albedo), Vec3::ZERO);
    model.scene.materials[material as usize].opacity = opacity;
    material
}

fn share(share: f32) -> Opacity {
    Opacity { share, ..Opacity::default() }
}

/// Adds a plate with coordinates from 0 to `repeats` on its texture.
fn mapped_plate(model: &mut Model, [center, half_u, half_v]: [Vec3; 3], repeats: f32, material: u32) {
    model.plate(center, half_u, half_v, material);
    let uvs = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y].map(|uv| repeats * uv);
    let first = model.scene.mesh.uvs.len() - 4;
    model.scene.mesh.uvs[first..].copy_from_slice(&uvs);
}

/// The sums of exact rays on the CPU, by one end of each direction, or by both.
fn exact(scene: &Scene, grid: &PhotonGrid, points: &[GatherPoint], directions: &[Direction], ends: &[f32]) -> Vec<Vec4> {
    let bvh = Bvh::new(&scene.mesh);
    let oracle = Reference::new(scene, &bvh, grid);
    let sum = |point: &GatherPoint| {
        let of = |direction: &Direction| {
            ends.iter().map(|end| oracle.sample(point, end * direction.vector, direction.number)).sum::<DVec4>()
        };
        directions.iter().map(of).sum::<DVec4>().as_vec4()
    };
    points.iter().map(sum).collect()
}

/// The irradiance of each pipeline with its name, and that of exact rays by the ends that it uses.
fn by_all(
    gpu: &Gpu,
    scene: &Scene,
    grid: &PhotonGrid,
    points: &[GatherPoint],
    (directions, size): (&[Direction], u32),
) -> Vec<(&'static str, Vec<Vec3>, Vec<Vec3>)> {
    let photons = PhotonTexture::upload(gpu, grid).unwrap();
    let [one, both] = [&[1.0][..], &[1.0, -1.0]].map(|ends| irradiance(&exact(scene, grid, points, directions, ends)));
    let kill = gather(gpu, scene, &photons, points, directions, size);
    let early = gather_early(gpu, scene, &photons, points, directions, size);
    let (fused, _) = gather_fused(gpu, scene, &photons, points, directions, size);
    let rays = gather_rays(gpu, scene, &photons, points, directions);
    vec![
        ("kill", irradiance(&kill), one.clone()),
        ("early-kill", irradiance(&early), one),
        ("fused", irradiance(&fused), both.clone()),
        ("raycast-gl", irradiance(&rays), both),
    ]
}

/// One, two and three panes over a floor under a bright sky, wide enough to hide nearly all of it from the middle of the floor.
#[test]
fn panes_let_their_share_of_the_sky_pass() {
    let gpu = gpu();
    let (count, size, spread) = sized(&gpu, (256, 256, 200), (128, 128, 100));
    let directions = directions(Sequence::Sobol, count);
    for panes in 0..=sized(&gpu, 3, 1) {
        let mut model = Model::new();
        let pane = cut_out(&mut model, 0.0, share(0.3));
        model.plate(Vec3::ZERO, 0.1 * Vec3::Z, 0.1 * Vec3::X, 0);
        let points = points_on(&model.scene, spread);
        for number in 0..panes {
            model.plate((0.02 + 0.01 * number as f32) * Vec3::Y, Vec3::Z, Vec3::X, pane);
        }
        let mut scene = model.scene;
        scene.environment = Some(Environment::constant(Vec3::ONE).unwrap());
        let grid = PhotonGrid::new(&scene.mesh, 4);
        for (pipeline, found, exact) in by_all(&gpu, &scene, &grid, &points, (&directions, size)) {
            let mean = found.iter().map(|e| e.x / PI).sum::<f32>() / found.len() as f32;
            let expected = 0.7f32.powi(panes);
            let difference = Difference::between(&found, &exact);
            eprintln!("{panes} panes, {pipeline}: {mean:.4} of {expected:.4}, {difference:?} from exact rays");
            // Independent choices of 256 rays with cosine weights have a standard error of 0.04, even ones of half.
            let most = 0.06 * (256.0 / count as f32).sqrt();
            assert!((mean - expected).abs() <= if panes == 0 { 1e-4 } else { most }, "{panes} panes, {pipeline}: {mean}");
            // Where two triangles of a pane meet, layers are off by half a texel. As a share of the sky that is 0.7 % at most (three panes by `kill`).
            let most = sized(&gpu, 0.01, 0.02);
            assert!(difference.mean * f64::from(expected) < most, "{panes} panes, {pipeline}: {difference:?}");
        }
    }
}

/// A fine blind: half of the sky passes, and layers see the same blind as rays.
#[test]
fn a_chess_board_lets_half_pass() {
    let gpu = gpu();
    let (count, size, spread) = sized(&gpu, (128, 512, 4000), (32, 256, 4000));
    let mut model = Model::new();
    let blind = cut_out(&mut model, 0.0, Opacity { texture: Some(0), cutoff: Some(0.5), ..Opacity::default() });
    model.plate(Vec3::ZERO, 0.1 * Vec3::Z, 0.1 * Vec3::X, 0);
    let floor = points_on(&model.scene, spread);
    mapped_plate(&mut model, [0.02 * Vec3::Y, Vec3::Z, Vec3::X], 7.0, blind);
    let mut scene = model.scene;
    scene.textures.push(chess(8));
    scene.environment = Some(Environment::constant(Vec3::ONE).unwrap());
    // In the outermost texel of the floor the centre may see nothing but a hole. There what lies beside closes the scene, as on any outline.
    let inside = |point: &GatherPoint| point.position.xz().abs().max_element() < 0.095;
    let points: Vec<_> = floor.into_iter().filter(inside).collect();
    let grid = PhotonGrid::new(&scene.mesh, 4);
    for (pipeline, found, exact) in by_all(&gpu, &scene, &grid, &points, (&directions(Sequence::R2, count), size)) {
        let mean = found.iter().map(|e| e.x / PI).sum::<f32>() / found.len() as f32;
        let difference = Difference::between(&found, &exact);
        eprintln!("blind, {pipeline}: {mean:.4}, {difference:?} from exact rays, {} points", points.len());
        assert!((mean - 0.5).abs() < sized(&gpu, 0.01, 0.03), "{pipeline}: {mean}");
        assert!(difference.bias.abs() < sized(&gpu, 0.005, 0.01), "{pipeline}: {difference:?}");
    }
}

/// Crossed cards with a mask of round leaves, on a floor.
fn leaves(cards: u32, opacity: Opacity) -> Scene {
    let mut model = Model::new();
    let leaf = cut_out(&mut model, 0.4, opacity);
    model.plate(Vec3::ZERO, Vec3::Z, Vec3::X, 0);
    let mut random = Random::new(3, 0);
    for _ in 0..cards {
        let mut within = |size: f32| size * (2.0 * random.uniform() - 1.0);
        let center = vec3(within(0.7), 0.3 + within(0.2), within(0.7));
        let u = vec3(within(1.0), within(1.0), within(1.0)).normalize();
        let v = u.cross(vec3(within(1.0), within(1.0), within(1.0))).normalize();
        mapped_plate(&mut model, [center, 0.12 * u, 0.12 * v], 2.0, leaf);
    }
    let side = 32;
    let round = |i: u32| vec2((i % side) as f32 + 0.5, (i / side) as f32 + 0.5) / side as f32 - 0.5;
    let alpha = |i: u32| (255.0 * ((0.4 - round(i).length()) * side as f32 / 2.0 + 0.5).clamp(0.0, 1.0)) as u8;
    let texels = (0..side * side).map(|i| [255, 255, 255, alpha(i)]).collect();
    let mut scene = model.scene;
    scene.textures.push(ImageTexture { width: side, height: side, texels, sampler: Sampler::default() });
    scene.environment = Some(Environment::constant(Vec3::ONE).unwrap());
    scene
}

/// Layers neither thicken nor thin leaves, seen from the floor and from leaves, whose edges end within texels.
#[test]
fn layers_see_leaves_as_rays_do() {
    let gpu = gpu();
    let (count, size, points) = sized(&gpu, (64, 512, 2000), (8, 256, 800));
    for (name, cutoff) in [("mask", Some(0.5)), ("blend", None)].into_iter().take(sized(&gpu, 2, 1)) {
        let scene = leaves(60, Opacity { texture: Some(0), cutoff, ..Opacity::default() });
        let mut grid = PhotonGrid::new(&scene.mesh, 8);
        // Surfaces send out a third of the sky's light.
        grid.sums.fill([PI, PI, PI, 1.0]);
        let all: Vec<_> = points_on(&scene, points);
        let there = |point: &&GatherPoint| {
            let near = |&triangle: &usize| {
                let weights = scene.mesh.barycentric(triangle, point.position);
                weights.min_element() >= 0.0 && (scene.mesh.corners(triangle)[0] - point.position).dot(point.normal).abs() < 1e-6
            };
            (0..scene.mesh.triangles.len()).find(near).is_some_and(|triangle| scene.opacity(triangle, point.position) > 0.5)
        };
        let all: Vec<GatherPoint> = all.iter().filter(there).cloned().collect();
        let (floor, leaf): (Vec<_>, Vec<_>) = all.into_iter().partition(|point| point.position.y == 0.0);
        for (place, points) in [("floor", floor), ("leaves", leaf)] {
            for (pipeline, found, exact) in by_all(&gpu, &scene, &grid, &points, (&directions(Sequence::R2, count), size)) {
                let difference = Difference::between(&found, &exact);
                eprintln!(
                    "{name}, {place}, {pipeline}: mean {:.3} %, bias {:+.3} % of {} points",
                    100.0 * difference.mean,
                    100.0 * difference.bias,
                    points.len()
                );
                let (mean, bias) =
                    if pipeline == "raycast-gl" { (0.001, 0.0005) } else { sized(&gpu, (0.02, 0.004), (0.04, 0.02)) };
                assert!(difference.mean < mean && difference.bias.abs() < bias, "{name}, {place}, {pipeline}: {difference:?}");
            }
        }
    }
}

/// In a furnace every ray brings the same light, whether it passes or not. So none is lost at cut-outs.
#[test]
fn a_furnace_with_cut_outs_stays_one() {
    let gpu = gpu();
    let (count, size, points) = sized(&gpu, (32, 512, 2048), (16, 128, 128));
    let mut model = Model::new();
    let mask = cut_out(&mut model, 1.0, Opacity { texture: Some(0), cutoff: Some(0.5), ..Opacity::default() });
    let pane = cut_out(&mut model, 1.0, share(0.4));
    model.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, 0);
    mapped_plate(&mut model, [vec3(0.1, 0.2, 0.1), 0.6 * Vec3::Z, vec3(0.5, 0.2, 0.0)], 1.0, mask);
    mapped_plate(&mut model, [vec3(-0.1, -0.3, 0.2), vec3(0.1, 0.1, 0.5), 0.6 * Vec3::X], 1.0, pane);
    model.scene.textures.push(chess(6));
    let scene = model.finish();
    let mut grid = PhotonGrid::new(&scene.mesh, 8);
    grid.sums.fill([PI, PI, PI, 1.0]);
    let points = points_on(&scene, points);
    for (pipeline, found, _) in by_all(&gpu, &scene, &grid, &points, (&directions(Sequence::R2, count), size)) {
        let worst = found.iter().map(|e| (*e / PI - 1.0).abs().max_element()).fold(0.0, f32::max);
        eprintln!("{pipeline}: worst of {} points {worst:e}", points.len());
        assert!(worst < 1e-3, "{pipeline}: {worst}");
    }
}

/// The hits of a bake by rays on the CPU are those of the oracle.
#[test]
fn cpu_rays_find_the_hits_of_the_oracle() {
    let gpu = gpu();
    let scene = leaves(20, share(0.5));
    let (bvh, grid) = (Rc::new(Bvh::new(&scene.mesh)), PhotonGrid::new(&scene.mesh, 1));
    let points = points_on(&scene, 500);
    let (geometry, list) = (Geometry::upload(&gpu, &scene).unwrap(), PointList::upload(&gpu, &points).unwrap());
    let mut finder = CpuRayFinder::new(&gpu, &scene, Rc::clone(&bvh));
    let oracle = Reference::new(&scene, &bvh, &grid);
    for direction in directions(Sequence::R2, 8) {
        finder.begin(&geometry, &[direction]).unwrap();
        finder.find(&geometry, list.points()).unwrap();
        let found: Vec<Vec4> = list.in_order(finder.hits().expect("it has found hits").read());
        let hits = oracle.hits(&points, direction.vector, direction.number);
        for ((point, hit), found) in points.iter().zip(hits).zip(found) {
            if point.normal.dot(direction.vector) > 0.0 {
                let slot = hit.map_or(0, |hit| 1 + geometry.order.iter().position(|&triangle| triangle == hit.triangle).unwrap());
                assert_eq!(found.y as usize, slot, "{point:?} along {direction:?}");
            }
        }
    }
}

/// Light of a nearly punctual lamp at points of a floor, with what `add` puts between them.
fn lit_through(points: &[GatherPoint], add: impl Fn(&mut Model)) -> Vec<f32> {
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, Vec3::splat(1e4));
    model.plate(vec3(0.0, 0.8, 0.0), 1e-3 * Vec3::X, 1e-3 * Vec3::Z, lamp);
    model.plate(-0.5 * Vec3::Y, 0.8 * Vec3::Z, 0.8 * Vec3::X, 0);
    add(&mut model);
    let (gpu, scene) = (gpu(), model.scene);
    let geometry = Geometry::upload(&gpu, &scene).unwrap();
    let list = PointList::upload(&gpu, points).unwrap();
    let direct = Direct::new(&gpu, 0).unwrap();
    let found = direct.irradiance(&geometry, &Lights::new(&scene), SampleShare::whole(4), list.points()).unwrap();
    gpu.check("direct light").unwrap();
    list.in_order(found).into_iter().map(|irradiance| irradiance.x).collect()
}

fn floor_points() -> Vec<GatherPoint> {
    let at = |i: u32| 0.038 * (i as f32 - 20.0) + 0.007;
    (0..1600).map(|i| GatherPoint::flat(vec3(at(i % 40), -0.5, at(i / 40)), Vec3::Y)).collect()
}

/// Without noise, as shadow rays make no choices.
#[test]
fn shadows_of_panes_are_products() {
    let points = floor_points();
    let bare = lit_through(&points, |_| {});
    let shadowed = lit_through(&points, |model| {
        for (height, opacity) in [(0.0, 0.3), (0.1, 0.5), (0.2, 0.2)] {
            let pane = cut_out(model, 0.5, share(opacity));
            model.plate(height * Vec3::Y, vec3(0.1, 0.0, 0.9), 0.9 * Vec3::X, pane);
        }
    });
    let expected = 0.7 * 0.5 * 0.8;
    for ((point, bare), found) in points.iter().zip(&bare).zip(&shadowed) {
        assert!((found / bare - expected).abs() < 1e-5, "{} at {}", found / bare, point.position);
    }
}

/// The lamp's light through a chess-board. Points are compared whose line passes a square well inside.
#[test]
fn shadows_of_a_mask_are_sharp() {
    let points = floor_points();
    let bare = lit_through(&points, |_| {});
    let found = lit_through(&points, |model| {
        let blind = cut_out(model, 0.5, Opacity { texture: Some(0), cutoff: Some(0.5), ..Opacity::default() });
        mapped_plate(model, [Vec3::ZERO, 0.6 * Vec3::Z, 0.6 * Vec3::X], 1.0, blind);
        model.scene.textures.push(chess(8));
    });
    let mut seen = [0, 0];
    for ((point, bare), found) in points.iter().zip(&bare).zip(&found) {
        // From the lamp at 0.8 to the floor at -0.5 the line passes height 0 after 0.8/1.3 of the way.
        let at = point.position.xz() * (0.8 / 1.3);
        let place = 8.0 * (vec2(at.y, at.x) / 1.2 + 0.5);
        if (place - place.round()).abs().min_element() < 0.02 {
            continue;
        }
        // u runs along z, v along x; the first row of texels is the highest v.
        let (column, row) = (place.x as u32, 7 - place.y as u32);
        let is_opaque = (column + row) % 2 == 0;
        seen[usize::from(is_opaque)] += 1;
        let expected = if is_opaque { 0.0 } else { 1.0 };
        assert!((found / bare - expected).abs() < 1e-5, "{} of {expected} at {}", found / bare, point.position);
    }
    assert!(seen.iter().all(|&seen| seen > 500), "{seen:?}");
}

/// The camera sees a pane in its share of the blocks, and rays see the same blocks.
#[test]
fn the_camera_sees_its_share() {
    const SIZE: [u32; 2] = [32, 32];
    let gpu = gpu();
    let blocks = sized(&gpu, 64, 16);
    let mut model = Model::new();
    let pane = cut_out(&mut model, 0.5, share(0.3));
    let mask = cut_out(&mut model, 0.5, Opacity { texture: Some(0), cutoff: Some(0.5), ..Opacity::default() });
    model.plate(-0.5 * Vec3::Z, 0.9 * Vec3::X, 0.9 * Vec3::Y, 0);
    mapped_plate(&mut model, [vec3(-0.4, 0.0, 0.0), 0.3 * Vec3::X, 0.6 * Vec3::Y], 1.0, pane);
    mapped_plate(&mut model, [vec3(0.4, 0.0, 0.0), 0.3 * Vec3::X, 0.6 * Vec3::Y], 1.0, mask);
    model.scene.textures.push(chess(4));
    let scene = model.scene;
    let camera = &Camera { eye: 2.0 * Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_y_degrees: 50.0, lens: None };
    let (geometry, bvh) = (Geometry::upload(&gpu, &scene).unwrap(), Bvh::new(&scene.mesh));
    let rasterised = CameraPoints::new(&gpu, SIZE).unwrap();
    let (mut panes, mut masks, mut different, mut pixels) = ([0, 0], [0, 0], 0, 0);
    for block in 0..blocks {
        let offset = Vec2::splat(0.5);
        let drawn = rasterised.see(&geometry, camera, offset, block);
        let cast = EyeRays { scene: &scene, bvh: &bvh, camera, size: SIZE, seed: 0, ground: None }.see(offset, block);
        let places = |buffer: &GBuffer| buffer.position.iter().map(|position| position.truncate()).collect::<Vec<_>>();
        for (drawn, cast) in places(&drawn).into_iter().zip(places(&cast)) {
            pixels += 1;
            different += u32::from(drawn.distance(cast) > 1e-4);
        }
        // The places of both plates, at their own height.
        for (index, position) in places(&drawn).into_iter().enumerate() {
            let pixel = vec2((index as u32 % SIZE[0]) as f32 + 0.5, (index as u32 / SIZE[0]) as f32 + 0.5) / 32.0;
            let ray = camera.ray(vec2(pixel.x, 1.0 - pixel.y), 1.0);
            let at = camera.eye + ray * (-camera.eye.z / ray.z);
            let is_there = u32::from(position.z == 0.0);
            let inside = |x: f32| (at.x - x).abs() < 0.28 && at.y.abs() < 0.58;
            if inside(-0.4) {
                panes = [panes[0] + is_there, panes[1] + 1];
            } else if inside(0.4) {
                masks = [masks[0] + is_there, masks[1] + 1];
            }
        }
    }
    let share = |[there, all]: [u32; 2]| there as f32 / all as f32;
    eprintln!("pane {:.4}, mask {:.4}, {different} of {pixels} pixels differ from rays", share(panes), share(masks));
    assert!((share(panes) - 0.3).abs() < 0.02, "the pane is there in {} of the pixels", share(panes));
    assert!((share(masks) - 0.5).abs() < 0.1, "the mask is there in {} of the pixels", share(masks));
    assert!(different * 200 < pixels, "{different} of {pixels} pixels differ from rays");
}
