//! Cut-outs and partial opacity on the CPU: choices of rays, photons, areas that photons share, and what files say.

#[path = "common/found.rs"]
mod found;

mod common;

use std::f32::consts::PI;

use common::{Model, form_factor_of_polygon, points_on};
use finalgather::photon::{PhotonAtlas, PhotonGrid, PhotonStore, PhotonTracer};
use finalgather::scene::{Bvh, Chance, ImageTexture, Lights, LoadOptions, Loaded, Opacity, Rays, Sampler, Scene, World};
use found::{QUAD, WALL, encoded, open};
use glam::{Vec2, Vec3, Vec3Swizzles, vec3};

/// Stacked panes of this opacity, two wide, one at each height, over a floor.
fn panes(opacity: f32, heights: &[f32]) -> Scene {
    let mut model = Model::new();
    let pane = model.material(Vec3::ZERO, Vec3::ZERO);
    model.scene.materials[pane as usize].opacity.share = opacity;
    for &height in heights {
        model.plate(height * Vec3::Y, Vec3::Z, Vec3::X, pane);
    }
    model.plate(Vec3::NEG_Y, Vec3::Z, Vec3::X, 0);
    model.scene
}

/// Opaque and clear squares, so many along a side, as on a chess-board.
fn chess(squares: u32) -> ImageTexture {
    let alpha = |i: u32| if (i % squares + i / squares).is_multiple_of(2) { 255 } else { 0 };
    let texels = (0..squares * squares).map(|i| [255, 255, 255, alpha(i)]).collect();
    ImageTexture { width: squares, height: squares, texels, sampler: Sampler { nearest: true, ..Sampler::default() } }
}

/// The share of chances by which a ray down the middle, a little off the diagonals of the panes, reaches the floor.
fn passed(scene: &Scene, chances: impl Iterator<Item = Chance>) -> f32 {
    let bvh = Bvh::new(&scene.mesh);
    let rays = Rays::new(scene, &bvh);
    let floor = scene.mesh.triangles.len() - 2;
    let origin = vec3(0.1, 0.9, 0.3);
    let reaches = |chance| rays.nearest(origin, Vec3::NEG_Y, None, chance).unwrap().triangle >= floor;
    let reached: Vec<bool> = chances.map(reaches).collect();
    reached.iter().filter(|&&reached| reached).count() as f32 / reached.len() as f32
}

#[test]
fn panes_let_the_product_pass() {
    for opacity in [0.0, 0.1, 0.3, 0.5, 0.9, 1.0] {
        for heights in [&[0.0][..], &[0.0, 0.2], &[0.0, 0.2, 0.4]] {
            let scene = panes(opacity, heights);
            let expected = (1.0f32 - opacity).powi(heights.len() as i32);
            for (name, found) in [
                ("directions", passed(&scene, (0..4096).map(Chance::of_direction))),
                ("blocks of a pixel", passed(&scene, (0..4096).map(|block| Chance::of_pixel(77, block, 0)))),
                ("pixels of a block", passed(&scene, (0..4096).map(|pixel| Chance::of_pixel(pixel, 3, 0)))),
                ("photons", passed(&scene, (0..4096).map(|photon| Chance::of_photon(photon, 0)))),
            ] {
                // Independent choices have a standard error of 0.008 at most. One pane is even over consecutive numbers of one stream.
                let even = heights.len() == 1 && name != "pixels of a block";
                let most = if even { 2.0 / 4096.0 } else { 0.03 };
                assert!((found - expected).abs() <= most, "{name}, {} panes of {opacity}: {found}", heights.len());
            }
            let bvh = Bvh::new(&scene.mesh);
            let through = Rays::new(&scene, &bvh).transmittance(vec3(0.1, 0.9, 0.3), Vec3::NEG_Y, 1.5);
            assert!((through - expected).abs() < 1e-6, "{} panes of {opacity}: {through}", heights.len());
        }
    }
}

#[test]
fn choices_of_one_path_are_independent() {
    // A photon that passes a pane twice, and an eye ray that sees it again in a mirror.
    let scene = panes(0.5, &[0.0]);
    let bvh = Bvh::new(&scene.mesh);
    let rays = Rays::new(&scene, &bvh);
    let is_cut = |chance| rays.nearest(vec3(0.1, 0.9, 0.3), Vec3::NEG_Y, None, chance).unwrap().triangle >= 2;
    let of_photon = |photon: u32, surfaces| is_cut(Chance::of_photon(photon.into(), surfaces));
    let of_pixel = |pixel: u32, surfaces| is_cut(Chance::of_pixel(pixel, 5, surfaces));
    for surfaces in 1..8 {
        let photons = (0..4096).filter(|&photon| of_photon(photon, 0) && of_photon(photon, surfaces)).count();
        let pixels = (0..4096).filter(|&pixel| of_pixel(pixel, 0) && of_pixel(pixel, surfaces)).count();
        for (name, both) in [("photons", photons), ("pixels", pixels)] {
            assert!((850..1200).contains(&both), "{name} of 4096 that pass first and after {surfaces} surfaces: {both}");
        }
    }
}

#[test]
fn a_cutoff_makes_places_opaque_or_clear() {
    let mut scene = panes(1.0, &[0.0]);
    let texels = [0u8, 100, 150, 255].map(|alpha| [255, 255, 255, alpha]).to_vec();
    let sampler = Sampler { nearest: true, ..Sampler::default() };
    scene.textures.push(ImageTexture { width: 4, height: 1, texels, sampler });
    scene.mesh.uvs[..4].copy_from_slice(&[Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
    let position = |column: u32| {
        let [a, b, ..] = scene.mesh.positions[..4] else { unreachable!() };
        a.lerp(b, (column as f32 + 0.5) / 4.0) + 0.1 * (scene.mesh.positions[2] - b)
    };
    let places: Vec<(usize, Vec3)> = (0..4).map(|column| (0, position(column))).collect();
    for (opacity, expected) in [
        (Opacity { texture: Some(0), ..Opacity::default() }, [0.0, 100.0 / 255.0, 150.0 / 255.0, 1.0]),
        (Opacity { texture: Some(0), share: 0.5, cutoff: None }, [0.0, 50.0 / 255.0, 75.0 / 255.0, 0.5]),
        (Opacity { texture: Some(0), share: 1.0, cutoff: Some(0.5) }, [0.0, 0.0, 1.0, 1.0]),
        (Opacity { texture: Some(0), share: 0.6, cutoff: Some(0.5) }, [0.0, 0.0, 0.0, 1.0]),
        (Opacity { texture: None, share: 0.4, cutoff: Some(0.5) }, [0.0; 4]),
    ] {
        let mut scene = scene.clone();
        scene.materials[1].opacity = opacity;
        for (&(triangle, position), expected) in places.iter().zip(expected) {
            let found = scene.opacity(triangle, position);
            assert!((found - expected).abs() < 1e-5, "{opacity:?}: {found}, not {expected}");
        }
    }
}

/// A floor of opacity `share` or with a mask, under a lamp of radiance 1, and another floor below. The lamp's corners are the first four vertices.
fn lit_floors(share: f32, mask: Option<ImageTexture>) -> Scene {
    let mut model = Model::new();
    let lamp = model.material(Vec3::ZERO, Vec3::ONE);
    let floor = model.material(Vec3::ZERO, Vec3::ZERO);
    let pane = model.material(Vec3::ZERO, Vec3::ZERO);
    model.plate(vec3(0.0, 0.8, 0.0), 0.3 * Vec3::X, 0.3 * Vec3::Z, lamp);
    model.plate(Vec3::ZERO, 0.8 * Vec3::Z, 0.8 * Vec3::X, pane);
    model.plate(vec3(0.0, -0.6, 0.0), 0.8 * Vec3::Z, 0.8 * Vec3::X, floor);
    let scene = &mut model.scene;
    scene.materials[pane as usize].opacity = Opacity { share, texture: mask.is_some().then_some(0), cutoff: None };
    scene.textures.extend(mask);
    scene.mesh.uvs[4..8].copy_from_slice(&[Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
    model.scene
}

/// What a pane stops lights it as an opaque one, because only the area that is there counts. The rest lights what is below.
#[test]
fn photons_light_what_is_there() {
    const PHOTONS: u64 = 2_000_000;
    for (name, scene, stopped) in [
        ("half a pane", lit_floors(0.5, None), 0.5),
        ("chess-board", lit_floors(1.0, Some(chess(16))), 0.5),
        ("a quarter", lit_floors(0.25, None), 0.25),
    ] {
        let (bvh, lights) = (Bvh::new(&scene.mesh), Lights::new(&scene));
        let tracer = PhotonTracer::new(&scene, &bvh, &lights, 0, 4);
        let mut atlas = PhotonAtlas::new(&scene, &bvh, None, |groups, count| tracer.arrivals(PHOTONS, groups, count));
        tracer.trace(0..PHOTONS, &mut atlas);
        let mut grid = PhotonGrid::new(&scene.mesh, 8);
        tracer.trace(0..PHOTONS, &mut grid);
        grid.add_area(&scene, &bvh, 0);
        let points: Vec<_> = points_on(&scene, 4000)
            .into_iter()
            .filter(|point| point.position.y < 0.5 && point.position.xz().abs().max_element() < 0.4)
            .collect();
        let (upper, lower): (Vec<_>, Vec<_>) = points.into_iter().partition(|point| point.position.y > -0.1);
        for (place, points, share) in [("pane", upper, 1.0), ("floor", lower, 1.0 - stopped)] {
            let of_lamp = |position, normal| PI * form_factor_of_polygon(&scene.mesh.positions[..4], position, normal) as f32;
            let expected: f32 = points.iter().map(|point| share * of_lamp(point.position, point.normal)).sum();
            let ray = |position: Vec3| bvh.nearest(position + 1e-3 * Vec3::Y, Vec3::NEG_Y, None).unwrap().triangle;
            for (map, store) in [("atlas", &atlas as &dyn PhotonStore), ("grid", &grid)] {
                let found: f32 = points
                    .iter()
                    .map(|point| {
                        store
                            .irradiance_of_hit(
                                &scene.mesh,
                                ray(point.position),
                                point.position,
                                scene.mesh.meets_front(ray(point.position), Vec3::NEG_Y),
                            )
                            .x
                    })
                    .sum();
                let error = found / expected - 1.0;
                eprintln!("{name}, {place}, {map}: {:+.2} % of {} points", 100.0 * error, points.len());
                // Some 50 000 photons in the middle of the pane: noise of 0.5 %, and the grid's cells reach beyond the middle.
                assert!(error.abs() < if map == "atlas" { 0.015 } else { 0.05 }, "{name}, {place}, {map}: {error}");
            }
        }
    }
}

fn picture_of(alpha: [u8; 4]) -> Vec<u8> {
    let mut picture = image::RgbaImage::new(2, 2);
    picture.pixels_mut().zip(alpha).for_each(|(pixel, alpha)| *pixel = image::Rgba([200, 100, 50, alpha]));
    encoded(picture.into())
}

#[test]
fn what_material_libraries_say() {
    let mut grey = image::GrayImage::new(2, 2);
    grey.pixels_mut().zip([0, 64, 128, 255]).for_each(|(pixel, value)| *pixel = image::Luma([value]));
    let (grey, white) = (encoded(grey.into()), encoded(image::GrayImage::from_pixel(2, 2, image::Luma([255])).into()));
    let (leaf, clear, opaque) = (picture_of([0, 9, 128, 255]), picture_of([0; 4]), picture_of([255; 4]));
    let (from_alpha, from_grey) = (Some([0, 9, 128, 255]), Some([0, 64, 128, 255]));
    let invisible = "m.mtl:3: material \"wall\" would be invisible";
    for (statements, share, alpha, warning) in [
        ("d 0.5", 0.5, None, ""),
        ("d -halo 0.25", 0.25, None, ""),
        ("D 0.5", 0.5, None, ""),
        ("Tr 0.25", 0.75, None, ""),
        ("d 1\nTr 1", 1.0, None, ""),
        ("Tr 1\nd 0.5", 0.5, None, ""),
        ("Tr 0", 1.0, None, ""),
        ("d 0", 1.0, None, invisible),
        ("Tr 1", 1.0, None, invisible),
        ("d 2", 1.0, None, "m.mtl:3: d has the value 2; it is clamped to 0 to 1"),
        ("d half", 1.0, None, "m.mtl:3: d has the value half; it is left out"),
        ("map_d grey.png", 1.0, from_grey, ""),
        ("map_d leaf.png", 1.0, from_alpha, ""),
        ("map_d -clamp on leaf.png\nd 0.5", 0.5, from_alpha, ""),
        ("map_d white.png", 1.0, None, ""),
        ("map_d gone.png\nd 0.5", 0.5, None, "m.mtl:3: cannot read this texture"),
        ("map_d clear.png", 1.0, None, invisible),
        ("d 0\nmap_d grey.png", 1.0, from_grey, "m.mtl:4: material \"wall\" would be invisible"),
        ("map_Kd leaf.png", 1.0, from_alpha, ""),
        ("map_Kd opaque.png", 1.0, None, ""),
        ("map_Kd leaf.png\nmap_d grey.png", 1.0, from_grey, ""),
        ("map_Kd leaf.png\nmap_d leaf.png", 1.0, from_alpha, ""),
        ("map_Kd opaque.png\nmap_d -s 2 2 grey.png", 1.0, None, "pictures do not show yet: wall (opacity map grey.png, placed"),
        ("map_Kd leaf.png\nillum 4", 1.0, None, ""),
        ("d 0.3\nillum 6", 1.0, None, ""),
    ] {
        let mtl = format!("{WALL}{statements}\n");
        let files: [(&str, &[u8]); 7] = [
            ("m.obj", QUAD.as_bytes()),
            ("m.mtl", mtl.as_bytes()),
            ("grey.png", &grey),
            ("white.png", &white),
            ("leaf.png", &leaf),
            ("clear.png", &clear),
            ("opaque.png", &opaque),
        ];
        let Loaded { world, report, .. } = open(&files);
        let Opacity { share: found, texture, cutoff } = world.materials[0].opacity;
        let texels = texture.map(|texture| [0, 1, 2, 3].map(|i| world.textures[texture].texels[i][3]));
        assert_eq!((found, texels, cutoff), (share, alpha, None), "{statements}: {:?}", report.warnings);
        let warnings = report.warnings.join("\n");
        assert!(warnings.is_empty() == warning.is_empty(), "{statements}: {warnings}");
        let (place, fragment) = warning.split_once(' ').unwrap_or_default();
        assert!(warnings.contains(place) && warnings.contains(fragment), "{statements}: {warnings}");
    }
}

#[test]
fn what_scene_files_say() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    write("m.obj", QUAD.as_bytes());
    write("m.mtl", WALL.as_bytes());
    write("leaf.png", &picture_of([0, 9, 128, 255]));
    let load = |lines: &str| {
        write("s.toml", format!("mesh = \"m.obj\"\n[materials.wall]\n{lines}\n").as_bytes());
        World::load_with(&folder.path().join("s.toml"), LoadOptions { unlit: true, ..LoadOptions::default() })
    };
    let opacity = |lines: &str| load(lines).unwrap().world.materials[0].opacity;
    assert_eq!(opacity("opacity = 0.5"), Opacity { share: 0.5, texture: None, cutoff: None });
    assert_eq!(opacity("opacity_texture = \"leaf.png\""), Opacity { share: 1.0, texture: Some(0), cutoff: None });
    let masked = "opacity_texture = \"leaf.png\"\ncutoff = 0.25\nopacity = 1";
    assert_eq!(opacity(masked), Opacity { share: 1.0, texture: Some(0), cutoff: Some(0.25) });
    for (lines, problem) in [("opacity = 1.5", "opacity is 1.5"), ("cutoff = -1", "cutoff is -1")] {
        let error = load(lines).unwrap_err().to_string();
        assert!(error.contains("s.toml:3") && error.contains(problem) && error.contains("from 0 to 1"), "{error}");
    }
}
