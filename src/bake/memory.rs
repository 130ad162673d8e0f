//! The memory of a bake: how many points gather at a time, and what a bake takes in all.

use glam::Vec3;

use super::accumulation::TILE;
use super::integrals::Values;
use super::plan::Plan;
use super::schedule::{PointSet, Schedule};
use crate::blocks::{Blocks, PairwiseSum};
use crate::error::{Error, Result};
use crate::gather::HIT_BYTES;
use crate::memory::common;
use crate::points::{GatherPoint, PointTextures};
use crate::scene::Scene;
use crate::settings::Settings;
use crate::shaders::BATCH;

/// Fewer points at a time are not worth a walk along all directions.
const LEAST: usize = 1 << 12;
/// Programs of spherical harmonics, beside those of every job. Measured with llvmpipe: 15 MiB at the highest order.
const PROGRAMS: usize = 24 << 20;

/// The most points of a round of the last stage, or of one before: whole tiles, or less than one.
pub fn most_points(plan: &Plan, blocks: Blocks, last: bool) -> usize {
    let fit = (plan.memory << 20) / bytes_of_point(plan, blocks, last);
    if fit < TILE { fit.max(LEAST) } else { fit / TILE * TILE }
}

/// Bytes of a point whose turn it is: its textures, and its sums on the GL side, in the pairwise tree and at the end.
fn bytes_of_point(plan: &Plan, blocks: Blocks, last: bool) -> usize {
    let copies = 1 + blocks.count().ilog2() as usize + 1;
    PointTextures::bytes([1, 1]) + copies * Values::bytes(&plan.wanted(last))
}

/// Whether the hits of the vertices are worth storing: a later round wants them again, and there is memory for all of them.
pub fn stores_hits(plan: &Plan, schedule: &Schedule) -> bool {
    let blocks = schedule.blocks;
    let mut of_vertices = schedule.rounds.iter().filter(|round| round.set == PointSet::Vertices).map(|round| &round.points);
    let Some(first) = of_vertices.next() else { return false };
    let bytes = bytes_of_point(plan, blocks, true) + HIT_BYTES * blocks.directions(0..blocks.count()).len();
    let again = of_vertices.clone().count() > 0 && of_vertices.all(|points| points == first);
    again && first.len() * bytes <= plan.memory << 20
}

impl Plan {
    /// Allows itself half of what so many points take. Returns whether that is possible.
    pub(super) fn halve(&mut self, blocks: Blocks, points: usize) -> bool {
        self.memory = self.memory.min((points / 2 * bytes_of_point(self, blocks, true)) >> 20);
        points > LEAST
    }

    /// Allows points at a time what the rest of a bake leaves of so many MiB.
    ///
    /// # Errors
    /// [`Error::Usage`] when that is not enough.
    pub(super) fn fit(&mut self, most: usize, scene: &Scene, settings: &Settings, schedule: &Schedule) -> Result<()> {
        let [during, end] = self.bytes(scene, settings, schedule);
        let [vertices, receivers] = schedule.points;
        let least = LEAST.min(vertices.max(receivers)) * bytes_of_point(self, schedule.blocks, true);
        let needed = (during + least).max(end).div_ceil(1 << 20);
        if needed > most {
            return Err(Error::usage(
                format!("the bake may take {needed} MiB, and --memory allows {most}"),
                format!("give --memory {needed}, or bake fewer points or fewer quantities at once"),
            ));
        }
        // Points need no more than the maximum, and parts hold this number.
        self.memory = (most - during.div_ceil(1 << 20)).min(1 << 20);
        Ok(())
    }

    /// Bytes while rounds go on, beside those of the round in progress; and in the end, when all points have their values.
    fn bytes(&self, scene: &Scene, settings: &Settings, schedule: &Schedule) -> [usize; 2] {
        let ([vertices, receivers], own) = (schedule.points, schedule.shard.clone());
        let all = 0..schedule.blocks.count();
        let sums = |last| Values::bytes(&self.wanted(last));
        let nodes = |blocks| PairwiseSum::<Values>::nodes_of(blocks) as usize;
        let hits = TILE.min(vertices.max(receivers)) * BATCH * HIT_BYTES;
        // Points as their source has them, in a list of all, and in a tile; direct light.
        let points = (vertices + receivers) * (3 * size_of::<GatherPoint>() + size_of::<Vec3>());
        // Sums of a stage, their total, and cached values.
        let cached = vertices * sums(false) * (nodes(all.clone()) + 2);
        let summed = receivers * sums(true) * nodes(own.clone());
        let during = common(scene, settings) + PROGRAMS + hits + points + cached + summed;
        // The total of a round and that of all; columns of all, once more those of a receiver, and in the file.
        let columns: usize = self.what.iter().map(|quantity| quantity.columns(self.order).len()).sum();
        let written = if own == all { 2 * sums(true) + 4 * size_of::<f32>() * columns } else { sums(true) };
        [during, during + receivers * written]
    }
}
