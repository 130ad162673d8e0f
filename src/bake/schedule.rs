//! The order of a bake's work: which points gather next, along which directions. It uses no GL.
//!
//! In a *stage*, all points of a set gather: the scene's vertices for each bounce, the receivers in the last stage. A *round* takes as many of these
//! points as fit into memory through all directions, block by block. A shard does some blocks of the last stage, and all of the earlier stages.

use std::ops::Range;

use super::accumulation::RoundSums;
use super::memory::{LEAST, most_points};
use super::plan::{Plan, blocks_of};
use super::points::{PointRun, Turn};
use crate::blocks::Blocks;
use crate::direction::{Direction, Directions};
use crate::settings::DirectionSettings;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointSet {
    /// The scene's vertices. They fill the vertex cache.
    Vertices,
    Receivers,
}

/// Points that gather together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Round {
    pub set: PointSet,
    pub points: Range<usize>,
    /// The round uses the results of the stage before.
    pub stage: u32,
    /// Whether it is of the last stage.
    pub last: bool,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlockInProgress {
    pub round: usize,
    pub block: u32,
    /// The remaining directions.
    pub left: Range<u32>,
}

pub struct Schedule {
    directions: Directions,
    pub blocks: Blocks,
    /// The wanted blocks of the last stage.
    pub shard: Range<u32>,
    /// The vertices that gather.
    vertices: [PointRun; 1],
    /// The receiver points.
    pub receivers: Vec<PointRun>,
    /// The set of the receiver points, which can be the vertices themselves.
    set: PointSet,
    /// In the order of stages.
    pub rounds: Vec<Round>,
    /// The current stage. Older sums than those of the stage before are dropped.
    pub stage: u32,
    /// A block with some directions done. `None` between blocks.
    pub current: Option<BlockInProgress>,
}

impl Schedule {
    /// A schedule without rounds.
    pub fn new(settings: &DirectionSettings, seed: u64, vertices: usize, receivers: Vec<PointRun>, set: PointSet) -> Self {
        let (directions, blocks) = (Directions::new(settings.sequence, seed), blocks_of(settings, PointRun::turns(&receivers)));
        let (shard, vertices) = (0..blocks.count(), [PointRun::whole(vertices)]);
        Self { directions, blocks, shard, vertices, receivers, set, rounds: Vec::new(), stage: 0, current: None }
    }

    /// Number of vertices that gather, and number of receiver points.
    pub fn points(&self) -> [usize; 2] {
        [&self.vertices[..], &self.receivers].map(PointRun::points)
    }

    /// The runs of the points of a round, with their turns.
    pub fn runs(&self, round: &Round) -> impl Iterator<Item = (Range<usize>, Turn)> {
        PointRun::within(if round.last { &self.receivers } else { &self.vertices }, round.points.clone())
    }

    /// Whether points of the last stage take turns. Then a block in progress has sums of some of them alone.
    pub fn takes_turns(&self) -> bool {
        PointRun::turns(&self.receivers) > 1
    }

    /// Begins the rounds of `plan`.
    pub fn restart(&mut self, plan: &Plan) {
        (self.rounds, self.stage, self.current) = (self.rounds_by(plan), 0, None);
    }

    /// The rounds of all points, with the memory of `plan`.
    pub fn rounds_by(&self, plan: &Plan) -> Vec<Round> {
        let bounce = |stage| Round::split(plan, self.blocks, PointSet::Vertices, &self.vertices, stage);
        let bounces = (0..plan.stages()).flat_map(bounce);
        bounces.chain(Round::split(plan, self.blocks, self.set, &self.receivers, plan.stages())).collect()
    }

    /// Indices of the rounds of a stage.
    pub fn of_stage(&self, stage: u32) -> Range<usize> {
        let first = |stage: u32| self.rounds.partition_point(|round| round.stage < stage);
        first(stage)..first(stage.saturating_add(1))
    }

    /// Indices of the rounds of the last stage.
    pub fn last(&self) -> Range<usize> {
        self.rounds.last().map_or(0..0, |round| self.of_stage(round.stage))
    }

    pub fn largest_round(&self) -> usize {
        self.rounds.iter().map(|round| round.points.len()).max().unwrap_or(0)
    }

    /// The block in progress, or else the first one missing in `sums` (one entry for each round). `None` at the end.
    pub fn next(&self, sums: &[RoundSums]) -> Option<BlockInProgress> {
        let first_missing = |round: usize| {
            let block = sums[round].values.missing(self.blocks_of(round)).first()?.start;
            Some(BlockInProgress { round, block, left: self.blocks.directions(block..block + 1) })
        };
        let in_stages = || {
            let mut last = self.last();
            let mut before = self.of_stage(self.stage.saturating_sub(1)).start..last.start;
            // If the last stage has all its blocks, earlier stages are not needed.
            let of_last = last.find_map(first_missing)?;
            before.find_map(first_missing).or(Some(of_last))
        };
        self.current.clone().or_else(in_stages)
    }

    /// The next directions of a block, at most `most`, all of the same turns.
    pub fn directions(&self, at: &BlockInProgress, most: usize) -> Vec<Direction> {
        let block = self.blocks.directions(at.block..at.block + 1);
        let parts = self.runs(&self.rounds[at.round]).map(|(_, turn)| turn.part(&block));
        let bounds = parts.flat_map(|part| [part.start, part.end]).filter(|&bound| bound > at.left.start);
        let end = bounds.min().unwrap_or(at.left.end).min(at.left.end);
        (at.left.start..end).take(most).map(|number| self.directions.get(number)).collect()
    }

    /// Whether points with this turn take the next directions of a block.
    pub fn takes(&self, at: &BlockInProgress, turn: Turn) -> bool {
        turn.part(&self.blocks.directions(at.block..at.block + 1)).contains(&at.left.start)
    }

    /// Directions along which the points of a round have gathered. `with_block`: those of the block in progress count.
    fn done(&self, round: usize, sums: &[RoundSums], with_block: bool) -> u32 {
        let current = self.current.iter().filter(|at| with_block && at.round == round);
        let current = current.map(|at| at.left.start - self.blocks.directions(at.block..at.block + 1).start);
        self.blocks.summed(&sums[round].values) + current.sum::<u32>()
    }

    /// Directions along which all points of the last stage have gathered, each in its turn.
    pub fn directions_done(&self, sums: &[RoundSums]) -> u32 {
        self.last().map(|round| self.done(round, sums, !self.takes_turns())).min().unwrap_or(0)
    }

    /// Directions done and in total, summed over all rounds.
    pub fn progress(&self, sums: &[RoundSums]) -> (u64, u64) {
        let total = |round| self.blocks.directions(self.blocks_of(round)).len() as u64;
        let kept = self.of_stage(self.stage.saturating_sub(1)).start;
        let done = |round| if round < kept { total(round) } else { self.done(round, sums, true).into() };
        let rounds = 0..self.rounds.len();
        (rounds.clone().map(done).sum(), rounds.map(total).sum())
    }

    /// The blocks that a round must do.
    fn blocks_of(&self, round: usize) -> Range<u32> {
        if self.rounds[round].last { self.shard.clone() } else { 0..self.blocks.count() }
    }
}

impl Round {
    /// The rounds of a stage for the points of `runs`, with the memory of `plan`.
    pub fn split(
        plan: &Plan,
        blocks: Blocks,
        set: PointSet,
        runs: &[PointRun],
        stage: u32,
    ) -> impl Iterator<Item = Self> + use<> {
        let last = stage == plan.stages();
        let ranges = PointRun::split(runs, most_points(plan, blocks, last), LEAST);
        ranges.into_iter().map(move |points| Self { set, points, stage, last })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::RadianceCache;
    use crate::bake::integrals::Values;
    use crate::quantity::Quantity;

    const VERTICES: usize = 5000;
    const RECEIVERS: usize = 11_000;

    /// Two bounces, then the receivers, in rounds of 4096 points; 20 blocks of 8 directions. Nothing is summed yet.
    fn schedule() -> (Schedule, Vec<RoundSums>) {
        let radiance_cache = RadianceCache::Vertices;
        let plan =
            Plan { what: vec![Quantity::Irradiance], order: 3, gather_bounces: 2, ao_distance: None, radiance_cache, memory: 0 };
        let settings = DirectionSettings { count: 157, ..Default::default() };
        let receivers = vec![PointRun::whole(RECEIVERS)];
        let mut schedule = Schedule::new(&settings, 0, VERTICES, receivers, PointSet::Receivers);
        schedule.restart(&plan);
        let sums = schedule.rounds.iter().map(|_| RoundSums::default()).collect();
        (schedule, sums)
    }

    /// Does the next block. Returns its round and block.
    fn step(schedule: &Schedule, sums: &mut [RoundSums]) -> Option<(usize, u32)> {
        let BlockInProgress { round, block, .. } = schedule.next(sums)?;
        sums[round].values.insert_block(block, Values::default());
        Some((round, block))
    }

    #[test]
    fn rounds_have_all_points_of_each_stage_once() {
        let (schedule, _) = schedule();
        let of_stage = |stage: u32| &schedule.rounds[schedule.of_stage(stage)];
        for (stage, count, set) in
            [(0, VERTICES, PointSet::Vertices), (1, VERTICES, PointSet::Vertices), (2, RECEIVERS, PointSet::Receivers)]
        {
            assert!(of_stage(stage).iter().flat_map(|round| round.points.clone()).eq(0..count), "stage {stage}");
            assert!(of_stage(stage).iter().all(|round| round.set == set && round.last == (stage == 2)), "stage {stage}");
        }
        assert_eq!([0, 1, 2].map(|stage| of_stage(stage).len()), [2, 2, 3]);
        assert_eq!((schedule.last(), schedule.largest_round()), (4..7, 4096));
    }

    #[test]
    fn rounds_come_one_after_another_and_a_shard_does_its_blocks_of_the_last_stage() {
        let (mut schedule, mut sums) = schedule();
        schedule.shard = 3..5;
        let mut expected: Vec<_> = (0..4).flat_map(|round| (0..20).map(move |block| (round, block))).collect();
        expected.extend((4..7).flat_map(|round| [(round, 3), (round, 4)]));
        let total = 4 * 157 + 3 * 16;
        assert_eq!(schedule.progress(&sums), (0, total));
        assert!(std::iter::from_fn(|| step(&schedule, &mut sums)).eq(expected));
        assert_eq!((schedule.progress(&sums), schedule.directions_done(&sums)), ((total, total), 16));
    }

    #[test]
    fn a_stage_needs_the_one_before_and_a_complete_last_one_needs_none() {
        let (mut schedule, mut sums) = schedule();
        // As after a resume in the second bounce: only the first bounce has its sums.
        assert_eq!((0..40).filter_map(|_| step(&schedule, &mut sums)).count(), 40);
        schedule.stage = 1;
        assert_eq!(step(&schedule, &mut sums), Some((2, 0)));
        schedule.stage = 2;
        sums[..2].fill_with(RoundSums::default);
        assert_eq!(schedule.next(&sums).map(|at| at.round), Some(2), "what the first stage found is handed on");
        assert_eq!(schedule.progress(&sums).0, 2 * 157 + 8);
        let (schedule, mut sums) = self::schedule();
        sums[4..].iter_mut().for_each(|sums| (0..20).for_each(|block| sums.values.insert_block(block, Values::default())));
        assert_eq!(schedule.next(&sums), None);
    }

    #[test]
    fn the_block_in_progress_comes_first() {
        let (mut schedule, sums) = schedule();
        let first = schedule.next(&sums).unwrap();
        assert_eq!(first, BlockInProgress { round: 0, block: 0, left: 0..8 });
        let half = BlockInProgress { left: 5..8, ..first };
        schedule.current = Some(half.clone());
        assert_eq!(schedule.next(&sums), Some(half.clone()));
        assert_eq!(schedule.progress(&sums).0, 5);
        let numbers = |most| schedule.directions(&half, most).iter().map(|direction| direction.vector).collect::<Vec<_>>();
        assert_eq!((numbers(8).len(), numbers(2).len()), (3, 2));
        assert_eq!(numbers(8)[..2], numbers(2));
    }
}
