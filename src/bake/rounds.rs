//! Which points take turns, in how much memory.

use std::ops::Range;

use super::integrals::Values;
use super::{Plan, TILE, blocks_of};
use glam::Vec3;

use crate::blocks::PairwiseSum;
use crate::error::{Error, Result};
use crate::gather::HIT_BYTES;
use crate::memory::common;
use crate::points::GatherPoint;
use crate::scene::Scene;
use crate::settings::Settings;

/// Fewer points at a time are not worth a walk along all directions.
const LEAST: usize = 1 << 12;

/// Some points along all directions.
#[derive(Clone, Debug)]
pub struct Round {
    pub whose: Whose,
    pub points: Range<usize>,
    /// Surfaces hand on what was found in the stage before.
    pub stage: u32,
    /// Whether it is about what was asked for, and not about what carriers hand on.
    pub last: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Whose {
    Carriers,
    Receivers,
}

impl Plan {
    /// Allows itself half of what the largest of these rounds takes. Returns whether that is possible.
    pub(super) fn halve(&mut self, settings: &Settings, rounds: &[Round]) -> bool {
        let most = largest(rounds);
        self.memory = self.memory.min((most / 2 * self.wanted(true).bytes(copies(settings))) >> 20);
        most > LEAST
    }

    /// Allows itself what is left of so many MiB for the points at a time, when all else has its own: these carriers, and these receivers, who are to
    /// have these blocks.
    ///
    /// # Errors
    /// [`Error::Usage`] when that is not enough.
    pub(super) fn fit(
        &mut self,
        most: usize,
        scene: &Scene,
        settings: &Settings,
        points: [usize; 2],
        blocks: Range<u32>,
    ) -> Result<()> {
        let [during, end] = taken(self, scene, settings, points, blocks);
        let least = LEAST.min(points[0].max(points[1])) * self.wanted(true).bytes(copies(settings));
        let needed = (during + least).max(end).div_ceil(1 << 20);
        if needed > most {
            return Err(Error::usage(
                format!("the bake may take {needed} MiB, and --memory allows {most}"),
                format!("give --memory {needed}, or bake fewer points or fewer quantities at once"),
            ));
        }
        // Points do not need more, and parts say how much it was.
        self.memory = (most - during.div_ceil(1 << 20)).min(1 << 20);
        Ok(())
    }
}

/// Bytes that are taken while points take turns, beside what those take whose turn it is, and in the end, when all have their values.
fn taken(plan: &Plan, scene: &Scene, settings: &Settings, [carriers, receivers]: [usize; 2], blocks: Range<u32>) -> [usize; 2] {
    // Of spherical harmonics there are several, large ones.
    const PROGRAMS: usize = 24 << 20;
    let sums = |last: bool| plan.wanted(last).bytes(1) - plan.wanted(last).bytes(0);
    let nodes = |blocks| PairwiseSum::<Values>::nodes_of(blocks) as usize;
    let hits = TILE.min(carriers.max(receivers)) * 8 * size_of::<[f32; 2]>();
    // Each once more in what it came from, with what it is to go to; light from the lights.
    let places = (carriers + receivers) * (3 * size_of::<GatherPoint>() + size_of::<Vec3>());
    // What carriers find they also hold.
    let of_carriers = carriers * sums(false) * (nodes(0..blocks_of(settings).count()) + 2);
    let kept = receivers * sums(true) * nodes(blocks.clone());
    let during = common(scene.mesh.triangles.len(), &scene.textures, scene.environment.as_ref(), 1, settings)
        + PROGRAMS
        + hits
        + places
        + of_carriers
        + kept;
    // A round's total and that of all; of the columns those of a receiver once more, and in the file.
    let columns: usize = plan.what.iter().map(|quantity| quantity.columns(plan.order).len()).sum();
    let whole = blocks == (0..blocks_of(settings).count());
    let values = if whole { 2 * sums(true) + 4 * size_of::<f32>() * columns } else { sums(true) };
    [during, during + receivers * values]
}

/// Of a point's sums, all there are at a time: on the GL side, in the tree, and at the end.
pub fn copies(settings: &Settings) -> usize {
    1 + blocks_of(settings).count().ilog2() as usize + 1
}

/// Those of the bounces and the last, for so many carriers and receivers.
pub fn all_rounds(plan: &Plan, settings: &Settings, whose: Whose, [carriers, receivers]: [usize; 2]) -> Vec<Round> {
    let bounces = plan.bounces_of_carriers();
    let of_bounces = (0..bounces).flat_map(|stage| rounds(Whose::Carriers, stage, false, carriers, plan, copies(settings)));
    of_bounces.chain(rounds(whose, bounces, true, receivers, plan, copies(settings))).collect()
}

/// Whether hits of carriers are worth keeping, for they are wanted again, and there is memory for those of all of them.
pub fn keeps(plan: &Plan, settings: &Settings, rounds: &[Round]) -> bool {
    let mut of_carriers = rounds.iter().filter(|round| round.whose == Whose::Carriers).map(|round| &round.points);
    let Some(first) = of_carriers.next() else { return false };
    let bytes = plan.wanted(true).bytes(copies(settings)) + HIT_BYTES * settings.directions as usize;
    let again = of_carriers.clone().count() > 0 && of_carriers.all(|points| points == first);
    again && first.len() * bytes <= plan.memory << 20
}

/// The most points of one of them.
pub fn largest(rounds: &[Round]) -> usize {
    rounds.iter().map(|round| round.points.len()).max().unwrap_or(0)
}

/// The rounds that so many points take in the memory there is, which holds their sums on the GL side and so many copies in all.
fn rounds(whose: Whose, stage: u32, last: bool, count: usize, plan: &Plan, copies: usize) -> Vec<Round> {
    let fit = (plan.memory << 20) / plan.wanted(last).bytes(copies);
    // Whole tiles, or less than one.
    let most = if fit < TILE { fit.max(LEAST) } else { fit / TILE * TILE };
    let round = |first: usize| Round { whose, points: first..count.min(first + most), stage, last };
    (0..count).step_by(most).map(round).collect()
}
