//! Sums of a bake: the block in progress on the GL side, and complete blocks as pairwise trees.

use std::ops::Range;
use std::path::Path;

use glam::Vec3;

use super::integrals::{Integrals, Tile, Values, Wanted};
use super::points::Turn;
use super::schedule::Round;
use crate::blocks::{Blocks, PairwiseSum, Part, Sum};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::points::GatherPoint;

/// Points of a tile. With so few, the hits of a batch (16 MB) stay in the cache between passes.
pub const TILE: usize = 1 << 18;

/// Sums of the points of a round.
#[derive(Default)]
pub struct RoundSums {
    /// Irradiance from the lights at each point. Empty before the round begins.
    pub direct: Vec<Vec3>,
    /// Sums of complete blocks.
    pub values: PairwiseSum<Values>,
}

/// The points of a round on the GL side, with the sums of the block in progress.
pub struct BlockSums {
    round: usize,
    pub integrals: Integrals,
    /// With the turn of its points.
    pub tiles: Vec<(Tile, Turn)>,
}

#[derive(Default)]
pub struct Accumulation {
    pub rounds: Vec<RoundSums>,
    /// `None` between rounds.
    pub block: Option<BlockSums>,
}

impl RoundSums {
    pub fn put<'a>(&'a self, part: &mut Part<'a>, round: &Round) {
        let [values, direct] = names(round);
        part.put_tree(&values, &self.values);
        if !self.direct.is_empty() {
            part.put(direct, bytemuck::cast_slice(&self.direct));
        }
    }

    /// Reads the sums of a round from `part`, a file at `path`.
    ///
    /// # Errors
    /// [`Error::Input`] when the part is damaged.
    pub fn read(path: &Path, part: &Part, round: &Round, wanted: &Wanted, blocks: Blocks) -> Result<Self> {
        let ([values, direct], points) = (names(round), round.points.len());
        let values = part.tree(path, &values, blocks, |_, planes| Values::of_planes(wanted, points, &planes))?;
        let direct = part.get(&direct).and_then(|floats| bytemuck::try_cast_slice::<_, Vec3>(floats).ok()).unwrap_or_default();
        if direct.len() == points || direct.is_empty() && values.blocks() == 0 {
            return Ok(Self { direct: direct.to_vec(), values });
        }
        Err(Error::input(path, None, "damaged: its direct light is not that of its points", "make it again"))
    }
}

/// The names of a round's values and direct light in a part.
fn names(round: &Round) -> [String; 2] {
    let stage = if round.last { "last".to_owned() } else { format!("stage{}", round.stage) };
    ["values", "direct"].map(|what| format!("{what}.{stage}.{}", round.points.start))
}

impl BlockSums {
    /// `points`: those of the round, by runs.
    pub fn new<'a>(
        gpu: &Gpu,
        round: usize,
        integrals: Integrals,
        points: impl Iterator<Item = (&'a [GatherPoint], Turn)>,
    ) -> Result<Self> {
        let tile = |(points, turn): (&[GatherPoint], Turn)| Ok((integrals.tile(gpu, points)?, turn));
        let runs = points.flat_map(|(points, turn)| points.chunks(TILE).map(move |points| (points, turn)));
        let tiles = runs.map(tile).collect::<Result<Vec<_>>>()?;
        let mut block = Self { round, integrals, tiles };
        block.clear();
        Ok(block)
    }

    fn clear(&mut self) {
        self.tiles.iter_mut().for_each(|(tile, _)| tile.clear());
    }

    fn read(&self) -> Values {
        let mut values = Values::default();
        self.tiles.iter().for_each(|(tile, _)| Integrals::read(tile, &mut values));
        values
    }
}

impl Accumulation {
    /// Empty sums for this number of rounds.
    pub fn new(rounds: usize) -> Self {
        Self { rounds: (0..rounds).map(|_| RoundSums::default()).collect(), block: None }
    }

    /// Adds the finished block to its round, and clears its sums for the next one.
    pub fn end_block(&mut self, gpu: &Gpu, index: u32) -> Result<()> {
        let Some(block) = &mut self.block else { return Ok(()) };
        let values = block.read();
        gpu.check("reading sums")?;
        self.rounds[block.round].values.insert_block(index, values);
        block.clear();
        Ok(())
    }

    /// The block in progress, if it belongs to this round.
    fn block_of(&self, round: usize) -> Option<&BlockSums> {
        self.block.as_ref().filter(|block| block.round == round)
    }

    /// Whether each of these rounds has sums of at least some directions. `with_block`: the block in progress counts.
    pub fn have_values(&self, mut rounds: Range<usize>, with_block: bool) -> bool {
        rounds.all(|round| self.rounds[round].values.blocks() > 0 || with_block && self.block_of(round).is_some())
    }

    /// Sums of these rounds so far, and direct light, in the order of their points. `with_block`: the block in progress counts.
    pub fn total(&self, rounds: Range<usize>, with_block: bool) -> (Values, Vec<Vec3>) {
        let (mut values, mut direct) = (Values::default(), Vec::new());
        for round in rounds {
            let latest = self.block_of(round).filter(|_| with_block).map(BlockSums::read);
            let sums = match (self.rounds[round].values.total(), latest) {
                (Some(mut sums), Some(latest)) => {
                    sums.add(&latest);
                    sums
                }
                (sums, latest) => sums.or(latest).unwrap_or_default(),
            };
            values.append(&sums);
            direct.extend(&self.rounds[round].direct);
        }
        (values, direct)
    }
}
