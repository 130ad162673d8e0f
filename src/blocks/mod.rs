//! Splits a sum over directions into independent blocks of consecutive directions. Sums of blocks merge to the same bits in any order
//! ([`PairwiseSum`]), are stored in files ([`Part`]), and are shared between machines ([`Shard`]).

mod pairwise;
mod part;
mod shard;

use std::ops::Range;
use std::path::Path;

use crate::error::{Error, Result};

pub use pairwise::{Node, PairwiseSum, Sum};
pub use part::{Part, Planes, sha256};
pub use shard::Shard;

/// The blocks of a job's directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Blocks {
    directions: u32,
    of: u32,
}

impl Blocks {
    /// About 32 blocks. Each has a power of two of directions, at least `least` and else at most 128, so that work done once for each block is also
    /// done often in long jobs. The last block may have fewer.
    pub fn new(directions: u32, least: u32) -> Self {
        Self { directions, of: directions.div_ceil(32).next_power_of_two().min(128).max(least.next_power_of_two()) }
    }

    pub fn count(self) -> u32 {
        self.directions.div_ceil(self.of)
    }

    /// The directions of some consecutive blocks.
    pub fn directions(self, blocks: Range<u32>) -> Range<u32> {
        let first = |block: u32| block.saturating_mul(self.of).min(self.directions);
        first(blocks.start)..first(blocks.end)
    }

    /// Inserts all nodes of `part`, read from `path`, into `sum`.
    ///
    /// # Errors
    /// [`Error::Input`] if `sum` contains some of its blocks already.
    pub fn merge<T: Sum>(self, path: &Path, sum: &mut PairwiseSum<T>, part: PairwiseSum<T>) -> Result<()> {
        for node in part.into_nodes() {
            sum.insert(node).map_err(|node| {
                let Range { start, end } = self.directions(node.range());
                let problem = format!("its directions {start} to {} are in an earlier part too", end - 1);
                Error::input(path, None, problem, "name each part once, of one way to deal out the directions")
            })?;
        }
        Ok(())
    }

    /// # Errors
    /// [`Error::Usage`] that names missing directions.
    pub fn check_whole<T: Sum>(self, sum: &PairwiseSum<T>) -> Result<()> {
        let missing = sum.missing(0..self.count()).into_iter().map(|blocks| self.directions(blocks));
        let missing: Vec<_> = missing.map(|Range { start, end }| format!("{start} to {}", end - 1)).collect();
        if missing.is_empty() {
            return Ok(());
        }
        let problem = format!("no part has directions {} of {}", missing.join(", "), self.directions);
        Err(Error::usage(problem, "name the parts of all shards, and run again with --resume those that are not complete"))
    }

    /// Number of directions in the blocks of `sum`.
    pub fn summed<T: Sum>(self, sum: &PairwiseSum<T>) -> u32 {
        sum.nodes().iter().map(|node| self.directions(node.range()).len() as u32).sum()
    }
}
