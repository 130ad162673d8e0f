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

/// The points of a bake.
#[derive(Clone, Copy, Debug)]
pub struct PointCounts {
    /// 0 where nothing is cached.
    pub vertices: usize,
    pub receivers: usize,
    /// Whether the receivers are the vertices themselves.
    pub same: bool,
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
    counts: PointCounts,
    blocks: Blocks,
    /// Those of the last stage that are wanted.
    shard: Range<u32>,
    /// In the order of stages.
    rounds: Vec<Round>,
    /// The stage that has begun. Sums of stages before the previous one are no longer there.
    pub stage: u32,
    pub current: Option<BlockInProgress>,
}

impl Schedule {
    /// Without rounds yet.
    pub fn new(settings: &Settings, counts: PointCounts) -> Self {
        let blocks = blocks_of(settings);
        Self {
            directions: Directions::new(settings.sequence, settings.seed),
            counts,
            blocks,
            shard: 0..blocks.count(),
            rounds: Vec::new(),
            stage: 0,
            current: None,
        }
    }

    /// Limits the last stage to these blocks.
    pub fn only(&mut self, blocks: Range<u32>) {
        self.shard = blocks;
    }

    /// Begins with the rounds of `plan`.
    pub fn restart(&mut self, plan: &Plan) {
        (self.rounds, self.stage, self.current) = (self.rounds_by(plan), 0, None);
    }

    /// The rounds that the points take by the memory of `plan`.
    pub fn rounds_by(&self, plan: &Plan) -> Vec<Round> {
        let bounces = (0..plan.stages()).flat_map(|stage| {
            let round = Round { set: PointSet::Vertices, points: 0..self.counts.vertices, stage, last: false };
            round.split(most_points(plan, self.blocks, false))
        });
        bounces.chain(Round::last(plan, self.blocks, self.counts)).collect()
    }

    pub fn counts(&self) -> PointCounts {
        self.counts
    }

    pub fn blocks(&self) -> Blocks {
        self.blocks
    }

    pub fn shard(&self) -> Range<u32> {
        self.shard.clone()
    }

    pub fn rounds(&self) -> &[Round] {
        &self.rounds
    }

    /// The rounds of a stage, by their numbers.
    pub fn of_stage(&self, stage: u32) -> Range<usize> {
        let first = |stage: u32| self.rounds.partition_point(|round| round.stage < stage);
        first(stage)..first(stage.saturating_add(1))
    }

    /// Those of the last stage.
    pub fn last(&self) -> Range<usize> {
        self.of_stage(self.last_stage())
    }

    /// Those of the stage before the one that has begun.
    pub fn before_stage(&self) -> Range<usize> {
        self.stage.checked_sub(1).map_or(0..0, |before| self.of_stage(before))
    }

    /// The most points of a round.
    pub fn largest_round(&self) -> usize {
        self.rounds.iter().map(|round| round.points.len()).max().unwrap_or(0)
    }

    pub fn last_stage(&self) -> u32 {
        self.rounds.last().map_or(0, |round| round.stage)
    }

    /// The block in progress, or the first that is missing in `sums`, those of each round. `None` at the end.
    pub fn next(&self, sums: &[RoundSums]) -> Option<BlockInProgress> {
        let first_missing = |round: usize| {
            let block = sums[round].values.missing(self.blocks_of(&self.rounds[round])).first()?.start;
            Some(BlockInProgress { round, block, left: self.blocks.directions(block..block + 1) })
        };
        let in_stages = || {
            let mut last = self.last();
            let earlier = self.before_stage().start..last.start;
            // Where the last stage has all its blocks, those before are not needed.
            let of_last = last.find_map(first_missing)?;
            earlier.into_iter().find_map(first_missing).or(Some(of_last))
        };
        self.current.clone().or_else(in_stages)
    }

    /// The next directions of a block, at most so many.
    pub fn directions(&self, at: &BlockInProgress, most: usize) -> Vec<Direction> {
        at.left.clone().take(most).map(|number| self.directions.get(number)).collect()
    }

    /// Directions of the block in progress that are done, if it is one of this round.
    fn done_of_current(&self, round: usize) -> u32 {
        let done = |at: &BlockInProgress| at.left.start - self.blocks.directions(at.block..at.block + 1).start;
        self.current.as_ref().filter(|at| at.round == round).map_or(0, done)
    }

    /// Whether nothing is lost by ending here.
    pub fn is_between_blocks(&self) -> bool {
        self.current.as_ref().is_none_or(|at| self.done_of_current(at.round) == 0)
    }

    /// Directions along which all points of the last stage have gathered.
    pub fn directions_done(&self, sums: &[RoundSums]) -> u32 {
        let done = |number: usize| self.blocks.summed(&sums[number].values) + self.done_of_current(number);
        self.last().map(done).min().unwrap_or(0)
    }

    /// Directions of all rounds together: those that are done, and all.
    pub fn progress(&self, sums: &[RoundSums]) -> (u64, u64) {
        let count = |(number, (round, sum)): (usize, (&Round, &RoundSums))| {
            let total = self.blocks.directions(self.blocks_of(round)).len() as u64;
            let summed = self.blocks.summed(&sum.values) + self.done_of_current(number);
            (if round.stage + 1 < self.stage { total } else { summed.into() }, total)
        };
        let counts = self.rounds.iter().zip(sums).enumerate().map(count);
        counts.fold((0, 0), |(done, total), (more, of)| (done + more, total + of))
    }

    fn blocks_of(&self, round: &Round) -> Range<u32> {
        if round.last { self.shard.clone() } else { 0..self.blocks.count() }
    }
}

impl Round {
    /// The rounds of the last stage.
    pub fn last(plan: &Plan, blocks: Blocks, counts: PointCounts) -> impl Iterator<Item = Self> + use<> {
        let set = if counts.same { PointSet::Vertices } else { PointSet::Receivers };
        let round = Self { set, points: 0..counts.receivers, stage: plan.stages(), last: true };
        round.split(most_points(plan, blocks, true))
    }

    /// Its points by so many at a time.
    fn split(self, most: usize) -> impl Iterator<Item = Self> {
        let end = self.points.end;
        let points = (0..end).step_by(most).map(move |first| first..end.min(first + most));
        points.map(move |points| Self { points, ..self.clone() })
    }
}
