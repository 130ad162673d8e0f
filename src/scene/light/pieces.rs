//! Divides triangles with a picture of emission into pieces, so that samples go where the picture is bright.
//!
//! A piece has a weight near its mean radiance. It need not be exact: a sample is the radiance at its point over its density, so the mean of samples is
//! right for any weights that are positive wherever the picture shines.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use glam::{Vec2, Vec3, vec2};

use super::super::{ImageTexture, Scene, WrapMode};

/// Most pieces that divisions add, over all triangles.
const MOST: usize = 8192;
/// Most cells of a picture's table along an axis.
const CELLS: usize = 512;
/// A piece of fewer texels is not divided.
const SMALLEST: f32 = 0.5;
/// Of a piece of at most so many texels the radiance is looked up at points.
const SMALL: f32 = 2.0;
/// Sides of the parts of a small piece at whose middles it is looked up.
const PARTS: u32 = 4;
/// The share of the surrounding cells in the weight of a small piece. Its points may miss the edge of a lit texel.
const AROUND: f64 = 0.1;
/// Pieces whose radiance differs by less than this share of the whole power are even enough.
const EVEN: f64 = 1e-6;

/// A part of a triangle.
pub struct Piece {
    /// Index into [`super::super::Mesh::triangles`].
    pub triangle: usize,
    /// Barycentric coordinates of its corners in the triangle.
    pub corners: [Vec3; 3],
    /// Estimate of the mean radiance, sum of the channels. Positive.
    pub radiance: f64,
    /// Its share of the triangle's area.
    pub share: f32,
}

/// A piece that may be divided.
struct Open {
    piece: Piece,
    uvs: [Vec2; 3],
    /// Index into the tables.
    table: usize,
    /// The quarters that lead to it, from the triangle: two bits each, the first in the upper bits.
    path: u64,
    depth: u32,
    /// Standard deviation of the radiance times the area: the noise that it leaves.
    error: f64,
    area: f64,
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        let order = |open: &Self| (open.piece.triangle, open.path);
        self.error.total_cmp(&other.error).then_with(|| order(self).cmp(&order(other)))
    }
}

/// The pieces of these triangles, whose materials have pictures of emission, in the order of the triangles. Pieces that are black are left out.
pub fn pieces(scene: &Scene, triangles: &[usize]) -> Vec<Piece> {
    let mut tables: Vec<(u32, Table)> = Vec::new();
    let mut heap = BinaryHeap::new();
    for &triangle in triangles {
        let material = scene.mesh.triangles[triangle].material;
        let table = tables.iter().position(|(of, _)| *of == material).unwrap_or_else(|| {
            tables.push((material, Table::new(scene, triangle)));
            tables.len() - 1
        });
        let whole = Piece { triangle, corners: [Vec3::X, Vec3::Y, Vec3::Z], radiance: 0.0, share: 1.0 };
        let (uvs, area) = (scene.mesh.uvs_of(triangle), f64::from(scene.mesh.area(triangle)));
        heap.push(measured(&tables[table].1, Open { piece: whole, uvs, table, path: 0, depth: 0, error: 0.0, area }));
    }
    let power: f64 = heap.iter().map(|open| open.piece.radiance * open.area).sum();
    let most = heap.len() + MOST;
    while heap.len() + 3 <= most && heap.peek().is_some_and(|open| open.error > EVEN * power) {
        let open = heap.pop().expect("it has a greatest");
        let [a, b, c] = open.piece.corners;
        let [d, e, f] = [(b, c), (c, a), (a, b)].map(|(p, q)| p.midpoint(q));
        let [ua, ub, uc] = open.uvs;
        let [ud, ue, uf] = [(ub, uc), (uc, ua), (ua, ub)].map(|(p, q)| p.midpoint(q));
        let quarters =
            [([a, f, e], [ua, uf, ue]), ([f, b, d], [uf, ub, ud]), ([d, e, f], [ud, ue, uf]), ([e, d, c], [ue, ud, uc])];
        for (quarter, (corners, uvs)) in (0u64..).zip(quarters) {
            let depth = open.depth + 1;
            let part = Open {
                piece: Piece { triangle: open.piece.triangle, corners, radiance: 0.0, share: 0.25 * open.piece.share },
                uvs,
                table: open.table,
                path: open.path | quarter << (62 - 2 * open.depth),
                depth,
                error: 0.0,
                area: 0.25 * open.area,
            };
            heap.push(measured(&tables[open.table].1, part));
        }
    }
    let mut pieces = heap.into_vec();
    pieces.retain(|open| open.piece.radiance > 0.0);
    // Neighbours on the triangle are neighbours in the list, so that even numbers are even on the surface.
    pieces.sort_by_key(|open| (open.piece.triangle, open.path));
    pieces.into_iter().map(|open| open.piece).collect()
}

/// The piece with its radiance and error.
fn measured(table: &Table, open: Open) -> Open {
    let (radiance, spread, size) = table.radiance(open.uvs);
    let error = if size < SMALLEST || open.depth == 31 { 0.0 } else { spread * open.area };
    Open { piece: Piece { radiance, ..open.piece }, error, ..open }
}

/// The radiance of a material's picture, sum of the channels, in cells of one or more texels.
struct Table<'a> {
    texture: &'a ImageTexture,
    emission: Vec3,
    size: [usize; 2],
    /// Sums of the radiance and of its square over the cells above and to the left, (width + 1) × (height + 1).
    sums: Vec<[f64; 2]>,
}

impl<'a> Table<'a> {
    fn new(scene: &'a Scene, triangle: usize) -> Self {
        let material = scene.material(triangle);
        let texture = &scene.textures[material.emission_texture.expect("the material has a picture")];
        let [of_width, of_height] = [texture.width, texture.height].map(|side| side as usize);
        let size @ [width, height] = [of_width, of_height].map(|side| side.min(CELLS));
        let mut sums = vec![[0.0; 2]; (width + 1) * (height + 1)];
        for y in 0..height {
            let rows = y * of_height / height..(y + 1) * of_height / height;
            let mut row = [0.0; 2];
            for x in 0..width {
                let columns = x * of_width / width..(x + 1) * of_width / width;
                let count = (rows.len() * columns.len()) as f64;
                for (x, y) in rows.clone().flat_map(|y| columns.clone().map(move |x| (x, y))) {
                    let radiance = f64::from(texture.texel(x, y).dot(material.emission));
                    row = [row[0] + radiance / count, row[1] + radiance * radiance / count];
                }
                let above = sums[y * (width + 1) + x + 1];
                sums[(y + 1) * (width + 1) + x + 1] = [above[0] + row[0], above[1] + row[1]];
            }
        }
        Self { texture, emission: material.emission, size, sums }
    }

    /// Of a piece with these coordinates: mean and standard deviation of the radiance, and its extent in texels.
    fn radiance(&self, uvs: [Vec2; 3]) -> (f64, f64, f32) {
        let texels = vec2(self.texture.width as f32, self.texture.height as f32);
        let place = uvs.map(|uv| vec2(uv.x, 1.0 - uv.y));
        let (low, high) = (place[0].min(place[1]).min(place[2]), place[0].max(place[1]).max(place[2]));
        let extent = ((high - low) * texels).max_element();
        let around = self.of_box(low - 0.5 / texels, high + 0.5 / texels);
        if extent > SMALL {
            return (around[0], deviation(around), extent);
        }
        let [a, b, c] = uvs;
        let (mut sums, mut count) = ([0.0; 2], 0.0);
        for (i, j) in (0..PARTS).flat_map(|i| (0..PARTS - i).map(move |j| (i, j))) {
            // Of the parts, those that point up, and those that point down.
            for (shift, inside) in [(1.0 / 3.0, true), (2.0 / 3.0, i + j + 1 < PARTS)] {
                if inside {
                    let [u, v] = [i, j].map(|part| (part as f32 + shift) / PARTS as f32);
                    let color = self.texture.sample_linear(a + u * (b - a) + v * (c - a));
                    let radiance = f64::from(color.dot(self.emission));
                    (sums, count) = ([sums[0] + radiance, sums[1] + radiance * radiance], count + 1.0);
                }
            }
        }
        let at_points = sums.map(|sum| sum / count);
        ((1.0 - AROUND) * at_points[0] + AROUND * around[0], deviation(at_points), extent)
    }

    /// Means of the radiance and of its square over a box of coordinates, v down.
    fn of_box(&self, low: Vec2, high: Vec2) -> [f64; 2] {
        let [width, height] = self.size;
        let [along_u, along_v] = self.texture.sampler.wrap;
        let columns = ranges(along_u, [low.x, high.x], width);
        let rows = ranges(along_v, [low.y, high.y], height);
        let (mut sums, mut count) = ([0.0; 2], 0.0);
        for (row, column) in rows.iter().flat_map(|row| columns.iter().map(move |column| (row, column))) {
            let at = |x: usize, y: usize| self.sums[y * (width + 1) + x];
            let [a, b, c, d] = [at(column[1], row[1]), at(column[0], row[1]), at(column[1], row[0]), at(column[0], row[0])];
            (0..2).for_each(|k| sums[k] += a[k] - b[k] - c[k] + d[k]);
            count += ((column[1] - column[0]) * (row[1] - row[0])) as f64;
        }
        // Differences of sums have a small rest where all is black.
        let all = self.sums.last().copied().unwrap_or_default();
        [0, 1].map(|k| if sums[k] > 1e-12 * count * all[k] { sums[k] / count } else { 0.0 })
    }
}

fn deviation([mean, of_squares]: [f64; 2]) -> f64 {
    (of_squares - mean * mean).max(0.0).sqrt()
}

/// The cells, of `size` from 0 to 1, that an interval of coordinates meets, as one or two ranges with their ends excluded.
fn ranges(mode: WrapMode, [low, high]: [f32; 2], size: usize) -> Vec<[usize; 2]> {
    let inside = |cell: f32| cell.clamp(0.0, size as f32) as usize;
    let range = |low: f32, high: f32| {
        let first = inside((low * size as f32).floor()).min(size - 1);
        [first, inside((high * size as f32).ceil()).max(first + 1)]
    };
    let start = low - low.floor();
    match mode {
        WrapMode::Clamp => vec![range(low, high)],
        // NaN and what is out of range takes all.
        _ if high - low >= 1.0 || !(high - low).is_finite() => vec![[0, size]],
        WrapMode::Repeat if start + (high - low) <= 1.0 => vec![range(start, start + (high - low))],
        WrapMode::Repeat => vec![range(start, 1.0), range(0.0, start + (high - low) - 1.0)],
        WrapMode::Mirror => {
            let folded = |place: f32| 1.0 - (1.0 - place.rem_euclid(2.0)).abs();
            let (ends, turns) = ([folded(low), folded(high)], low.floor() != high.floor());
            // Between its ends an interval may turn at 0 or at 1.
            let [least, greatest] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
            match (turns, high.floor().rem_euclid(2.0) == 0.0) {
                (false, _) => vec![range(least, greatest)],
                (true, true) => vec![range(0.0, greatest)],
                (true, false) => vec![range(least, 1.0)],
            }
        }
    }
}
