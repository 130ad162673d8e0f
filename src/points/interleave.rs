//! Interleaved sampling: in each square of neighbouring pixels, one pixel gathers along a given direction. Pixels of one surface then share
//! their sums ([`Sharing`](super::Sharing), after Keller and Heidrich 2001, "Interleaved sampling").
//!
//! All points share the directions of a bundle, so with few directions the error shows as bands and not as noise. With squares of k × k pixels,
//! k² times as many directions cost the same passes over points, and neighbours have different directions.

use std::ops::Range;

use glam::Vec4;
use serde::Serialize;

use crate::random::Random;

/// From so many directions on, squares are small.
const MANY: u32 = 1000;

/// The points at `offset` and at every `stride`-th texel from there, along both axes of the textures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Subset {
    pub stride: u32,
    pub offset: [u32; 2],
}

impl Subset {
    pub const ALL: Self = Self { stride: 1, offset: [0, 0] };

    /// Width and height of the tile of [`super::Accumulator`] for this subset; `points` is the size of the textures. All offsets have the same.
    pub fn size(self, points: [u32; 2]) -> [u32; 2] {
        points.map(|side| side.div_ceil(self.stride))
    }

    /// The subset's number among the subsets of its stride.
    pub fn index(self) -> usize {
        (self.offset[1] * self.stride + self.offset[0]) as usize
    }
}

/// Assigns directions to the pixels of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Interleave {
    stride: u32,
    size: [u32; 2],
    seed: u64,
    /// How many directions of the sequence stand for one of the settings' number.
    spread: u32,
}

impl Interleave {
    /// For pictures of `size` pixels, with squares of `stride` × `stride` pixels.
    ///
    /// # Panics
    /// If `stride` is neither 1 nor even: a window of neighbours would not hold equally many pixels of each subset.
    pub fn new(stride: u32, size: [u32; 2], seed: u64) -> Self {
        assert!(stride == 1 || stride > 0 && stride.is_multiple_of(2), "a square of {stride} pixels");
        Self { stride, size, seed, spread: 1 }
    }

    /// For pipelines that lose nothing when neighbours look along different directions. Few directions: 8 times as many, in squares of 4 × 4 pixels, so a
    /// pixel casts half of the rays. Many directions have fewer bands, and the blur of large squares would show in creases: 4 times as many, in
    /// squares of 2 × 2, so a pixel casts all of the rays. Measured: docs/performance.md.
    pub fn spread(size: [u32; 2], seed: u64, directions: u32) -> Self {
        let (stride, spread) = if directions < MANY { (4, 8) } else { (2, 4) };
        Self { spread, ..Self::new(stride, size, seed) }
    }

    /// The numbers in the sequence of these of the settings' directions. Beyond the last number there are none.
    pub fn numbers(&self, directions: Range<u32>) -> Range<u32> {
        directions.start.saturating_mul(self.spread)..directions.end.saturating_mul(self.spread)
    }

    /// How many of the settings' directions so many of the sequence are.
    pub fn directions(&self, numbers: u32) -> u32 {
        numbers / self.spread
    }

    /// The size of the picture, and the side of its squares.
    pub fn squares(&self) -> ([u32; 2], u32) {
        (self.size, self.stride)
    }

    /// Number of subsets.
    pub fn subsets(&self) -> usize {
        (self.stride * self.stride) as usize
    }

    /// The subset that gathers along direction `index` of `block`. Consecutive directions go to consecutive subsets, and each block begins with
    /// another subset. So the directions of a neighbourhood are spread evenly at any time. A run of consecutive directions for each subset
    /// spreads those of a single pixel evenly, but it measured worse (1.70 against 1.53 % error, squares of 2 × 2, 1000 directions).
    pub fn subset(&self, index: u32, block: u32) -> Subset {
        let turn = Random::new(self.seed ^ 0x1e4f, block.into()).bits() as u32;
        let number = index.wrapping_add(turn) % self.subsets() as u32;
        Subset { stride: self.stride, offset: [number % self.stride, number / self.stride] }
    }

    /// The subset of a pixel; pixels are counted row by row.
    pub fn subset_of(&self, pixel: usize) -> Subset {
        let [x, y] = [pixel as u32 % self.size[0], pixel as u32 / self.size[0]];
        Subset { stride: self.stride, offset: [x % self.stride, y % self.stride] }
    }

    /// Width and height of a tile with one value for each pixel of a subset.
    pub fn tile(&self) -> [u32; 2] {
        Subset { stride: self.stride, offset: [0, 0] }.size(self.size)
    }

    /// Size of the sums of all subsets, with one tile for each.
    pub fn sums_size(&self) -> [u32; 2] {
        self.tile().map(|side| side * self.stride)
    }

    /// Reorders sums from the GL side, which are in tiles of subsets, to the order of pixels.
    pub fn in_order(&self, tiles: Vec<Vec4>) -> Vec<Vec4> {
        if self.stride == 1 {
            return tiles;
        }
        let tile = self.tile();
        let width = self.sums_size()[0];
        let place = |[x, y]: [u32; 2]| {
            let [tx, ty] = [(x, tile[0]), (y, tile[1])].map(|(at, side)| at % self.stride * side + at / self.stride);
            tiles[(ty * width + tx) as usize]
        };
        self.pixels().map(place).collect()
    }

    fn pixels(&self) -> impl Iterator<Item = [u32; 2]> {
        let [width, height] = self.size;
        (0..height).flat_map(move |y| (0..width).map(move |x| [x, y]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [7, 5];

    #[test]
    fn every_subset_takes_its_share_of_a_block() {
        for stride in [1, 2, 4] {
            let interleave = Interleave::new(stride, SIZE, 3);
            for block in 0..8 {
                let mut taken = vec![0; interleave.subsets()];
                (0..32).for_each(|index| taken[interleave.subset(block * 32 + index, block).index()] += 1);
                assert!(taken.iter().all(|&directions| directions == 32 / (stride * stride)), "{stride}: {taken:?}");
            }
        }
    }

    #[test]
    fn tiles_go_back_to_their_pixels() {
        let interleave = Interleave::new(2, SIZE, 0);
        // Four tiles of 4 x 3. Each texel holds its pixel's number, where the shaders put it.
        let mut tiles = vec![Vec4::NEG_ONE; 8 * 6];
        for y in 0..SIZE[1] {
            for x in 0..SIZE[0] {
                tiles[((y % 2 * 3 + y / 2) * 8 + x % 2 * 4 + x / 2) as usize] = Vec4::splat((y * SIZE[0] + x) as f32);
            }
        }
        assert_eq!(interleave.sums_size(), [8, 6]);
        let expected: Vec<_> = (0..SIZE[0] * SIZE[1]).map(|pixel| Vec4::splat(pixel as f32)).collect();
        assert_eq!(interleave.in_order(tiles), expected);
    }

    #[test]
    fn a_longer_sequence_is_dealt_out_evenly() {
        let many = Interleave::spread([48, 40], 5, 1000);
        assert_eq!((many.subsets(), many.numbers(32..64)), (4, 128..256));
        let interleave = Interleave::spread([48, 40], 5, 999);
        let numbers = interleave.numbers(32..64);
        assert_eq!((numbers.clone(), interleave.directions(numbers.len() as u32)), (256..512, 32));
        let mut taken = vec![0; interleave.subsets()];
        numbers.for_each(|number| taken[interleave.subset(number, 1).index()] += 1);
        assert!(taken.iter().all(|&directions| directions == 16), "{taken:?}");
        assert_eq!(interleave.numbers(u32::MAX - 1..u32::MAX).len(), 0);
    }
}
