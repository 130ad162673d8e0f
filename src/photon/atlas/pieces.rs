//! Pages of a chart, and their pieces.
//!
//! A page is a square of the chart's plane. Most pages are one piece. Contacts divide a page: its parts between contacts are pieces of their own, so
//! that light of one part never shows on another. Such a page has a raster of cells, and each cell belongs to a piece.
//!
//! Cells that a contact crosses belong to a *seam*. Nobody can tell on which side of the contact a ray meets them, so they count as dark as the darkest
//! piece beside them, and no light leaks. Photons and area in seams do not count, nor do pieces inside solid things: a few rays from a piece tell. Else
//! the floor below a wall would draw dark lines along it.

use glam::{IVec2, UVec2, UVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::super::clip::{OPACITY_POINTS, area, even_points, slice};
use super::chart::Charts;
use super::contact::Contact;
use crate::math::cosine_direction;
use crate::random::Random;
use crate::scene::{Bvh, Mesh, RAY_OFFSET, Scene};

/// Binary logarithms of the fewest and most cells along a side of a divided page.
const SHIFTS: [u32; 2] = [3, 8];
/// A page whose pieces have less than this share of its cells is cut into too many parts to tell apart. It stays one piece.
const LEAST: f32 = 0.25;
/// Cells of a part from which rays tell whether it lies inside something.
const PROBES: usize = 8;
/// To the four neighbours of a place in a raster.
const STEPS: [IVec2; 4] = [IVec2::X, IVec2::NEG_X, IVec2::Y, IVec2::NEG_Y];
/// Marks of cells that are no piece: outside the chart, and on a contact.
const OUTSIDE: u32 = u32::MAX;
const SEAM: u32 = u32::MAX - 1;

/// The pages of one chart.
#[derive(Clone, Copy, Debug)]
pub struct ChartPages {
    /// Number of the first page.
    pub first: u32,
    /// Pages along the two axes of the plane.
    pub size: UVec2,
    /// Side of a page in unit space.
    pub side: f32,
}

/// All pages of all charts, with their pieces.
#[derive(Default)]
pub struct Pieces {
    /// For each page: its first cell × 16 + the binary logarithm of its cells along a side.
    pub pages: Vec<u32>,
    /// The piece of each cell.
    pub cells: Vec<u32>,
    /// Surface area of each piece, in unit space, times its mean opacity. That of a seam is 0.
    pub areas: Vec<f32>,
    /// Seams, with the pieces beside them on the front and on the back of their chart.
    pub seams: Vec<(u32, [Vec<u32>; 2])>,
    /// Pairs of pieces with a common border, and its length as a share of a page's side.
    pub borders: Vec<([u32; 2], f32)>,
}

/// A page divided by contacts.
struct DividedPage {
    page: u32,
    /// The part of each cell, or a mark.
    cells: Vec<u32>,
    /// Number of cells of each part, and of all parts and seams, each cell times its opacity.
    counts: Vec<f32>,
    inner: f32,
    /// The parts beside each seam that count, on the front and on the back. Seams have the numbers after those of the parts.
    seams: Vec<[Vec<u32>; 2]>,
}

impl ChartPages {
    /// The page of a place in the chart's plane, in pages from its lower corner.
    pub fn page(&self, place: Vec2) -> UVec2 {
        place.max(Vec2::ZERO).as_uvec2().min(self.size - 1)
    }

    pub fn number(&self, page: UVec2) -> u32 {
        self.first + page.y * self.size.x + page.x
    }
}

/// The cell of a place in `page`, in a raster of 2^shift cells along a side.
pub fn cell_of(place: Vec2, page: UVec2, shift: u32) -> UVec2 {
    let side = 1u32 << shift;
    ((place - page.as_vec2()) * side as f32).max(Vec2::ZERO).as_uvec2().min(UVec2::splat(side - 1))
}

impl Pieces {
    /// Most cells of all divided pages, unless there are so many that the fewest cells of each exceed it.
    pub const MOST_CELLS: usize = 1 << 21;

    pub fn new(scene: &Scene, bvh: &Bvh, charts: &Charts, pages: &[ChartPages], contacts: &[Contact]) -> Self {
        let mesh = &scene.mesh;
        let own = |chart: usize, triangle: u32| {
            mesh.corners(triangle as usize).map(|corner| charts.planes[chart].in_pages(corner, pages[chart].side))
        };
        // The pages that contacts cross, and the contacts of each.
        let mut crossings: Vec<(u32, u32)> = Vec::new();
        for (number, contact) in (0..).zip(contacts) {
            let pages = &pages[contact.chart as usize];
            walk(contact.ends, |page| {
                if page.cmpge(IVec2::ZERO).all() && page.as_uvec2().cmplt(pages.size).all() {
                    crossings.push((pages.number(page.as_uvec2()), number));
                }
            });
        }
        crossings.sort_unstable();
        crossings.dedup();
        let count = pages.last().map_or(0, |last| last.first + last.size.element_product()) as usize;
        let mut is_crossed = vec![false; count];
        crossings.iter().for_each(|&(page, _)| is_crossed[page as usize] = true);
        let (page_areas, mut triangles) = page_areas(scene, charts, pages, &own, &is_crossed);
        triangles.sort_unstable();
        let crossings: Vec<&[(u32, u32)]> =
            crossings.chunk_by(|a, b| a.0 == b.0).filter(|crossings| page_areas[crossings[0].0 as usize] > 0.0).collect();
        let fits = |&shift: &u32| crossings.len() << (2 * shift) <= Self::MOST_CELLS;
        let shift = (SHIFTS[0]..=SHIFTS[1]).rev().find(fits).unwrap_or(SHIFTS[0]);
        let divided: Vec<DividedPage> = crossings
            .into_par_iter()
            .filter_map(|crossings| {
                let chart = contacts[crossings[0].1 as usize].chart as usize;
                let lines = crossings.iter().map(|&(_, number)| contacts[number as usize].ends);
                let page = crossings[0].0;
                let first = triangles.partition_point(|&(other, _)| other < page);
                let triangles = triangles[first..].iter().take_while(|&&(other, _)| other == page);
                let triangles: Vec<_> = triangles.map(|&(_, triangle)| (triangle, own(chart, triangle))).collect();
                let is_inside = |triangle: u32, position: Vec2, side: bool| {
                    let turned = charts.turned[triangle as usize] != side;
                    is_inside(mesh, bvh, triangle as usize, position, turned)
                };
                let opacity = |triangle: u32, weights: &dyn Fn() -> Vec2| match scene.is_cut_out(triangle as usize) {
                    true => scene.opacity(triangle as usize, position_at(mesh, triangle as usize, weights())),
                    false => 1.0,
                };
                divide((page, &pages[chart]), shift, &triangles, lines, is_inside, opacity)
            })
            .collect();

        let mut pieces = Self::default();
        let mut divided = divided.into_iter().peekable();
        for (page, &area) in (0..).zip(&page_areas) {
            match divided.next_if(|divided| divided.page == page) {
                Some(divided) => pieces.push_divided(divided, area, shift),
                None => {
                    pieces.pages.push((pieces.cells.len() as u32) << 4);
                    pieces.cells.push(if area > 0.0 { pieces.areas.len() as u32 } else { OUTSIDE });
                    pieces.areas.extend((area > 0.0).then_some(area));
                }
            }
        }
        pages.iter().for_each(|pages| pieces.join(pages));
        pages.iter().for_each(|pages| pieces.fill(pages));
        pieces
    }

    /// Bytes of the tables.
    pub fn size(&self) -> usize {
        let seams: usize = self
            .seams
            .iter()
            .map(|(_, beside)| size_of_val(beside) + beside.iter().map(|b| size_of_val(&b[..])).sum::<usize>())
            .sum();
        size_of_val(&self.pages[..])
            + size_of_val(&self.cells[..])
            + size_of_val(&self.areas[..])
            + seams
            + size_of_val(&self.borders[..])
    }

    fn push_divided(&mut self, divided: DividedPage, area: f32, shift: u32) {
        let first = self.areas.len() as u32;
        self.pages.push((self.cells.len() as u32) << 4 | shift);
        self.cells.extend(divided.cells.iter().map(|cell| first + cell));
        self.areas.extend(divided.counts.iter().map(|&count| area * count / divided.inner));
        for beside in divided.seams {
            self.seams.push((self.areas.len() as u32, beside.map(|parts| parts.iter().map(|part| first + part).collect())));
            self.areas.push(0.0);
        }
    }

    /// The piece at a place of a page.
    pub fn piece(&self, page: u32, cell: impl Fn(u32) -> UVec2) -> u32 {
        let word = self.pages[page as usize];
        let shift = word & 15;
        let cell = cell(shift);
        self.cells[((word >> 4) + (cell.y << shift) + cell.x) as usize]
    }

    /// The piece that is the whole page; `None` of a divided page.
    pub fn whole(&self, page: u32) -> Option<u32> {
        let word = self.pages[page as usize];
        (word & 15 == 0).then(|| self.cells[(word >> 4) as usize])
    }

    /// Finds the borders between pieces of neighbouring pages.
    fn join(&mut self, pages: &ChartPages) {
        let size = pages.size;
        for y in 0..size.y {
            for x in 0..size.x {
                for axis in 0..2 {
                    let here = UVec2::new(x, y);
                    let there = here + UVec2::AXES[axis];
                    if there.cmpge(size).any() {
                        continue;
                    }
                    let numbers = [here, there].map(|page| pages.number(page));
                    let shift = numbers.map(|page| self.pages[page as usize] & 15).into_iter().max().unwrap_or(0);
                    let mut border: Vec<([u32; 2], f32)> = Vec::new();
                    for step in 0..1u32 << shift {
                        let piece = |end: usize| {
                            self.piece(numbers[end], |own| {
                                let along = step >> (shift - own);
                                let across = if end == 0 { (1 << own) - 1 } else { 0 };
                                if axis == 0 { UVec2::new(across, along) } else { UVec2::new(along, across) }
                            })
                        };
                        let pair = [piece(0), piece(1)];
                        if pair.iter().any(|&piece| piece == OUTSIDE || self.areas[piece as usize] == 0.0) {
                            continue;
                        }
                        let length = 1.0 / (1u32 << shift) as f32;
                        match border.last_mut() {
                            Some((last, sum)) if *last == pair => *sum += length,
                            _ => border.push((pair, length)),
                        }
                    }
                    self.borders.extend(border);
                }
            }
        }
    }

    /// Gives each page outside the chart the cells of the nearest page inside. Rounding puts some hits there.
    fn fill(&mut self, pages: &ChartPages) {
        let own = pages.first as usize..(pages.first + pages.size.element_product()) as usize;
        let cells = &self.cells;
        spread(&mut self.pages[own], pages.size, |word| word & 15 == 0 && cells[(word >> 4) as usize] == OUTSIDE);
    }
}

/// The surface area in each page, times its mean opacity, and the triangles of those pages that are crossed: (page, triangle).
fn page_areas(
    scene: &Scene,
    charts: &Charts,
    pages: &[ChartPages],
    own: &dyn Fn(usize, u32) -> [Vec2; 3],
    is_crossed: &[bool],
) -> (Vec<f32>, Vec<(u32, u32)>) {
    let mesh = &scene.mesh;
    let (mut areas, mut crossed) = (vec![0.0; is_crossed.len()], Vec::new());
    for (chart, (triangles, pages)) in charts.triangles.iter().zip(pages).enumerate() {
        // The area of each page without its holes, and that of all with them.
        let mut plain: Vec<(usize, f32)> = Vec::new();
        let mut there = 0.0;
        for &triangle in triangles {
            let corners = own(chart, triangle);
            let whole = mesh.area(triangle as usize);
            let cut_out = scene.is_cut_out(triangle as usize);
            // Of a part of the triangle, by its corners in pages.
            let opacity = |part: &[Vec3]| {
                let places = even_points(part, OPACITY_POINTS).map(|place| weights(corners, place.truncate()));
                scene.mean_opacity(triangle as usize, places.map(|weights| position_at(mesh, triangle as usize, weights)))
            };
            let [low, high] = [corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2])];
            let mut add = |page: UVec2, area: f32, opaque: f32| {
                let page = pages.number(page);
                areas[page as usize] += area * opaque;
                there += area * opaque;
                plain.push((page as usize, area));
                if is_crossed[page as usize] {
                    crossed.push((page, triangle));
                }
            };
            if pages.page(low) == pages.page(high) {
                let opaque = if cut_out { opacity(&corners.map(|corner| corner.extend(0.0))) } else { 1.0 };
                add(pages.page(low), whole, opaque);
                continue;
            }
            let polygon = corners.map(|corner| corner.max(Vec2::ZERO).extend(0.0)).to_vec();
            let projected = area(&polygon).max(f32::MIN_POSITIVE);
            for (cell, part) in slice(UVec3::ZERO, polygon, 0).into_iter().flat_map(|(cell, part)| slice(cell, part, 1)) {
                let opaque = if cut_out { opacity(&part) } else { 1.0 };
                add(pages.page(cell.truncate().as_vec2()), whole * area(&part) / projected, opaque);
            }
        }
        if there == 0.0 {
            // All samples may miss a thin wire, but photons find it.
            plain.into_iter().for_each(|(page, area)| areas[page] += area);
        }
    }
    (areas, crossed)
}

/// Divides a page by lines. `None`: it stays one piece.
fn divide(
    (page, pages): (u32, &ChartPages),
    shift: u32,
    triangles: &[(u32, [Vec2; 3])],
    lines: impl Iterator<Item = [Vec2; 2]>,
    is_inside: impl Fn(u32, Vec2, bool) -> bool,
    opacity: impl Fn(u32, &dyn Fn() -> Vec2) -> f32,
) -> Option<DividedPage> {
    let side = 1i32 << shift;
    let at = UVec2::new((page - pages.first) % pages.size.x, (page - pages.first) / pages.size.x).as_vec2();
    let in_cells = |place: Vec2| (place - at) * side as f32;
    let index = |cell: IVec2| (cell.y * side + cell.x) as usize;
    let is_cell = |cell: IVec2| cell.cmpge(IVec2::ZERO).all() && cell.cmplt(IVec2::splat(side)).all();
    let mut cells = vec![OUTSIDE; (side * side) as usize];
    // The triangle at the centre of each cell, by its place in the list.
    let mut owners = vec![0; cells.len()];

    // The surface: cells whose centres lie in a triangle. Parts get their numbers below.
    const BLANK: u32 = u32::MAX - 2;
    for (owner, (_, corners)) in triangles.iter().enumerate() {
        let corners = corners.map(in_cells);
        let low = corners[0].min(corners[1]).min(corners[2]).max(Vec2::ZERO).as_ivec2();
        let high = corners[0].max(corners[1]).max(corners[2]).min(Vec2::splat(side as f32)).as_ivec2();
        for y in low.y..=high.y.min(side - 1) {
            for x in low.x..=high.x.min(side - 1) {
                if holds(corners, Vec2::new(x as f32 + 0.5, y as f32 + 0.5)) {
                    cells[index(IVec2::new(x, y))] = BLANK;
                    owners[index(IVec2::new(x, y))] = owner;
                }
            }
        }
    }
    for line in lines {
        walk(line.map(in_cells), |cell| {
            if is_cell(cell) && cells[index(cell)] == BLANK {
                cells[index(cell)] = SEAM;
            }
        });
    }

    let cell_at = |i: usize| IVec2::new(i as i32 % side, i as i32 / side);
    let mut counts: Vec<u32> = Vec::new();
    for first in 0..cells.len() {
        if cells[first] != BLANK {
            continue;
        }
        let part = counts.len() as u32;
        cells[first] = part;
        let (mut open, mut count) = (vec![first], 0);
        while let Some(here) = open.pop() {
            count += 1;
            for near in STEPS.map(|step| cell_at(here) + step).into_iter().filter(|&near| is_cell(near)) {
                if cells[index(near)] == BLANK {
                    cells[index(near)] = part;
                    open.push(index(near));
                }
            }
        }
        counts.push(count);
    }
    let inner = cells.iter().filter(|&&cell| cell != OUTSIDE).count();
    if (counts.iter().sum::<u32>() as f32) < LEAST * inner as f32 || inner == 0 {
        return None;
    }

    let weights_at = |i: usize| weights(triangles[owners[i]].1, (cell_at(i).as_vec2() + 0.5) / side as f32 + at);
    let (mut opaque, mut all_opaque) = (vec![0.0; counts.len()], 0.0);
    for i in (0..cells.len()).filter(|&i| cells[i] != OUTSIDE) {
        let opacity = opacity(triangles[owners[i]].0, &|| weights_at(i));
        all_opaque += opacity;
        if cells[i] != SEAM {
            opaque[cells[i] as usize] += opacity;
        }
    }

    // The parts beside each cell of a seam: those around it, else those beside its neighbours in the seam.
    let around = |i: usize| (0..9).map(move |k| cell_at(i) + IVec2::new(k % 3 - 1, k / 3 - 1));
    let mut beside: Vec<Vec<u32>> = vec![Vec::new(); cells.len()];
    let mut left: Vec<usize> = (0..cells.len()).filter(|&i| cells[i] == SEAM).collect();
    for &i in &left {
        beside[i] = around(i).filter(|&near| is_cell(near)).map(|near| cells[index(near)]).filter(|&part| part < BLANK).collect();
        beside[i].sort_unstable();
        beside[i].dedup();
    }
    loop {
        let before = left.len();
        let reached: Vec<(usize, Vec<u32>)> = left
            .iter()
            .filter(|&&i| beside[i].is_empty())
            .filter_map(|&i| {
                let near = around(i).filter(|&near| is_cell(near)).map(index).find(|&near| !beside[near].is_empty())?;
                Some((i, beside[near].clone()))
            })
            .collect();
        reached.into_iter().for_each(|(i, parts)| beside[i] = parts);
        left.retain(|&i| beside[i].is_empty());
        if left.len() == before || left.is_empty() {
            break;
        }
    }
    // Whether each part lies inside something, on the front and on the back, by what almost all of some of its cells see. On the back of a sheet half see
    // backs too.
    let inside: Vec<[bool; 2]> = (0..counts.len() as u32)
        .map(|part| {
            let own: Vec<usize> = (0..cells.len()).filter(|&i| cells[i] == part).collect();
            let probes = own.len().min(PROBES);
            let probe = |k: usize, back: bool| {
                let i = own[k * own.len() / probes];
                is_inside(triangles[owners[i]].0, weights_at(i), back)
            };
            [false, true].map(|back| 8 * (0..probes).filter(|&k| probe(k, back)).count() >= 7 * probes)
        })
        .collect();
    let mut seams: Vec<Vec<u32>> = Vec::new();
    for i in 0..cells.len() {
        if cells[i] == SEAM {
            let number = seams.iter().position(|seam| *seam == beside[i]).unwrap_or_else(|| {
                seams.push(beside[i].clone());
                seams.len() - 1
            });
            cells[i] = (counts.len() + number) as u32;
        }
    }
    spread(&mut cells, UVec2::splat(side as u32), |cell| cell == OUTSIDE);
    let counted = |parts: &Vec<u32>, side: usize| -> Vec<u32> {
        let outside: Vec<u32> = parts.iter().copied().filter(|&part| !inside[part as usize][side]).collect();
        // In a room whose fronts look outward all seem to lie inside something.
        if outside.is_empty() { parts.clone() } else { outside }
    };
    let seams = seams.iter().map(|parts| [0, 1].map(|side| counted(parts, side))).collect();
    if all_opaque == 0.0 {
        (opaque, all_opaque) = (counts.iter().map(|&count| count as f32).collect(), inner as f32);
    }
    Some(DividedPage { page, cells, counts: opaque, inner: all_opaque, seams })
}

/// Barycentric weights of the second and third corner of a triangle at a place.
fn weights([a, b, c]: [Vec2; 3], place: Vec2) -> Vec2 {
    let area = (b - a).perp_dot(c - a);
    Vec2::new((place - a).perp_dot(c - a), (b - a).perp_dot(place - a)) / if area == 0.0 { 1.0 } else { area }
}

/// The position of a place of a triangle, given by its weights.
fn position_at(mesh: &Mesh, triangle: usize, weights: Vec2) -> Vec3 {
    let [a, b, c] = mesh.corners(triangle);
    a + weights.x * (b - a) + weights.y * (c - a)
}

/// Whether a ray from a place of a triangle, given by its weights, meets the back side of a surface. `back`: from the triangle's back.
fn is_inside(mesh: &Mesh, bvh: &Bvh, triangle: usize, weights: Vec2, back: bool) -> bool {
    let normal = if back { -mesh.geometric_normal(triangle) } else { mesh.geometric_normal(triangle) };
    let position = position_at(mesh, triangle, weights);
    let mut random = Random::new(triangle as u64, u64::from(weights.x.to_bits()) << 32 | u64::from(weights.y.to_bits()));
    let direction = cosine_direction(normal, random.uniform(), random.uniform());
    let hit = bvh.nearest(position + RAY_OFFSET * normal, direction, Some(triangle));
    hit.is_some_and(|hit| !mesh.meets_front(hit.triangle, direction))
}

/// Gives each place outside the chart, in a raster of `size`, the value of the nearest place inside.
fn spread(values: &mut [u32], size: UVec2, is_outside: impl Fn(u32) -> bool) {
    let size = size.as_ivec2();
    let mut known: Vec<usize> = (0..values.len()).filter(|&i| !is_outside(values[i])).collect();
    let mut next = 0;
    while let Some(&here) = known.get(next) {
        next += 1;
        let at = IVec2::new(here as i32 % size.x, here as i32 / size.x);
        for near in STEPS.map(|step| at + step) {
            let inside = near.cmpge(IVec2::ZERO).all() && near.cmplt(size).all();
            let near = (near.y * size.x + near.x) as usize;
            if inside && is_outside(values[near]) {
                values[near] = values[here];
                known.push(near);
            }
        }
    }
}

/// Whether a triangle holds a place, or almost so: no place between two neighbours may be lost.
fn holds(corners: [Vec2; 3], place: Vec2) -> bool {
    let turn = (corners[1] - corners[0]).perp_dot(corners[2] - corners[0]).signum();
    (0..3).all(|i| {
        let edge = corners[(i + 1) % 3] - corners[i];
        turn * edge.perp_dot(place - corners[i]) >= -1e-3 * edge.length()
    })
}

/// Visits the unit squares that a line passes, one beside the other (Amanatides and Woo 1987, "A fast voxel traversal algorithm for ray tracing").
fn walk([from, to]: [Vec2; 2], mut visit: impl FnMut(IVec2)) {
    let way = to - from;
    let mut square = from.floor().as_ivec2();
    let last = to.floor().as_ivec2();
    let step = IVec2::new(way.x.signum() as i32, way.y.signum() as i32);
    // Shares of the way to the next square, and from square to square.
    let next = |axis: usize, square: i32| {
        let border = square as f32 + if step[axis] > 0 { 1.0 } else { 0.0 };
        if way[axis] == 0.0 { f32::INFINITY } else { (border - from[axis]) / way[axis] }
    };
    visit(square);
    for _ in 0..(last - square).abs().element_sum() {
        let axis = usize::from(next(1, square.y) < next(0, square.x));
        square[axis] += step[axis];
        visit(square);
    }
}
