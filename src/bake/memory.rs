//! Memory of a bake: the number of points at a time, and the total.

use glam::Vec3;

use super::accumulation::TILE;
use super::integrals::Values;
use super::on_cpu::PacketTile;
use super::plan::Plan;
use super::schedule::{PointSet, Schedule};
use crate::blocks::{Blocks, PairwiseSum};
use crate::error::{Error, Result};
use crate::gather::{CpuRayFinder, HIT_BYTES};
use crate::memory::common;
use crate::points::{GatherPoint, PointTextures};
use crate::scene::Scene;
use crate::settings::{Pipeline, Settings};
use crate::shaders::BATCH;

/// Minimum number of points at a time. Fewer do not justify a pass through all directions.
pub const LEAST: usize = 1 << 12;
/// Programs for spherical harmonics, in addition to those of every job. Measured with llvmpipe: 15 MiB at the highest order.
const PROGRAMS: usize = 24 << 20;

/// Maximum number of points in a round of the last stage, or of an earlier one: whole tiles, or less than one tile.
pub fn most_points(plan: &Plan, blocks: Blocks, last: bool) -> usize {
    let fit = (plan.memory << 20) / bytes_of_point(plan, blocks, last);
    // A point's light samples depend on its place among four rows of its texture, so rounds begin at whole groups of them.
    if fit < TILE { (fit / LEAST * LEAST).max(LEAST) } else { fit / TILE * TILE }
}

/// Bytes of a point of the round in progress: its textures, its packet if it has one, and its sums: of the block, in the pairwise tree and in the total.
fn bytes_of_point(plan: &Plan, blocks: Blocks, last: bool) -> usize {
    let copies = 1 + blocks.count().ilog2() as usize + 1;
    PointTextures::bytes([1, 1]) + PacketTile::bytes(1) + copies * Values::bytes(&plan.wanted(last))
}

/// Whether to store the hits of the vertices: a later round uses them again, and memory can hold all of them.
pub fn stores_hits(plan: &Plan, schedule: &Schedule) -> bool {
    let blocks = schedule.blocks;
    let mut of_vertices = schedule.rounds.iter().filter(|round| round.set == PointSet::Vertices).map(|round| &round.points);
    let Some(first) = of_vertices.next() else { return false };
    let bytes = bytes_of_point(plan, blocks, true) + HIT_BYTES * blocks.directions(0..blocks.count()).len();
    let again = of_vertices.clone().count() > 0 && of_vertices.all(|points| points == first);
    again && first.len() * bytes <= plan.memory << 20
}

impl Plan {
    /// Limits the plan to half of the memory for `points`. Returns false if `points` is already the minimum.
    pub(super) fn halve(&mut self, blocks: Blocks, points: usize) -> bool {
        self.memory = self.memory.min((points / 2 * bytes_of_point(self, blocks, true)) >> 20);
        points > LEAST
    }

    /// Gives the points of a round the memory that the rest of the bake leaves from `most` MiB.
    ///
    /// # Errors
    /// [`Error::Usage`] when `most` is too small.
    pub(super) fn fit(&mut self, most: usize, scene: &Scene, settings: &Settings, schedule: &Schedule) -> Result<()> {
        let [during, end] = self.bytes(scene, settings, schedule);
        let [vertices, receivers] = schedule.points();
        let least = LEAST.min(vertices.max(receivers)) * bytes_of_point(self, schedule.blocks, true);
        let needed = (during + least).max(end).div_ceil(1 << 20);
        if needed > most {
            return Err(Error::usage(
                format!("the bake may take {needed} MiB, and --memory allows {most}"),
                format!("give --memory {needed}, or bake fewer points or fewer quantities at once"),
            ));
        }
        // The upper limit is more than enough for any points. Parts store this number.
        self.memory = (most - during.div_ceil(1 << 20)).min(1 << 20);
        Ok(())
    }

    /// Bytes during rounds, without the round in progress; and bytes at the end, when all points have their values.
    fn bytes(&self, scene: &Scene, settings: &Settings, schedule: &Schedule) -> [usize; 2] {
        let ([vertices, receivers], own) = (schedule.points(), schedule.shard.clone());
        let all = 0..schedule.blocks.count();
        let sums = |last| Values::bytes(&self.wanted(last));
        let nodes = |blocks| PairwiseSum::<Values>::nodes_of(blocks) as usize;
        // Hits are stored, and packets kept, for passes alone.
        let passes = !self.is_on_cpu(settings.gather.pipeline);
        let hits = if passes { TILE.min(vertices.max(receivers)) * BATCH * HIT_BYTES } else { 0 };
        // Points: in their receiver, in the list of all, and in a tile. Then their direct light.
        let points = (vertices + receivers) * (3 * size_of::<GatherPoint>() + size_of::<Vec3>());
        // Sums of a stage, their total, and cached values.
        let cached = vertices * sums(false) * (nodes(all.clone()) + 2);
        let summed = receivers * sums(true) * nodes(own.clone());
        let packets = match settings.gather.pipeline {
            Pipeline::Raycast | Pipeline::Auto if passes => CpuRayFinder::bytes(vertices.max(receivers), TILE),
            _ => 0,
        };
        let during = common(scene, settings, self.needs_photons()) + PROGRAMS + hits + packets + points + cached + summed;
        // Totals: of a round and of all rounds. Columns: of all points, of one receiver, and in the file.
        let columns: usize = self.what.iter().map(|quantity| quantity.columns(self.order).len()).sum();
        let written = if own == all { 2 * sums(true) + 4 * size_of::<f32>() * columns } else { sums(true) };
        [during, during + receivers * written]
    }
}
