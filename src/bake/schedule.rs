//! The order of a bake's work: which points gather next, and along which directions. Knows no GL.
//!
//! A *stage* is a gather by all points of a set: each bounce is one at the scene's vertices, and the last stage is that of the receivers. A *round*
//! is as many of these points as fit into memory, along all directions, block by block. A shard does some blocks of the last stage, but all of
//! the stages before, on which the last depends.

use std::ops::Range;

use super::accumulation::RoundSums;
use super::memory::most_points;
use super::plan::{Plan, blocks_of};
use crate::blocks::Blocks;
use crate::direction::{Direction, Directions};
use crate::settings::Settings;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointSet {
    /// Of the scene: they cache what surfaces send.
    Vertices,
    Receivers,
}

/// Points that gather together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Round {
    pub set: PointSet,
    pub points: Range<usize>,
    /// It sees what the vertices found in the stage before.
    pub stage: u32,
    /// Whether it is of the last stage.
    pub last: bool,
}

/// A block of directions in progress.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlockInProgress {
    pub round: usize,
    pub block: u32,
    /// Its directions that are left.
    pub left: Range<u32>,
}

pub struct Schedule {
    directions: Directions,
    pub blocks: Blocks,
    /// The blocks of the last stage that are wanted.
    pub shard: Range<u32>,
    /// How many vertices gather, and how many receivers.
    pub points: [usize; 2],
    /// Receivers may be the vertices themselves.
    receivers: PointSet,
    /// In the order of stages.
    pub rounds: Vec<Round>,
    /// The stage that has begun. Only sums from the previous one on are kept.
    pub stage: u32,
    /// Some of its directions are done. `None` between blocks.
    pub current: Option<BlockInProgress>,
}

impl Schedule {
    /// Without rounds yet.
    pub fn new(settings: &Settings, points: [usize; 2], receivers: PointSet) -> Self {
        let (directions, blocks) = (Directions::new(settings.sequence, settings.seed), blocks_of(settings));
        let shard = 0..blocks.count();
        Self { directions, blocks, shard, points, receivers, rounds: Vec::new(), stage: 0, current: None }
    }

    /// Begins with the rounds of `plan`.
    pub fn restart(&mut self, plan: &Plan) {
        (self.rounds, self.stage, self.current) = (self.rounds_by(plan), 0, None);
    }

    /// The rounds that the points take by the memory of `plan`.
    pub fn rounds_by(&self, plan: &Plan) -> Vec<Round> {
        let [vertices, receivers] = self.points;
        let bounces = (0..plan.stages()).flat_map(|stage| Round::split(plan, self.blocks, PointSet::Vertices, vertices, stage));
        bounces.chain(Round::split(plan, self.blocks, self.receivers, receivers, plan.stages())).collect()
    }

    /// The numbers of the rounds of a stage.
    pub fn of_stage(&self, stage: u32) -> Range<usize> {
        let first = |stage: u32| self.rounds.partition_point(|round| round.stage < stage);
        first(stage)..first(stage.saturating_add(1))
    }

    /// The numbers of the rounds of the last stage.
    pub fn last(&self) -> Range<usize> {
        self.rounds.last().map_or(0..0, |round| self.of_stage(round.stage))
    }

    /// The most points of a round.
    pub fn largest_round(&self) -> usize {
        self.rounds.iter().map(|round| round.points.len()).max().unwrap_or(0)
    }

    /// The block in progress, or the first that is missing in `sums`, those of each round. `None` at the end.
    pub fn next(&self, sums: &[RoundSums]) -> Option<BlockInProgress> {
        let first_missing = |round: usize| {
            let block = sums[round].values.missing(self.blocks_of(round)).first()?.start;
            Some(BlockInProgress { round, block, left: self.blocks.directions(block..block + 1) })
        };
        let in_stages = || {
            let mut last = self.last();
            let mut before = self.of_stage(self.stage.saturating_sub(1)).start..last.start;
            // Where the last stage has all its blocks, those before are not needed.
            let of_last = last.find_map(first_missing)?;
            before.find_map(first_missing).or(Some(of_last))
        };
        self.current.clone().or_else(in_stages)
    }

    /// The next directions of a block, at most so many.
    pub fn directions(&self, at: &BlockInProgress, most: usize) -> Vec<Direction> {
        at.left.clone().take(most).map(|number| self.directions.get(number)).collect()
    }

    /// Directions along which the points of a round have gathered.
    fn done(&self, round: usize, sums: &[RoundSums]) -> u32 {
        let current = self.current.iter().filter(|at| at.round == round);
        let current = current.map(|at| at.left.start - self.blocks.directions(at.block..at.block + 1).start);
        self.blocks.summed(&sums[round].values) + current.sum::<u32>()
    }

    /// Directions along which all points of the last stage have gathered.
    pub fn directions_done(&self, sums: &[RoundSums]) -> u32 {
        self.last().map(|round| self.done(round, sums)).min().unwrap_or(0)
    }

    /// Directions of all rounds together: those that are done, and all.
    pub fn progress(&self, sums: &[RoundSums]) -> (u64, u64) {
        let total = |round| self.blocks.directions(self.blocks_of(round)).len() as u64;
        let kept = self.of_stage(self.stage.saturating_sub(1)).start;
        let done = |round| if round < kept { total(round) } else { self.done(round, sums).into() };
        let rounds = 0..self.rounds.len();
        (rounds.clone().map(done).sum(), rounds.map(total).sum())
    }

    /// The blocks that a round is to do.
    fn blocks_of(&self, round: usize) -> Range<u32> {
        if self.rounds[round].last { self.shard.clone() } else { 0..self.blocks.count() }
    }
}

impl Round {
    /// The rounds of a stage, for so many points by the memory of `plan`.
    pub fn split(plan: &Plan, blocks: Blocks, set: PointSet, count: usize, stage: u32) -> impl Iterator<Item = Self> + use<> {
        let last = stage == plan.stages();
        let most = most_points(plan, blocks, last);
        (0..count).step_by(most).map(move |first| Self { set, points: first..count.min(first + most), stage, last })
    }
}
