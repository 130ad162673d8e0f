//! Finds lamps that are turned the wrong way, by a few rays from their fronts and backs. [`reversed_lamps`] is the entry point.

use std::collections::{BTreeMap, HashMap};

use glam::Vec3;

use super::{Bvh, RAY_OFFSET, Scene};
use crate::math::cosine_direction;
use crate::random::Random;

/// Rays to each side of a lamp, and to the front of one that looks turned: a warning must not hang on a small thing that few rays meet.
const RAYS: usize = 1024;
const CERTAIN: usize = 16 * RAYS;

/// Of a material with more lamps, so many are examined.
const MOST_LAMPS: usize = 64;

/// A lamp sees something if so many of its rays meet fronts.
const LEAST: f32 = 4.0;

/// A front is taken for a back if it sees less than this share of what the other side sees.
const BLIND: f32 = 0.05;

/// A lamp that shines up is taken for one that hangs under a ceiling the wrong way if the gap above it is narrower than twice the lamp, and the gap
/// below is wider by this factor.
const ASKEW: f32 = 2.5;

/// What the rays from one side of a lamp meet.
#[derive(Default)]
struct LampSide {
    /// Shares of the cosine-weighted rays that meet fronts of other surfaces, and other surfaces at all.
    fronts: f32,
    surfaces: f32,
    /// Median distance straight ahead; infinite if most rays meet nothing.
    gap: f32,
}

/// A warning for each emissive material with lamps whose backs look at the scene while their fronts do not. A lamp is what hangs together by corners.
pub fn reversed_lamps(scene: &Scene, bvh: &Bvh) -> Vec<String> {
    let warning = |(material, lamps): (u32, Vec<Vec<usize>>)| {
        let step = lamps.len().div_ceil(MOST_LAMPS);
        let examined = lamps.iter().step_by(step);
        let count = examined.len();
        let reversed = examined.filter(|lamp| is_reversed(scene, bvh, lamp)).count();
        let name = &scene.materials[material as usize].name;
        let lamps = if reversed == count { "the lamps".to_owned() } else { format!("{reversed} of {count} lamps") };
        (reversed > 0).then(|| {
            format!(
                "{lamps} of material {name} shine away from the scene, which lies behind their backs; turn them by flip = true under \
                 [materials.{name}] in a scene file, or let both sides shine by two_sided = true there; --flip turns the whole model"
            )
        })
    };
    lamps_of(scene).into_iter().filter_map(warning).collect()
}

/// The triangles of each lamp, by material. Two-sided lamps are left out.
fn lamps_of(scene: &Scene) -> BTreeMap<u32, Vec<Vec<usize>>> {
    let mesh = &scene.mesh;
    let emits = |&triangle: &usize| scene.material(triangle).is_emissive() && !scene.material(triangle).two_sided;
    let triangles: Vec<usize> = (0..mesh.triangles.len()).filter(emits).collect();
    // A forest over the triangles. Those with a common corner have a common root.
    let mut parents: Vec<usize> = (0..triangles.len()).collect();
    let mut at: HashMap<(u32, [u32; 3]), usize> = HashMap::new();
    for (index, &triangle) in triangles.iter().enumerate() {
        for corner in mesh.corners(triangle) {
            let key = (mesh.triangles[triangle].material, corner.to_array().map(f32::to_bits));
            let other = *at.entry(key).or_insert(index);
            let [a, b] = [index, other].map(|index| root(&mut parents, index));
            parents[a.max(b)] = a.min(b);
        }
    }
    let mut lamps: BTreeMap<u32, BTreeMap<usize, Vec<usize>>> = BTreeMap::new();
    for (index, &triangle) in triangles.iter().enumerate() {
        let first = root(&mut parents, index);
        lamps.entry(mesh.triangles[triangle].material).or_default().entry(first).or_default().push(triangle);
    }
    lamps.into_iter().map(|(material, lamps)| (material, lamps.into_values().collect())).collect()
}

fn root(parents: &mut [usize], mut index: usize) -> usize {
    while parents[index] != index {
        parents[index] = parents[parents[index]];
        index = parents[index];
    }
    index
}

fn is_reversed(scene: &Scene, bvh: &Bvh, lamp: &[usize]) -> bool {
    let [front, back] = [1.0, -1.0].map(|side| look(scene, bvh, lamp, side, RAYS));
    let is_blind = |front: &LampSide| front.fronts < BLIND * back.fronts;
    if back.fronts >= LEAST / RAYS as f32 && is_blind(&front) && is_blind(&look(scene, bvh, lamp, 1.0, CERTAIN)) {
        return true;
    }
    let mesh = &scene.mesh;
    let up = scene.camera.map_or(Vec3::Y, |camera| camera.up);
    let facing =
        lamp.iter().map(|&triangle| mesh.area(triangle) * mesh.geometric_normal(triangle)).sum::<Vec3>().normalize_or_zero();
    let size = crate::math::Aabb::from_points(lamp.iter().flat_map(|&triangle| mesh.corners(triangle))).diagonal();
    // Rooms are closed below, but for a missing wall.
    facing.dot(up) > 0.7 && back.surfaces > 0.6 && ASKEW * front.gap <= back.gap && back.gap.is_finite() && front.gap < 2.0 * size
}

/// Looks from points spread over the front (`side` 1) or back (-1) of a lamp.
fn look(scene: &Scene, bvh: &Bvh, lamp: &[usize], side: f32, rays: usize) -> LampSide {
    let mesh = &scene.mesh;
    let areas: Vec<f32> = lamp.iter().map(|&triangle| mesh.area(triangle)).collect();
    let total: f32 = areas.iter().sum();
    let material = mesh.triangles[lamp[0]].material;
    let mut random = Random::new(0, 0);
    let (mut seen, mut gaps) = (LampSide::default(), Vec::with_capacity(rays));
    let (mut slot, mut before) = (0, 0.0);
    for ray in 0..rays {
        let place = (ray as f32 + 0.5) / rays as f32 * total;
        while slot + 1 < lamp.len() && before + areas[slot] < place {
            before += areas[slot];
            slot += 1;
        }
        let triangle = lamp[slot];
        let [a, b, c] = mesh.corners(triangle);
        let [u, v, s, t] = [(); 4].map(|()| random.uniform());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let normal = side * mesh.geometric_normal(triangle);
        let origin = a + u * (b - a) + v * (c - a) + RAY_OFFSET * normal;
        let other = |direction| {
            let hit = bvh.nearest(origin, direction, Some(triangle));
            hit.filter(|hit| mesh.triangles[hit.triangle].material != material)
        };
        let direction = cosine_direction(normal, s, t);
        if let Some(hit) = other(direction) {
            seen.surfaces += 1.0 / rays as f32;
            if mesh.meets_front(hit.triangle, direction) {
                seen.fronts += 1.0 / rays as f32;
            }
        }
        gaps.push(other(normal).map_or(f32::INFINITY, |hit| hit.distance));
    }
    gaps.sort_unstable_by(f32::total_cmp);
    LampSide { gap: gaps[rays / 2], ..seen }
}
