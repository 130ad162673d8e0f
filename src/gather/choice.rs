//! What [`Pipeline::Auto`] stands for. Where the driver computes on the processor, rays that the program casts there itself are faster than anything the
//! driver does, and exact. On a GPU it is bundles, or exact rays where bundles go wrong. That depends on the scene, the points and the settings, not on
//! the GPU. It casts some thousands of rays on the CPU, always the same ones.
//!
//! A texel of a layer is seen at its centre, half a texel beside the ray of a point. So layers are right where surfaces go on for half a texel around
//! the points. Three shares of a sample of points tell where not:
//! - *crossed*: of the steps from a point, within its tangent plane, to a ray through another place of the same texel, those that meet a surface.
//!   Points near walls have such steps; in scans and terrains, whose triangles are about as wide as a texel, most points have.
//! - *thin*: of the points, those with a second surface within a texel, behind their own or before it. Light leaks past the edges of thin walls.
//! - *dividing*: of the points, those on sheets without thickness between two rooms.

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::Bundle;
use super::outline::outline;
use crate::direction::Directions;
use crate::points::GatherPoint;
use crate::random::Random;
use crate::scene::{Bvh, Mesh, RAY_OFFSET, Scene};
use crate::settings::{Pipeline, Sequence, Settings};

/// Most points that stand for all, and the directions of each.
const POINTS: usize = 1024;
const DIRECTIONS: u32 = 4;
/// Bundles that the points take in turns.
const BUNDLES: u32 = 64;

/// Largest share of crossed steps for which layers are used. Measured: 0.3 to 0.7 % in rooms such as the Cornell box, where layers add 0.2 % to the
/// error, and 4 to 40 % in scans and terrains, where they add 2.3 to 7.9 %.
const CROSSED: f64 = 0.02;
/// Largest share of points at thin walls. Measured: 0.6 % in the Cornell box, at its lamp; 22 to 47 % in rooms with thin walls.
const THIN: f64 = 0.05;
/// Largest share of points on sheets between two rooms. Tops of blocks without a bottom, as in the Cornell box, count too: 5 % of its points.
const DIVIDING: f64 = 0.1;
/// Fewer points than this do not pay for the peeling of a direction.
const FEW: usize = 16_384;
/// Cosine of the steepest angle of a direction to the normal that counts. A step along the tangent plane is longest there, and the weight least.
const GRAZING: f32 = 0.05;

/// The pipeline of a picture that sees `points`, of the scene without glass. The light of an environment comes along the directions alone. So few
/// directions show its shadows as bands, unless neighbours have different ones, which rays give for nothing.
///
/// `software`: [`Gpu::is_software`](crate::gpu::Gpu::is_software).
pub fn chosen_for_picture(software: bool, settings: &Settings, scene: &Scene, bvh: &Bvh, points: &[GatherPoint]) -> Pipeline {
    by_rays(software, || scene.environment.is_some() || !resolves(settings.layers(), &scene.mesh, bvh, points))
}

/// The pipeline of a bake of `points`.
pub fn chosen_for_bake(software: bool, settings: &Settings, mesh: &Mesh, bvh: &Bvh, points: &[GatherPoint]) -> Pipeline {
    by_rays(software, || points.len() < FEW || !resolves(settings.layers(), mesh, bvh, points))
}

fn by_rays(software: bool, rays: impl Fn() -> bool) -> Pipeline {
    match software {
        true => Pipeline::Raycast,
        false if rays() => Pipeline::RaycastGl,
        false => Pipeline::Fused,
    }
}

/// Whether layers with this side in texels, fitted to `points`, resolve what lies around them.
fn resolves(layers: u32, mesh: &Mesh, bvh: &Bvh, points: &[GatherPoint]) -> bool {
    let positions: Vec<Vec3> = points.iter().map(|point| point.position).collect();
    let outline = outline(&positions);
    let directions = Directions::new(Sequence::R2, 0);
    // The depth range has no effect here.
    let bundles: Vec<_> =
        (0..BUNDLES).map(|i| Bundle::new(&directions.get(i), &outline, layers)).map(|b| (b.direction, steps(&b))).collect();
    let texel = bundles.iter().map(|(_, [x, y])| x.length().max(y.length())).sum::<f32>() / BUNDLES as f32;
    let count = points.len().min(POINTS);
    let of_point = |number: usize| {
        let point = &points[number * points.len() / count];
        let mut random = Random::new(0, number as u64);
        let from = |side: f32| point.position + side * 3.0 * RAY_OFFSET * point.surface_normal;
        let meets = |origin: Vec3, way: Vec3, reach: f32| bvh.nearest(origin, way, None).is_some_and(|hit| hit.distance < reach);
        // A sheet without thickness divides two rooms where its back sees the front of a surface. Behind the wall of a solid there are backs.
        let divides = bvh
            .nearest(from(-1.0), -point.surface_normal, None)
            .is_some_and(|hit| mesh.meets_front(hit.triangle, -point.surface_normal));
        let thin = [-1.0, 1.0].iter().any(|&side| meets(from(side), side * point.surface_normal, texel));
        let (mut crossed, mut all) = (0.0, 0.0);
        for turn in 0..DIRECTIONS {
            let (direction, [x, y]) = bundles[(number * DIRECTIONS as usize + turn as usize) % BUNDLES as usize];
            let step = (random.uniform() - 0.5) * x + (random.uniform() - 0.5) * y;
            let cosine = direction.dot(point.surface_normal);
            if cosine.abs() < GRAZING {
                continue;
            }
            let along = step - direction * (step.dot(point.surface_normal) / cosine);
            all += f64::from(cosine.abs());
            crossed += if meets(from(1.0), along, 1.0) { f64::from(cosine.abs()) } else { 0.0 };
        }
        [f64::from(u8::from(thin)), f64::from(u8::from(divides)), crossed, all]
    };
    let shares: Vec<_> = (0..count).into_par_iter().map(of_point).collect();
    let [thin, divides, crossed, all] = shares.iter().fold([0.0; 4], |sum, share| [0, 1, 2, 3].map(|i| sum[i] + share[i]));
    crossed <= CROSSED * all && thin <= THIN * count as f64 && divides <= DIVIDING * count as f64
}

/// The steps in unit space to the next texel in x and in y.
fn steps(bundle: &Bundle) -> [Vec3; 2] {
    let from_layer = Mat3::from_mat4(bundle.to_layer).inverse();
    [from_layer.x_axis, from_layer.y_axis]
}
