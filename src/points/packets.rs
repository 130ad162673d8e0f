//! Gather points in packets: 16 neighbours each, whose parallel rays the processor traces together.

use std::f32::consts::PI;

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::GatherPoint;
use crate::direction::Direction;
use crate::random::hash;
use crate::scene::{Chance, LANES, Lanes, NO_TRIANGLE, PacketHits, RAY_OFFSET, RayPacket, Rays, Scene, SharedDirection, of_lane};

/// Packets that one task takes along all directions. Their rays meet the same part of the scene.
const TASK: usize = 32;
/// Side of a square of pixels that makes a packet.
const SIDE: u32 = 4;
/// Least cosine of the normals of a square that makes a packet, and its largest step away from a plane, as a share of its width.
const LIKE: f32 = 0.7;
const FLAT: f32 = 0.3;
/// Bits of a coordinate in the order of points.
const BITS: u32 = 16;

/// Up to 16 points near each other, whose surfaces face about the same way.
pub struct PointPacket {
    rays: RayPacket,
    hashes: Lanes,
    surface_normals: [Lanes; 3],
    normals: [Lanes; 3],
    /// The number of each point.
    points: [u32; LANES],
    count: usize,
}

/// Puts a value of each point's sums into `values`, in the order of the points. `value` is told the lane of the point.
pub fn put_in_order<'a, Sums: 'a>(
    packets: impl Iterator<Item = (&'a PointPacket, &'a Sums)>,
    values: &mut [Vec4],
    value: impl Fn(&Sums, usize) -> Vec4,
) {
    for (packet, sums) in packets {
        packet.points().iter().enumerate().for_each(|(lane, &point)| values[point as usize] = value(sums, lane));
    }
}

/// The hits of a packet's points along one direction.
pub struct PointHits {
    /// Whether an end of the direction lies on the outer side of a point's surface: a bit for each. It does not if the direction lies in the surface.
    pub outside: u32,
    /// Whether the direction counts at a point: a bit for each. Its weight is then above 0, for it lies in the hemisphere of the normal too.
    pub counting: u32,
    /// Whether a point looks against the direction: a bit for each.
    pub against: u32,
    /// The cosine of the direction at each point.
    pub weights: Lanes,
    pub hits: PacketHits,
    /// Where they are.
    pub positions: [Lanes; 3],
}

/// A direction with both ends.
pub struct Ends {
    along: SharedDirection,
    against: SharedDirection,
    chance: Chance,
}

impl Ends {
    pub fn new(direction: &Direction) -> Self {
        let [along, against] = [1.0, -1.0].map(|side| SharedDirection::new(side * direction.vector));
        Self { along, against, chance: Chance::of_direction(direction.number) }
    }

    /// The radiance of rays without a hit that gather rays bring, along and against the direction.
    pub fn misses(&self, scene: &Scene) -> [Vec3; 2] {
        [false, true].map(|against| scene.gathered_radiance(self.vector(against)))
    }

    /// The unit vector of an end.
    #[inline(always)]
    pub fn vector(&self, against: bool) -> Vec3 {
        if against { self.against.vector } else { self.along.vector }
    }
}

/// All points in packets, each of one subset.
pub struct SubsetPackets {
    /// The step between the points of a subset, along each axis of the textures.
    pub stride: u32,
    /// Those of each subset, in the order of [`Subset::index`](super::Subset::index).
    pub subsets: Vec<Vec<PointPacket>>,
    /// Number of points, with those that are none.
    pub places: usize,
}

impl PointHits {
    /// The radiance that comes to each point: red, green and blue. `radiosities`: of the hits; `misses`: of rays without a hit, along and against the
    /// direction.
    #[inline(always)]
    pub fn radiance(&self, mut radiosities: [Lanes; 3], misses: [Vec3; 2]) -> [Lanes; 3] {
        for (color, radiance) in radiosities.iter_mut().enumerate() {
            let misses = misses.map(|miss| miss[color]);
            for (lane, radiance) in radiance.iter_mut().enumerate() {
                let miss = misses[(self.against >> lane & 1) as usize];
                *radiance = if self.hits.triangles[lane] == NO_TRIANGLE { miss } else { *radiance / PI };
            }
        }
        radiosities
    }

    /// The weight of the direction at each point, 0 where it does not count.
    #[inline(always)]
    pub fn counted_weights(&self) -> Lanes {
        let mut weights = self.weights;
        for (lane, weight) in weights.iter_mut().enumerate() {
            *weight = if self.counting >> lane & 1 == 1 { *weight } else { 0.0 };
        }
        weights
    }
}

impl SubsetPackets {
    /// The points of a picture, row by row. Squares of a subset's pixels make packets as they are, where they see one surface.
    pub fn of_picture(points: &[Option<GatherPoint>], size: [u32; 2], stride: u32) -> Self {
        let [columns, rows] = size.map(|side| side.div_ceil(stride * SIDE));
        let subset = |number: u32| {
            let [left, bottom] = [number % stride, number / stride];
            let row = |row: u32| {
                let (mut whole, mut rest) = (Vec::new(), Vec::new());
                for column in 0..columns {
                    let pixel = |i: u32| {
                        let x = left + stride * (column * SIDE + i % SIDE);
                        let y = bottom + stride * (row * SIDE + i / SIDE);
                        let number = y * size[0] + x;
                        let point = (x < size[0] && y < size[1]).then(|| points[number as usize]).flatten();
                        point.map(|point| (number, point))
                    };
                    let square: [Option<(u32, GatherPoint)>; LANES] = std::array::from_fn(|i| pixel(i as u32));
                    if sees_one_surface(&square) {
                        whole.push(PointPacket::new(&square.map(|point| point.expect("the square is full")), LANES));
                    } else {
                        rest.extend(square.into_iter().flatten());
                    }
                }
                (whole, rest)
            };
            let of_rows: Vec<_> = (0..rows).into_par_iter().map(row).collect();
            let rest: Vec<(u32, GatherPoint)> = of_rows.iter().flat_map(|(_, rest)| rest).copied().collect();
            of_rows.into_iter().flat_map(|(whole, _)| whole).chain(packets(&rest)).collect()
        };
        Self { stride, subsets: (0..stride * stride).map(subset).collect(), places: points.len() }
    }

    /// Points of a list, row by row in textures of this size. Neighbours in the list need not be neighbours in space.
    pub fn of_list(points: &[Option<GatherPoint>], size: [u32; 2], stride: u32) -> Self {
        let mut subsets = vec![Vec::new(); (stride * stride) as usize];
        for (number, point) in (0..).zip(points) {
            let [x, y] = [number % size[0] % stride, number / size[0] % stride];
            subsets[(y * stride + x) as usize].extend(point.map(|point| (number, point)));
        }
        Self { stride, subsets: subsets.iter().map(|points| packets(points)).collect(), places: points.len() }
    }
}

/// Whether a square is full and flat: its normals about the same, and no point far from the plane of the first.
fn sees_one_surface(square: &[Option<(u32, GatherPoint)>; LANES]) -> bool {
    let Some((_, first)) = square[0] else { return false };
    let mut step = 0.0f32;
    let mut width = 0.0f32;
    for point in square {
        let Some((_, point)) = point else { return false };
        if point.surface_normal.dot(first.surface_normal) < LIKE {
            return false;
        }
        let way = point.position - first.position;
        step = step.max(way.dot(first.surface_normal).abs());
        width = width.max(way.length_squared());
    }
    step * step <= FLAT * FLAT * width
}

/// Puts points, given by their numbers, into packets of neighbours.
pub fn packets(points: &[(u32, GatherPoint)]) -> Vec<PointPacket> {
    // A key's lowest bits are the place in the list, so equal keys have one order.
    let mut keys: Vec<(u64, u32)> = points.par_iter().zip(0..points.len() as u32).map(|((_, p), i)| (key(p), i)).collect();
    keys.par_sort_unstable();
    let packet = |keys: &[(u64, u32)]| {
        PointPacket::new(&std::array::from_fn(|lane| points[keys[lane.min(keys.len() - 1)].1 as usize]), keys.len())
    };
    keys.par_chunks(LANES).map(packet).collect()
}

/// A number in [0, 1) from a position. The twin of `hash` in `glsl/direct.frag`.
fn hash_of(position: Vec3) -> f32 {
    let [x, y, z] = position.to_array().map(f32::to_bits);
    (hash(x.wrapping_mul(73_856_093) ^ y.wrapping_mul(19_349_663) ^ z.wrapping_mul(83_492_791)) >> 8) as f32 / (1 << 24) as f32
}

/// The octant of a point's normal, then its place along a curve that fills the unit cube (Morton 1966).
fn key(point: &GatherPoint) -> u64 {
    let octant = point.surface_normal.cmpgt(Vec3::ZERO).bitmask();
    let steps = ((point.position + 1.0) * (0.5 * (1 << BITS) as f32)).clamp(Vec3::ZERO, Vec3::splat(((1 << BITS) - 1) as f32));
    let place = (0..3).fold(0, |code, axis| code | spread(steps[axis] as u64) << axis);
    u64::from(octant) << (3 * BITS) | place
}

/// Two zeros between the bits of a number of 16 bits.
fn spread(mut bits: u64) -> u64 {
    let steps = [(16, 0xff00_00ff), (8, 0xf00f_00f0_0f00_f00f), (4, 0x30c3_0c30_c30c_30c3), (2, 0x9249_2492_4924_9249)];
    for (shift, mask) in steps {
        bits = (bits | bits << shift) & mask;
    }
    bits
}

/// What is done with the hits of packets.
pub trait PacketConsumer: Sync {
    /// What a packet has of its own, such as sums.
    type Sums: Send;

    /// Takes the hits along one of the directions of [`cast`]. Implementations are inlined, so that they are compiled for the vectors of the processor.
    fn take(&self, packet: &PointPacket, sums: &mut Self::Sums, direction: usize, found: &PointHits);
}

/// Casts the rays of `packets` along `directions`, towards the end on each point's side of its surface. Gives the hits of each packet along one direction
/// after the other to the consumer, together with what belongs to the packet of `sums`.
pub fn cast<C: PacketConsumer>(rays: Rays, packets: &[PointPacket], directions: &[Ends], sums: &mut [C::Sums], consumer: &C) {
    let task = |(packets, sums): (&[PointPacket], &mut [C::Sums])| {
        let arch = pulp::Arch::new();
        if rays.meet_cut_outs() {
            arch.dispatch(CastTask::<_, true> { rays, packets, directions, sums, consumer });
        } else {
            arch.dispatch(CastTask::<_, false> { rays, packets, directions, sums, consumer });
        }
    };
    packets.par_chunks(TASK).zip(sums.par_chunks_mut(TASK)).for_each(task);
}

/// What [`cast`] does with some packets, compiled for the vectors of the processor.
struct CastTask<'a, C: PacketConsumer, const CUT_OUTS: bool> {
    rays: Rays<'a>,
    packets: &'a [PointPacket],
    directions: &'a [Ends],
    sums: &'a mut [C::Sums],
    consumer: &'a C,
}

impl<C: PacketConsumer, const CUT_OUTS: bool> pulp::NullaryFnOnce for CastTask<'_, C, CUT_OUTS> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        for (number, direction) in self.directions.iter().enumerate() {
            for (packet, sums) in self.packets.iter().zip(&mut *self.sums) {
                if let Some(hits) = packet.look::<CUT_OUTS>(self.rays, direction) {
                    self.consumer.take(packet, sums, number, &hits);
                }
            }
        }
    }
}

impl PointPacket {
    /// The first `count` of these points. The others fill the packet up.
    fn new(points: &[(u32, GatherPoint); LANES], count: usize) -> Self {
        let origin = |(_, point): (u32, GatherPoint)| point.position + RAY_OFFSET * point.surface_normal;
        Self {
            rays: RayPacket::new(&points.map(origin)),
            hashes: points.map(|(_, point)| hash_of(point.position)),
            surface_normals: [0, 1, 2].map(|axis| points.map(|(_, point)| point.surface_normal[axis])),
            normals: [0, 1, 2].map(|axis| points.map(|(_, point)| point.normal[axis])),
            points: points.map(|(number, _)| number),
            count,
        }
    }

    /// The hits along a direction; `None` if it lies in the surfaces of all points.
    #[inline(always)]
    fn look<const CUT_OUTS: bool>(&self, rays: Rays, direction: &Ends) -> Option<PointHits> {
        let vector = direction.along.vector;
        let (mut outside, mut counts, mut against, mut weights) = (0, 0, 0, [0.0; LANES]);
        for lane in 0..LANES {
            let dot =
                |normals: &[Lanes; 3]| normals[0][lane] * vector.x + normals[1][lane] * vector.y + normals[2][lane] * vector.z;
            let (side, cosine) = (dot(&self.surface_normals), dot(&self.normals));
            let weight = if side < 0.0 { -cosine } else { cosine };
            weights[lane] = weight;
            outside |= u32::from((side != 0.0) & (lane < self.count)) << lane;
            counts |= u32::from((weight > 0.0) & (side != 0.0) & (lane < self.count)) << lane;
            against |= u32::from(side < 0.0) << lane;
        }
        if outside == 0 {
            return None;
        }
        let mut hits = PacketHits::NONE;
        // A loop, so that the search is inlined once.
        for (end, active) in [(&direction.along, counts & !against), (&direction.against, counts & against)] {
            if active != 0 {
                rays.nearest_of_packet::<CUT_OUTS>(&self.rays, end, active, direction.chance, &mut hits);
            }
        }
        let mut positions = self.rays.origins();
        for (axis, positions) in positions.iter_mut().enumerate() {
            for (lane, position) in positions.iter_mut().enumerate() {
                let step = if against >> lane & 1 == 1 { -vector[axis] } else { vector[axis] };
                *position += hits.distances[lane] * step;
            }
        }
        Some(PointHits { outside, counting: counts, against, weights, hits, positions })
    }

    /// The numbers of the points.
    pub fn points(&self) -> &[u32] {
        &self.points[..self.count]
    }

    /// The rays of the points, of whatever direction.
    pub fn rays(&self) -> &RayPacket {
        &self.rays
    }

    /// The cosine of a unit vector of each point, 0 below its surface: [`GatherPoint::cosine`].
    #[inline(always)]
    pub fn cosines(&self, [x, y, z]: &[Lanes; 3]) -> Lanes {
        let mut cosines = [0.0; LANES];
        for lane in 0..LANES {
            let dot = |normals: &[Lanes; 3]| normals[0][lane] * x[lane] + normals[1][lane] * y[lane] + normals[2][lane] * z[lane];
            let (side, cosine) = (dot(&self.surface_normals), dot(&self.normals));
            cosines[lane] = if (side > 0.0) & (cosine > 0.0) { cosine } else { 0.0 };
        }
        cosines
    }

    /// A number in [0, 1) from the position of each point.
    pub fn hashes(&self) -> &Lanes {
        &self.hashes
    }

    /// The shading normal of a point.
    pub fn normal(&self, lane: usize) -> Vec3 {
        Vec3::from(of_lane(&self.normals, lane))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_spread_by_three() {
        for bits in [0, 1, 2, 3, 0x8000, 0xffff, 0xa5c3] {
            let expected = (0..BITS).fold(0, |code, bit| code | (bits >> bit & 1) << (3 * bit));
            assert_eq!(spread(bits), expected, "{bits:x}");
        }
    }
}
