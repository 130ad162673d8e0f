//! Depth peeling gives layers from far to near. Together they contain each surface once.

mod common;

use common::{Model, gpu, sized, writes_images};
use finalgather::direction::Direction;
use finalgather::gather::{Bundle, LayerStore, Peel};
use finalgather::geometry::Geometry;
use finalgather::gpu::Gpu;
use finalgather::random::Random;
use finalgather::scene::{Mesh, Scene};
use glam::{DVec2, DVec3, Vec3, Vec4, vec2, vec3};

/// Depths are sums of a few products of numbers up to 1, each rounded to 6e-8.
const DEPTH_ROUNDING: f64 = 1e-6;
/// Rasterisers move vertices to a grid of 1/256 of a texel or finer. That close to an edge, a texel may fall on either side; and the
/// depth of a surface moves by as much of its slope.
const VERTEX_ROUNDING: f64 = 1.0 / 256.0;

/// Far to near, each row by row.
type Layers = Vec<Vec<Vec4>>;

/// A texel that sees nothing: before all surfaces, so that every point lies beyond.
const EMPTY: Vec4 = Vec4::new(-1.0, 0.0, 0.0, 0.0);

/// All layers of a bundle up to and with the first empty one, row by row.
fn peel(gpu: &Gpu, geometry: &Geometry, bundle: &Bundle, size: u32) -> Layers {
    let mut peel = Peel::new(gpu, size).unwrap();
    peel.start();
    let mut layers = Layers::new();
    // More layers than there are in any test, so that peeling that never ends fails.
    while layers.len() < 100 && layers.last().is_none_or(|layer| layer.iter().any(|texel| texel.w > 0.0)) {
        layers.push(peel.next(geometry, bundle).read());
    }
    gpu.check("peeling").unwrap();
    layers
}

/// A store for each way to fill one that the device has.
fn stores(gpu: &Gpu, size: u32) -> Vec<LayerStore> {
    let peeling = LayerStore::peeling(gpu, size).unwrap();
    if writes_images(gpu) { vec![peeling, LayerStore::new(gpu, size).unwrap()] } else { vec![peeling] }
}

/// The layers of each bundle as [`peel`] has them, but that there may be further empty ones, from each of [`stores`].
fn store(gpu: &Gpu, geometry: &Geometry, bundles: &[Bundle], size: u32) -> Vec<Vec<Layers>> {
    let layers = |mut store: LayerStore| {
        // The second time it knows how many there are.
        for _ in 0..2 {
            store.fill(geometry, bundles).unwrap();
        }
        gpu.check("filling a store").unwrap();
        (0..bundles.len() as u32).map(|tile| store.read(tile)).collect()
    };
    stores(gpu, size).into_iter().map(layers).collect()
}

/// What the line through (x, y) of layer space meets: (depth, triangle counted from 1), far to near. `None` too near an edge to tell.
fn line(mesh: &Mesh, bundle: &Bundle, at: DVec2) -> Option<Vec<(f64, f32)>> {
    let to_layer = bundle.to_layer.as_dmat4();
    let mut met = Vec::new();
    for triangle in 0..mesh.triangles.len() {
        let corners = mesh.corners(triangle).map(|corner| to_layer.transform_point3(corner.as_dvec3()));
        let flat = corners.map(DVec3::truncate);
        let area = (flat[1] - flat[0]).perp_dot(flat[2] - flat[0]);
        // Distances from the edges in texels, positive inside; their sum with the opposite heights as weights is the depth.
        let inside: [f64; 3] = std::array::from_fn(|k| {
            let (from, to) = (flat[(k + 1) % 3], flat[(k + 2) % 3]);
            (to - from).perp_dot(at - from) * area.signum() / (to - from).length()
        });
        let least = inside.into_iter().fold(f64::INFINITY, f64::min);
        if least.abs() < 2.0 * VERTEX_ROUNDING {
            return None;
        }
        if least > 0.0 {
            let weight = |k: usize| inside[k] * (flat[(k + 2) % 3] - flat[(k + 1) % 3]).length() / area.abs();
            met.push(((0..3).map(|k| weight(k) * corners[k].z).sum(), triangle as f32 + 1.0));
        }
    }
    met.sort_by(|a: &(f64, f32), b| b.0.total_cmp(&a.0));
    Some(met)
}

/// Fails unless every texel holds in its layers what its line meets.
fn check(layers: &[Vec<Vec4>], mesh: &Mesh, bundle: &Bundle, size: u32) {
    let mut tested = 0;
    for texel in 0..size * size {
        let at = vec2((texel % size) as f32 + 0.5, (texel / size) as f32 + 0.5).as_dvec2();
        let Some(met) = line(mesh, bundle, at) else { continue };
        tested += 1;
        let found: Vec<Vec4> = layers.iter().map(|layer| layer[texel as usize]).take_while(|texel| texel.w > 0.0).collect();
        let triangles = |of: &mut dyn Iterator<Item = f32>| of.collect::<Vec<_>>();
        assert_eq!(
            triangles(&mut found.iter().map(|found| found.w)),
            triangles(&mut met.iter().map(|&(_, triangle)| triangle)),
            "triangles at {at}, far to near"
        );
        for (found, (depth, _)) in found.iter().zip(met) {
            let rounding = DEPTH_ROUNDING + VERTEX_ROUNDING * vec2(found.y, found.z).as_dvec2().length();
            assert!((f64::from(found.x) - depth).abs() < rounding, "depth at {at}: {} for {depth}", found.x);
        }
        // What follows the nearest surface is empty.
        assert!(layers.iter().skip(found.len()).all(|layer| layer[texel as usize].w == 0.0), "more beyond the last at {at}");
    }
    assert!(tested > size * size / 2, "only {tested} texels are clear of edges");
}

/// Parallel plates, farthest along +z last or in the order of `shuffle`.
fn stack(count: u32, shuffle: u64) -> Scene {
    let mut order: Vec<u32> = (0..count).collect();
    let mut random = Random::new(shuffle, 0);
    for i in (1..order.len()).rev() {
        order.swap(i, random.bits() as usize % (i + 1));
    }
    let mut model = Model::new();
    for place in order {
        model.plate(Vec3::Z * (place as f32 / 32.0), Vec3::X, Vec3::Y, 0);
    }
    model.finish()
}

fn along(vector: Vec3) -> Direction {
    Direction { vector: vector.normalize(), turn: 0.4, shift: vec2(0.3, 0.6), number: 0 }
}

#[test]
fn stacked_planes_in_any_draw_order() {
    let gpu = gpu();
    let size = sized(&gpu, 64, 16);
    for count in 1..=32 {
        let scene = stack(count, u64::from(count));
        let geometry = Geometry::upload(&gpu, &scene).unwrap();
        let vectors = [Vec3::Z, vec3(0.1, -0.2, -1.0)];
        let bundles = vectors.map(|vector| Bundle::new(&along(vector), &geometry.positions, size));
        for stored in store(&gpu, &geometry, &bundles, size) {
            bundles.iter().zip(stored).for_each(|(bundle, stored)| check(&stored, &scene.mesh, bundle, size));
        }
        for (vector, bundle) in vectors.into_iter().zip(bundles) {
            let layers = peel(&gpu, &geometry, &bundle, size);
            check(&layers, &scene.mesh, &bundle, size);
            // Straight on, all plates cover the same texels.
            if vector == Vec3::Z {
                assert_eq!(layers.len(), count as usize + 1, "layers of {count} plates and the empty one");
            }
        }
    }
}

#[test]
fn a_store_holds_shallow_scenes_after_deep_ones_in_all_tiles() {
    let gpu = gpu();
    let size = 16;
    for mut store in stores(&gpu, size) {
        let tiles = store.tiles();
        assert_eq!(tiles, 8);
        for count in [32, 2, 3, 2] {
            let scene = stack(count, 5);
            let geometry = Geometry::upload(&gpu, &scene).unwrap();
            let tilted = |tile: u32| Bundle::new(&along(vec3(0.05 * tile as f32, 0.1, 1.0)), &geometry.positions, size);
            // The last batch is not whole.
            let bundles: Vec<Bundle> = (0..tiles - u32::from(count == 3)).map(tilted).collect();
            store.fill(&geometry, &bundles).unwrap();
            for (tile, bundle) in (0..).zip(&bundles) {
                check(&store.read(tile), &scene.mesh, bundle, size);
            }
        }
    }
}

/// What both ways to fill a store draw into has the same size here, so that depths are the same to the bit.
#[test]
fn sorting_stores_what_peeling_does() {
    let gpu = gpu();
    if !writes_images(&gpu) {
        return;
    }
    let size = 1024;
    let mut model = Model::new();
    model.sphere(vec3(0.2, 0.0, 0.1), 0.8, 24, false, 0);
    model.cuboid(vec3(-0.3, 0.2, 0.0), Vec3::splat(0.7), 0.5, false, 0);
    for tilt in [-0.9_f32, 0.2, 0.7] {
        model.plate(Vec3::ZERO, Vec3::X + tilt * Vec3::Z, Vec3::Y, 0);
    }
    let mut scene = model.finish();
    // Doubled here, for unit space drops what lies exactly on another: of these the first drawn is kept.
    scene.mesh.triangles.extend_from_within(..40);
    let geometry = Geometry::upload(&gpu, &scene).unwrap();
    let bundles =
        [vec3(0.3, -0.4, 0.8), vec3(1.0, 0.2, -0.3)].map(|vector| Bundle::new(&along(vector), &geometry.positions, size));
    let [peeled, sorted] = store(&gpu, &geometry, &bundles, size).try_into().unwrap();
    for (mut peeled, sorted) in peeled.into_iter().zip(sorted) {
        let surfaces = peeled.iter().flatten().filter(|texel| texel.w > 0.0).count();
        assert!(surfaces > 1_000_000, "{surfaces}");
        // Lists count surfaces that are there twice.
        peeled.resize(sorted.len().max(peeled.len()), vec![Vec4::ZERO; (size * size) as usize]);
        let differing = peeled.iter().flatten().zip(sorted.iter().flatten()).filter(|(a, b)| a != b).count();
        assert_eq!((differing, peeled.len()), (0, sorted.len()), "of {surfaces} surfaces");
    }
}

#[test]
fn coplanar_duplicates_come_once() {
    let gpu = gpu();
    let mut model = Model::new();
    model.plate(Vec3::ZERO, Vec3::X, Vec3::Y, 0);
    model.plate(Vec3::Z, Vec3::X, Vec3::Y, 0);
    // Doubled here, for unit space drops what lies exactly on another.
    let mut scene = model.finish();
    scene.mesh.triangles.extend_from_within(..2);
    scene.mesh.triangles.extend_from_within(..2);
    let geometry = Geometry::upload(&gpu, &scene).unwrap();
    let bundle = Bundle::new(&along(vec3(0.3, 0.2, 1.0)), &geometry.positions, 32);
    let layers = peel(&gpu, &geometry, &bundle, 32);
    assert_eq!(layers.len(), 3, "the two distinct plates and the empty layer");
    // Of equals, depth test GREATER keeps the first drawn.
    assert!(layers.iter().flatten().all(|texel| [0.0, 1.0, 2.0, 3.0, 4.0].contains(&texel.w)));
    for stored in store(&gpu, &geometry, &[bundle], 32) {
        let triangles = |layer: &Vec<Vec4>| layer.iter().map(|texel| texel.w).collect::<Vec<f32>>();
        let [near, far] = [&stored[0][1], &stored[0][0]].map(triangles);
        assert_eq!([far, near], [triangles(&layers[0]), triangles(&layers[1])]);
        assert!(stored[0].iter().skip(2).flatten().all(|texel| texel.w == 0.0));
    }
}

#[test]
fn crossing_planes_are_in_order_at_each_texel() {
    let gpu = gpu();
    let size = sized(&gpu, 256, 64);
    let mut model = Model::new();
    for tilt in [-0.9_f32, -0.3, 0.2, 0.7] {
        model.plate(Vec3::ZERO, Vec3::X + tilt * Vec3::Z, Vec3::Y - 0.5 * tilt * Vec3::Z, 0);
    }
    model.cuboid(vec3(0.1, 0.2, 0.0), Vec3::splat(0.5), 0.5, false, 0);
    let scene = model.finish();
    let geometry = Geometry::upload(&gpu, &scene).unwrap();
    let vectors = [Vec3::Z, Vec3::NEG_Z, vec3(0.3, -0.4, 0.8), vec3(1.0, 0.2, -0.3)];
    let bundles = vectors.map(|vector| Bundle::new(&along(vector), &geometry.positions, size));
    let peeled = bundles.iter().map(|bundle| peel(&gpu, &geometry, bundle, size)).collect();
    for layers in store(&gpu, &geometry, &bundles, size).into_iter().chain([peeled]) {
        bundles.iter().zip(layers).for_each(|(bundle, layers)| check(&layers, &scene.mesh, bundle, size));
    }
}

#[test]
fn slopes_are_those_of_the_surfaces() {
    let gpu = gpu();
    let size = sized(&gpu, 256, 64);
    let mut model = Model::new();
    model.sphere(Vec3::ZERO, 1.0, 8, true, 0);
    let scene = model.finish();
    let geometry = Geometry::upload(&gpu, &scene).unwrap();
    let bundle = Bundle::new(&along(vec3(0.5, 0.3, -0.7)), &geometry.positions, size);
    check_slopes(&peel(&gpu, &geometry, &bundle, size), size, 0.0);
    // The store keeps slopes to 1/4096.
    for stored in store(&gpu, &geometry, &[bundle], size) {
        check_slopes(&stored[0], size, 1.0 / 4096.0);
    }
}

/// Fails unless the surface in a texel, followed by its slopes, which may be `rounded` by this share, is where the next texel has it.
fn check_slopes(layers: &[Vec<Vec4>], size: u32, rounded: f32) {
    let at = |layer: &[Vec4], x: u32, y: u32| layer[(y * size + x) as usize];
    let mut compared = 0;
    for layer in layers {
        for (x, y) in (0..size * size).map(|texel| (texel % size, texel / size)) {
            let here = at(layer, x, y);
            for (step, slope) in [((1, 0), here.y), ((0, 1), here.z)] {
                if here.w == 0.0 || x + step.0 >= size || y + step.1 >= size {
                    continue;
                }
                let next = at(layer, x + step.0, y + step.1);
                if next.w == here.w {
                    compared += 1;
                    // Slope and check are differences of depths, each rounded to 6e-8; and a rasteriser that steps across
                    // the target rounds products of its size and the slopes, in both of the depths.
                    let rounding = 3e-7 + (1.2e-7 * size as f32 + rounded) * (here.y.abs() + here.z.abs());
                    assert!((here.x + slope - next.x).abs() < rounding, "({x}, {y}): {here} and {next}");
                }
            }
        }
    }
    assert!(compared > size * size, "only {compared} pairs of texels");
}

#[test]
fn nothing_in_view() {
    let gpu = gpu();
    let scene = stack(3, 0);
    let geometry = Geometry::upload(&gpu, &scene).unwrap();
    let elsewhere = [Vec3::splat(50.0), Vec3::splat(51.0)];
    let bundle = Bundle::new(&along(Vec3::Z), &elsewhere, 16);
    let layers = peel(&gpu, &geometry, &bundle, 16);
    assert_eq!(layers.len(), 1);
    assert!(layers[0].iter().all(|&texel| texel == EMPTY));
}
