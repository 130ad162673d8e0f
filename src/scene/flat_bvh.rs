//! A bounding volume hierarchy as tables that a shader can walk without a stack.
//!
//! Nodes stand in depth-first order, and each knows where to go on: a ray that meets a node's box goes to the next node, one that does not
//! skips to the node after the subtree. What a stack would do, to visit the nearer child first, is done beforehand: there is an order
//! for each octant of directions. Source: Smits 1998, "Efficiency issues for ray tracing"; the orders as Torres et al. 2009, "Ray casting using
//! a roped BVH with CUDA", have ropes. The tree is the `obvhs` crate's.

use std::time::Duration;

use glam::{DVec3, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::triangle::Triangle;

use crate::math::Aabb;

/// Steps along an axis of the scene's box in which nodes store theirs.
const STEPS: f64 = 65535.0;

/// The flag of a leaf in [`FlatBvh::nodes`].
const LEAF: u32 = 1 << 31;
/// Bits of a leaf's number of triangles.
const COUNT_BITS: u32 = 3;
/// The most triangles in a leaf. A driver that runs rays in step has them wait for those with more.
const IN_LEAF: u32 = 2;

/// A tree, its orders one after the other.
pub struct FlatBvh {
    /// Where step 0 of the boxes is, and how long a step is along each axis.
    pub origin: Vec3,
    pub step: Vec3,
    /// Of one order.
    pub count: usize,
    /// For the octants 0 to 7, bit 0 set where a direction's x is negative, bit 1 for y and 2 for z: `count` nodes each. Of a node, the first
    /// three words are its box along x, y and z, in the low 16 bits the side that rays of the octant enter by, in the high ones the
    /// other. The last is, for an inner node, the index in all `nodes` of the one after its subtree; for a leaf, its first
    /// triangle × 8 + how many, and the highest bit set.
    pub nodes: Vec<[u32; 4]>,
    /// What leaves refer to: indices into the list that the tree is built from.
    pub triangles: Vec<u32>,
}

impl FlatBvh {
    /// Builds it for triangles given by their corners.
    pub fn new(corners: &[[Vec3; 3]]) -> Self {
        let to_triangle = |&[v0, v1, v2]: &[Vec3; 3]| Triangle { v0: v0.into(), v1: v1.into(), v2: v2.into() };
        let triangles: Vec<_> = corners.iter().map(to_triangle).collect();
        // Slow as builds of this crate go: 0.4 s for 200 000 triangles. Copies of large triangles in several leaves gain nothing.
        let params = BvhBuildParams { pre_split: false, max_prims_per_leaf: IN_LEAF, ..BvhBuildParams::slow_build() };
        let tree = build_bvh2_from_tris(&triangles, params, &mut Duration::default());
        let bounds = Aabb::from_points(corners.iter().flatten().copied());
        // A step to spare at either end.
        let step = (bounds.extent().as_dvec3() / (STEPS - 2.0)).max(DVec3::splat(1e-6));
        let mut flat = Self {
            origin: (bounds.min.as_dvec3() - step).as_vec3(),
            step: step.as_vec3(),
            count: tree.nodes.len(),
            nodes: Vec::with_capacity(8 * tree.nodes.len()),
            triangles: tree.primitive_indices.clone(),
        };
        for octant in 0..8 {
            flat.add_order(&tree, octant);
        }
        flat
    }

    /// Appends the nodes in the order for an octant.
    fn add_order(&mut self, tree: &Bvh2, octant: usize) {
        let sign = Vec3A::from_array([0, 1, 2].map(|axis| if octant >> axis & 1 == 1 { -1.0 } else { 1.0 }));
        enum Task {
            Visit(u32),
            /// The subtree of the node at this place is complete.
            Close(usize),
        }
        let mut tasks = vec![Task::Visit(0)];
        while let Some(task) = tasks.pop() {
            match task {
                Task::Close(place) => self.nodes[place][3] = self.nodes.len() as u32,
                Task::Visit(index) => {
                    let node = &tree.nodes[index as usize];
                    let [x, y, z] = self.box_words(node.aabb(), octant);
                    let place = self.nodes.len();
                    if node.is_leaf() {
                        assert!(node.prim_count < 1 << COUNT_BITS, "leaves are as small as asked for");
                        self.nodes.push([x, y, z, LEAF | node.first_index << COUNT_BITS | node.prim_count]);
                    } else {
                        self.nodes.push([x, y, z, 0]);
                        let [first, second] = [node.first_index, node.first_index + 1];
                        let center = |child: u32| tree.nodes[child as usize].aabb().center();
                        let ahead = (center(second) - center(first)).dot(sign);
                        let (near, far) = if ahead >= 0.0 { (first, second) } else { (second, first) };
                        tasks.extend([Task::Close(place), Task::Visit(far), Task::Visit(near)]);
                    }
                }
            }
        }
    }

    /// A box in steps, outwards by at least a quarter, which is more than a ray rounds by.
    fn box_words(&self, bounds: &obvhs::aabb::Aabb, octant: usize) -> [u32; 3] {
        [0, 1, 2].map(|axis| {
            let steps = |at: f32| (f64::from(at) - f64::from(self.origin[axis])) / f64::from(self.step[axis]);
            let low = (steps(bounds.min[axis]) - 0.25).floor().clamp(0.0, STEPS) as u32;
            let high = (steps(bounds.max[axis]) + 0.25).ceil().clamp(0.0, STEPS) as u32;
            if octant >> axis & 1 == 1 { high | low << 16 } else { low | high << 16 }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn soup(count: u64) -> Vec<[Vec3; 3]> {
        let mut random = Random::new(7, 0);
        let mut vector = |size: f32| Vec3::from_array([0, 1, 2].map(|_| size * (random.uniform() - 0.5)));
        (0..count)
            .map(|_| {
                let center = vector(1.0);
                [0, 1, 2].map(|_| center + vector(0.1))
            })
            .collect()
    }

    #[test]
    fn every_order_visits_every_triangle() {
        for count in [1, 2, 3, 5, 1000] {
            let corners = soup(count);
            let flat = FlatBvh::new(&corners);
            assert_eq!(flat.nodes.len(), 8 * flat.count);
            for octant in 0..8 {
                let (start, end) = (octant * flat.count, (octant + 1) * flat.count);
                let mut met = vec![0; corners.len()];
                for (i, node) in flat.nodes.iter().enumerate().take(end).skip(start) {
                    if node[3] & LEAF == 0 {
                        assert!((i + 3..=end).contains(&(node[3] as usize)), "{count} triangles: node {i} skips to {}", node[3]);
                        continue;
                    }
                    let first = ((node[3] & !LEAF) >> COUNT_BITS) as usize;
                    for place in first..first + (node[3] & ((1 << COUNT_BITS) - 1)) as usize {
                        met[flat.triangles[place] as usize] += 1;
                    }
                }
                assert!(met.iter().all(|&times| times == 1), "{count} triangles, octant {octant}: {met:?}");
            }
        }
    }
}
