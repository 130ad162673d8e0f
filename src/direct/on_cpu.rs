//! Direct light by rays on the CPU, in packets. The twin of `glsl/direct.frag`.

use glam::Vec3;
use rayon::prelude::*;

use super::{BatchSamples, GOLDEN, LightBatch, STRIDE, SamplePlan, SampleShare, offsets};
use crate::points::packets::{PointPacket, SubsetPackets};
use crate::points::{PointGloss, Subset};
use crate::scene::{LANES, Lanes, LightSample, Lights, Rays, ShadowPacket, of_lane};

/// The length of a ray to a light outside the scene, whose diameter is 2 in unit space.
const FARTHEST: f32 = 4.0;
/// Packets that one task takes with all its samples.
const TASK: usize = 16;

/// The mean irradiance of a share of the samples at each point, and the radiance that its lobe reflects, as [`super::Direct::light`]. `rays` are those of
/// the scene. `gloss`: that of each point; empty in scenes without gloss.
///
/// # Panics
/// When the packets are not of subsets of this stride: [`STRIDE`].
pub fn direct_light_on_cpu(
    rays: Rays,
    lights: &Lights,
    (share, seed): (SampleShare, u64),
    packets: &SubsetPackets,
    gloss: &[PointGloss],
) -> [Vec<Vec3>; 2] {
    let mut all = [vec![Vec3::ZERO; packets.places], vec![Vec3::ZERO; gloss.len()]];
    if !lights.are_sampled() {
        return all;
    }
    assert_eq!(packets.stride, STRIDE, "neighbours have different samples");
    let plan = SamplePlan::new(lights, share, seed);
    let mean = 1.0 / plan.samples() as f32;
    for offset in offsets() {
        let packets = &packets.subsets[Subset { stride: STRIDE, offset }.index()];
        let batches = plan.batches(offset);
        let lights_of = |packets: &[PointPacket]| {
            let arch = pulp::Arch::new();
            if rays.meet_cut_outs() {
                arch.dispatch(LightTask::<true> { rays, lights, packets, batches: &batches, gloss })
            } else {
                arch.dispatch(LightTask::<false> { rays, lights, packets, batches: &batches, gloss })
            }
        };
        let lit: Vec<Vec<PacketLight>> = packets.par_chunks(TASK).map(lights_of).collect();
        for (packet, light) in packets.iter().zip(lit.iter().flatten()) {
            for (lane, &point) in packet.points().iter().enumerate() {
                let mean_of = |channels: &[Lanes; 3]| mean * Vec3::from(of_lane(channels, lane));
                all[0][point as usize] = mean_of(&light.base);
                if let Some(lobe) = all[1].get_mut(point as usize) {
                    *lobe = mean_of(&light.lobe);
                }
            }
        }
    }
    all
}

/// Red, green and blue of the light at each point of a packet: what reaches the base, and what the lobe reflects.
#[derive(Clone, Copy)]
struct PacketLight {
    base: [Lanes; 3],
    lobe: [Lanes; 3],
}

impl PacketLight {
    const NONE: Self = Self { base: [[0.0; LANES]; 3], lobe: [[0.0; LANES]; 3] };
}

/// One sample, as the points of a packet see it.
struct SeenSample {
    light: PacketLight,
    directions: [Lanes; 3],
    reaches: Lanes,
}

/// The light of some packets, compiled for the vectors of the processor.
struct LightTask<'a, const CUT_OUTS: bool> {
    rays: Rays<'a>,
    lights: &'a Lights,
    packets: &'a [PointPacket],
    batches: &'a [LightBatch],
    gloss: &'a [PointGloss],
}

impl<const CUT_OUTS: bool> pulp::NullaryFnOnce for LightTask<'_, CUT_OUTS> {
    type Output = Vec<PacketLight>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        let mut all = Vec::with_capacity(self.packets.len());
        for packet in self.packets {
            let mut sums = PacketLight::NONE;
            for batch in self.batches {
                self.add(packet, batch, &mut sums);
            }
            all.push(sums);
        }
        all
    }
}

impl<const CUT_OUTS: bool> LightTask<'_, CUT_OUTS> {
    /// Adds the light of a batch. Some samples share a ray, which goes to one of them, chosen by the light that it would bring.
    #[inline(always)]
    fn add(&self, packet: &PointPacket, batch: &LightBatch, sums: &mut PacketLight) {
        let count = match &batch.samples {
            BatchSamples::Tree(numbers) => numbers.len(),
            BatchSamples::Chosen(samples) => samples.len(),
        };
        let mut first = batch.choice;
        let shifts = packet.hashes();
        for start in (0..count).step_by(batch.of_ray) {
            let mut shared = PacketLight::NONE;
            let mut chosen = ShadowPacket { origins: packet.rays(), directions: [[0.0; LANES]; 3], reaches: [-1.0; LANES] };
            let (mut totals, mut left) = ([0.0; LANES], [0.0; LANES]);
            for lane in 0..LANES {
                // Renewed by what remains of it after each decision.
                let number = first + shifts[lane];
                left[lane] = number - number.floor();
            }
            first += GOLDEN;
            for number in start..count.min(start + batch.of_ray) {
                let seen = match &batch.samples {
                    BatchSamples::Chosen(samples) => self.see(packet, &samples[number]),
                    BatchSamples::Tree(numbers) => self.see_by_tree(packet, numbers[number]),
                };
                for lane in 0..LANES {
                    let mut power = 0.0;
                    for channel in 0..3 {
                        shared.base[channel][lane] += seen.light.base[channel][lane];
                        shared.lobe[channel][lane] += seen.light.lobe[channel][lane];
                        // In this measure a white base and the lobe count alike.
                        power += seen.light.base[channel][lane] + std::f32::consts::PI * seen.light.lobe[channel][lane];
                    }
                    totals[lane] += power;
                    let share = if power > 0.0 { power / totals[lane] } else { 0.0 };
                    let takes = left[lane] < share;
                    for axis in 0..3 {
                        let directions = &mut chosen.directions[axis];
                        directions[lane] = if takes { seen.directions[axis][lane] } else { directions[lane] };
                    }
                    chosen.reaches[lane] = if takes { seen.reaches[lane] } else { chosen.reaches[lane] };
                    let rest = 1.0 - share;
                    let rest = if rest > 1e-7 { rest } else { 1e-7 };
                    left[lane] = if takes { left[lane] / share } else { (left[lane] - share) / rest };
                }
            }
            for lane in packet.points().len()..LANES {
                chosen.reaches[lane] = -1.0;
            }
            let passed = self.rays.transmittance_of_packet::<CUT_OUTS>(&chosen);
            for channel in 0..3 {
                for (lane, passed) in passed.iter().enumerate() {
                    sums.base[channel][lane] += passed * shared.base[channel][lane];
                    sums.lobe[channel][lane] += passed * shared.lobe[channel][lane];
                }
            }
        }
    }

    /// A sample of all points.
    #[inline(always)]
    fn see(&self, packet: &PointPacket, sample: &LightSample) -> SeenSample {
        let unseen = sample.place.w > 1.0 || sample.cone[1] > 0.0;
        if sample.place.w > 1.0 {
            return self.see_each(packet, unseen, |_, origin| Some(sample.seen_from(origin)));
        }
        let near = sample.place.w > 0.0;
        let [ox, oy, oz] = packet.rays().origins();
        let mut seen = SeenSample { light: PacketLight::NONE, directions: [[0.0; LANES]; 3], reaches: [0.0; LANES] };
        let mut emitted = [0.0; LANES];
        for lane in 0..LANES {
            let from = if near { Vec3::new(ox[lane], oy[lane], oz[lane]) } else { Vec3::ZERO };
            let way = sample.place.truncate() - from;
            let squared = way.dot(way);
            let distance = squared.sqrt();
            let direction = way / distance;
            for axis in 0..3 {
                seen.directions[axis][lane] = direction[axis];
            }
            let sent = -sample.normal.dot(direction);
            emitted[lane] = if sent > 0.0 { sent / if near { squared } else { 1.0 } } else { 0.0 };
            seen.reaches[lane] = if near { distance } else { FARTHEST };
        }
        let cosines = packet.cosines(&seen.directions);
        for lane in 0..LANES {
            let received = emitted[lane] * cosines[lane];
            // At a distance of 0 it is no number.
            let received = if received > 0.0 { received } else { 0.0 };
            for channel in 0..3 {
                seen.light.base[channel][lane] = received * sample.weight[channel];
            }
        }
        self.split(packet, unseen, &mut seen);
        seen
    }

    /// A sample on a lamp that each point chooses by the tree.
    fn see_by_tree(&self, packet: &PointPacket, [u, v, factor]: [f32; 3]) -> SeenSample {
        self.see_each(packet, false, |lane, origin| {
            let (direction, reach, light) = self.lights.sample_tree(origin, packet.normal(lane), [u, v])?.seen_from(origin);
            Some((direction, reach, factor * light))
        })
    }

    /// A sample that each point sees for itself: direction, length of the ray, and irradiance on a surface that faces it.
    fn see_each(&self, packet: &PointPacket, unseen: bool, see: impl Fn(usize, Vec3) -> Option<(Vec3, f32, Vec3)>) -> SeenSample {
        let mut seen = SeenSample { light: PacketLight::NONE, directions: [[0.0; LANES]; 3], reaches: [-1.0; LANES] };
        let mut light = [Vec3::ZERO; LANES];
        for (lane, light) in light.iter_mut().enumerate().take(packet.points().len()) {
            let Some((direction, reach, facing)) = see(lane, packet.rays().origin(lane)) else { continue };
            for axis in 0..3 {
                seen.directions[axis][lane] = direction[axis];
            }
            // A light that touches the point has a ray without length, which nothing stops.
            (seen.reaches[lane], *light) = (reach.clamp(f32::MIN_POSITIVE, FARTHEST), facing);
        }
        let cosines = packet.cosines(&seen.directions);
        for lane in 0..packet.points().len() {
            let received = cosines[lane] * light[lane];
            for channel in 0..3 {
                seen.light.base[channel][lane] = if received.is_finite() { received[channel] } else { 0.0 };
            }
        }
        self.split(packet, unseen, &mut seen);
        seen
    }

    /// Divides the light of glossy points between base and lobe. `unseen`: no eye ray that follows a lobe meets the light.
    fn split(&self, packet: &PointPacket, unseen: bool, seen: &mut SeenSample) {
        if self.gloss.is_empty() {
            return;
        }
        for (lane, &point) in packet.points().iter().enumerate() {
            let gloss = &self.gloss[point as usize];
            let light = Vec3::from(of_lane(&seen.light.base, lane));
            if light == Vec3::ZERO {
                continue;
            }
            let direction = Vec3::from(of_lane(&seen.directions, lane));
            let weights = gloss.weights_if(gloss.counts || unseen, packet.normal(lane), direction);
            let lobe = light * weights.lobe;
            for channel in 0..3 {
                seen.light.base[channel][lane] = light[channel] * weights.base;
                seen.light.lobe[channel][lane] = lobe[channel];
            }
        }
    }
}
