//! The hemisphere integrals of packets of points, summed on the CPU as their rays find hits. The twin of `glsl/consumer/hemisphere.glsl`: between the rays
//! and a shader, hits would go through memory, which takes longer than the rays.

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::Bake;
use super::integrals::HEMISPHERE;
use super::schedule::{BlockInProgress, Round};
use crate::direction::Direction;
use crate::points::GatherPoint;
use crate::points::packets::{Ends, PacketConsumer, PointHits, PointPacket, cast, packets, put_in_order};
use crate::prepared::Prepared;
use crate::reference::Reference;
use crate::scene::{LANES, Lanes, NO_TRIANGLE, Rays, Scene, of_lane};

/// The points of a tile in packets, with their sums.
pub struct PacketTile {
    packets: Vec<PointPacket>,
    sums: Vec<HemisphereSums>,
    /// Number of points.
    count: usize,
}

/// The outputs of `glsl/consumer/hemisphere.glsl`, four numbers each.
type HemisphereSums = [[Lanes; 4]; HEMISPHERE];

/// What rays meet.
#[derive(Clone, Copy)]
pub struct PacketInputs<'a> {
    pub scene: &'a Scene,
    pub rays: Rays<'a>,
    /// `None`: surfaces are black, or their radiance is not wanted.
    pub radiance: Option<Reference<'a>>,
    /// In unit space. Hits beyond this distance leave a point open.
    pub open_distance: f32,
}

impl Bake {
    /// Adds what packets of rays see along these directions, in a round whose points have packets.
    pub(super) fn add_packets(&mut self, at: &BlockInProgress, round: &Round, directions: &[Direction]) {
        let Prepared { scene, bvh, .. } = &*self.prepared;
        let photons = self.photons.as_ref().filter(|_| self.plan.wanted(round.last).radiance);
        let radiance = photons.map(|photons| Reference::new(scene, bvh, photons.map.store()));
        let inputs = PacketInputs { scene, rays: Rays::new(scene, bvh), radiance, open_distance: self.plan.open_distance(scene) };
        let tiles = self.sums.block.iter_mut().flat_map(|block| &mut block.tiles);
        for (tile, _) in tiles.filter(|(_, turn)| self.schedule.takes(at, *turn)) {
            tile.packets.iter_mut().for_each(|packets| packets.add(inputs, directions));
        }
    }
}

impl PacketTile {
    pub fn new(points: &[GatherPoint]) -> Self {
        let numbered: Vec<(u32, GatherPoint)> = (0..).zip(points.iter().copied()).collect();
        let packets = packets(&numbered);
        Self { sums: vec![Default::default(); packets.len()], packets, count: points.len() }
    }

    /// Bytes of so many points.
    pub fn bytes(points: usize) -> usize {
        points * (size_of::<PointPacket>() + size_of::<HemisphereSums>()) / LANES
    }

    pub fn clear(&mut self) {
        self.sums.fill(Default::default());
    }

    /// Adds what the points see along both ends of `directions`.
    pub fn add(&mut self, inputs: PacketInputs, directions: &[Direction]) {
        let ends: Vec<Ends> = directions.iter().map(Ends::new).collect();
        let misses = ends.iter().map(|ends| ends.misses(inputs.scene)).collect();
        cast(inputs.rays, &self.packets, &ends, &mut self.sums, &Hemisphere { inputs, ends: &ends, misses });
    }

    /// The sums of each output, in the order of the points.
    pub fn read(&self) -> [Vec<Vec4>; HEMISPHERE] {
        let mut planes = [(); HEMISPHERE].map(|()| vec![Vec4::ZERO; self.count]);
        planes.par_iter_mut().enumerate().for_each(|(output, plane)| {
            put_in_order(self.packets.iter().zip(&self.sums), plane, |sums, lane| Vec4::from(of_lane(&sums[output], lane)));
        });
        planes
    }
}

struct Hemisphere<'a> {
    inputs: PacketInputs<'a>,
    ends: &'a [Ends],
    /// The radiance of rays without a hit, along and against each direction.
    misses: Vec<[Vec3; 2]>,
}

impl PacketConsumer for Hemisphere<'_> {
    type Sums = HemisphereSums;

    #[inline(always)]
    fn take(&self, _: &PointPacket, [reflected, sky, open, counts]: &mut HemisphereSums, direction: usize, found: &PointHits) {
        let (hits, weights) = (&found.hits, found.counted_weights());
        let radiosities = self.inputs.radiance.map_or([[0.0; LANES]; 3], |oracle| oracle.radiosities(hits, &found.positions));
        let radiance = found.radiance(radiosities, self.misses[direction]);
        let along = self.ends[direction].vector(false);
        for lane in 0..LANES {
            let (weight, missed) = (weights[lane], hits.triangles[lane] == NO_TRIANGLE);
            let (of_hit, of_miss) = if missed { (0.0, weight) } else { (weight, 0.0) };
            let of_open = if hits.distances[lane] > self.inputs.open_distance { weight } else { of_miss };
            let of_back = if hits.fronts >> lane & 1 == 1 { 0.0 } else { of_hit };
            let signed = if found.against >> lane & 1 == 1 { -of_open } else { of_open };
            for color in 0..3 {
                reflected[color][lane] += of_hit * radiance[color][lane];
                sky[color][lane] += of_miss * radiance[color][lane];
                open[color][lane] += signed * along[color];
            }
            reflected[3][lane] += weight;
            sky[3][lane] += of_miss;
            open[3][lane] += of_open;
            counts[0][lane] += of_back;
            counts[1][lane] += if found.outside >> lane & 1 == 1 { 1.0 } else { 0.0 };
        }
    }
}
