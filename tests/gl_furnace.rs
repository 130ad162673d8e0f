//! The white furnace. If every surface of a closed scene sends out radiance 1, every point receives irradiance π, for any geometry and directions.
//! Layers and exact rays must both give it.

mod common;

use std::f32::consts::PI;

use common::{Model, directions, gather, gather_early, gather_fused, gather_rays, gpu, irradiance, points_on, sized, vectors};
use finalgather::photon::{PhotonGrid, PhotonTexture};
use finalgather::points::GatherPoint;
use finalgather::reference::Reference;
use finalgather::scene::{Bvh, Scene};
use finalgather::settings::Sequence;
use glam::{Vec3, Vec4, vec3};

/// A lost ray of 64 directions shows as more than this, unless it grazes: it has a share of some 1/16 at most, and of fewer directions as much
/// more. Sums of 64 terms round by less than 1e-5.
const LIMIT: f32 = 1e-3;

/// Irradiance π in every cell: flux is π times any area.
fn furnace(scene: &Scene) -> PhotonGrid {
    let mut grid = PhotonGrid::new(&scene.mesh, 8);
    grid.sums.fill([PI, PI, PI, 1.0]);
    grid
}

/// In the corners of all triangles and along their edges, so far inside.
fn points_beside_edges(scene: &Scene, inset: f32) -> Vec<GatherPoint> {
    let mesh = &scene.mesh;
    let beside = |triangle: usize| {
        let [a, b, c] = mesh.corners(triangle);
        let middle = (a + b + c) / 3.0;
        let on_edges = [a, b, c, a.midpoint(b), b.midpoint(c), c.midpoint(a), a.lerp(b, 0.3), b.lerp(c, 0.7)];
        on_edges.map(|at| GatherPoint::flat(at + inset * (middle - at).normalize(), mesh.geometric_normal(triangle)))
    };
    (0..mesh.triangles.len()).flat_map(beside).collect()
}

/// Fails unless every point receives π, also those `inset` from an edge. There, a ray is lost that rises from the point's tangent plane by less
/// than the depth bias before it meets what closes the scene; a thousandth inside, with a depth bias of 1.6e-5, its share of 64 directions
/// is at most 1.6e-2 / 16.
fn check(name: &str, scene: &Scene, inset: Option<f32>) {
    let gpu = gpu();
    let (count, size, points) = sized(&gpu, (64, 512, 4096), (16, 128, 256));
    let mut points = points_on(scene, points);
    points.extend(inset.filter(|_| size == 512).into_iter().flat_map(|inset| points_beside_edges(scene, inset)));
    let grid = furnace(scene);
    let photons = PhotonTexture::upload(&gpu, &grid).unwrap();
    let bvh = Bvh::new(&scene.mesh);
    for sequence in [Sequence::Random, Sequence::R2, Sequence::Sobol] {
        let directions = directions(sequence, count);
        let rays = Reference::new(scene, &bvh, &grid).gather(&points, &vectors(&directions));
        let layers = gather(&gpu, scene, &photons, &points, &directions, size);
        let early = gather_early(&gpu, scene, &photons, &points, &directions, size);
        let (fused, _) = gather_fused(&gpu, scene, &photons, &points, &directions, size);
        let gl_rays = gather_rays(&gpu, scene, &photons, &points, &directions);
        let found =
            [("rays", rays), ("layers", layers), ("early KILL", early), ("fused", fused), ("rays on the GL side", gl_rays)];
        for (pipeline, sums) in found {
            let errors: Vec<f32> = irradiance(&sums).iter().map(|e| (e / PI - 1.0).abs().max_element()).collect();
            let limit = LIMIT * 64.0 / count as f32;
            let beyond = errors.iter().filter(|&&error| error > limit).count();
            let worst = errors.iter().copied().fold(0.0, f32::max);
            eprintln!("{name}, {sequence:?}, {pipeline}: worst of {} points {worst:e}", points.len());
            assert!(beyond == 0, "{name}, {sequence:?}, {pipeline}: {beyond} of {} points are up to {worst} off", points.len());
        }
    }
}

#[test]
fn room() {
    let mut model = Model::new();
    model.cuboid(Vec3::ZERO, vec3(1.0, 0.8, 0.6), 0.0, true, 0);
    check("room", &model.finish(), Some(1e-3));
}

#[test]
fn room_with_blocks() {
    let mut model = Model::new();
    model.cuboid(Vec3::ZERO, Vec3::ONE, 0.0, true, 0);
    model.cuboid(vec3(-0.4, -0.5, -0.3), vec3(0.3, 0.3, 0.3), 0.3, false, 0);
    model.cuboid(vec3(0.4, -0.2, 0.3), vec3(0.2, 0.5, 0.25), -0.4, false, 0);
    check("room with blocks", &model.finish(), Some(1e-3));
}

#[test]
fn hollow_sphere() {
    let mut model = Model::new();
    model.sphere(Vec3::ZERO, 1.0, 16, true, 0);
    // Between facets that meet at 11 degrees, a thousandth from the edge, one point of ten thousand still loses a ray that grazes.
    check("hollow sphere", &model.finish(), None);
}

/// From outside, a convex body sees nothing of itself. Where a texel's centre is as near to an edge as vertices are rounded, a ray may take one
/// face for the other. That is rare, so the mean over several layer sizes is held (measured 2.7e-5 of a furnace's light over these; less by a third if
/// the steepness of the other face is not allowed for, but then three of 49 152 points in a hollow sphere lose a ray); it is 5e-5 if texels
/// beside the outline count below the tangent plane too.
#[test]
fn convex_bodies_see_nothing_of_themselves() {
    let gpu = gpu();
    // Of the few, one ray of 16 that one of 256 points takes wrongly is 3e-4 already; two are let pass.
    let (count, sizes, points, limit) = sized(&gpu, (64, 252..260, 4096, 4e-5), (16, 64..65, 256, 6e-4));
    let mut model = Model::new();
    model.cuboid(Vec3::ZERO, vec3(1.0, 0.8, 0.6), 0.3, false, 0);
    let scene = model.finish();
    let photons = PhotonTexture::upload(&gpu, &furnace(&scene)).unwrap();
    let points = points_on(&scene, points);
    let directions = directions(Sequence::R2, count);
    let total = |sums: &[Vec4]| irradiance(sums).iter().map(|e| e.max_element()).sum::<f32>();
    let (mut kill, mut fused) = (0.0, 0.0);
    for size in sizes.clone() {
        kill += total(&gather(&gpu, &scene, &photons, &points, &directions, size));
        fused += total(&gather_fused(&gpu, &scene, &photons, &points, &directions, size).0);
    }
    for (pipeline, total) in [("kill", kill), ("fused", fused)] {
        let mean = total / (points.len() * sizes.len()) as f32 / PI;
        eprintln!("convex body, {pipeline}: it sees {mean:e} of a furnace's light");
        assert!(mean < limit, "by {pipeline}, the body sees {mean} of itself");
    }
}
