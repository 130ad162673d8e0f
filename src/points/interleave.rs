//! Interleaved sampling: in each square of neighbouring pixels, one pixel gathers along a given direction. Pixels of one surface then share
//! their sums (after Keller and Heidrich 2001, "Interleaved sampling").
//!
//! All points share the directions of a bundle, so with few directions the error shows as bands and not as noise. With squares of k × k pixels,
//! k² times as many directions cost the same passes over points, and neighbours have different directions.

use std::ops::Range;

use glam::Vec4;
use rayon::prelude::*;
use serde::Serialize;

use super::{GBuffer, GatherPoint};
use crate::random::Random;

/// Least sum of the weights of a window's pixels, as a share of a square's: with less, too much noise is left, and the window grows.
const ENOUGH: f32 = 0.75;
/// Farthest that a window grows, in pixels.
const FARTHEST: i32 = 8;
/// Pixels along a side of the largest window.
const WINDOW: usize = 2 * FARTHEST as usize + 1;
/// Whether a pixel and its neighbours see the same surface, by row and column of the window, as far as it is known.
type Joined = [[Option<bool>; WINDOW]; WINDOW];
/// From so many directions on, squares are small.
const MANY: u32 = 1000;
/// Pixels share sums only if the surface between them bends and steps less than this, as the sine of an angle.
const FLAT: f32 = 0.2;

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

    /// Estimates the sums of each pixel over all directions of a block. Subset i gathered along `taken[i]` of them. The estimate adds the sums
    /// of the pixel and of its neighbours on the same surface, and scales them to all directions.
    ///
    /// A neighbour counts only together with the one opposite. So where light changes steadily, as beside an edge, the mean stays that of the pixel. At
    /// an edge, those along it are left. Where they are too few, the window grows, and takes in single neighbours only as a last resort.
    pub fn share(&self, sums: Vec<Vec4>, taken: &[u32], g_buffer: &GBuffer) -> Vec<Vec4> {
        if self.stride == 1 {
            return sums;
        }
        let all = taken.iter().sum::<u32>() as f32;
        let points = g_buffer.pixels();
        let runs = self.runs(&points);
        let of = |pixel: usize| (sums[pixel], taken[self.subset_of(pixel).index()] as f32);
        let share = |here: usize| {
            if let Some(whole) = self.whole_window(&points, &runs, here, &sums) {
                return whole;
            }
            let (total, directions) = self.shared(&points, here, &of);
            if directions > 0.0 { total * (all / directions) } else { Vec4::ZERO }
        };
        (0..sums.len()).into_par_iter().map(share).collect()
    }

    /// For each pixel, how many of the next ones along x, and along y, see the same surface one after the other, up to the width of a window.
    fn runs(&self, points: &[Option<GatherPoint>]) -> Vec<[u8; 2]> {
        let [width, height] = self.size.map(|side| side as usize);
        let steps = [(1, [1, 0]), (width, [0, 1])];
        let most = [width, height].map(|side| self.stride.min(side as u32) as u8);
        let joins: Vec<[bool; 2]> =
            (0..points.len()).into_par_iter().map(|here| steps.map(|(_, step)| self.see_same(points, here, step))).collect();
        let run = |here: usize| {
            [0, 1].map(|axis| {
                let is_joined = |step: &u8| joins[here + usize::from(*step) * steps[axis].0][axis];
                (0..most[axis]).take_while(is_joined).count() as u8
            })
        };
        (0..points.len()).into_par_iter().map(run).collect()
    }

    /// The sums of a pixel's window, as those of [`Self::shared`], if it sees one surface: neighbours do along all its rows and columns, and the pixel does
    /// with the corners and the middles of the sides. So it is for most pixels. The window then holds all subsets alike, and all directions of the block.
    fn whole_window(&self, points: &[Option<GatherPoint>], runs: &[[u8; 2]], here: usize, sums: &[Vec4]) -> Option<Vec4> {
        let (reach, width) = (self.stride as usize / 2, self.size[0] as usize);
        let [x, y] = [here % width, here / width];
        if x < reach || y < reach || x + reach >= width || y + reach >= self.size[1] as usize {
            return None;
        }
        let (first, side) = ((y - reach) * width + x - reach, 2 * reach);
        let is_joined =
            (0..=side).all(|d| usize::from(runs[first + d * width][0]) >= side && usize::from(runs[first + d][1]) >= side);
        let far = |d: i32| d * reach as i32;
        let ends = [[1, 0], [0, 1], [1, 1], [1, -1]].map(|[dx, dy]| [far(dx), far(dy)]);
        let reaches = |[dx, dy]: [i32; 2]| self.see_same(points, here, [dx, dy]) && self.see_same(points, here, [-dx, -dy]);
        if !is_joined || !ends.into_iter().all(reaches) {
            return None;
        }
        let mut total = Vec4::ZERO;
        for dy in 0..=side {
            let row = &sums[first + dy * width..][..=side];
            // The two ends of the window belong to the same subset, so each counts half.
            let inner = row[1..side].iter().fold(0.5 * (row[0] + row[side]), |sum, value| sum + *value);
            total += if dy == 0 || dy == side { 0.5 * inner } else { inner };
        }
        Some(total)
    }

    /// The sums and the number of directions of a pixel's window.
    fn shared(&self, points: &[Option<GatherPoint>], here: usize, of: &dyn Fn(usize) -> (Vec4, f32)) -> (Vec4, f32) {
        if points[here].is_none() {
            return of(here);
        }
        let enough = ENOUGH * self.subsets() as f32;
        let (mut reach, mut pairs) = (self.stride as i32 / 2, true);
        let mut joined = [[None; WINDOW]; WINDOW];
        loop {
            let ((mut total, mut directions), mut weights) = (of(here), 1.0);
            // One of each pair of opposite steps.
            for dy in 0..=reach {
                for dx in if dy == 0 { 1 } else { -reach }..=reach {
                    let [one, other] = [1, -1].map(|side| self.neighbour(points, here, [side * dx, side * dy], &mut joined));
                    if pairs && (one.is_none() || other.is_none()) {
                        continue;
                    }
                    // The two ends of the window belong to the same subset, so each counts half.
                    let weight = [dx, dy].map(|d| if d.abs() == reach { 0.5 } else { 1.0 }).iter().product::<f32>();
                    for (sums, taken) in [one, other].into_iter().flatten().map(of) {
                        (total, directions, weights) = (total + weight * sums, directions + weight * taken, weights + weight);
                    }
                }
            }
            if weights >= enough || !pairs {
                return (total, directions);
            }
            (reach, pairs) = if reach < FARTHEST { (2 * reach, true) } else { (self.stride as i32 / 2, false) };
        }
    }

    /// The pixel at `step` from pixel `here`, if both and the pixel half way between them see the same surface. `joined`: whether they do, for other
    /// steps from there.
    fn neighbour(&self, points: &[Option<GatherPoint>], here: usize, step: [i32; 2], joined: &mut Joined) -> Option<usize> {
        let [column, row] = step.map(|d| (d + FARTHEST) as usize);
        let is_joined = joined[row][column].unwrap_or_else(|| {
            let half = step.map(|d| d / 2);
            (half == [0, 0] || self.neighbour(points, here, half, joined).is_some()) && self.see_same(points, here, step)
        });
        joined[row][column] = Some(is_joined);
        is_joined.then(|| here.wrapping_add_signed((step[1] * self.size[0] as i32 + step[0]) as isize))
    }

    /// Whether pixel `here` and the pixel at `step` from it see the same surface.
    fn see_same(&self, points: &[Option<GatherPoint>], here: usize, step: [i32; 2]) -> bool {
        let at = [here % self.size[0] as usize, here / self.size[0] as usize];
        let [x, y] = [0, 1].map(|axis| at[axis] as i64 + i64::from(step[axis]));
        if !(0..i64::from(self.size[0])).contains(&x) || !(0..i64::from(self.size[1])).contains(&y) {
            return false;
        }
        let there = (y * i64::from(self.size[0]) + x) as usize;
        points[here].as_ref().zip(points[there].as_ref()).is_some_and(|(a, b)| same_surface(a, b))
    }

    fn pixels(&self) -> impl Iterator<Item = [u32; 2]> {
        let [width, height] = self.size;
        (0..height).flat_map(move |y| (0..width).map(move |x| [x, y]))
    }
}

/// Whether two points lie on one surface that is flat enough between them to share irradiance.
fn same_surface(a: &GatherPoint, b: &GatherPoint) -> bool {
    let way = b.position - a.position;
    let step = a.surface_normal.dot(way).abs().max(b.surface_normal.dot(way).abs());
    a.normal.dot(b.normal) > (1.0 - FLAT * FLAT).sqrt() && step < FLAT * way.length()
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::list::octahedral_encode;
    use super::*;

    const SIZE: [u32; 2] = [7, 5];

    /// A floor with a wall that rises from column `wall` on.
    fn corner(wall: u32) -> GBuffer {
        let pixels = || (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y)));
        let position = |(x, y): (u32, u32)| Vec3::new(x.min(wall) as f32, x.saturating_sub(wall) as f32, y as f32);
        let normal = |(x, _): (u32, u32)| if x < wall { Vec3::Y } else { Vec3::NEG_X };
        GBuffer {
            position: pixels().map(|pixel| position(pixel).extend(octahedral_encode(normal(pixel)).x)).collect(),
            normal: pixels().map(|pixel| normal(pixel).extend(octahedral_encode(normal(pixel)).y)).collect(),
            albedo: Vec::new(),
            emission: Vec::new(),
            gloss: Vec::new(),
            count: SIZE[0] * SIZE[1],
            cut: 0,
        }
    }

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
    fn shared_sums_are_those_of_all_directions_and_stay_on_their_surface() {
        // Each pixel found 1 per direction on the floor and 5 on the wall. Subsets took different numbers of directions.
        let (stride, taken, wall) = (2, [1, 2, 3, 4], 3);
        let interleave = Interleave::new(stride, SIZE, 0);
        let radiance = |pixel: usize| if pixel as u32 % SIZE[0] < wall { 1.0 } else { 5.0 };
        let one = |pixel: usize| Vec3::splat(radiance(pixel)).extend(1.0);
        let found = |pixel: usize| one(pixel) * taken[interleave.subset_of(pixel).index()] as f32;
        let sums: Vec<_> = (0..(SIZE[0] * SIZE[1]) as usize).map(found).collect();
        for (pixel, sum) in interleave.share(sums, &taken, &corner(wall)).iter().enumerate() {
            // All ten directions of the block, up to rounding.
            assert!((*sum - 10.0 * one(pixel)).abs().max_element() < 1e-4, "{pixel}: {sum}");
        }
    }

    #[test]
    fn a_mean_stays_that_of_its_pixel_where_light_changes_steadily() {
        // Light grows along x. At the foot of the wall and at the borders, no window lies about its pixel, but a line along the edge does.
        let (interleave, wall) = (Interleave::new(2, SIZE, 0), 3);
        let column = |pixel: usize| pixel as u32 % SIZE[0];
        let sums: Vec<_> = (0..(SIZE[0] * SIZE[1]) as usize).map(|pixel| Vec4::splat(column(pixel) as f32)).collect();
        let shared = interleave.share(sums, &[1; 4], &corner(wall));
        for pixel in (0..shared.len()).filter(|pixel| (1..SIZE[1] - 1).contains(&(*pixel as u32 / SIZE[0]))) {
            assert_eq!(shared[pixel], Vec4::splat(4.0 * column(pixel) as f32), "{pixel}");
        }
    }

    /// Whole windows are a short cut: they add up what [`Interleave::shared`] does.
    #[test]
    fn whole_windows_have_the_sums_of_their_pixels() {
        const SIDES: [u32; 2] = [24, 20];
        let mut random = crate::random::Random::new(7, 0);
        for (bend, least) in [(0.0, 300), (0.02, 100)] {
            let point = |pixel: u32| {
                let [x, y] = [(pixel % SIDES[0]) as f32, (pixel / SIDES[0]) as f32];
                // A wall beyond column 17, and a floor that bends more and more.
                let slope = bend * x;
                let floor = GatherPoint::flat(Vec3::new(x, 0.5 * slope * x, y), Vec3::new(-slope, 1.0, 0.0).normalize());
                Some(if x > 17.0 { GatherPoint::flat(Vec3::new(17.0, x - 17.0, y), Vec3::NEG_X) } else { floor })
            };
            let points: Vec<_> = (0..SIDES[0] * SIDES[1]).map(point).collect();
            for stride in [2, 4] {
                let interleave = Interleave::new(stride, SIDES, 0);
                let taken: Vec<u32> = (0..stride * stride).map(|subset| 3 + subset % 4).collect();
                let sums: Vec<Vec4> = points.iter().map(|_| Vec4::from([0; 4].map(|_: u32| random.uniform()))).collect();
                let of = |pixel: usize| (sums[pixel], taken[interleave.subset_of(pixel).index()] as f32);
                let (runs, all) = (interleave.runs(&points), taken.iter().sum::<u32>() as f32);
                let mut whole = 0;
                for here in 0..points.len() {
                    let Some(found) = interleave.whole_window(&points, &runs, here, &sums) else { continue };
                    let (total, directions) = interleave.shared(&points, here, &of);
                    assert_eq!(directions, all, "pixel {here} of {stride}");
                    assert!((found - total).abs().max_element() < 1e-5, "pixel {here} of {stride}: {found} for {total}");
                    whole += 1;
                }
                assert!(whole > least / stride as usize, "{whole} whole windows of {stride}");
            }
        }
    }

    #[test]
    fn a_pixel_without_pairs_takes_single_neighbours() {
        // The corners of the picture. Only one subset found something.
        let interleave = Interleave::new(2, SIZE, 0);
        let found = |pixel: usize| Vec4::splat(if interleave.subset_of(pixel).index() == 3 { 8.0 } else { 0.0 });
        let sums: Vec<_> = (0..(SIZE[0] * SIZE[1]) as usize).map(found).collect();
        let shared = interleave.share(sums, &[2; 4], &corner(SIZE[0]));
        // The weights of the pixel, its two neighbours and the one between are 1, 1/2, 1/2 and 1/4.
        assert_eq!(shared[0], Vec4::splat(8.0 * 4.0 * 0.25 / 2.25));
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

    #[test]
    fn a_pixel_far_from_edges_weighs_all_subsets_alike() {
        // Only one subset found something, so each pixel has a quarter of it.
        let interleave = Interleave::new(2, SIZE, 0);
        let found = |pixel: usize| Vec4::splat(if interleave.subset_of(pixel).index() == 2 { 8.0 } else { 0.0 });
        let sums: Vec<_> = (0..(SIZE[0] * SIZE[1]) as usize).map(found).collect();
        let shared = interleave.share(sums, &[2; 4], &corner(SIZE[0]));
        for y in 1..SIZE[1] - 1 {
            for x in 1..SIZE[0] - 1 {
                assert_eq!(shared[(y * SIZE[0] + x) as usize], Vec4::splat(8.0), "{x} {y}");
            }
        }
    }
}
