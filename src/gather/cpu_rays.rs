//! A hit finder that casts exact rays on the CPU, in [packets](crate::points::packets). The hits of other finders can be compared with its hits.

use std::rc::{Rc, Weak};

use glam::{Vec2, Vec4};
use rayon::prelude::*;

use super::{Found, HitFinder};
use crate::direction::Direction;
use crate::error::Result;
use crate::geometry::{Geometry, triangle_order};
use crate::gpu::{Format, Gpu, Texture};
use crate::points::packets::{Ends, PacketConsumer, PointHits, PointPacket, cast, packets};
use crate::points::{GatherPoint, Points};
use crate::scene::{Bvh, LANES, NO_TRIANGLE, Rays, Scene};
use crate::shaders::BATCH;

/// Most points whose packets are kept.
const KEPT: usize = 1 << 22;

/// Casts a ray for each point and direction, towards the end of the direction on the point's side of its surface.
pub struct CpuRayFinder {
    gpu: Gpu,
    bvh: Rc<Bvh>,
    /// A copy of the scene, if rays pass through parts of it.
    cut_outs: Option<Scene>,
    /// The place of each triangle in the shaders' table.
    slots: Vec<u32>,
    directions: Vec<Vec4>,
    ends: Vec<Ends>,
    /// With the identities of their textures.
    kept: Vec<(Weak<()>, Rc<KeptPoints>)>,
    hits: Option<Texture>,
}

/// Points in packets.
struct KeptPoints {
    packets: Vec<PointPacket>,
    /// For each texel, its place in the packets, counted from 1; 0: no point.
    places: Vec<u32>,
}

/// Distance and triangle of a packet's hits along each direction, as `glsl/finder/stored.glsl` reads them.
type StoredPacket = [[Vec2; LANES]; BATCH];

impl CpuRayFinder {
    /// `scene` is in unit space; `bvh` belongs to its mesh.
    pub fn new(gpu: &Gpu, scene: &Scene, bvh: Rc<Bvh>) -> Self {
        let mut slots = vec![0; scene.mesh.triangles.len()];
        for (slot, triangle) in (0..).zip(triangle_order(scene)) {
            slots[triangle] = slot;
        }
        let cut_outs = scene.has_cut_outs().then(|| scene.clone());
        let (directions, ends, kept) = Default::default();
        Self { gpu: gpu.clone(), bvh, cut_outs, slots, directions, ends, kept, hits: None }
    }

    /// The hits of the last search, as `glsl/finder/stored.glsl` reads them.
    pub fn hits(&self) -> Option<&Texture> {
        self.hits.as_ref()
    }

    /// Bytes of the packets that are kept of so many points, and of the hits of a batch at `tile` points before they are on the device.
    pub fn bytes(points: usize, tile: usize) -> usize {
        let kept = points.min(KEPT + tile) * (size_of::<PointPacket>() / LANES + size_of::<u32>());
        kept + 2 * points.min(tile) * BATCH * size_of::<Vec2>()
    }

    /// The packets of `points`.
    fn packets_of(&mut self, points: Points) -> Rc<KeptPoints> {
        let Some(identity) = points.identity else { return Rc::new(KeptPoints::new(&points.read())) };
        if let Some((_, kept)) = self.kept.iter().find(|(kept, _)| kept.as_ptr() == Rc::as_ptr(identity)) {
            return Rc::clone(kept);
        }
        let new = Rc::new(KeptPoints::new(&points.read()));
        self.kept.retain(|(kept, _)| kept.strong_count() > 0);
        // Points come in turns, so those that do not fit would only drive others out.
        if self.kept.iter().map(|(_, kept)| kept.places.len()).sum::<usize>() < KEPT {
            self.kept.push((Rc::downgrade(identity), Rc::clone(&new)));
        }
        new
    }
}

impl KeptPoints {
    fn new(points: &[Option<GatherPoint>]) -> Self {
        let found: Vec<(u32, GatherPoint)> = (0..).zip(points).filter_map(|(number, point)| Some((number, (*point)?))).collect();
        let packets = packets(&found);
        let mut places = vec![0; points.len()];
        for (number, packet) in packets.iter().enumerate() {
            packet
                .points()
                .iter()
                .enumerate()
                .for_each(|(lane, &point)| places[point as usize] = (number * LANES + lane + 1) as u32);
        }
        Self { packets, places }
    }
}

/// Stores the hits of packets.
struct HitStorage<'a> {
    slots: &'a [u32],
}

impl PacketConsumer for HitStorage<'_> {
    type Sums = StoredPacket;

    #[inline(always)]
    fn take(&self, _: &PointPacket, stored: &mut StoredPacket, direction: usize, found: &PointHits) {
        for (lane, stored) in stored[direction].iter_mut().enumerate() {
            *stored = match found.hits.triangles[lane] {
                NO_TRIANGLE => Vec2::ZERO,
                triangle => Vec2::new(found.hits.distances[lane], (self.slots[triangle as usize] + 1) as f32),
            };
        }
    }
}

impl HitFinder for CpuRayFinder {
    fn batch(&self) -> usize {
        BATCH
    }

    fn begin(&mut self, _: &Geometry, directions: &[Direction]) -> Result<usize> {
        let batch = &directions[..directions.len().min(self.batch())];
        self.directions = batch.iter().map(|direction| direction.vector.extend(0.0)).collect();
        self.ends = batch.iter().map(Ends::new).collect();
        Ok(batch.len())
    }

    fn find(&mut self, _: &Geometry, points: Points) -> Result<Found<'_>> {
        let kept = self.packets_of(points);
        let KeptPoints { packets, places } = &*kept;
        let rays = Rays::through(self.cut_outs.as_ref(), &self.bvh);
        let mut stored: Vec<StoredPacket> = vec![Default::default(); packets.len()];
        cast(rays, packets, &self.ends, &mut stored, &HitStorage { slots: &self.slots });
        let size = [points.position.width(), points.position.height()];
        let pairs = self.ends.len().div_ceil(2);
        let texel = |index: usize| {
            let Some(place) = places[index % places.len()].checked_sub(1) else { return Vec4::ZERO };
            let (packet, lane) = (&stored[place as usize / LANES], place as usize % LANES);
            let [first, second] = [0, 1].map(|of| packet[2 * (index / places.len()) + of][lane]);
            Vec4::new(first.x, first.y, second.x, second.y)
        };
        let texels: Vec<Vec4> = (0..pairs * places.len()).into_par_iter().map(texel).collect();
        let texture = self.hits.insert(Texture::array(&self.gpu, Format::Rgba32F, size, pairs as u32, &texels)?);
        Ok(Found::stored(texture, &self.directions, true, 0))
    }
}
