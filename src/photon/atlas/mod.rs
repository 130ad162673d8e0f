//! The photon map on surfaces. The flux of photons stays on the surface that they meet.
//!
//! Connected surfaces that are almost flat form charts (`chart.rs`). A chart is divided into square pages, smaller where more photons arrive. Where other
//! surfaces stand on a chart (`contact.rs`), they divide its pages into pieces (`pieces.rs`). The irradiance of a piece is the flux on one of its sides
//! over its true area. It is smoothed with the pieces that go on beyond the borders of the page, never across a contact. So the two sides of a wall, the
//! rooms beside it, and surfaces that light does not reach stay apart, whatever their distance. Memory follows area, not volume.
//!
//! A look-up is one affine map and a few fetches. Mirrors `glsl/include/photon_atlas.glsl`.

mod chart;
mod contact;
mod pieces;

use glam::{DVec3, Vec2, Vec3, Vec4};

use self::chart::{ChartPlane, Charts};
use self::contact::contacts;
use self::pieces::{ChartPages, Pieces, cell_of};
use super::store::PhotonStore;
use crate::scene::{Bvh, LANES, Lanes, Mesh, NO_TRIANGLE, PacketHits, Scene, common, of_lane};

/// Photons on a page, on average over its chart. With its neighbours that is four times as many.
const PHOTONS: f32 = 64.0;
/// Most pages of all charts.
const MOST_PAGES: f32 = (1 << 18) as f32;
/// Pages if all were equal. They are at most four times as wide as that.
const PAGES: f32 = (1 << 14) as f32;
/// A chart has at least so many pages along its longer side, unless there are too many charts.
const LEAST_PAGES: f32 = 4.0;
/// Greatest distance of a surface from its chart's plane, in such equal pages.
const THICKNESS: f32 = 0.25;
/// Weight of a neighbour page in the smoothing.
const BORDER: f32 = 0.5;

/// The flux and area of all pieces, on both sides.
pub struct PhotonAtlas {
    /// For each triangle of the traced mesh: its chart × 2, plus 1 if its front is the chart's back.
    codes: Vec<u32>,
    charts: Vec<ChartMap>,
    pieces: Pieces,
    /// For each piece, on the front and on the back of its chart.
    flux: Vec<Vec3>,
    irradiance: Vec<Vec3>,
    /// For each page, on both sides: what most look-ups ask for.
    faces: Vec<PageFace>,
    /// The index in the traced mesh of each triangle of the gathered mesh, if the two differ.
    gathered: Option<Vec<u32>>,
}

/// One side of a page.
#[derive(Clone, Copy)]
struct PageFace {
    /// That of the piece that is the whole page.
    irradiance: Vec3,
    is_divided: bool,
}

/// From unit space to pages of a chart: u = dot(u.xyz, position) + u.w.
#[derive(Clone, Copy)]
struct ChartMap {
    u: Vec4,
    v: Vec4,
    pages: ChartPages,
}

/// The tables that shaders read, see `glsl/include/photon_atlas.glsl`.
pub(super) struct AtlasTables {
    pub triangles: Vec<u32>,
    pub charts: Vec<[f32; 4]>,
    pub pages: Vec<u32>,
    pub cells: Vec<u32>,
    pub irradiance: Vec<[f32; 4]>,
}

impl PhotonAtlas {
    /// An atlas of the surfaces of `scene`, to which `bvh` belongs. `arrivals` tells how many photons of a map each group of triangles gets, from the
    /// group of each triangle and the number of groups. `gathered`: the index in `scene` of each triangle of the gathered mesh, if the two differ.
    pub fn new(scene: &Scene, bvh: &Bvh, gathered: Option<Vec<u32>>, arrivals: impl FnOnce(&[u32], usize) -> Vec<f32>) -> Self {
        let mesh = &scene.mesh;
        let total: f64 = (0..mesh.triangles.len()).map(|triangle| f64::from(mesh.area(triangle))).sum();
        let equal = (total as f32 / PAGES).sqrt();
        let charts = Charts::new(mesh, THICKNESS * equal);
        let arrivals = arrivals(&charts.of, charts.planes.len());
        let pages = size_pages(mesh, &charts, &arrivals, equal);
        let pieces = Pieces::new(scene, bvh, &charts, &pages, &contacts(mesh, bvh, &charts, &pages));
        let map = |(plane, &pages): (&ChartPlane, &ChartPages)| {
            let [u, v] = plane.axes();
            let low = plane.low / pages.side;
            ChartMap { u: (u / pages.side).extend(-low.x), v: (v / pages.side).extend(-low.y), pages }
        };
        let sides = 2 * pieces.areas.len();
        Self {
            codes: charts.of.iter().zip(&charts.turned).map(|(chart, &turned)| chart << 1 | u32::from(turned)).collect(),
            charts: charts.planes.iter().zip(&pages).map(map).collect(),
            pieces,
            flux: vec![Vec3::ZERO; sides],
            irradiance: vec![Vec3::ZERO; sides],
            faces: Vec::new(),
            gathered,
        }
    }

    /// The index in `flux` and `irradiance` of a place on a triangle. `front`: on the triangle's front. The twin of `photon_irradiance` in the shader.
    fn index(&self, triangle: usize, position: Vec3, front: bool) -> usize {
        let code = self.codes[triangle];
        let ChartMap { u, v, pages } = self.charts[(code >> 1) as usize];
        let place = Vec2::new(u.truncate().dot(position) + u.w, v.truncate().dot(position) + v.w);
        let page = pages.page(place);
        let piece = self.pieces.piece(pages.number(page), |shift| cell_of(place, page, shift));
        2 * piece as usize + usize::from(front == (code & 1 == 1))
    }

    /// Area of each piece in unit space. Seams have none.
    pub fn areas(&self) -> &[f32] {
        &self.pieces.areas
    }

    /// Total flux on all surfaces, and how much of it lies on seams.
    pub fn total_flux(&self) -> [Vec3; 2] {
        let sum = |indices: &mut dyn Iterator<Item = usize>| indices.map(|i| self.flux[i].as_dvec3()).sum::<DVec3>().as_vec3();
        let seams = self.pieces.seams.iter().flat_map(|&(seam, _)| [2 * seam as usize, 2 * seam as usize + 1]);
        [sum(&mut (0..self.flux.len())), sum(&mut { seams })]
    }

    /// Bytes that an atlas of so many triangles and photons and its textures take, if each photon meets eight surfaces, a chart has eight triangles and a
    /// page in eight is divided, in four.
    pub fn bytes(triangles: usize, photons: u64) -> usize {
        const PIECE: usize =
            size_of::<f32>() + 2 * (2 * size_of::<Vec3>() + 2 * size_of::<Vec4>()) + 2 * size_of::<([u32; 2], f32)>();
        let charts = triangles.div_ceil(8);
        let lit = 8.0 * photons as f32 / PHOTONS;
        let pages = charts + (lit + PAGES + LEAST_PAGES.powi(2) * charts as f32).min(MOST_PAGES) as usize;
        let cells = Pieces::MOST_CELLS.max(64 * pages / 8);
        pages * (11 * PIECE / 8 + 4 * size_of::<u32>() + 2 * size_of::<PageFace>())
            + 3 * cells * size_of::<u32>()
            + triangles * 4 * size_of::<u32>()
            + charts * 3 * size_of::<ChartMap>()
    }

    /// Bytes that the atlas takes on the CPU.
    pub fn size(&self) -> usize {
        size_of_val(&self.codes[..])
            + size_of_val(&self.charts[..])
            + size_of_val(&self.flux[..])
            + size_of_val(&self.irradiance[..])
            + size_of_val(&self.faces[..])
            + self.pieces.size()
    }

    /// The tables, for triangles in `order`, by their indices in the gathered mesh.
    pub(super) fn tables(&self, order: &[usize]) -> AtlasTables {
        let code = |&triangle: &usize| self.codes[self.traced(triangle)];
        let chart = |chart: &ChartMap| {
            let ChartPages { first, size, .. } = chart.pages;
            [chart.u.to_array(), chart.v.to_array(), [first as f32, size.x as f32, size.y as f32, 0.0], [0.0; 4]]
        };
        AtlasTables {
            triangles: order.iter().map(code).collect(),
            charts: self.charts.iter().flat_map(chart).collect(),
            pages: self.pieces.pages.clone(),
            cells: self.pieces.cells.clone(),
            irradiance: self.irradiance_table(),
        }
    }

    pub(super) fn irradiance_table(&self) -> Vec<[f32; 4]> {
        self.irradiance.iter().map(|irradiance| irradiance.extend(0.0).to_array()).collect()
    }

    /// Irradiance at a point of a triangle of the traced mesh, on the side of the unit vector `normal`.
    pub fn irradiance(&self, mesh: &Mesh, triangle: usize, position: Vec3, normal: Vec3) -> Vec3 {
        self.irradiance[self.index(triangle, position, mesh.meets_front(triangle, -normal))]
    }

    fn traced(&self, triangle: usize) -> usize {
        self.gathered.as_ref().map_or(triangle, |traced| traced[triangle] as usize)
    }
}

impl PhotonStore for PhotonAtlas {
    fn index_of_hit(&self, mesh: &Mesh, triangle: usize, position: Vec3, direction: Vec3) -> usize {
        self.index(triangle, position, mesh.meets_front(triangle, direction))
    }

    fn add_flux(&mut self, index: usize, flux: Vec3) {
        self.flux[index] += flux;
    }

    fn settle(&mut self) {
        let mut sums: Vec<Vec4> = self.flux.iter().enumerate().map(|(i, flux)| flux.extend(self.pieces.areas[i / 2])).collect();
        for &([a, b], length) in &self.pieces.borders {
            for side in 0..2 {
                let [a, b] = [a, b].map(|piece| 2 * piece as usize + side);
                let own = |i: usize| self.flux[i].extend(self.pieces.areas[i / 2]);
                sums[a] += BORDER * length * own(b);
                sums[b] += BORDER * length * own(a);
            }
        }
        self.irradiance = sums.iter().map(|sum| if sum.w > 0.0 { sum.truncate() / sum.w } else { Vec3::ZERO }).collect();
        for (seam, beside) in &self.pieces.seams {
            for (side, parts) in beside.iter().enumerate() {
                let darkest = parts.iter().map(|&piece| self.irradiance[2 * piece as usize + side]).reduce(Vec3::min);
                self.irradiance[2 * *seam as usize + side] = darkest.unwrap_or(Vec3::ZERO);
            }
        }
        let face = |number: usize| {
            let piece = self.pieces.whole((number / 2) as u32);
            let irradiance = piece.map_or(Vec3::ZERO, |piece| self.irradiance[2 * piece as usize + number % 2]);
            PageFace { irradiance, is_divided: piece.is_none() }
        };
        self.faces = (0..2 * self.pieces.pages.len()).map(face).collect();
    }

    fn clear_flux(&mut self) {
        self.flux.fill(Vec3::ZERO);
    }

    fn irradiance_of_hit(&self, _: &Mesh, triangle: usize, position: Vec3, front: bool) -> Vec3 {
        self.irradiance[self.index(self.traced(triangle), position, front)]
    }

    fn irradiance_of_packet(&self, _: &Mesh, hits: &PacketHits, positions: &[Lanes; 3]) -> [Lanes; 3] {
        pulp::Arch::new().dispatch(LookUp { atlas: self, hits, positions })
    }
}

/// [`PhotonStore::irradiance_of_packet`] in steps, each of all hits: so the processor waits for several reads at once, and computes in vectors. A type and
/// not a closure, because `pulp` compiles only for its vectors what is inlined.
struct LookUp<'a> {
    atlas: &'a PhotonAtlas,
    hits: &'a PacketHits,
    positions: &'a [Lanes; 3],
}

/// Of the chart of each hit: its map, as functions of x, y, z and 1; its first page, its width and last page; and the side that is met.
struct ChartLanes {
    maps: [[Lanes; 4]; 2],
    first: [u32; LANES],
    width: [u32; LANES],
    last: [Lanes; 2],
    sides: [u32; LANES],
}

impl ChartLanes {
    #[inline(always)]
    fn of(LookUp { atlas, hits, .. }: &LookUp) -> Self {
        let (first, width, sides) = Default::default();
        let mut charts = Self { maps: [[[0.0; LANES]; 4]; 2], first, width, last: [[0.0; LANES]; 2], sides };
        let chart_of = |triangle: u32| {
            let code = atlas.codes[atlas.traced(triangle as usize)];
            (code, &atlas.charts[(code >> 1) as usize])
        };
        // Neighbours mostly meet one triangle.
        if let Some(triangle) = common(&hits.triangles) {
            let (code, chart) = chart_of(triangle);
            (0..LANES).for_each(|lane| charts.set(lane, chart, code ^ hits.fronts >> lane));
        } else {
            for lane in (0..LANES).filter(|&lane| hits.triangles[lane] != NO_TRIANGLE) {
                let (code, chart) = chart_of(hits.triangles[lane]);
                charts.set(lane, chart, code ^ hits.fronts >> lane);
            }
        }
        charts
    }

    /// The last bit of `side` is 0 on the chart's back.
    #[inline(always)]
    fn set(&mut self, lane: usize, ChartMap { u, v, pages }: &ChartMap, side: u32) {
        for axis in 0..4 {
            (self.maps[0][axis][lane], self.maps[1][axis][lane]) = (u[axis], v[axis]);
        }
        (self.first[lane], self.width[lane], self.sides[lane]) = (pages.first, pages.size.x, !side & 1);
        (self.last[0][lane], self.last[1][lane]) = ((pages.size.x - 1) as f32, (pages.size.y - 1) as f32);
    }
}

impl pulp::NullaryFnOnce for LookUp<'_> {
    type Output = [Lanes; 3];

    #[inline(always)]
    fn call(self) -> [Lanes; 3] {
        let ChartLanes { maps, first, width, last, sides } = ChartLanes::of(&self);
        let Self { atlas, hits, positions } = self;
        let [x, y, z] = positions;
        // The last bits of this and a smaller whole number are that number. A cast would check for numbers out of range, one lane after the other.
        const WHOLE: f32 = (1 << 23) as f32;
        let mut pages = [[0; LANES]; 2];
        for ((pages, map), last) in pages.iter_mut().zip(&maps).zip(&last) {
            for lane in 0..LANES {
                let place = map[0][lane] * x[lane] + map[1][lane] * y[lane] + map[2][lane] * z[lane] + map[3][lane];
                let place = if place > 0.0 { place } else { 0.0 };
                let place = if place < last[lane] { place } else { last[lane] };
                pages[lane] = (place.floor() + WHOLE).to_bits() - WHOLE.to_bits();
            }
        }
        let mut faces = [0; LANES];
        for lane in 0..LANES {
            faces[lane] = 2 * (first[lane] + pages[1][lane] * width[lane] + pages[0][lane]) + sides[lane];
        }
        let mut irradiance = [[0.0; LANES]; 3];
        for lane in (0..LANES).filter(|&lane| hits.triangles[lane] != NO_TRIANGLE) {
            let face = &atlas.faces[faces[lane] as usize];
            let mut found = face.irradiance;
            if face.is_divided {
                let triangle = atlas.traced(hits.triangles[lane] as usize);
                let position = Vec3::from(of_lane(positions, lane));
                found = atlas.irradiance[atlas.index(triangle, position, hits.fronts >> lane & 1 == 1)];
            }
            for color in 0..3 {
                irradiance[color][lane] = found[color];
            }
        }
        irradiance
    }
}

/// The pages of all charts. `arrivals`: photons of each chart. `equal`: the side of a page if all were equal.
fn size_pages(mesh: &Mesh, charts: &Charts, arrivals: &[f32], equal: f32) -> Vec<ChartPages> {
    let area = |triangles: &Vec<u32>| triangles.iter().map(|&triangle| mesh.area(triangle as usize)).sum::<f32>();
    let mut sides: Vec<f32> = (charts.triangles.iter().zip(&charts.planes).zip(arrivals))
        .map(|((triangles, plane), &photons)| {
            let most = (4.0 * equal).min((plane.high - plane.low).max_element() / LEAST_PAGES);
            (area(triangles) * PHOTONS / photons.max(1.0)).sqrt().clamp(1e-6, most.max(1e-6))
        })
        .collect();
    let size = |side: f32, plane: &ChartPlane| ((plane.high - plane.low) / side).ceil().max(Vec2::ONE);
    // Too many pages become wider together. A chart has one page at least, beside the pages of larger charts.
    let most = MOST_PAGES + charts.planes.len() as f32;
    loop {
        let count: f32 = sides.iter().zip(&charts.planes).map(|(&side, plane)| size(side, plane).element_product()).sum();
        if count <= most {
            break;
        }
        let wider = (count / most).sqrt().max(1.1);
        sides.iter_mut().for_each(|side| *side *= wider);
    }
    let mut first = 0;
    let pages = |(&side, plane): (&f32, &ChartPlane)| {
        let size = size(side, plane).as_uvec2();
        first += size.element_product();
        ChartPages { first: first - size.element_product(), size, side }
    };
    sides.iter().zip(&charts.planes).map(pages).collect()
}
