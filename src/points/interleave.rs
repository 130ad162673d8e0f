//! Interleaved subsets: of each square of neighbouring pixels, every direction is gathered by one pixel only, and what the pixels of a
//! surface found is then shared among them (after Keller and Heidrich 2001, "Interleaved sampling").
//!
//! All points share the directions of a bundle, so that at low counts their error is not noise but bands. With squares of k × k pixels, k²
//! times as many directions cost the same passes over points, and the bands of one pixel's directions are no longer its neighbour's.

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::Visible;
use crate::random::Random;

/// Surfaces that bend or step more than this between two pixels, as the sine of an angle, share nothing.
const FLAT: f32 = 0.2;

/// The points at `offset`, and every `stride`-th from there along both axes of the textures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Subset {
    pub stride: u32,
    pub offset: [u32; 2],
}

impl Subset {
    pub const ALL: Self = Self { stride: 1, offset: [0, 0] };

    /// Width and height of the part of [`super::Sums`] that holds this subset, for points of this size; the same for all offsets.
    pub fn size(self, points: [u32; 2]) -> [u32; 2] {
        points.map(|side| side.div_ceil(self.stride))
    }

    /// Its number among those of the same stride.
    pub fn index(self) -> usize {
        (self.offset[1] * self.stride + self.offset[0]) as usize
    }
}

/// Shares directions out to the pixels of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Interleave {
    stride: u32,
    size: [u32; 2],
    seed: u64,
}

impl Interleave {
    /// For pictures of `size` pixels, in squares with a side of `stride`.
    pub fn new(stride: u32, size: [u32; 2], seed: u64) -> Self {
        Self { stride, size, seed }
    }

    /// Number of subsets.
    pub fn subsets(&self) -> usize {
        (self.stride * self.stride) as usize
    }

    /// Which points gather along direction `index` of `block`. Consecutive directions go to different subsets, and the first of a block
    /// to any, so that the directions of one pixel are as well spread as all.
    pub fn subset(&self, index: u32, block: u32) -> Subset {
        let turn = Random::new(self.seed ^ 0x1e4f, block.into()).bits() as u32;
        let number = index.wrapping_add(turn) % (self.stride * self.stride);
        Subset { stride: self.stride, offset: [number % self.stride, number / self.stride] }
    }

    /// The subset that a pixel belongs to, counted row by row.
    pub fn subset_of(&self, pixel: usize) -> Subset {
        let [x, y] = [pixel as u32 % self.size[0], pixel as u32 / self.size[0]];
        Subset { stride: self.stride, offset: [x % self.stride, y % self.stride] }
    }

    /// Size of the sums of all subsets, one tile each.
    pub fn sums_size(&self) -> [u32; 2] {
        Subset { stride: self.stride, offset: [0, 0] }.size(self.size).map(|side| side * self.stride)
    }

    /// Sums as the GL side holds them, subset by subset, in the order of pixels.
    pub fn in_order(&self, tiles: Vec<Vec4>) -> Vec<Vec4> {
        if self.stride == 1 {
            return tiles;
        }
        let tile = Subset { stride: self.stride, offset: [0, 0] }.size(self.size);
        let width = self.sums_size()[0];
        let place = |[x, y]: [u32; 2]| {
            let [tx, ty] = [(x, tile[0]), (y, tile[1])].map(|(at, side)| at % self.stride * side + at / self.stride);
            tiles[(ty * width + tx) as usize]
        };
        self.pixels().map(place).collect()
    }

    /// The sums that each pixel would have if it had gathered along all directions of a block, of which subset i took `taken[i]`: its own
    /// and those of neighbours on the same surface, of every subset as many, scaled to the whole count.
    pub fn share(&self, sums: Vec<Vec4>, taken: &[u32], visible: &Visible) -> Vec<Vec4> {
        if self.stride == 1 {
            return sums;
        }
        let all = taken.iter().sum::<u32>() as f32;
        let reach = self.stride as i32 / 2;
        let share = |here: usize| {
            let (mut total, mut directions) = (Vec4::ZERO, 0.0);
            for dy in -reach..=reach {
                for dx in -reach..=reach {
                    let Some(there) = self.neighbour(visible, here, [dx, dy]) else { continue };
                    // Both ends of a window of odd side see the same subset: each counts half.
                    let weight = [dx, dy].map(|d| if d.abs() == reach { 0.5 } else { 1.0 }).iter().product::<f32>();
                    total += weight * sums[there];
                    directions += weight * taken[self.subset_of(there).index()] as f32;
                }
            }
            if directions > 0.0 { total * (all / directions) } else { Vec4::ZERO }
        };
        (0..sums.len()).into_par_iter().map(share).collect()
    }

    /// The pixel a step away from pixel `here`, if it sees the same surface.
    fn neighbour(&self, visible: &Visible, here: usize, step: [i32; 2]) -> Option<usize> {
        let [width, height] = self.size.map(|side| side as usize);
        let x = (here % width).checked_add_signed(step[0] as isize).filter(|&x| x < width)?;
        let y = (here / width).checked_add_signed(step[1] as isize).filter(|&y| y < height)?;
        Some(y * width + x).filter(|&there| same_surface(visible, here, there))
    }

    fn pixels(&self) -> impl Iterator<Item = [u32; 2]> {
        let [width, height] = self.size;
        (0..height).flat_map(move |y| (0..width).map(move |x| [x, y]))
    }
}

/// Whether two pixels see one surface, flat enough for the irradiance of one to be that of the other.
fn same_surface(visible: &Visible, a: usize, b: usize) -> bool {
    let [na, nb] = [a, b].map(|pixel| visible.normal[pixel].truncate());
    if a == b || na == Vec3::ZERO || nb == Vec3::ZERO {
        return a == b;
    }
    let way = (visible.position[b] - visible.position[a]).truncate();
    let step = na.dot(way).abs().max(nb.dot(way).abs());
    na.dot(nb) > (1.0 - FLAT * FLAT).sqrt() && step < FLAT * way.length()
}
