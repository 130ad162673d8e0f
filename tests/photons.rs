//! The photon map: energy, density, and the side of a surface that photons belong to.

mod common;

use std::f32::consts::PI;

use common::{Model, form_factor_of_opposed_squares, form_factor_of_polygon, points_on};
use finalgather::Environment;
use finalgather::photon::{PhotonCounts, PhotonGrid, PhotonStore, PhotonTracer};
use finalgather::random::Recurrence;
use finalgather::scene::{Bvh, Lights, Scene};
use glam::{DVec3, IVec3, Vec3, Vec4, dvec3, vec3};

/// A closed white room 2 wide with a lamp of half side 0.2 and radiance 1 near its ceiling.
fn room() -> Model {
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, Vec3::ONE);
    model.plate(vec3(0.0, 0.9, 0.0), 0.2 * Vec3::X, 0.2 * Vec3::Z, lamp);
    model.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, 0);
    model
}

fn traced(scene: &Scene, cells: u32, photons: u64, bounces: u32) -> PhotonGrid {
    let bvh = Bvh::new(&scene.mesh);
    let mut grid = PhotonGrid::new(&scene.mesh, cells);
    counted(scene, &bvh, photons, bounces, &mut grid);
    grid.add_area(scene, &bvh, 0);
    grid
}

/// Traces photons, each of which must come to an end of some kind.
fn counted(scene: &Scene, bvh: &Bvh, photons: u64, bounces: u32, grid: &mut PhotonGrid) -> PhotonCounts {
    let counts = PhotonTracer::new(scene, bvh, &Lights::new(scene), 0, bounces).trace(0..photons, grid);
    assert_eq!(counts.emitted, photons);
    assert_eq!(counts.emitted, counts.absorbed + counts.escaped + counts.cut, "{counts:?}");
    counts
}

fn total(grid: &PhotonGrid) -> Vec4 {
    grid.sums.iter().map(|&sums| Vec4::from(sums).as_dvec4()).sum::<glam::DVec4>().as_vec4()
}

/// Irradiance from the lamp, the first four vertices.
fn closed_form(scene: &Scene, position: Vec3, normal: Vec3) -> f32 {
    PI * form_factor_of_polygon(&scene.mesh.positions[..4], position, normal) as f32
}

#[test]
fn clipped_areas_add_up_to_the_surfaces() {
    // Light everywhere in a closed room: all within it counts on both sides, the ball's inside too. The room itself is left out of
    // the sum with the outermost cells, for its outside sees nothing.
    let mut model = Model::new();
    model.plate(vec3(0.1, 0.05, -0.1), vec3(0.5, 0.3, 0.1), vec3(-0.2, 0.4, 0.3), 0);
    model.sphere(vec3(-0.4, -0.3, 0.2), 0.3, 12, false, 0);
    let inner = model.scene.mesh.triangles.len();
    model.cuboid(Vec3::ZERO, Vec3::splat(1.2), 0.0, true, 0);
    let scene = model.finish();
    let mesh = &scene.mesh;
    let mut grid = PhotonGrid::new(mesh, 16);
    for sums in &mut grid.sums {
        sums[0] = 1.0;
    }
    grid.add_area(&scene, &Bvh::new(mesh), 0);
    let [width, height, depth] = grid.cells.to_array().map(|cells| cells as usize);
    let is_inner = |i: usize| {
        let cell = [i % width, i / width % height, i / (width * height) % depth];
        cell.into_iter().zip([width, height, depth]).all(|(at, cells)| at > 0 && at < cells - 1)
    };
    let found: f64 = grid.sums.iter().enumerate().filter(|&(i, _)| is_inner(i)).map(|(_, sums)| f64::from(sums[3])).sum();
    let expected = 2.0 * (0..inner).map(|triangle| f64::from(mesh.area(triangle))).sum::<f64>();
    eprintln!("area {found}, both sides {expected}");
    // Corners of clipped polygons are rounded to 6e-8 of the scene, some 1e-6 of a cell.
    assert!((found / expected - 1.0).abs() < 1e-5, "{found} of {expected}");
}

#[test]
fn flux_at_the_first_surface_is_what_was_emitted() {
    let scene = room().finish();
    let mesh = &scene.mesh;
    let emitted = PI * (mesh.area(0) + mesh.area(1));
    let found = total(&traced(&scene, 16, 100_000, 1));
    // No photon leaves the closed room. A cell adds some hundred photons in 32 bits, each rounded to 6e-8.
    for flux in found.truncate().to_array() {
        assert!((flux / emitted - 1.0).abs() < 1e-5, "{flux} of {emitted}");
    }
}

/// The walls lie between cells, and rounding would put photons on both sides.
#[test]
fn there_is_no_flux_without_area() {
    let mut grid = traced(&room().finish(), 16, 100_000, 4);
    let alone = |grid: &PhotonGrid| grid.sums.iter().filter(|sums| sums[0] > 0.0 && sums[3] == 0.0).count();
    assert_eq!(alone(&grid), 0);
    // Nor does it come with further photons.
    grid.clear_flux();
    counted(&room().finish(), &Bvh::new(&room().finish().mesh), 100_000, 4, &mut grid);
    assert_eq!(alone(&grid), 0);
    assert!(total(&grid).x > 0.0);
}

/// Across the surface, and not along it, where it would be another place's.
#[test]
fn flux_beside_a_surface_goes_straight_to_it() {
    let scene = room().finish();
    let mut grid = traced(&scene, 16, 100_000, 4);
    grid.clear_flux();
    let size = grid.cells.as_ivec3();
    let index = |bin: i32, cell: IVec3| (((bin * size.z + cell.z) * size.y + cell.y) * size.x + cell.x) as usize;
    let mut expected = vec![0; grid.sums.len()];
    for bin in 0..6 {
        for at in 0..size.element_product() {
            let cell = IVec3::new(at % size.x, at / size.x % size.y, at / (size.x * size.y));
            let is_cell = |cell: &IVec3| cell.cmpge(IVec3::ZERO).all() && cell.cmplt(size).all();
            let across = [-IVec3::AXES[bin as usize / 2], IVec3::AXES[bin as usize / 2]].map(|step| cell + step);
            let mut near = across.iter().filter(|near| is_cell(near) && grid.sums[index(bin, **near)][3] > 0.0);
            if let (0.0, Some(&near), None) = (grid.sums[index(bin, cell)][3], near.next(), near.next()) {
                grid.add_flux(index(bin, cell), Vec3::ONE);
                expected[index(bin, near)] += 1;
            }
        }
    }
    assert!(expected.iter().sum::<i32>() > 1000);
    // Of photons there are none, but what is there settles with them.
    PhotonTracer::new(&scene, &Bvh::new(&scene.mesh), &Lights::new(&scene), 0, 1).trace(0..0, &mut grid);
    assert!(grid.sums.iter().zip(expected).all(|(sums, expected)| sums[0] == expected as f32));
}

#[test]
fn white_surfaces_reflect_all_of_it() {
    let scene = room().finish();
    let emitted = PI * (scene.mesh.area(0) + scene.mesh.area(1));
    let found = total(&traced(&scene, 16, 20_000, 8));
    // The lamp itself is black and takes the share of each flight that meets it: the total is between all of 8 and none of its shadow.
    let share = found.x / emitted;
    assert!(share < 8.0 + 1e-4 && share > 8.0 * 0.9, "{share} times the emitted flux");
}

/// In a closed room of one albedo ρ, the lamp's included, all flux ends in surfaces: what they receive, times 1 - ρ, is what was emitted.
#[test]
fn a_closed_room_absorbs_what_is_emitted() {
    const PHOTONS: u64 = 500_000;
    let albedo = vec3(0.8, 0.5, 0.2);
    let mut model = Model::new();
    let lamp = model.material(albedo, Vec3::ONE);
    let wall = model.material(albedo, Vec3::ZERO);
    model.plate(vec3(0.0, 0.9, 0.0), 0.2 * Vec3::X, 0.2 * Vec3::Z, lamp);
    model.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, wall);
    let scene = model.finish();
    let mut grid = PhotonGrid::new(&scene.mesh, 16);
    let counts = counted(&scene, &Bvh::new(&scene.mesh), PHOTONS, 64, &mut grid);
    // No ray slips between walls, and a photon survives 64 surfaces with probability 0.8^64 = 6e-7.
    assert_eq!(counts.escaped, 0, "{counts:?}");
    assert!(counts.cut <= 4, "{counts:?}");
    let emitted = f64::from(PI * (scene.mesh.area(0) + scene.mesh.area(1)));
    let stored = total(&grid).truncate().as_dvec3() / emitted;
    for channel in 0..3 {
        // One photon's share is X = 1 + r X' if it survives, with probability s = 0.8, where r = ρ/s is what survivors keep of the
        // channel. So E[X] = 1/(1 - ρ) and E[X²] = (1 + 2ρ E[X]) / (1 - ρ²/s); four standard errors of the mean over the photons.
        let albedo = f64::from(albedo[channel]);
        let mean = 1.0 / (1.0 - albedo);
        let variance = (1.0 + 2.0 * albedo * mean) / (1.0 - albedo * albedo / 0.8) - mean * mean;
        let limit = 4.0 * (variance / PHOTONS as f64).sqrt() / mean;
        let share = stored[channel] * (1.0 - albedo);
        eprintln!("albedo {albedo:.1}: {:+.3} % off, at most {:.3} %", 100.0 * (share - 1.0), 100.0 * limit);
        assert!((share - 1.0).abs() < limit, "albedo {albedo}: {share} of the emitted flux");
    }
    // Each of the surfaces that a photon meets ends its flight with probability 0.2, so that 5 N (1 ± √0.8/√N) are met.
    let met = counts.stored as f64 * 0.2 / PHOTONS as f64;
    assert!((met - 1.0).abs() < 4.0 * (0.8 / PHOTONS as f64).sqrt(), "{counts:?}");
}

/// What does not escape is absorbed: emitted = Σ stored (1 - ρ) + escaped, for grey photons keep their flux.
#[test]
fn an_open_scene_absorbs_what_does_not_escape() {
    const PHOTONS: u64 = 100_000;
    const ALBEDO: f64 = 0.7;
    let mut model = Model::new();
    let lamp = model.material(Vec3::splat(ALBEDO as f32), Vec3::ONE);
    let grey = model.material(Vec3::splat(ALBEDO as f32), Vec3::ZERO);
    model.plate(vec3(0.0, 0.9, 0.0), 0.4 * Vec3::X, 0.4 * Vec3::Z, lamp);
    model.plate(vec3(0.0, -0.5, 0.0), Vec3::Z, Vec3::X, grey);
    model.plate(vec3(-1.0, 0.3, 0.0), 0.8 * Vec3::Y, Vec3::Z, grey);
    model.cuboid(vec3(0.3, -0.3, 0.2), Vec3::splat(0.19), 0.4, false, grey);
    let scene = model.finish();
    let bvh = Bvh::new(&scene.mesh);
    for bounces in [64, 2] {
        let mut grid = PhotonGrid::new(&scene.mesh, 16);
        let counts = counted(&scene, &bvh, PHOTONS, bounces, &mut grid);
        eprintln!("{bounces} bounces: {counts:?}");
        assert!(counts.escaped > PHOTONS / 10 && counts.absorbed > PHOTONS / 10, "{counts:?}");
        assert!(if bounces == 2 { counts.cut > PHOTONS / 20 } else { counts.cut == 0 }, "{counts:?}");
        // A surface ends a flight with probability 1 - ρ, whatever else happens: four standard errors.
        let expected = counts.stored as f64 * (1.0 - ALBEDO);
        let limit = 4.0 * (expected * ALBEDO).sqrt();
        assert!((counts.absorbed as f64 - expected).abs() < limit, "{} absorbed for {expected} ± {limit}", counts.absorbed);
        // All photons have the same flux, rounded to 6e-8 with each surface and each sum.
        let emitted = PI * (scene.mesh.area(0) + scene.mesh.area(1));
        let share = total(&grid).x / emitted / (counts.stored as f32 / PHOTONS as f32);
        assert!((share - 1.0).abs() < 1e-4, "{share}");
    }
}

/// Two black plates: what the lamp's light does not meet of the wall is lost to space.
#[test]
fn what_misses_a_wall_escapes() {
    const PHOTONS: u64 = 100_000;
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, Vec3::ONE);
    let black = model.material(Vec3::ZERO, Vec3::ZERO);
    model.plate(vec3(0.0, 1.0, 0.0), Vec3::X, Vec3::Z, lamp);
    model.plate(Vec3::ZERO, Vec3::Z, Vec3::X, black);
    let scene = model.finish();
    let counts = counted(&scene, &Bvh::new(&scene.mesh), PHOTONS, 64, &mut PhotonGrid::new(&scene.mesh, 16));
    let factor = form_factor_of_opposed_squares(2.0);
    let found = counts.escaped as f64 / PHOTONS as f64;
    eprintln!("{found} of the photons escape, expected {}", 1.0 - factor);
    // Four standard errors of independent photons; those of a low-discrepancy sequence do better.
    let limit = 4.0 * (factor * (1.0 - factor) / PHOTONS as f64).sqrt();
    assert!((found - (1.0 - factor)).abs() < limit, "{found} for {} ± {limit}", 1.0 - factor);
    assert_eq!((counts.absorbed, counts.cut), (counts.stored, 0), "{counts:?}");
}

#[test]
fn irradiance_is_that_under_the_lamp() {
    let scene = room().finish();
    let grid = traced(&scene, 16, 1_000_000, 1);
    let mut worst = 0.0_f32;
    let mut mean = 0.0;
    let points: Vec<_> = points_on(&scene, 2000).into_iter().filter(|point| point.normal.y > 0.9).collect();
    for point in &points {
        let found = grid.irradiance(point.position, 1, true).x;
        let error = found / closed_form(&scene, point.position, point.normal) - 1.0;
        worst = worst.max(error.abs());
        mean += error / points.len() as f32;
    }
    eprintln!("{} points of the floor: mean error {:+.2} %, worst {:.2} %", points.len(), 100.0 * mean, 100.0 * worst);
    // A cell of the floor's corners, an eighth wide, gets some thousand photons: a standard error of 3 %, four of which chance does not reach.
    // The mean over the floor has little share in it.
    assert!(points.len() > 100);
    assert!(worst < 0.12, "{worst}");
    assert!(mean.abs() < 0.01, "{mean}");
}

#[test]
fn corners_are_not_darkened() {
    let scene = room().finish();
    let grid = traced(&scene, 16, 1_000_000, 1);
    let low = scene.mesh.bounds().min;
    // Into each of the floor's corners, a quarter of a cell from both walls. A disc of a cell's radius would lie half outside the room
    // or more, and show less than half of the light.
    for (x, z) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
        let inset = low.abs() - 0.25 * grid.cell_size;
        let position = vec3(x * inset.x, low.y, z * inset.z);
        let share = grid.irradiance(position, 1, true).x / closed_form(&scene, position, Vec3::Y);
        eprintln!("corner {x} {z}: {share}");
        // Measured 1.05: the mean of a cell is that of its middle, which is nearer to the lamp; and 3 % are noise.
        assert!((share - 1.0).abs() < 0.12, "{share} of the irradiance in the corner {x} {z}");
    }
}

#[test]
fn thin_walls_keep_their_sides_apart() {
    // The lit room is on the right, at x > 0; the wall is a hundredth of a cell thick.
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, Vec3::ONE);
    let white = model.material(Vec3::splat(0.8), Vec3::ZERO);
    model.plate(vec3(1.0, 0.9, 0.0), 0.2 * Vec3::X, 0.2 * Vec3::Z, lamp);
    model.cuboid(vec3(1.0005, 0.0, 0.0), Vec3::ONE, 0.0, true, white);
    model.cuboid(vec3(-1.0005, 0.0, 0.0), Vec3::ONE, 0.0, true, white);
    let scene = model.finish();
    let grid = traced(&scene, 32, 200_000, 16);
    let on_wall = |point: &Vec3| point.x.abs() < 1e-3;
    let (mut dark, mut lit, mut far) = (0, 0, 0);
    for point in points_on(&scene, 5000) {
        let position = point.position;
        let normal = point.normal;
        let axis = finalgather::math::dominant_axis(normal);
        let found = grid.irradiance(position, axis, normal[axis] > 0.0);
        if on_wall(&position) && normal.x < 0.0 {
            dark += 1;
            assert_eq!(found, Vec3::ZERO, "the dark side of the wall at {position}");
        } else if on_wall(&position) {
            lit += 1;
            assert!(found.min_element() > 0.0, "the lit side of the wall at {position}");
        } else if position.x < -1.5 * grid.cell_size {
            // Nearer to the foot of the wall, a cell holds floor of both rooms.
            far += 1;
            assert_eq!(found, Vec3::ZERO, "the dark room at {position}");
        }
    }
    assert!(dark > 100 && lit > 100 && far > 100);
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let scene = room().finish();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let sums = pool.install(|| traced(&scene, 16, 50_000, 8)).sums;
        sums.into_iter().map(|sums| sums.map(f32::to_bits)).collect::<Vec<_>>()
    };
    assert!(with(1) == with(4));
}

#[test]
fn rays_along_axes_meet_a_room_whatever_the_sign_of_their_zeros() {
    let mut model = Model::new();
    model.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, 0);
    model.sphere(Vec3::ZERO, 0.2, 12, false, 0);
    let bvh = Bvh::new(&model.finish().mesh);
    for direction in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z] {
        for zero in [0.0, -0.0] {
            let direction = Vec3::from_array(direction.to_array().map(|x| if x == 0.0 { zero } else { x }));
            for origin in [vec3(0.11, 0.12, 0.13), vec3(0.05, -0.3, 0.35), vec3(-0.4, 0.3, -0.07)] {
                assert!(bvh.nearest(origin, direction, None).is_some(), "from {origin} along {direction:?}");
            }
        }
    }
}

/// A sky of radiance L sends πL to each unit of area that sees nothing else, the side below included; one of radiance 1 + y sends π(1 + 2/3 n·y).
#[test]
fn a_plate_receives_the_whole_sky() {
    const PHOTONS: u64 = 400_000;
    let row = |row: usize| Vec3::ONE * (1.0 + (PI * (row as f32 + 0.5) / 64.0).cos());
    let gradient = Environment::from_texels([128, 64], (0..128 * 64).map(|i| row(i / 128)).collect()).unwrap();
    let constant = Environment::constant(vec3(1.0, 2.0, 0.5)).unwrap();
    let skies =
        [("constant", constant, vec3(1.0, 2.0, 0.5), [1.0, 1.0]), ("gradient", gradient, Vec3::ONE, [5.0 / 3.0, 1.0 / 3.0])];
    for (name, sky, radiance, factors) in skies {
        let mut model = Model::new();
        let black = model.material(Vec3::ZERO, Vec3::ZERO);
        model.plate(Vec3::ZERO, Vec3::Z, Vec3::X, black);
        let mut scene = model.finish();
        scene.environment = Some(sky);
        let mut grid = PhotonGrid::new(&scene.mesh, 8);
        let counts = counted(&scene, &Bvh::new(&scene.mesh), PHOTONS, 64, &mut grid);
        let area = scene.mesh.area(0) + scene.mesh.area(1);
        // Bins of +y come before those of -y, and all the others are empty.
        let bin = grid.sums.len() / 6;
        for (side, factor) in [(2, factors[0]), (3, factors[1])] {
            let flux: Vec3 = grid.sums[side * bin..(side + 1) * bin].iter().map(|&[r, g, b, _]| vec3(r, g, b)).sum();
            let found = flux / (PI * area * factor * radiance);
            eprintln!("{name}, side {side}: {found} of the sky's");
            // Of equal fluxes so many meet the side: four standard errors, of which a low-discrepancy sequence needs few.
            let limit = 4.0 / (counts.stored as f32 * factor / 2.0).sqrt();
            assert!((found - 1.0).abs().max_element() < limit, "{name}, side {side}: {found} ± {limit}");
        }
        assert_eq!(counts.escaped + counts.stored, PHOTONS);
    }
}

/// A lamp and a sky share the photons by power, and each light has its own flux: two black plates, of which one shines at the other with
/// form factor F. The lamp's flux is πA F; the sky's πA from outside to each, and πA(1 - F) to each from between.
#[test]
fn a_lamp_and_a_sky_share_the_photons() {
    const PHOTONS: u64 = 400_000;
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, vec3(4.0, 0.0, 0.0));
    let black = model.material(Vec3::ZERO, Vec3::ZERO);
    model.plate(vec3(0.0, 1.0, 0.0), Vec3::X, Vec3::Z, lamp);
    model.plate(Vec3::ZERO, Vec3::Z, Vec3::X, black);
    let mut scene = model.finish();
    scene.environment = Some(Environment::constant(vec3(0.0, 1.0, 0.0)).unwrap());
    let mut grid = PhotonGrid::new(&scene.mesh, 8);
    let counts = counted(&scene, &Bvh::new(&scene.mesh), PHOTONS, 64, &mut grid);
    let (area, factor) = (scene.mesh.area(0) + scene.mesh.area(1), form_factor_of_opposed_squares(2.0) as f32);
    let found = total(&grid).truncate() / (PI * area);
    let expected = vec3(4.0 * factor, 2.0 * (2.0 - factor), 0.0);
    eprintln!("{found} for {expected}, {counts:?}");
    // The lamp has 0.36 of the power, and F of its photons meet the plate: 60 000 with a standard error of 0.31 %. Of the sky's more do.
    let error = (found / expected - 1.0).truncate().abs().max_element();
    assert!(error < 4.0 * 0.0031 && found.z == 0.0, "{found} for {expected}");
}

/// Each light is picked as often as it has power, and photons bring the flux of all.
#[test]
fn lights_are_picked_by_power() {
    const PHOTONS: u64 = 100_000;
    let mut scene = room().finish();
    scene.environment = Some(Environment::constant(vec3(0.01, 0.02, 0.0)).unwrap());
    let lights = Lights::new(&scene);
    let starts = Recurrence::<5>::new(0);
    let (mut from_sky, mut flux) = (0, DVec3::ZERO);
    for photon in 0..PHOTONS {
        let (path, of_one) = lights.emit(starts.point(photon));
        from_sky += u64::from(path.triangle.is_none());
        flux += of_one.as_dvec3() / PHOTONS as f64;
    }
    let area = f64::from(scene.mesh.area(0) + scene.mesh.area(1));
    let pi = f64::from(PI);
    // The sky's radiance comes from 4π and through a disc of area π.
    let sky = 4.0 * pi * pi * dvec3(0.01, 0.02, 0.0);
    let lamp = pi * area * DVec3::ONE;
    let share = sky.element_sum() / (sky + lamp).element_sum();
    let found = from_sky as f64 / PHOTONS as f64;
    assert!((found / share - 1.0).abs() < 1e-3, "{found} of the photons for {share} of the power");
    assert!((flux / (sky + lamp) - 1.0).abs().max_element() < 1e-3, "{flux} for {}", sky + lamp);
}

/// A world without light makes a scene without lights, and a black sky is none.
#[test]
fn darkness_is_the_same_before_and_after_flattening() {
    let sky = |radiance| Some(Environment::constant(Vec3::splat(radiance)).unwrap());
    for (emission, environment, dark) in
        [(0.0, None, true), (0.0, sky(0.0), true), (0.0, sky(1.0), false), (1.0, sky(0.0), false), (1.0, None, false)]
    {
        let mut model = Model::new();
        let material = model.material(Vec3::ZERO, Vec3::splat(emission));
        model.plate(Vec3::ZERO, Vec3::X, Vec3::Z, material);
        // A material that no triangle uses is no light.
        model.material(Vec3::ZERO, Vec3::ONE);
        model.scene.environment = environment;
        let world = model.world();
        let lights = Lights::new(&world.flatten());
        assert_eq!((world.is_dark(), lights.is_dark()), (dark, dark));
        assert_eq!(lights.count() > 0, emission > 0.0);
    }
}
