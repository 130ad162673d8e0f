//! Mirrors, glass and lenses compared with closed forms, on paths of eye rays and of photons.

mod common;

use std::f32::consts::PI;

use common::{Model, form_factor_of_polygon};
use finalgather::photon::{CausticMap, CausticPhoton, PhotonGrid, PhotonTracer};
use finalgather::points::{EyeRays, GBuffer};
use finalgather::scene::{Bvh, Camera, Chance, Lens, Lights, Path, Rays, Scene, Surface, fresnel};
use glam::{Vec2, Vec3, vec3};

const CLEAR: Surface = Surface::Glass { index: 1.5, filter: Vec3::ONE };

/// Adds a material of this surface that keeps all light.
fn specular(model: &mut Model, surface: Surface) -> u32 {
    let material = model.material(Vec3::ONE, Vec3::ZERO);
    model.scene.materials[material as usize].surface = surface;
    material
}

/// A camera on the z axis that looks against it.
fn camera(z: f32, fov_y_degrees: f32) -> Camera {
    Camera { eye: z * Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, fov_y_degrees, lens: None }
}

fn see(scene: &Scene, camera: &Camera, side: u32, block: u32) -> GBuffer {
    let bvh = Bvh::new(&scene.mesh);
    EyeRays { scene, bvh: &bvh, camera, size: [side; 2], seed: 0, ground: None }.see(Vec2::splat(0.5), block)
}

/// Relative to the closed form, or absolute below 1: a few roundings.
fn assert_near(found: f32, expected: f32, what: &str) {
    assert!((found - expected).abs() <= 2e-6 * expected.abs().max(1.0), "{what}: {found}, expected {expected}");
}

#[test]
fn fresnel_has_its_closed_forms() {
    for index in [1.1_f32, 1.5, 2.4] {
        assert_near(fresnel(1.0, index.recip()), ((index - 1.0) / (index + 1.0)).powi(2), "head on");
        // At Brewster's angle, tan θ = n, only one of two polarisations is reflected.
        let squared = ((index * index - 1.0) / (index * index + 1.0)).powi(2);
        assert_near(fresnel((1.0 + index * index).sqrt().recip(), index.recip()), squared / 2.0, "Brewster's angle");
        // The way back reflects as much.
        for sine in [0.2_f32, 0.7, 0.95] {
            let [outside, inside] = [sine, sine / index].map(|sine| (1.0 - sine * sine).sqrt());
            assert_near(fresnel(outside, index.recip()), fresnel(inside, index), "either side");
        }
        // Totally beyond the critical angle, sin θ = 1/n, and not before.
        let cosine = |sine: f32| (1.0 - sine * sine).sqrt();
        assert!(fresnel(cosine(0.999 / index), index) < 0.9 && fresnel(cosine(1.001 / index), index) == 1.0);
    }
    assert_near(fresnel(0.5, 1.0 / 1.5), 0.089_185_6, "60 degrees");
}

#[test]
fn light_bends_by_snells_law() {
    let mut model = Model::new();
    let glass = specular(&mut model, CLEAR);
    // Its front faces +z: glass is below.
    model.plate(Vec3::ZERO, Vec3::X, Vec3::Y, glass);
    let (scene, bvh) = (&model.scene, Bvh::new(&model.scene.mesh));
    let rays = Rays::new(scene, &bvh);
    for (from, ratio) in [(1.0_f32, 1.0 / 1.5), (-1.0, 1.5)] {
        for sine in [0.0_f32, 0.3, 0.6, 0.9] {
            let direction = vec3(0.8 * sine, 0.6 * sine, -from * (1.0 - sine * sine).sqrt());
            for choice in [0.0, 0.9999] {
                let mut path = Path { origin: -0.5 * direction + vec3(0.01, 0.02, 0.0), direction, triangle: None };
                assert!(path.advance(&rays, Chance::of_direction(0)).is_some());
                assert_eq!(path.scatter(scene, &mut { choice }), Some(Vec3::ONE));
                let through = choice > 0.5 && ratio * sine < 1.0;
                let expected = if through {
                    let refracted = ratio * sine;
                    vec3(0.8 * refracted, 0.6 * refracted, -from * (1.0 - refracted * refracted).sqrt())
                } else {
                    direction * vec3(1.0, 1.0, -1.0)
                };
                assert!((path.direction - expected).length() < 1e-6, "{direction}: {} for {expected}", path.direction);
                assert!(path.origin.z * path.direction.z > 0.0, "it starts on its own side");
            }
        }
    }
}

/// Of a pane, summed over all reflections inside: with R at a face and the filter f, T = f (1 - R) / (1 + R) passes and R + R T
/// returns; panes are added one by one, again with all reflections between.
#[test]
fn panes_of_glass_pass_what_they_do_not_reflect() {
    const SIDE: u32 = 32;
    const BLOCKS: u32 = 32;
    let filter = vec3(1.0, 0.5, 0.1);
    let face = 0.04_f32;
    for panes in 1..=3 {
        let mut model = Model::new();
        let glass = specular(&mut model, Surface::Glass { index: 1.5, filter });
        let lit = model.material(Vec3::ONE, Vec3::ONE);
        model.plate(-3.0 * Vec3::Z, Vec3::X, Vec3::Y, lit);
        for pane in 0..panes {
            model.cuboid(vec3(0.0, 0.0, -0.5 * pane as f32), vec3(1.0, 1.0, 0.1), 0.0, false, glass);
        }
        let (mut found, mut emission) = (Vec3::ZERO, Vec3::ZERO);
        for block in 0..BLOCKS {
            let visible = see(&model.scene, &camera(3.0, 1.0), SIDE, block);
            assert_eq!(visible.cut, 0);
            emission = visible.emission[0].truncate();
            found += visible.albedo.iter().map(|albedo| albedo.truncate()).sum::<Vec3>() / (SIDE * SIDE * BLOCKS) as f32;
        }
        for channel in 0..3 {
            let pass = filter[channel] * (1.0 - face) / (1.0 + face);
            let back = face + face * pass;
            let (mut passed, mut returned) = (1.0, 0.0);
            for _ in 0..panes {
                let between = 1.0 - returned * back;
                (passed, returned) = (passed * pass / between, returned + passed * passed * back / between);
            }
            let [found, emission] = [found[channel], emission[channel]];
            eprintln!("{panes} panes, channel {channel}: {found} and {emission} for {passed}");
            // All ways are followed to a light but those that bring less than a thousandth, which are many behind many panes.
            assert!((emission - passed).abs() < 5e-3, "{panes} panes, channel {channel}: {emission} for {passed}");
            // Each path brings some f^k or nothing: five standard errors of as many independent ones.
            let limit = 5.0 * passed * (0.25 / (SIDE * SIDE * BLOCKS) as f32).sqrt() / passed.min(0.5);
            assert!((found - passed).abs() < limit, "{panes} panes, channel {channel}: {found} for {passed}");
        }
    }
}

/// A room of which one wall is a mirror looks as one twice as wide, of which the other half is its image.
#[test]
fn a_mirror_shows_the_room_again() {
    const WALL: f32 = 0.999;
    let room = |doubled: bool| {
        let mut model = Model::new();
        let red = model.material(vec3(0.8, 0.1, 0.1), Vec3::ZERO);
        let floor = model.material(vec3(0.2, 0.3, 0.4), Vec3::ZERO);
        let mirror = specular(&mut model, Surface::Mirror);
        model.scene.materials[mirror as usize].albedo = vec3(0.9, 0.8, 0.7);
        let ball = vec3(0.3, -0.4, -0.2);
        model.sphere(ball, 0.3, 16, false, red);
        let (middle, half) = if doubled { (WALL, 1.0 + WALL) } else { (0.0, 1.0) };
        model.cuboid(vec3(middle, 0.0, 0.0), vec3(half, 1.0, 1.0), 0.0, true, 0);
        model.plate(vec3(middle, -0.9, 0.0), half * Vec3::X, -0.99 * Vec3::Z, floor);
        match doubled {
            true => model.sphere(vec3(2.0 * WALL, 0.0, 0.0) + ball * vec3(-1.0, 1.0, 1.0), 0.3, 16, false, red),
            false => model.plate(vec3(WALL, 0.0, 0.0), Vec3::Y, Vec3::Z, mirror),
        }
        model.scene
    };
    let camera =
        Camera { eye: vec3(-0.6, 0.3, 0.8), target: vec3(0.8, -0.1, -0.2), up: Vec3::Y, fov_y_degrees: 70.0, lens: None };
    let [mirrored, doubled] = [false, true].map(|doubled| see(&room(doubled), &camera, 128, 0));
    let (mut in_mirror, mut off) = (0, 0);
    for (pixel, (here, there)) in mirrored.pixels().into_iter().zip(doubled.pixels()).enumerate() {
        let (here, there) = (here.unwrap(), there.unwrap());
        let beyond = there.position.x > WALL;
        let (flip, kept) = if beyond { (vec3(-1.0, 1.0, 1.0), vec3(0.9, 0.8, 0.7)) } else { (Vec3::ONE, Vec3::ONE) };
        in_mirror += usize::from(beyond);
        let position = flip * there.position + if beyond { vec3(2.0 * WALL, 0.0, 0.0) } else { Vec3::ZERO };
        let albedo = kept * doubled.albedo[pixel].truncate();
        let same = (here.position - position).length() < 1e-5
            && (here.normal - flip * there.normal).length() < 1e-5
            && (mirrored.albedo[pixel].truncate() - albedo).length() < 1e-6;
        off += usize::from(!same);
    }
    eprintln!("{in_mirror} pixels in the mirror, {off} off");
    // Rays that graze an outline may meet either side of it.
    assert!(in_mirror > 4000 && off <= 16, "{off} of {} pixels differ, {in_mirror} in the mirror", 128 * 128);
}

/// Between two mirrors that face each other, each ray is followed so far and no farther, and is counted.
#[test]
fn endless_reflections_are_cut_and_counted() {
    let mut model = Model::new();
    let mirror = specular(&mut model, Surface::Mirror);
    model.plate(-Vec3::Z, 9.0 * Vec3::X, 9.0 * Vec3::Y, mirror);
    model.plate(4.0 * Vec3::Z, 9.0 * Vec3::X, 9.0 * Vec3::Y, mirror);
    let visible = see(&model.scene, &camera(3.0, 1.0), 8, 0);
    assert_eq!((visible.cut, visible.count), (64, 0));
    assert!(visible.emission.iter().all(|emission| (emission.w - 4.0).abs() < 1e-3), "the first mirror's depth");
}

/// A lens of radius r focused at f blurs what is at z to a disc of radius r |z - f| / f there.
#[test]
fn a_lens_is_sharp_where_it_is_focused() {
    const RADIUS: f32 = 0.2;
    const FOCUS: f32 = 2.0;
    const BLOCKS: u32 = 256;
    for distance in [1.0, FOCUS, 3.0] {
        let mut model = Model::new();
        model.plate(vec3(0.0, 0.0, 3.0 - distance), 9.0 * Vec3::X, 9.0 * Vec3::Y, 0);
        let pinhole = camera(3.0, 40.0);
        let lens = Camera { lens: Some(Lens { radius: RADIUS, focus_distance: FOCUS }), ..pinhole };
        let sharp = see(&model.scene, &pinhole, 4, 0);
        let blur = RADIUS * (distance - FOCUS).abs() / FOCUS;
        let (mut farthest, mut squares) = (0.0_f32, 0.0);
        for block in 0..BLOCKS {
            let seen = see(&model.scene, &lens, 4, block);
            for (a, b) in seen.position.iter().zip(&sharp.position) {
                let off = (a - b).truncate().length();
                farthest = farthest.max(off);
                squares += off * off / (16 * BLOCKS) as f32;
            }
        }
        eprintln!("at {distance}: up to {farthest}, root mean square {}, for {blur}", squares.sqrt());
        // The mean square over a disc is half its radius squared; 256 stratified samples know it to a percent.
        assert!(farthest < blur + 1e-5 && farthest > 0.97 * blur, "at {distance}: {farthest} for {blur}");
        assert!((squares.sqrt() - blur / 2.0_f32.sqrt()).abs() < 0.01 * blur + 1e-5, "at {distance}: {}", squares.sqrt());
    }
}

/// A black room with a lamp: what is emitted arrives, whatever clear glass and perfect mirrors it passes.
#[test]
fn glass_and_mirrors_keep_the_flux_of_photons() {
    const PHOTONS: u64 = 100_000;
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, vec3(1.0, 2.0, 3.0));
    let black = model.material(Vec3::ZERO, Vec3::ZERO);
    let [glass, mirror] = [CLEAR, Surface::Mirror].map(|surface| specular(&mut model, surface));
    model.plate(vec3(0.0, 0.9, 0.0), 0.2 * Vec3::X, 0.2 * Vec3::Z, lamp);
    model.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, black);
    model.sphere(vec3(0.2, 0.1, 0.3), 0.4, 24, false, glass);
    model.cuboid(vec3(-0.5, -0.5, -0.4), vec3(0.3, 0.4, 0.2), 0.5, false, mirror);
    let scene = model.finish();
    let (bvh, lights) = (Bvh::new(&scene.mesh), Lights::new(&scene));
    let mut grid = PhotonGrid::new(&scene.mesh, 16);
    let tracer = PhotonTracer::new(&scene, &bvh, &lights, 0, 8);
    let counts = tracer.trace(0..PHOTONS, &mut grid);
    eprintln!("{counts:?}");
    assert_eq!((counts.escaped, counts.absorbed + counts.cut, counts.stored), (0, PHOTONS, counts.absorbed), "{counts:?}");
    // From a sphere all light that enters comes out again; along facets some is caught. Measured: 0.2 %.
    assert!(counts.cut < PHOTONS / 200, "{counts:?}");
    let emitted = PI * (scene.mesh.area(0) + scene.mesh.area(1)) * vec3(1.0, 2.0, 3.0);
    let stored: Vec3 = grid.sums.iter().map(|sums| Vec3::from_slice(sums)).sum();
    let share = stored / emitted * PHOTONS as f32 / counts.absorbed as f32;
    assert!((share - 1.0).abs().max_element() < 1e-4, "{share} of the emitted flux");

    let caustics: Vec<CausticPhoton> = tracer.caustics(0..PHOTONS);
    assert!(caustics.len() > PHOTONS as usize / 10, "{} photons by way of the bodies", caustics.len());
    let each = emitted / PHOTONS as f32;
    assert!(caustics.iter().all(|photon| (photon.flux / each - 1.0).abs().max_element() < 1e-4), "clear glass takes nothing");
    // Nothing that comes straight is among them.
    let mut opaque = scene.clone();
    opaque.materials.iter_mut().for_each(|material| material.surface = Surface::Diffuse);
    assert!(PhotonTracer::new(&opaque, &bvh, &lights, 0, 8).caustics(0..PHOTONS).is_empty());
}

/// Glass of index 1 is not there, but that all light behind it counts as a caustic.
#[test]
fn caustics_have_the_closed_form_of_direct_light() {
    const PHOTONS: u64 = 1_000_000;
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, Vec3::ONE);
    let black = model.material(Vec3::ZERO, Vec3::ZERO);
    let nothing = specular(&mut model, Surface::Glass { index: 1.0, filter: Vec3::ONE });
    model.plate(0.5 * Vec3::Y, 0.3 * Vec3::X, 0.3 * Vec3::Z, lamp);
    model.plate(-0.5 * Vec3::Y, Vec3::Z, Vec3::X, black);
    model.cuboid(Vec3::ZERO, vec3(1.0, 0.1, 1.0), 0.0, false, nothing);
    let scene = model.finish();
    let (bvh, lights) = (Bvh::new(&scene.mesh), Lights::new(&scene));
    let tracer = PhotonTracer::new(&scene, &bvh, &lights, 0, 8);
    let floor = scene.mesh.positions[4].y;
    for block in [0, 31] {
        let map = CausticMap::new(tracer.caustics(0..PHOTONS), block);
        let (mut found, mut expected) = (0.0, 0.0);
        for step in 0..400 {
            let position = vec3(step as f32 % 20.0 / 20.0 - 0.5, 0.0, step as f32 / 400.0 - 0.5) * 0.6 + floor * Vec3::Y;
            found += map.irradiance(position, Vec3::Y).y;
            expected += PI * form_factor_of_polygon(&scene.mesh.positions[..4], position, Vec3::Y) as f32;
            assert_eq!(map.irradiance(position, Vec3::NEG_Y), Vec3::ZERO, "the other side");
        }
        eprintln!("block {block}: {:+.3} %", 100.0 * (found / expected - 1.0));
        // Some 100 000 photons in all discs together, which overlap: 0.3 % and a little.
        assert!((found / expected - 1.0).abs() < 0.01, "block {block}: {found} for {expected}");
    }
}
