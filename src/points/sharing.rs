//! Pixels that look along different directions of a block share their sums with their neighbours on the same surface: see [`Interleave`].
//!
//! A pixel takes the sums of a window around it. A neighbour counts only together with the one opposite. So where light changes steadily, as beside an
//! edge, the mean stays that of the pixel. At an edge, those along it are left. Where they are too few, the window grows, and takes in single neighbours
//! only as a last resort.
//!
//! Sixteen pixels of a row go through all this together, in plain loops that `pulp` compiles for the vectors of the processor. Planes have a margin, which
//! sees no surface, so no loop asks for the picture's borders.

use glam::Vec4;
use rayon::prelude::*;

use super::{GBuffer, GatherPoint, Interleave};
use crate::scene::{LANES, Lanes};

/// Least sum of the weights of a window's pixels, as a share of a square's: with less, too much noise is left, and the window grows.
const ENOUGH: f32 = 0.75;
/// Farthest that a window grows, in pixels.
const FARTHEST: usize = 8;
/// Pixels along a side of the largest window.
const WINDOW: usize = 2 * FARTHEST + 1;
/// Pixels share sums only if the surface between them bends and steps less than this, as the sine of an angle.
const FLAT: f32 = 0.2;

/// The surfaces that the pixels of a picture see.
pub struct Sharing<'a> {
    interleave: &'a Interleave,
    size: [usize; 2],
    /// Of a point: position, normal and geometric normal. Zero where there is no point. Empty if pixels share nothing.
    surfaces: [Plane; 9],
}

/// A number of each pixel, row by row from the bottom, with margins.
type Plane = Vec<f32>;

/// For each step from a pixel, by row and column of the largest window: 1 if it leads to the same surface, else 0.
type Joined = [[Lanes; WINDOW]; WINDOW];

impl<'a> Sharing<'a> {
    pub fn new(interleave: &'a Interleave, g_buffer: &GBuffer) -> Self {
        let (size, stride) = interleave.squares();
        let size = size.map(|side| side as usize);
        if stride == 1 {
            return Self { interleave, size, surfaces: Default::default() };
        }
        let points = g_buffer.pixels();
        let part = |point: &Option<GatherPoint>, number: usize| {
            point.map_or(0.0, |point| [point.position, point.normal, point.surface_normal][number / 3][number % 3])
        };
        let surfaces = std::array::from_fn(|number| plane(size, |pixel| part(&points[pixel], number)));
        Self { interleave, size, surfaces }
    }

    /// Bytes that so many pixels take, with what they share.
    pub fn bytes(pixels: usize) -> usize {
        pixels * (size_of::<Option<GatherPoint>>() + (9 + 5) * size_of::<f32>())
    }

    /// Estimates the sums of each pixel over all directions of a block. Subset i gathered along `taken[i]` of them. The estimate adds the sums
    /// of the pixel and of its neighbours on the same surface, and scales them to all directions.
    pub fn share(&self, sums: Vec<Vec4>, taken: &[u32]) -> Vec<Vec4> {
        if self.interleave.subsets() == 1 {
            return sums;
        }
        let taken_of = |pixel: usize| taken[self.interleave.subset_of(pixel).index()] as f32;
        let planes = SharedSums {
            sums: std::array::from_fn(|part| plane(self.size, |pixel| sums[pixel][part])),
            taken: plane(self.size, taken_of),
            all: taken.iter().sum::<u32>() as f32,
        };
        let mut shared = sums;
        let row =
            |(y, row): (usize, &mut [Vec4])| pulp::Arch::new().dispatch(SharedRow { sharing: self, planes: &planes, y, row });
        shared.par_chunks_mut(self.size[0]).enumerate().for_each(row);
        shared
    }

    /// Pixels from the start of a row of a plane to the start of the next.
    fn pitch(&self) -> usize {
        pitch(self.size)
    }

    /// Three numbers of 16 pixels.
    #[inline(always)]
    fn vectors(&self, first: usize, at: usize) -> [&Lanes; 3] {
        let [a, b, c] = [first, first + 1, first + 2];
        [lanes(&self.surfaces[a], at), lanes(&self.surfaces[b], at), lanes(&self.surfaces[c], at)]
    }

    /// Multiplies `joined` by 1 where the surface at some pixels of a plane is that at others, else by 0. Surfaces are the same if they are so flat that they
    /// can share irradiance.
    #[inline(always)]
    fn join(&self, here: usize, there: usize, joined: &mut Lanes) {
        let [from, to] = [self.vectors(0, here), self.vectors(0, there)];
        let normals = [self.vectors(3, here), self.vectors(3, there)];
        let surfaces = [self.vectors(6, here), self.vectors(6, there)];
        let least = (1.0 - FLAT * FLAT).sqrt();
        for (lane, joined) in joined.iter_mut().enumerate() {
            let (x, y, z) = (to[0][lane] - from[0][lane], to[1][lane] - from[1][lane], to[2][lane] - from[2][lane]);
            let [a, b] = surfaces;
            let first = (a[0][lane] * x + a[1][lane] * y + a[2][lane] * z).abs();
            let second = (b[0][lane] * x + b[1][lane] * y + b[2][lane] * z).abs();
            let step = if first > second { first } else { second };
            let [a, b] = normals;
            let cosine = a[0][lane] * b[0][lane] + a[1][lane] * b[1][lane] + a[2][lane] * b[2][lane];
            let is_same = (cosine > least) & (step < FLAT * (x * x + y * y + z * z).sqrt());
            *joined *= if is_same { 1.0 } else { 0.0 };
        }
    }
}

fn pitch([width, _]: [usize; 2]) -> usize {
    // The last lanes of a row may lie beyond it, and their windows too.
    width + LANES + 2 * FARTHEST
}

fn plane(size: [usize; 2], value: impl Fn(usize) -> f32 + Sync) -> Plane {
    let (pitch, [width, height]) = (pitch(size), size);
    let mut plane = vec![0.0; pitch * (height + 2 * FARTHEST)];
    let rows = plane[FARTHEST * pitch..].par_chunks_mut(pitch).take(height).enumerate();
    rows.for_each(|(y, row)| (0..width).for_each(|x| row[FARTHEST + x] = value(y * width + x)));
    plane
}

#[inline(always)]
fn lanes(plane: &[f32], at: usize) -> &Lanes {
    plane[at..].first_chunk().expect("planes have a margin")
}

/// What pixels have to share.
struct SharedSums {
    sums: [Plane; 4],
    /// Directions that a pixel took.
    taken: Plane,
    /// Directions of all subsets.
    all: f32,
}

/// The work on one row of pixels.
struct SharedRow<'a> {
    sharing: &'a Sharing<'a>,
    planes: &'a SharedSums,
    y: usize,
    row: &'a mut [Vec4],
}

impl pulp::NullaryFnOnce for SharedRow<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { sharing, planes, y, row } = self;
        let start = (y + FARTHEST) * sharing.pitch() + FARTHEST;
        let mut joined = [[[0.0; LANES]; WINDOW]; WINDOW];
        for (group, pixels) in row.chunks_mut(LANES).enumerate() {
            share_lanes(sharing, planes, start + group * LANES, &mut joined, pixels);
        }
    }
}

/// Writes the estimates of at most 16 pixels, from place `here` of the planes on.
#[inline(always)]
fn share_lanes(sharing: &Sharing, planes: &SharedSums, here: usize, joined: &mut Joined, pixels: &mut [Vec4]) {
    let (pitch, stride) = (sharing.pitch(), sharing.interleave.squares().1 as usize);
    let enough = ENOUGH * (stride * stride) as f32;
    let (normal, own) = (sharing.vectors(3, here), lanes(&planes.taken, here));
    let mut left = 0u32;
    for (lane, pixel) in pixels.iter_mut().enumerate() {
        if (normal[0][lane] != 0.0) | (normal[1][lane] != 0.0) | (normal[2][lane] != 0.0) {
            left |= 1 << lane;
        } else if own[lane] > 0.0 {
            // Without a point there is nothing to share.
            *pixel *= planes.all / own[lane];
        }
    }
    let (mut reach, mut pairs, mut known) = (stride / 2, true, 0);
    while left != 0 {
        for ring in known + 1..=reach {
            join_ring(sharing, here, ring, joined);
        }
        known = known.max(reach);
        // Names, and no array: they stay in the registers of the processor.
        let [reds, greens, blues, alphas] = &planes.sums;
        let (mut red, mut green, mut blue) = (*lanes(reds, here), *lanes(greens, here), *lanes(blues, here));
        let (mut alpha, mut directions, mut weights) = (*lanes(alphas, here), *own, [1.0; LANES]);
        // One of each pair of opposite steps.
        for dy in 0..=reach {
            for column in if dy == 0 { FARTHEST + 1 } else { FARTHEST - reach }..=FARTHEST + reach {
                let (one, other) = (&joined[FARTHEST + dy][column], &joined[FARTHEST - dy][2 * FARTHEST - column]);
                // The two ends of the window belong to the same subset, so each counts half.
                let half = |d: usize| if d == reach { 0.5 } else { 1.0 };
                let weight = half(dy) * half(column.abs_diff(FARTHEST));
                let step = dy * pitch + column;
                for (counts, opposite, at) in [(one, other, here + step - FARTHEST), (other, one, here + FARTHEST - step)] {
                    let mut lane_weights = [0.0; LANES];
                    for lane in 0..LANES {
                        let counts = if pairs { counts[lane] * opposite[lane] } else { counts[lane] };
                        lane_weights[lane] = weight * counts;
                        weights[lane] += lane_weights[lane];
                    }
                    add(&mut red, &lane_weights, reds, at);
                    add(&mut green, &lane_weights, greens, at);
                    add(&mut blue, &lane_weights, blues, at);
                    add(&mut alpha, &lane_weights, alphas, at);
                    add(&mut directions, &lane_weights, &planes.taken, at);
                }
            }
        }
        for (lane, pixel) in pixels.iter_mut().enumerate() {
            if left >> lane & 1 == 1 && (weights[lane] >= enough || !pairs) {
                left &= !(1 << lane);
                let sum = Vec4::new(red[lane], green[lane], blue[lane], alpha[lane]);
                *pixel = if directions[lane] > 0.0 { sum * (planes.all / directions[lane]) } else { Vec4::ZERO };
            }
        }
        (reach, pairs) = if reach < FARTHEST { (2 * reach, true) } else { (stride / 2, false) };
    }
}

/// Adds 16 weighted numbers of a plane.
#[inline(always)]
fn add(sums: &mut Lanes, weights: &Lanes, plane: &[f32], at: usize) {
    let values = lanes(plane, at);
    for lane in 0..LANES {
        sums[lane] += weights[lane] * values[lane];
    }
}

/// Tells which steps of a ring around some pixels lead to the same surface: those that do so half way, too.
#[inline(always)]
fn join_ring(sharing: &Sharing, here: usize, ring: usize, joined: &mut Joined) {
    for row in FARTHEST - ring..=FARTHEST + ring {
        let on_side = row.abs_diff(FARTHEST) == ring;
        for column in (FARTHEST - ring..=FARTHEST + ring).step_by(if on_side { 1 } else { 2 * ring }) {
            let half = [half_way(row), half_way(column)];
            let mut there = if half == [FARTHEST; 2] { [1.0; LANES] } else { joined[half[0]][half[1]] };
            // A sum of zeros: none leads there half way.
            if there.iter().sum::<f32>() > 0.0 {
                sharing.join(here, here + row * sharing.pitch() + column - FARTHEST * (sharing.pitch() + 1), &mut there);
            }
            joined[row][column] = there;
        }
    }
}

/// Half of the step to a row or column of the largest window, rounded towards the pixel.
#[inline(always)]
fn half_way(at: usize) -> usize {
    let half = at.abs_diff(FARTHEST) / 2;
    if at < FARTHEST { FARTHEST - half } else { FARTHEST + half }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::list::octahedral_encode;
    use super::*;
    use crate::random::Random;

    const SIZE: [u32; 2] = [7, 5];

    /// A picture of these points.
    fn buffer_of(size: [u32; 2], point: impl Fn(u32) -> Option<GatherPoint>) -> GBuffer {
        let texels = (0..size[0] * size[1]).map(|pixel| {
            point(pixel).map_or_else(Default::default, |point| {
                let code = octahedral_encode(point.surface_normal);
                (point.position.extend(code.x), point.normal.extend(code.y))
            })
        });
        let (position, normal): (Vec<Vec4>, Vec<Vec4>) = texels.unzip();
        let count = size[0] * size[1];
        GBuffer { position, normal, albedo: Vec::new(), emission: Vec::new(), gloss: Vec::new(), count, cut: 0 }
    }

    /// A floor with a wall that rises from column `wall` on.
    fn corner(wall: u32) -> GBuffer {
        let position = |(x, y): (u32, u32)| Vec3::new(x.min(wall) as f32, x.saturating_sub(wall) as f32, y as f32);
        let normal = |(x, _): (u32, u32)| if x < wall { Vec3::Y } else { Vec3::NEG_X };
        buffer_of(SIZE, |pixel| {
            let pixel = (pixel % SIZE[0], pixel / SIZE[0]);
            Some(GatherPoint::flat(position(pixel), normal(pixel)))
        })
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
        for (pixel, sum) in Sharing::new(&interleave, &corner(wall)).share(sums, &taken).iter().enumerate() {
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
        let shared = Sharing::new(&interleave, &corner(wall)).share(sums, &[1; 4]);
        for pixel in (0..shared.len()).filter(|pixel| (1..SIZE[1] - 1).contains(&(*pixel as u32 / SIZE[0]))) {
            assert_eq!(shared[pixel], Vec4::splat(4.0 * column(pixel) as f32), "{pixel}");
        }
    }

    #[test]
    fn a_pixel_without_pairs_takes_single_neighbours() {
        // The corners of the picture. Only one subset found something.
        let interleave = Interleave::new(2, SIZE, 0);
        let found = |pixel: usize| Vec4::splat(if interleave.subset_of(pixel).index() == 3 { 8.0 } else { 0.0 });
        let sums: Vec<_> = (0..(SIZE[0] * SIZE[1]) as usize).map(found).collect();
        let shared = Sharing::new(&interleave, &corner(SIZE[0])).share(sums, &[2; 4]);
        // The weights of the pixel, its two neighbours and the one between are 1, 1/2, 1/2 and 1/4.
        assert_eq!(shared[0], Vec4::splat(8.0 * 4.0 * 0.25 / 2.25));
    }

    #[test]
    fn a_pixel_far_from_edges_weighs_all_subsets_alike() {
        // Only one subset found something, so each pixel has a quarter of it.
        let interleave = Interleave::new(2, SIZE, 0);
        let found = |pixel: usize| Vec4::splat(if interleave.subset_of(pixel).index() == 2 { 8.0 } else { 0.0 });
        let sums: Vec<_> = (0..(SIZE[0] * SIZE[1]) as usize).map(found).collect();
        let shared = Sharing::new(&interleave, &corner(SIZE[0])).share(sums, &[2; 4]);
        for y in 1..SIZE[1] - 1 {
            for x in 1..SIZE[0] - 1 {
                assert_eq!(shared[(y * SIZE[0] + x) as usize], Vec4::splat(8.0), "{x} {y}");
            }
        }
    }

    /// The rules for one pixel, without vectors: its window's sum, and the directions of the window.
    struct Window<'a> {
        size: [i32; 2],
        stride: i32,
        points: &'a [Option<GatherPoint>],
    }

    impl Window<'_> {
        fn sum(&self, here: i32, of: impl Fn(i32) -> (Vec4, f32)) -> (Vec4, f32) {
            if self.points[here as usize].is_none() {
                return of(here);
            }
            let farthest = FARTHEST as i32;
            let mut tries =
                std::iter::successors(Some(self.stride / 2), |reach| Some(2 * reach)).take_while(|&reach| reach <= farthest);
            loop {
                let (reach, pairs) = tries.next().map_or((self.stride / 2, false), |reach| (reach, true));
                let ((mut total, mut directions), mut weights) = (of(here), 1.0);
                for dy in 0..=reach {
                    for dx in if dy == 0 { 1 } else { -reach }..=reach {
                        let [one, other] = [1, -1].map(|side| self.neighbour(here, [side * dx, side * dy]));
                        if pairs && (one.is_none() || other.is_none()) {
                            continue;
                        }
                        let weight = [dx, dy].map(|d| if d.abs() == reach { 0.5 } else { 1.0 }).iter().product::<f32>();
                        for (sums, taken) in [one, other].into_iter().flatten().map(&of) {
                            (total, directions, weights) = (total + weight * sums, directions + weight * taken, weights + weight);
                        }
                    }
                }
                if weights >= ENOUGH * (self.stride * self.stride) as f32 || !pairs {
                    return (total, directions);
                }
            }
        }

        fn neighbour(&self, here: i32, step: [i32; 2]) -> Option<i32> {
            let [x, y] = [here % self.size[0] + step[0], here / self.size[0] + step[1]];
            let half = step.map(|d| d / 2);
            let half_way = half == [0, 0] || self.neighbour(here, half).is_some();
            let there = y * self.size[0] + x;
            let is_inside = (0..self.size[0]).contains(&x) && (0..self.size[1]).contains(&y);
            let [a, b] = [here, if is_inside { there } else { here }].map(|pixel| self.points[pixel as usize]);
            let is_same = a.zip(b).is_some_and(|(a, b)| {
                let way = b.position - a.position;
                let step = a.surface_normal.dot(way).abs().max(b.surface_normal.dot(way).abs());
                a.normal.dot(b.normal) > (1.0 - FLAT * FLAT).sqrt() && step < FLAT * way.length()
            });
            (half_way && is_inside && is_same).then_some(there)
        }
    }

    /// A floor that bends more and more, with bumps, a wall, and pixels that see nothing.
    #[test]
    fn vectors_follow_the_rules_for_one_pixel() {
        const SIDES: [u32; 2] = [45, 37];
        let mut random = Random::new(7, 0);
        let (mut widest, mut narrow) = (0, 0);
        for (bend, bumps) in [(0.0, 0.0), (0.02, 0.0), (0.01, 0.3), (0.02, 0.6)] {
            let mut uneven = || Vec3::from([0; 3].map(|_: u32| bumps * (random.uniform() - 0.5)));
            let mut point = |pixel: u32| {
                let [x, y] = [(pixel % SIDES[0]) as f32, (pixel / SIDES[0]) as f32];
                let slope = bend * x;
                let normal = (Vec3::new(-slope, 1.0, 0.0).normalize() + uneven()).normalize();
                let floor = GatherPoint::flat(Vec3::new(x, 0.5 * slope * x, y), normal);
                let wall = GatherPoint::flat(Vec3::new(27.0, x - 27.0, y), Vec3::NEG_X);
                (pixel % 11 != 3).then_some(if x > 27.0 { wall } else { floor })
            };
            let points: Vec<_> = (0..SIDES[0] * SIDES[1]).map(&mut point).collect();
            let buffer = buffer_of(SIDES, |pixel| points[pixel as usize]);
            let points = buffer.pixels();
            for stride in [2, 4] {
                let interleave = Interleave::new(stride, SIDES, 0);
                let taken: Vec<u32> = (0..stride * stride).map(|subset| 3 + subset % 4).collect();
                let sums: Vec<Vec4> = points.iter().map(|_| Vec4::from([0; 4].map(|_: u32| random.uniform()))).collect();
                let of = |pixel: i32| (sums[pixel as usize], taken[interleave.subset_of(pixel as usize).index()] as f32);
                let all = taken.iter().sum::<u32>() as f32;
                let window = Window { size: SIDES.map(|side| side as i32), stride: stride as i32, points: &points };
                let shared = Sharing::new(&interleave, &buffer).share(sums.clone(), &taken);
                for (pixel, shared) in (0..).zip(&shared) {
                    let (total, directions) = window.sum(pixel, of);
                    assert_eq!(
                        *shared,
                        total * (all / directions),
                        "pixel {pixel}, squares of {stride}, bend {bend}, bumps {bumps}"
                    );
                    widest += i32::from(directions > 2.0 * all);
                    narrow += i32::from(directions < 0.5 * all);
                }
            }
        }
        assert!(widest > 100 && narrow > 100, "{widest} windows have grown, {narrow} are small");
    }
}
