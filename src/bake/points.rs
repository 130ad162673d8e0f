//! The points of a bake, and the part of the directions that each takes.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::points::GatherPoint;

/// Most parts of a block's directions: as many as a block of the greatest length has batches.
pub const MOST_TURNS: u32 = 16;

/// A part of each block's directions: number `index` of `of` parts that are equal, or differ by one direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Turn {
    pub index: u32,
    pub of: u32,
}

/// Points that follow each other in the list and take the same turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointRun {
    pub count: usize,
    pub turn: Turn,
}

/// The points of all receivers in order. Points that stand for one texel share the directions: each takes its turn.
#[derive(Clone, Debug, Default)]
pub struct BakePoints {
    pub points: Vec<GatherPoint>,
    /// They hold all points.
    pub runs: Vec<PointRun>,
}

impl Turn {
    /// All directions.
    pub const ALL: Self = Self { index: 0, of: 1 };

    /// This part of the directions of a block.
    pub fn part(self, block: &Range<u32>) -> Range<u32> {
        let [start, end] = [self.index, self.index + 1].map(|index| {
            let before = u64::from(block.end - block.start) * u64::from(index) / u64::from(self.of);
            block.start + before as u32
        });
        start..end
    }
}

impl PointRun {
    /// Points that take all directions.
    pub fn whole(count: usize) -> Self {
        Self { count, turn: Turn::ALL }
    }

    /// Number of points in all `runs`, which are possible.
    pub fn points(runs: &[Self]) -> usize {
        runs.iter().map(|run| run.count).sum()
    }

    /// Number of points in all `runs`; `None` if these or their turns are impossible.
    pub fn count(runs: &[Self]) -> Option<usize> {
        let is_turn = |Turn { index, of }: Turn| index < of && of <= MOST_TURNS;
        let count = runs.iter().try_fold(0, |sum: u32, run| sum.checked_add(u32::try_from(run.count).ok()?))?;
        runs.iter().all(|run| is_turn(run.turn)).then_some(count as usize)
    }

    /// The number of parts of the directions in these runs.
    pub fn turns(runs: &[Self]) -> u32 {
        runs.iter().map(|run| run.turn.of).max().unwrap_or(1)
    }

    /// The runs within a range of the points of all `runs`, with their turns.
    pub fn within(runs: &[Self], range: Range<usize>) -> impl Iterator<Item = (Range<usize>, Turn)> {
        runs.iter()
            .scan(0, |end, run| {
                *end += run.count;
                Some((*end - run.count..*end, run.turn))
            })
            .map(move |(own, turn)| (own.start.max(range.start)..own.end.min(range.end), turn))
            .filter(|(own, _)| !own.is_empty())
    }

    /// All points in ranges of at most `most`. A range ends at the end of a run, or whole multiples of `group` after its start.
    pub fn split(runs: &[Self], most: usize, group: usize) -> Vec<Range<usize>> {
        let count = Self::points(runs);
        let mut ranges = Vec::new();
        let mut start = 0;
        while start < count {
            let mut end = count.min(start + most);
            if let Some((last, _)) = Self::within(runs, 0..count).find(|(own, _)| own.start < end && end < own.end) {
                // A run that begins within this range may be cut at its first group, and any other where the range before left it.
                end = last.start + (end - last.start) / group * group;
            }
            ranges.push(start..end);
            start = end;
        }
        ranges
    }
}

impl From<Vec<GatherPoint>> for BakePoints {
    fn from(points: Vec<GatherPoint>) -> Self {
        Self { runs: vec![PointRun::whole(points.len())], points }
    }
}

impl FromIterator<Self> for BakePoints {
    fn from_iter<I: IntoIterator<Item = Self>>(receivers: I) -> Self {
        receivers.into_iter().fold(Self::default(), |mut all, receiver| {
            all.points.extend(receiver.points);
            all.runs.extend(receiver.runs);
            all
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_share_a_block_without_gap() {
        for (block, of) in [(0..32, 4), (32..64, 4), (64..75, 4), (8..10, 4), (0..72, 9)] {
            let parts: Vec<_> = (0..of).map(|index| Turn { index, of }.part(&block)).collect();
            assert!(parts.iter().cloned().flatten().eq(block.clone()), "{parts:?} of {block:?}");
            let lengths = parts.iter().map(ExactSizeIterator::len);
            assert!(lengths.clone().max().unwrap() - lengths.min().unwrap() <= 1, "{parts:?}");
        }
    }

    #[test]
    fn ranges_end_at_whole_groups_of_their_run() {
        let run = |count| PointRun { count, turn: Turn::ALL };
        let runs = [run(10), run(25), run(7)];
        assert_eq!((PointRun::split(&runs, 100, 4).len(), &PointRun::split(&runs, 100, 4)[0]), (1, &(0..42)));
        // 16 lies 6 after the second run's start: one group of 4. The next range goes on from there.
        assert_eq!(PointRun::split(&runs, 16, 4), [0..14, 14..30, 30..42]);
        assert_eq!(
            PointRun::split(&runs, 4, 4),
            [0..4, 4..8, 8..10, 10..14, 14..18, 18..22, 22..26, 26..30, 30..34, 34..35, 35..39, 39..42]
        );
    }
}
