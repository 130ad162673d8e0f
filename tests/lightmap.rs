//! Light maps. A function of position gives values at the points. The test reads it back from the map at other positions, with its own bilinear lookup.
//! Faulty texture coordinates must be reported.

use std::path::{Path, PathBuf};

use finalgather::image::Channel;
use finalgather::points::{GatherPoint, LightMap, LightMapOptions, Mended, Resolution, UvSource};
use finalgather::random::Random;
use finalgather::scene::{Mesh, Scene};
use finalgather::{Image, WriteOptions};
use glam::{Vec2, Vec3, vec2, vec3};

mod common;
use common::{Model, cornell, fifty_objects};

fn options(uvs: UvSource, side: u32) -> LightMapOptions {
    LightMapOptions { resolution: Resolution::Pixels(side), uvs, ..LightMapOptions::default() }
}

/// Smooth, positive, and nowhere flat for long.
fn wave(at: Vec3) -> Vec3 {
    0.5 + 0.3 * vec3((5.0 * at.x + 2.0 * at.y).sin(), (4.0 * at.y - 3.0 * at.z).sin(), (5.0 * at.z + 2.0 * at.x).sin())
}

/// No component of [`wave`] is steeper.
const STEEPEST: f32 = 0.3 * 5.4;

fn columns(points: &[GatherPoint], value: impl Fn(&GatherPoint) -> Vec3) -> Vec<Channel> {
    let column =
        |(k, name): (usize, &str)| Channel { name: name.into(), samples: points.iter().map(|point| value(point)[k]).collect() };
    ["R", "G", "B"].into_iter().enumerate().map(column).collect()
}

/// The map of [`wave`], as if nothing were inside anything.
fn wave_map(map: &LightMap) -> (Image, Mended) {
    map.image(&columns(map.points(), |point| wave(point.position)), &vec![0.0; map.points().len()])
}

/// What a renderer reads with bilinear filtering, v up.
fn lookup(image: &Image, uv: Vec2) -> Vec3 {
    let [r, g, b] = image.rgb().unwrap();
    let at = vec2(uv.x * image.width as f32, (1.0 - uv.y) * image.height as f32) - 0.5;
    let (low, part) = (at.floor(), at - at.floor());
    let texel = |x: f32, y: f32| {
        let column = x.clamp(0.0, image.width as f32 - 1.0) as usize;
        let index = y.clamp(0.0, image.height as f32 - 1.0) as usize * image.width + column;
        vec3(r[index], g[index], b[index])
    };
    let row = |y: f32| texel(low.x, y).lerp(texel(low.x + 1.0, y), part.x);
    row(low.y).lerp(row(low.y + 1.0), part.y)
}

/// Largest difference of the map from [`wave`] at random places of the surfaces, half of them on edges of triangles, and the root mean square.
fn error(mesh: &Mesh, image: &Image) -> [f32; 2] {
    let mut random = Random::new(7, 0);
    let (mut worst, mut sum, places) = (0.0_f32, 0.0, 200);
    for triangle in 0..mesh.triangles.len() {
        for place in 0..places {
            let (u, v) = (random.uniform(), random.uniform());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let weights = if place % 2 == 0 { [1.0 - u - v, u, v] } else { [u, 1.0 - u, 0.0] };
            let vertices = mesh.triangles[triangle].vertices;
            let at: Vec3 = (0..3).map(|k| weights[(k + place) % 3] * mesh.positions[vertices[k] as usize]).sum();
            let uv: Vec2 = (0..3).map(|k| weights[(k + place) % 3] * mesh.lightmap_uvs[vertices[k] as usize]).sum();
            let difference = (lookup(image, uv) - wave(at)).abs().max_element();
            worst = worst.max(difference);
            sum += difference * difference;
        }
    }
    [worst, (sum / (places * mesh.triangles.len()) as f32).sqrt()]
}

/// Length of a texel in the mesh, at its longest.
fn texel_length(mesh: &Mesh, image: &Image) -> f32 {
    let size = vec2(image.width as f32, image.height as f32);
    let along = mesh.triangles.iter().flat_map(|triangle| {
        (0..3).map(|k| {
            let [p, q] = [triangle.vertices[k] as usize, triangle.vertices[(k + 1) % 3] as usize];
            mesh.positions[p].distance(mesh.positions[q]) / ((mesh.lightmap_uvs[p] - mesh.lightmap_uvs[q]) * size).length()
        })
    });
    along.fold(0.0, f32::max)
}

/// Where pictures to look at go.
fn picture(image: &Image, name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    image.write(&path, &WriteOptions::default()).unwrap();
    path
}

/// A square of two triangles with these texture coordinates, beside others.
fn quad(model: &mut Model, at: f32, uvs: [Vec2; 4]) {
    model.plate(vec3(at, 0.0, 0.0), 0.5 * Vec3::X, 0.5 * Vec3::Y, 0);
    let mesh = &mut model.scene.mesh;
    let first = mesh.uvs.len() - 4;
    mesh.uvs[first..].copy_from_slice(&uvs);
}

/// The corners of a rectangle of the map.
fn rectangle(low: Vec2, high: Vec2) -> [Vec2; 4] {
    [low, vec2(high.x, low.y), high, vec2(low.x, high.y)]
}

/// Two squares side by side in space, apart in the map.
fn two_quads(left: [Vec2; 4], right: [Vec2; 4]) -> Scene {
    let mut model = Model::new();
    quad(&mut model, 0.0, left);
    quad(&mut model, 1.0, right);
    model.finish()
}

#[test]
fn a_map_put_back_on_the_model_is_what_it_was() {
    for (scene, side, name) in [(cornell(), 256, "cornell.png"), (fifty_objects(), 1024, "fifty.png")] {
        let map = LightMap::new(&scene.mesh, &options(UvSource::Auto, side)).unwrap();
        let (image, mended) = wave_map(&map);
        let [worst, rms] = error(map.mesh(), &image);
        let texel = STEEPEST * texel_length(map.mesh(), &image);
        println!("{:?} {mended:?} worst {worst} rms {rms} texel {texel} {}", map.counts(), picture(&image, name).display());
        // What the function changes by over a texel: at the edge of a chart a texel shows the mean of the part of it that is covered.
        assert!(worst < texel, "{name}: off by {worst}, {texel} a texel");
        assert!(rms < 0.2 * texel, "{name}: off by {rms} on average, {texel} a texel");
        assert_eq!((mended.filled, mended.hidden, map.counts().shared, map.counts().lost), (0, 0, 0, 0), "{name}");
        assert_eq!(map.mesh().triangles.len(), scene.mesh.triangles.len());
        assert!(
            map.origins().iter().zip(&map.mesh().positions).all(|(&origin, &at)| scene.mesh.positions[origin as usize] == at)
        );
    }
}

#[test]
fn points_lie_inside_their_texels_triangles_and_off_their_edges() {
    let scene = cornell();
    let map = LightMap::new(&scene.mesh, &options(UvSource::Auto, 128)).unwrap();
    assert!(map.points().len() > 2 * map.counts().texels, "{:?}", map.counts());
    // Where the surface goes on flat behind an edge, a point may come nearer to it.
    let goes_on = |normal: Vec3, ends: [Vec3; 2]| {
        let like = (0..scene.mesh.triangles.len()).filter(|&triangle| scene.mesh.geometric_normal(triangle).dot(normal) > 0.999);
        like.filter(|&triangle| ends.iter().all(|end| scene.mesh.corners(triangle).contains(end))).count() > 1
    };
    let edges: Vec<_> = (0..scene.mesh.triangles.len())
        .map(|triangle| {
            let ([a, b, c], normal) = (scene.mesh.corners(triangle), scene.mesh.geometric_normal(triangle));
            [(a, b), (b, c), (c, a)].map(|(p, q)| {
                // Of the scene's radius, less what 32 bits round.
                (p, normal.cross((q - p).normalize()), if goes_on(normal, [p, q]) { 0.9e-5 } else { 0.99e-3 })
            })
        })
        .collect();
    for point in map.points() {
        let inside = (0..scene.mesh.triangles.len()).any(|triangle| {
            let normal = scene.mesh.geometric_normal(triangle);
            let off_plane = (point.position - scene.mesh.corners(triangle)[0]).dot(normal).abs();
            let far_in = edges[triangle].iter().all(|&(from, inward, least)| inward.dot(point.position - from) > least);
            off_plane < 1e-6 && far_in && normal == point.normal && normal == point.surface_normal
        });
        assert!(inside, "{point:?} is on no triangle or on an edge");
    }
}

#[test]
fn samples_inside_geometry_do_not_count() {
    // The part of the left square with x < 0, and all of the right, lie inside something that sends -1000.
    let scene = two_quads(rectangle(Vec2::splat(0.05), vec2(0.45, 0.95)), rectangle(vec2(0.55, 0.05), Vec2::splat(0.95)));
    let map = LightMap::new(&scene.mesh, &options(UvSource::Own, 64)).unwrap();
    let middle = 0.5 * (scene.mesh.positions[0].x + scene.mesh.positions[1].x);
    let hidden = |point: &GatherPoint| point.position.x < middle;
    let values = columns(map.points(), |point| if hidden(point) { Vec3::splat(-1000.0) } else { Vec3::ONE });
    let inside: Vec<f32> = map.points().iter().map(|point| if hidden(point) { 0.9 } else { 0.1 }).collect();
    let (image, mended) = map.image(&values, &inside);
    let texels = map.counts().texels;
    assert!((texels / 5..texels / 3).contains(&mended.filled) && mended.hidden == 0, "{mended:?} of {texels}");
    // All that there is outside is 1: so is every texel that is filled, and the padding.
    let written = image.rgb().unwrap()[0].iter().filter(|&&value| value != 0.0);
    assert!(written.clone().count() > texels && written.clone().all(|&value| (value - 1.0).abs() < 1e-5));

    let (_, mended) = map.image(&values, &vec![1.0; inside.len()]);
    assert_eq!((mended.filled, mended.hidden), (0, texels));
}

#[test]
fn seams_close() {
    // One square lies upright in the map and the other across it, with texels of another size.
    let [a, b, c, d] = rectangle(vec2(0.55, 0.07), vec2(0.93, 0.41));
    let scene = two_quads(rectangle(Vec2::splat(0.03), vec2(0.47, 0.89)), [b, c, d, a]);
    let map = LightMap::new(&scene.mesh, &options(UvSource::Own, 32)).unwrap();
    assert_eq!((map.counts().seams, map.counts().charts), (1, 2));
    // Noise, which two sides do not agree in.
    let mut random = Random::new(1, 0);
    let noise: Vec<Vec3> = map.points().iter().map(|_| vec3(random.uniform(), random.uniform(), random.uniform())).collect();
    let values: Vec<Channel> = ["R", "G", "B"]
        .into_iter()
        .enumerate()
        .map(|(k, name)| Channel { name: name.into(), samples: noise.iter().map(|value| value[k]).collect() })
        .collect();
    let (image, mended) = map.image(&values, &vec![0.0; noise.len()]);
    // The test's own measure, between the places where the map was made to agree.
    let mesh = map.mesh();
    let (mut step, mut value) = (0.0, 0.0);
    for place in 0..1000 {
        let t = (place as f32 + 0.5) / 1000.0;
        let [left, right] = [[1, 2], [4, 7]].map(|ends: [usize; 2]| {
            let [p, q] = ends.map(|end| {
                let at = scene.mesh.positions[end];
                let uv = scene.mesh.uvs[end];
                mesh.uvs[mesh.positions.iter().zip(&mesh.uvs).position(|(&p, &u)| p == at && u == uv).unwrap()]
            });
            lookup(&image, p.lerp(q, t))
        });
        step += (left - right).length_squared();
        value += left.length_squared();
    }
    let step = f64::from((step / value).sqrt());
    println!("{mended:?} step {step} {}", picture(&image, "seam.png").display());
    assert!(mended.steps_before > 0.1, "{mended:?}");
    assert!(step < 0.2 * mended.steps_before, "{step} after {}", mended.steps_before);
    assert!(mended.steps < 0.2 * mended.steps_before, "{mended:?}");
}

#[test]
fn charts_do_not_bleed() {
    // Each chart has its own colour: what filtering reads at any place of it, its edges too, is that colour alone, and never black.
    let scene = fifty_objects();
    let map = LightMap::new(&scene.mesh, &options(UvSource::Auto, 512)).unwrap();
    let values = columns(map.points(), |point| if point.surface_normal.y > 0.5 { Vec3::X } else { Vec3::Y });
    let (image, _) = map.image(&values, &vec![0.0; map.points().len()]);
    println!("{}", picture(&image, "colours.png").display());
    let flat = |triangle: usize| {
        let y = scene.mesh.geometric_normal(triangle).y;
        // Those of floor, boxes and cylinders, whose charts are of one colour; a ball's chart has both.
        y.abs() < 1e-4 || y.abs() > 0.9999
    };
    let mut seen = 0;
    for triangle in (0..scene.mesh.triangles.len()).filter(|&triangle| flat(triangle)) {
        let expected = if scene.mesh.geometric_normal(triangle).y > 0.5 { Vec3::X } else { Vec3::Y };
        let [a, b, c] = map.mesh().triangles[triangle].vertices.map(|vertex| map.mesh().lightmap_uvs[vertex as usize]);
        for uv in [a, b, c, a.midpoint(b), b.midpoint(c), c.midpoint(a), (a + b + c) / 3.0] {
            let read = lookup(&image, uv);
            assert!((read - expected).abs().max_element() < 1e-5, "triangle {triangle} reads {read} at {uv}");
            seen += 1;
        }
    }
    assert!(seen > 1000, "{seen} places");
}

#[test]
fn texels_have_the_size_asked_for() {
    let scene = cornell();
    let good = two_quads(rectangle(Vec2::splat(0.1), vec2(0.4, 0.4)), rectangle(vec2(0.5, 0.5), Vec2::splat(0.8)));
    for (mesh, uvs) in [(&scene.mesh, UvSource::Atlas), (&good.mesh, UvSource::Own)] {
        let map =
            LightMap::new(mesh, &LightMapOptions { resolution: Resolution::TexelsPerUnit(60.0), ..options(uvs, 0) }).unwrap();
        let (image, _) = wave_map(&map);
        let length = texel_length(map.mesh(), &image);
        assert!((length * 60.0 - 1.0).abs() < 0.03, "{uvs:?}: {length} a texel");
    }
}

#[test]
fn unusable_coordinates_are_refused_or_give_way_to_an_atlas() {
    let square = rectangle(Vec2::splat(0.1), Vec2::splat(0.4));
    let cases = [
        (two_quads([Vec2::ZERO; 4], [Vec2::ZERO; 4]), "the mesh has no texture coordinates", false),
        (two_quads(square, [Vec2::splat(0.5); 4]), "1 of 2 charts have no area in the texture, first triangle 2", true),
        (
            two_quads(square, rectangle(Vec2::splat(0.5), Vec2::splat(1.5))),
            "of 2 of 4 triangles leave 0 to 1, first triangle 2",
            true,
        ),
        (
            two_quads(square, rectangle(Vec2::splat(0.3), Vec2::splat(0.9))),
            "% of the map, first those of triangles 0 and 2",
            true,
        ),
    ];
    for (scene, problem, warned) in cases {
        let refused = LightMap::new(&scene.mesh, &options(UvSource::Own, 64)).err().unwrap().to_string();
        assert!(refused.contains(problem) && refused.contains("atlas"), "{refused}");
        let map = LightMap::new(&scene.mesh, &options(UvSource::Auto, 64)).unwrap();
        assert_eq!((map.counts().layout, map.warnings().len()), ("atlas", usize::from(warned)), "{problem}");
        assert!(map.warnings().iter().all(|warning| warning.contains(problem)), "{:?}", map.warnings());
    }
    // Charts that touch do not overlap, but share texels unless they end between them.
    let touching = |at: f32| {
        let [a, b, c, d] = rectangle(vec2(at, 0.0), Vec2::ONE);
        two_quads(rectangle(Vec2::ZERO, vec2(at, 1.0)), [b, c, d, a])
    };
    for (at, shared) in [(0.5, 0), (0.505, 64)] {
        let map = LightMap::new(&touching(at).mesh, &options(UvSource::Own, 64)).unwrap();
        assert_eq!((map.counts().layout, map.counts().shared), ("own", shared));
    }
}

#[test]
fn maps_that_are_too_large_are_refused() {
    let good = two_quads(rectangle(Vec2::ZERO, vec2(0.4, 1.0)), rectangle(vec2(0.5, 0.0), Vec2::ONE)).mesh;
    let asked = |options: LightMapOptions| LightMap::new(&good, &options).err().unwrap().to_string();
    assert!(asked(options(UvSource::Own, 16_385)).contains("16385 x 16385 texels, where 1 to 16384 a side"));
    assert!(asked(options(UvSource::Own, 0)).contains("0 x 0 texels"));
    assert!(asked(options(UvSource::Own, 16_384)).contains("samples, where 67108864 are possible"));
    let many = LightMap::new(&fifty_objects().mesh, &options(UvSource::Atlas, 16)).err().unwrap().to_string();
    assert!(many.contains("do not fit into one map"), "{many}");
    let none = LightMapOptions { padding: 0, ..options(UvSource::Own, 64) };
    assert!(asked(none).contains("without padding"));
}
