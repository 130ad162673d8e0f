//! A bounding volume hierarchy in tables. A shader traverses it without a stack.
//!
//! Nodes are in depth-first order. A ray that hits a node's box goes to the next node, another ray to the node after the subtree (Smits 1998,
//! "Efficiency issues for ray tracing"). Each octant of directions has its own order: nearer children come first. `obvhs` builds the tree.
//!
//! An inner node is left out if rays often hit it, because they test its children anyway. With k children and a share p of the parent's area, its test
//! pays if 1 + p k < k. This drops a fifth of the nodes, the most visited: a third of all visits in the Cornell box, a seventh with 10 000 triangles.

use std::time::Duration;

use glam::{DVec3, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::triangle::Triangle;

use crate::math::Aabb;

/// Box coordinates of nodes are whole steps; this many steps span the scene's box along each axis.
const STEPS: f64 = 65535.0;

/// Marks a leaf in [`FlatBvh::nodes`].
const LEAF: u32 = 1 << 31;
/// Number of bits for the triangle count of a leaf.
const COUNT_BITS: u32 = 3;

/// Build parameters. The build takes 0.4 s for 200 000 triangles. With 2 to 4 triangles in a leaf, or with more effort, ray times differ by about 5 %.
/// Copies of large triangles in several leaves gain nothing.
const BUILD: BvhBuildParams =
    BvhBuildParams { pre_split: false, max_prims_per_leaf: 4, collapse_traversal_cost: 2.0, ..BvhBuildParams::slow_build() };

/// A tree, stored once for each octant of directions.
pub struct FlatBvh {
    /// Position of step 0, and length of a step along each axis.
    pub origin: Vec3,
    pub step: Vec3,
    /// Number of nodes in one order.
    pub count: usize,
    /// `count` nodes for each octant 0 to 7. Bit 0 of the octant is set if x of the direction is negative, bit 1 for y, bit 2 for z. Words 0 to 2 of a
    /// node are its box along x, y and z: low 16 bits the side where rays enter, high 16 bits the other side. Word 3 of an inner node: index of the
    /// node after its subtree. Word 3 of a leaf: first triangle × 8 + number of triangles, with the highest bit set.
    pub nodes: Vec<[u32; 4]>,
    /// Leaves refer to ranges of this list. It holds indices into the triangles that the tree was built from.
    pub triangles: Vec<u32>,
}

impl FlatBvh {
    /// Builds the tree of at least one triangle, given by corners.
    pub fn new(corners: &[[Vec3; 3]]) -> Self {
        let triangles: Vec<_> = corners.iter().map(|&[a, b, c]| Triangle { v0: a.into(), v1: b.into(), v2: c.into() }).collect();
        let tree = build_bvh2_from_tris(&triangles, BUILD, &mut Duration::default());
        let kept = worth_testing(&tree);
        let bounds = Aabb::from_points(corners.iter().flatten().copied());
        // Leaves a spare step at either end.
        let step = (bounds.extent().as_dvec3() / (STEPS - 2.0)).max(DVec3::splat(1e-6)).as_vec3();
        let count = kept.iter().filter(|&&kept| kept).count();
        let mut flat = Self {
            origin: bounds.min - step,
            step,
            count,
            nodes: Vec::with_capacity(8 * count),
            triangles: tree.primitive_indices.clone(),
        };
        for octant in 0..8 {
            flat.add_order(&tree, &kept, octant);
        }
        flat
    }

    /// Appends the nodes in the order for an octant.
    fn add_order(&mut self, tree: &Bvh2, kept: &[bool], octant: usize) {
        enum BuildStep {
            Visit(usize),
            /// The subtree of the node at this index is complete.
            Close(usize),
        }
        let sign = Vec3A::from_array([0, 1, 2].map(|axis| if octant >> axis & 1 == 1 { -1.0 } else { 1.0 }));
        let mut tasks = vec![BuildStep::Visit(0)];
        while let Some(task) = tasks.pop() {
            let index = match task {
                BuildStep::Visit(index) => index,
                BuildStep::Close(place) => {
                    self.nodes[place][3] = self.nodes.len() as u32;
                    continue;
                }
            };
            let node = &tree.nodes[index];
            let [x, y, z] = self.box_words(node.aabb(), octant);
            if node.is_leaf() {
                assert!(node.prim_count < 1 << COUNT_BITS, "leaves are as small as asked for");
                self.nodes.push([x, y, z, LEAF | node.first_index << COUNT_BITS | node.prim_count]);
                continue;
            }
            if kept[index] {
                tasks.push(BuildStep::Close(self.nodes.len()));
                self.nodes.push([x, y, z, 0]);
            }
            let [first, second] = children(tree, index);
            let center = |child: usize| tree.nodes[child].aabb().center();
            let (near, far) = if (center(second) - center(first)).dot(sign) >= 0.0 { (first, second) } else { (second, first) };
            tasks.extend([BuildStep::Visit(far), BuildStep::Visit(near)]);
        }
    }

    /// A box in steps. It grows by at least a quarter of a step on each side, more than the rounding error of a ray.
    fn box_words(&self, bounds: &obvhs::aabb::Aabb, octant: usize) -> [u32; 3] {
        [0, 1, 2].map(|axis| {
            let steps = |at: f32| (f64::from(at) - f64::from(self.origin[axis])) / f64::from(self.step[axis]);
            let low = (steps(bounds.min[axis]) - 0.25).floor().clamp(0.0, STEPS) as u32;
            let high = (steps(bounds.max[axis]) + 0.25).ceil().clamp(0.0, STEPS) as u32;
            if octant >> axis & 1 == 1 { high | low << 16 } else { low | high << 16 }
        })
    }
}

fn children(tree: &Bvh2, index: usize) -> [usize; 2] {
    let first = tree.nodes[index].first_index as usize;
    [first, first + 1]
}

/// Tells which nodes keep their box: all leaves, and inner nodes whose test saves more than it costs. The root has none, because all rays hit it.
fn worth_testing(tree: &Bvh2) -> Vec<bool> {
    // Pairs of node and parent, parents before their children.
    let mut order = vec![(0, 0)];
    let mut next = 0;
    while let Some(&(index, _)) = order.get(next) {
        if !tree.nodes[index].is_leaf() {
            order.extend(children(tree, index).map(|child| (child, index)));
        }
        next += 1;
    }
    let area = |index: usize| tree.nodes[index].aabb().half_area();
    let mut kept = vec![true; tree.nodes.len()];
    // Number of tests of a ray in place of this node.
    let mut tests = vec![1.0; tree.nodes.len()];
    for &(index, parent) in order.iter().rev().filter(|(index, _)| !tree.nodes[*index].is_leaf()) {
        let below: f32 = children(tree, index).map(|child| tests[child]).iter().sum();
        kept[index] = area(parent) + area(index) * below < area(parent) * below;
        tests[index] = if kept[index] { 1.0 } else { below };
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Small triangles at random positions in a box.
    fn soup(count: usize) -> Vec<[Vec3; 3]> {
        let mut random = Random::new(7, 0);
        let mut within = |size: f32| Vec3::from_array([0, 1, 2].map(|_| size * (random.uniform() - 0.5)));
        let mut triangle = || {
            let center = within(1.0);
            [0, 1, 2].map(|_| center + within(0.1))
        };
        (0..count).map(|_| triangle()).collect()
    }

    /// The triangles of a leaf.
    fn leaf<'a>(flat: &'a FlatBvh, node: &[u32; 4]) -> Option<&'a [u32]> {
        let (first, count) = ((node[3] & !LEAF) >> COUNT_BITS, node[3] & ((1 << COUNT_BITS) - 1));
        (node[3] & LEAF != 0).then(|| &flat.triangles[first as usize..(first + count) as usize])
    }

    /// The triangles of the leaves, in the order for an octant.
    fn visits(flat: &FlatBvh, octant: usize) -> Vec<u32> {
        let nodes = &flat.nodes[octant * flat.count..(octant + 1) * flat.count];
        nodes.iter().filter_map(|node| leaf(flat, node)).flatten().copied().collect()
    }

    #[test]
    fn every_order_visits_every_triangle_once() {
        for count in [1, 2, 3, 5, 32, 1000] {
            let flat = FlatBvh::new(&soup(count));
            assert_eq!(flat.nodes.len(), 8 * flat.count);
            for octant in 0..8 {
                let mut met = visits(&flat, octant);
                met.sort_unstable();
                assert!(met.iter().copied().eq(0..count as u32), "{count} triangles, octant {octant}: {met:?}");
            }
        }
    }

    #[test]
    fn who_skips_misses_only_what_is_in_the_box() {
        let corners = soup(1000);
        let flat = FlatBvh::new(&corners);
        for (place, node) in flat.nodes.iter().enumerate() {
            let octant = place / flat.count;
            let end = if node[3] & LEAF == 0 { node[3] as usize } else { place + 1 };
            // An inner node has at least two children, and ends within its own order.
            assert!(node[3] & LEAF != 0 || end > place + 2, "node {place} skips to {end}");
            assert!(end <= (octant + 1) * flat.count, "node {place} skips to {end}");
            for &triangle in flat.nodes[place..end].iter().filter_map(|node| leaf(&flat, node)).flatten() {
                for axis in 0..3 {
                    let [enter, leave] = [node[axis] & 0xffff, node[axis] >> 16];
                    let (low, high) = if octant >> axis & 1 == 1 { (leave, enter) } else { (enter, leave) };
                    let side = |steps: u32| flat.origin[axis] + steps as f32 * flat.step[axis];
                    let inside = |corner: &Vec3| side(low) < corner[axis] && corner[axis] < side(high);
                    assert!(corners[triangle as usize].iter().all(inside), "triangle {triangle} leaves node {place}");
                }
            }
        }
    }

    #[test]
    fn orders_run_from_front_to_back() {
        let corners = soup(1000);
        let flat = FlatBvh::new(&corners);
        for octant in 0..8 {
            let sign = Vec3::from_array([0, 1, 2].map(|axis| if octant >> axis & 1 == 1 { -1.0 } else { 1.0 }));
            let depths: Vec<f32> = visits(&flat, octant).iter().map(|&i| corners[i as usize][0].dot(sign)).collect();
            let mean = |depths: &[f32]| depths.iter().sum::<f32>() / depths.len() as f32;
            let (front, back) = depths.split_at(500);
            // The mean depths of the two halves of a unit cube, cut across its diagonal, differ by 0.56.
            assert!(mean(front) + 0.4 < mean(back), "octant {octant}: {} before {}", mean(front), mean(back));
        }
    }
}
