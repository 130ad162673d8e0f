//! Guides photons to the surfaces that gather rays see.
//!
//! Of the photons of a sky few find a window, and of those that fall on a landscape few a room. A photon's start is a point of the unit cube of its five
//! random numbers. A tree divides the cube, and its leaves get photons in proportion to the light that pilots brought from there to surfaces that count.
//! A share of all photons stays even, so that no start is left out. Flux is divided by density, and its mean does not change.
//!
//! Surfaces count that a few gather rays from the points see, in cells of space, for each of six directions of normals.

use std::collections::HashMap;
use std::f32::consts::SQRT_2;

use glam::{IVec3, Vec3};
use rayon::prelude::*;

use super::trace::PhotonTracer;
use crate::math::{cosine_direction, dominant_axis};
use crate::random::Random;
use crate::scene::{Bvh, Chance, Focus, RAY_OFFSET, Rays, Scene};

/// Share of the photons that stay even. Flux is at most the inverse of it times that without a guide.
const EVEN: f32 = 0.3;
/// Rounds of pilots, and pilots in each. Each round but the first is guided by those before.
const ROUNDS: u64 = 3;
const PILOTS: u64 = 1 << 15;
/// Fewest pilots that divide a leaf, and most divisions on the way to one.
const FEWEST: usize = 64;
const DEPTH: u32 = 24;
/// Points that gather rays start from, and rays from each.
const POINTS: usize = 1024;
const RAYS: u32 = 32;
/// Cells along the radius of the points' sphere.
const CELLS: f32 = 16.0;

/// A density over the starts of photons.
pub struct Guide {
    /// Where the points are.
    pub focus: Focus,
    /// The root first; empty if no pilot brought light.
    nodes: Vec<GuideNode>,
}

#[derive(Clone, Copy)]
struct GuideNode {
    /// The number that is divided at the middle of its interval. A leaf has none.
    axis: Option<usize>,
    /// Probability of the lower half.
    lower: f32,
    /// Nodes of the lower and of the upper half.
    halves: [usize; 2],
}

/// A pilot: its start, and the light that it brought over the density of its start.
#[derive(Clone, Copy)]
struct Pilot {
    start: [f32; 5],
    light: f32,
}

/// How much light counts on the surfaces in a cell.
struct Seen {
    cell: f32,
    rays: HashMap<(IVec3, usize), f32>,
}

impl Guide {
    /// Guides the photons of `tracer` for points, each with its unit normal. `bvh` belongs to `scene`, the surfaces that gather rays see.
    pub fn new(tracer: &PhotonTracer, scene: &Scene, bvh: &Bvh, points: &[(Vec3, Vec3)]) -> Self {
        let (center, radius) = most_of(points);
        let mut guide = Self { focus: Focus::around(center, radius), nodes: Vec::new() };
        let seen = Seen::new(scene, bvh, points, radius / CELLS);
        let score = |triangle: usize, position: Vec3, direction: Vec3| {
            // Where many see a surface its light matters more, but not in proportion: each of them needs it once.
            seen.rays.get(&seen.key(position, tracer.side_met(triangle, direction))).map_or(0.0, |rays| rays.sqrt())
        };
        let mut pilots: Vec<Pilot> = Vec::new();
        for round in 0..ROUNDS {
            let brought = |photon| {
                let (start, density) = guide.start(tracer.start(photon));
                (start, tracer.brought(photon, start, &guide.focus, &score) / density)
            };
            let found: Vec<([f32; 5], f32)> = (round * PILOTS..(round + 1) * PILOTS).into_par_iter().map(brought).collect();
            pilots.extend(found.into_iter().map(|(start, light)| Pilot { start, light }).filter(|pilot| pilot.light > 0.0));
            guide.nodes.clear();
            if !pilots.is_empty() {
                divide(&mut guide.nodes, pilots.clone(), [[0.0, 1.0]; 5], 0);
            }
        }
        guide
    }

    /// The start of a photon from even numbers, and its density.
    pub fn start(&self, mut numbers: [f32; 5]) -> ([f32; 5], f32) {
        if self.nodes.is_empty() {
            return (numbers, 1.0);
        }
        if numbers[0] < EVEN {
            numbers[0] /= EVEN;
        } else {
            numbers[0] = (numbers[0] - EVEN) / (1.0 - EVEN);
            let (mut low, mut side) = ([0.0; 5], [1.0; 5]);
            let mut node = self.nodes[0];
            while let Some(axis) = node.axis {
                let upper = numbers[axis] >= node.lower;
                numbers[axis] =
                    if upper { (numbers[axis] - node.lower) / (1.0 - node.lower) } else { numbers[axis] / node.lower };
                side[axis] *= 0.5;
                low[axis] += if upper { side[axis] } else { 0.0 };
                node = self.nodes[node.halves[usize::from(upper)]];
            }
            // Rounding must not reach 1.
            numbers = [0, 1, 2, 3, 4].map(|axis| (low[axis] + side[axis] * numbers[axis]).min(1.0 - f32::EPSILON / 2.0));
        }
        let density = self.density(numbers);
        (numbers, density)
    }

    fn density(&self, start: [f32; 5]) -> f32 {
        let (mut low, mut side) = ([0.0; 5], [1.0; 5]);
        let (mut node, mut density) = (self.nodes[0], 1.0);
        while let Some(axis) = node.axis {
            side[axis] *= 0.5;
            let upper = start[axis] >= low[axis] + side[axis];
            low[axis] += if upper { side[axis] } else { 0.0 };
            density *= 2.0 * if upper { 1.0 - node.lower } else { node.lower };
            node = self.nodes[node.halves[usize::from(upper)]];
        }
        EVEN + (1.0 - EVEN) * density
    }
}

/// Adds the node of a box of starts with these pilots, and the nodes below it. Returns its index.
fn divide(nodes: &mut Vec<GuideNode>, pilots: Vec<Pilot>, bounds: [[f32; 2]; 5], depth: u32) -> usize {
    let index = nodes.len();
    nodes.push(GuideNode { axis: None, lower: 0.5, halves: [0; 2] });
    if pilots.len() < FEWEST || depth == DEPTH {
        return index;
    }
    let middle = |axis: usize| 0.5 * (bounds[axis][0] + bounds[axis][1]);
    let lower = |axis: usize| {
        let light = |pilot: &Pilot| f64::from(pilot.light);
        let below = pilots.iter().filter(|pilot| pilot.start[axis] < middle(axis)).map(light).sum::<f64>();
        (below / pilots.iter().map(light).sum::<f64>()) as f32
    };
    // The axis along which the light differs most.
    let shares: Vec<f32> = (0..5).map(lower).collect();
    let uneven = |&axis: &usize| (shares[axis] - 0.5).abs();
    let axis = (0..5).max_by(|a, b| uneven(a).total_cmp(&uneven(b))).unwrap_or(0);
    let (below, above): (Vec<Pilot>, Vec<Pilot>) = pilots.into_iter().partition(|pilot| pilot.start[axis] < middle(axis));
    let [mut first, mut second] = [bounds; 2];
    (first[axis][1], second[axis][0]) = (middle(axis), middle(axis));
    let halves = [divide(nodes, below, first, depth + 1), divide(nodes, above, second, depth + 1)];
    nodes[index] = GuideNode { axis: Some(axis), lower: shares[axis].clamp(0.02, 0.98), halves };
    index
}

/// A sphere that holds most of the points: far ones, as hills behind a house, need no fine light.
fn most_of(points: &[(Vec3, Vec3)]) -> (Vec3, f32) {
    let middle = |mut values: Vec<f32>, share: f32| {
        values.sort_unstable_by(f32::total_cmp);
        values[((values.len() - 1) as f32 * share) as usize]
    };
    let center = Vec3::from_array([0, 1, 2].map(|axis| middle(points.iter().map(|(position, _)| position[axis]).collect(), 0.5)));
    (center, middle(points.iter().map(|(position, _)| position.distance(center)).collect(), 0.8))
}

impl Seen {
    fn new(scene: &Scene, bvh: &Bvh, points: &[(Vec3, Vec3)], cell: f32) -> Self {
        let mut seen = Self { cell: cell.max(1e-5), rays: HashMap::new() };
        let (mesh, rays) = (&scene.mesh, &Rays::new(scene, bvh));
        let count = points.len().min(POINTS);
        let hits = |number: usize| {
            let (position, normal) = points[number * points.len() / count];
            let mut random = Random::new(0x901de, number as u64);
            (0..RAYS).filter_map(move |ray| {
                let direction = cosine_direction(normal, random.uniform(), random.uniform());
                let origin = position + SQRT_2 * RAY_OFFSET * normal;
                let hit = rays.nearest(origin, direction, None, Chance::of_pixel(number as u32, ray, 0))?;
                Some((origin + hit.distance * direction, mesh.side_met(hit.triangle, direction)))
            })
        };
        let found: Vec<(Vec3, Vec3)> = (0..count).into_par_iter().flat_map_iter(hits).collect();
        for (position, side) in found {
            *seen.rays.entry(seen.key(position, side)).or_default() += 1.0;
        }
        seen
    }

    /// The cell of a place on the side of a surface.
    fn key(&self, position: Vec3, side: Vec3) -> (IVec3, usize) {
        let axis = dominant_axis(side);
        ((position / self.cell).floor().as_ivec3(), 2 * axis + usize::from(side[axis] > 0.0))
    }
}
