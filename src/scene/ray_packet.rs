//! Packets of parallel rays. A global direction is shared by all points, so the rays of neighbouring points meet the same boxes and triangles. A packet
//! takes 16 of them through the tree together: a box is tested once for all of them, and a triangle for all at once by the processor's vector units.
//!
//! All sums and products are those of one ray, without fused ones. So the hits have the same bits whatever the vectors of the processor.

use glam::{UVec2, Vec3};
use obvhs::cwbvh::node::CwBvhNode;
use obvhs::traverse;
use obvhs::triangle::Triangle;

use super::bvh::{Bvh, EDGE, Hit, SCALE};

/// Rays of a packet.
pub const LANES: usize = 16;

/// One number of each ray.
pub type Lanes = [f32; LANES];

/// [`PacketHits::triangles`] of a ray without a hit.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// Boxes are taken larger by this, in the tree's units: a [`RAY_OFFSET`](super::RAY_OFFSET), and twice the rounding of a step through the whole scene.
pub(super) const SLACK: f32 = 1e-3;
/// A component of a direction below this counts as this, so that its inverse is finite.
const LEAST: f32 = 1e-20;

/// The numbers of one ray. Not by `map`, which copies the arrays.
#[inline(always)]
pub fn of_lane<const N: usize>(numbers: &[Lanes; N], lane: usize) -> [f32; N] {
    std::array::from_fn(|i| numbers[i][lane])
}

/// The origins of parallel rays.
#[derive(Clone, Copy)]
pub struct RayPacket {
    /// In the tree's units, and the box around them.
    scaled: [Lanes; 3],
    low: Vec3,
    high: Vec3,
}

impl RayPacket {
    /// Rays from these origins in unit space.
    pub fn new(origins: &[Vec3; LANES]) -> Self {
        let scaled = origins.map(|origin| SCALE * origin);
        let (low, high) = scaled.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &o| (low.min(o), high.max(o)));
        Self { scaled: [0, 1, 2].map(|axis| scaled.map(|origin| origin[axis])), low, high }
    }

    /// The origins, in the tree's units.
    pub(super) fn scaled(&self) -> &[Lanes; 3] {
        &self.scaled
    }

    /// The least and the greatest coordinate of the origins along an axis, in the tree's units.
    pub(super) fn bounds(&self, axis: usize) -> [f32; 2] {
        [self.low[axis], self.high[axis]]
    }

    /// The origins, in unit space.
    #[inline(always)]
    pub fn origins(&self) -> [Lanes; 3] {
        self.scaled.map(|axis| axis.map(|coordinate| coordinate / SCALE))
    }

    /// The origin of a ray, in unit space.
    pub fn origin(&self, lane: usize) -> Vec3 {
        Vec3::from(of_lane(&self.scaled, lane)) / SCALE
    }
}

/// The unit direction of a packet, with what all boxes need of it.
#[derive(Clone, Copy)]
pub struct SharedDirection {
    pub vector: Vec3,
    inverse: Vec3,
    negative: [bool; 3],
    /// The order of children, as the tree codes it.
    order: u32,
}

impl SharedDirection {
    pub fn new(vector: Vec3) -> Self {
        let safe = vector.to_array().map(invertible);
        let negative = safe.map(|c| c < 0.0);
        let bit = |axis: usize, bit: u32| if negative[axis] { 0 } else { bit };
        let order = bit(0, 0x0404_0404) | bit(1, 0x0202_0202) | bit(2, 0x0101_0101);
        Self { vector, inverse: Vec3::from(safe).recip(), negative, order }
    }
}

/// The nearest hits of a packet.
#[derive(Clone, Copy)]
pub struct PacketHits {
    /// In unit space. Without meaning where there is no hit.
    pub distances: Lanes,
    /// Index into [`Mesh::triangles`](super::Mesh::triangles), or [`NO_TRIANGLE`].
    pub triangles: [u32; LANES],
    /// A bit for each ray: whether it meets the front of the triangle.
    pub fronts: u32,
}

impl PacketHits {
    pub const NONE: Self = Self { distances: [0.0; LANES], triangles: [NO_TRIANGLE; LANES], fronts: 0 };
}

/// The number that all lanes have which have any, if that is one number. [`NO_TRIANGLE`]: none.
#[inline(always)]
pub(crate) fn common(numbers: &[u32; LANES]) -> Option<u32> {
    let least = numbers.iter().fold(NO_TRIANGLE, |least, &number| if number < least { number } else { least });
    let others = numbers.iter().fold(0, |others, &number| others | if number == NO_TRIANGLE { 0 } else { number ^ least });
    (others == 0 && least != NO_TRIANGLE).then_some(least)
}

/// What a packet knows while it goes through the tree.
struct ParallelSearch<'a> {
    packet: &'a RayPacket,
    direction: &'a SharedDirection,
    /// Origins and their bounds, divided by the direction. `entry` and `exit` are the corners where the packet's rays enter boxes first and leave last.
    over: [Lanes; 3],
    entry: Vec3,
    exit: Vec3,
    distances: Lanes,
    /// Twice the leaf of the nearest hit, plus 1 for its front.
    sides: [u32; LANES],
    /// The greatest distance of a ray that still looks for a hit.
    reach: f32,
}

impl Bvh {
    /// Writes the nearest hits of the rays of `active`, a bit for each, and leaves those of others. With `CUT_OUTS`, `stops` is asked of
    /// hits: whether the triangle stops the ray of a lane.
    ///
    /// Inlined, so that it is compiled for the vectors of the caller.
    #[inline(always)]
    pub fn nearest_of_packet<const CUT_OUTS: bool>(
        &self,
        packet: &RayPacket,
        direction: &SharedDirection,
        active: u32,
        hits: &mut PacketHits,
        stops: impl Fn(usize, Hit) -> bool,
    ) {
        let mut search = ParallelSearch::new(packet, direction, active);
        let mut state = self.tree.new_traversal(direction.vector.into());
        // The boxes are coded by this order, which takes the least components for positive.
        state.oct_inv4 = direction.order;
        let mut node;
        traverse!(self.tree, node, state, search.children(node), {
            let leaf = state.primitive_id;
            let triangle = self.tree.primitive_indices[leaf as usize] as usize;
            let stops = |lane, distance| stops(lane, Hit { triangle, distance });
            search.meet::<CUT_OUTS>(&self.triangles[leaf as usize], leaf, stops);
        });
        search.write(self, active, hits);
    }
}

/// A component of a direction, or the least one in its place.
#[inline(always)]
pub(super) fn invertible(component: f32) -> f32 {
    if component.abs() < LEAST { LEAST } else { component }
}

/// The lower and the upper sides of a node's children, along each axis.
#[inline(always)]
pub(super) fn sides(node: &CwBvhNode) -> [[&[u8; 8]; 2]; 3] {
    [[&node.child_min_x, &node.child_max_x], [&node.child_min_y, &node.child_max_y], [&node.child_min_z, &node.child_max_z]]
}

/// Those of the children `left` that are met, as the tree codes them: leaves by their triangles, inner nodes by their place in the order.
#[inline(always)]
pub(super) fn code_of(node: &CwBvhNode, order: u32, mut left: u32, is_met: impl Fn(usize) -> bool) -> u32 {
    let (counts, places) = node.get_child_and_index_bits(order);
    let mut code = 0;
    while left != 0 {
        let child = left.trailing_zeros() as usize;
        left &= left - 1;
        let byte = |bytes: u64| (bytes >> (8 * child)) as u32 & 0xff;
        code |= if is_met(child) { byte(counts) << byte(places) } else { 0 };
    }
    code
}

/// The greater of two numbers, in one instruction: [`f32::max`] takes more, for NaN.
#[inline(always)]
pub(super) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The greatest of all, by halves: each step is one of vectors.
#[inline(always)]
pub(super) fn greatest(mut numbers: Lanes) -> f32 {
    let mut half = LANES / 2;
    while half > 0 {
        for lane in 0..half {
            numbers[lane] = greater(numbers[lane], numbers[lane + half]);
        }
        half /= 2;
    }
    numbers[0]
}

/// The least of all.
#[inline(always)]
pub(super) fn least(numbers: Lanes) -> f32 {
    -greatest(numbers.map(|number| -number))
}

/// The lesser of two numbers.
#[inline(always)]
pub(super) fn less(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

impl<'a> ParallelSearch<'a> {
    #[inline(always)]
    fn new(packet: &'a RayPacket, direction: &'a SharedDirection, active: u32) -> Self {
        let inverse = direction.inverse;
        let over = [0, 1, 2].map(|axis| packet.scaled[axis].map(|o| o * inverse[axis]));
        let (mut entry, mut exit) = (packet.high, packet.low);
        for axis in 0..3 {
            if direction.negative[axis] {
                (entry[axis], exit[axis]) = (exit[axis], entry[axis]);
            }
        }
        let mut distances = [-1.0; LANES];
        for (lane, distance) in distances.iter_mut().enumerate() {
            *distance = if active >> lane & 1 == 1 { f32::MAX } else { -1.0 };
        }
        let (entry, exit) = (entry * inverse, exit * inverse);
        Self { packet, direction, over, entry, exit, distances, sides: [NO_TRIANGLE; LANES], reach: f32::MAX }
    }

    /// The children of a node that a ray meets, coded as the tree does it. First all boxes are tested against the box of the origins, then those left
    /// against each ray.
    #[inline(always)]
    fn children(&self, node: &CwBvhNode) -> u32 {
        let SharedDirection { inverse, negative, order, .. } = *self.direction;
        let sides = sides(node);
        let (mut enter, mut leave) = ([[0.0; 8]; 3], [[0.0; 8]; 3]);
        for axis in 0..3 {
            let [low, high] = sides[axis];
            let (near, far) = if negative[axis] { (high, low) } else { (low, high) };
            let step = f32::from_bits(u32::from(node.e[axis]) << 23) * inverse[axis];
            let (base, slack) = (node.p[axis] * inverse[axis], SLACK * inverse[axis].abs());
            for child in 0..8 {
                enter[axis][child] = f32::from(near[child]) * step + (base - slack);
                leave[axis][child] = f32::from(far[child]) * step + (base + slack);
            }
        }
        let mut meets = [0; 8];
        for child in 0..8 {
            let [x, y, z] = [0, 1, 2].map(|axis| enter[axis][child] - self.entry[axis]);
            let near = greater(greater(x, y), greater(z, 0.0));
            let [x, y, z] = [0, 1, 2].map(|axis| leave[axis][child] - self.exit[axis]);
            meets[child] = u32::from(near <= less(less(x, y), less(z, self.reach)));
        }
        let left = (0..8).fold(0, |bits, child| bits | meets[child] << child);
        code_of(node, order, left, |child| {
            let mut met = 0;
            for lane in 0..LANES {
                let [x, y, z] = [0, 1, 2].map(|axis| enter[axis][child] - self.over[axis][lane]);
                let near = greater(greater(x, y), greater(z, 0.0));
                let [x, y, z] = [0, 1, 2].map(|axis| leave[axis][child] - self.over[axis][lane]);
                met |= u32::from(near <= less(less(x, y), less(z, self.distances[lane])));
            }
            met != 0
        })
    }

    /// Tests all rays against a triangle, as [`Bvh::nearest`] tests one (Möller and Trumbore 1997).
    #[inline(always)]
    fn meet<const CUT_OUTS: bool>(&mut self, triangle: &Triangle, leaf: u32, stops: impl Fn(usize, f32) -> bool) {
        let direction = self.direction.vector;
        let corner = Vec3::from(triangle.v0);
        let (e1, e2) = (Vec3::from(triangle.v0 - triangle.v1), Vec3::from(triangle.v2 - triangle.v0));
        let normal = e1.cross(e2);
        let across = normal.dot(direction);
        let scale = 1.0 / across;
        let (for_u, for_v, for_distance) = (scale * e2.cross(direction), scale * e1.cross(direction), scale * normal);
        let [ox, oy, oz] = &self.packet.scaled;
        // The normal is that of the back.
        let side = 2 * leaf + u32::from(across > 0.0);
        let mut any = 0;
        for lane in 0..LANES {
            let to_corner = Vec3::new(corner.x - ox[lane], corner.y - oy[lane], corner.z - oz[lane]);
            let (u, v, distance) = (for_u.dot(to_corner), for_v.dot(to_corner), for_distance.dot(to_corner));
            let inside = (u >= -EDGE) & (v >= -EDGE) & (1.0 - u - v >= -EDGE);
            // For rays in the triangle's plane the numbers are infinite or NaN. They hit nothing.
            let mut met = inside & (distance >= 0.0) & (distance < self.distances[lane]);
            if CUT_OUTS {
                met = met && stops(lane, distance / SCALE);
            }
            self.distances[lane] = if met { distance } else { self.distances[lane] };
            self.sides[lane] = if met { side } else { self.sides[lane] };
            any |= u32::from(met);
        }
        if any != 0 {
            self.reach = greatest(self.distances);
        }
    }

    #[inline(always)]
    fn write(&self, bvh: &Bvh, active: u32, hits: &mut PacketHits) {
        for lane in 0..LANES {
            let is_active = active >> lane & 1 == 1;
            hits.distances[lane] = if is_active { self.distances[lane] / SCALE } else { hits.distances[lane] };
            let side = self.sides[lane];
            let is_hit = side != NO_TRIANGLE;
            // Read in any case, without a branch. A tree has a triangle.
            let triangle = bvh.tree.primitive_indices[if is_hit { side >> 1 } else { 0 } as usize];
            hits.triangles[lane] = if is_hit { triangle } else { hits.triangles[lane] };
            hits.fronts |= (u32::from(is_hit) & side) << lane;
        }
    }
}
