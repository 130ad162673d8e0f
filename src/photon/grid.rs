//! Density estimation: E = flux / area for each grid cell and each of six orientations.
//!
//! A cell sums the flux of photons and the area of the surfaces inside it, as triangles clipped to the cell. A disc around a photon would extend
//! past corners and darken them; clipped area does not. Each of the six dominant normal directions has its own bin. A surface counts in two bins,
//! one for each side, so light on one side of a wall never shows on the other. Only area that light can reach counts: the floor under a closed
//! block receives no photons, and would darken the floor around the block in the same cells. Readers interpolate flux and area between cells
//! and divide last.

use glam::{IVec3, UVec3, Vec3, Vec4};
use rayon::prelude::*;

use super::clip::{OPACITY_POINTS, area, even_points, slice};
use super::store::PhotonStore;
use crate::math::{cosine_direction, dominant_axis};
use crate::random::Random;
use crate::scene::{Bvh, Chance, Mesh, RAY_OFFSET, Rays, Scene};

/// Number of orientations: two signs of three axes.
pub(super) const BINS: usize = 6;

/// Points that are probed for light, for each cell face of area.
const PROBES: f32 = 64.0;
/// Rays from each probed point. A surface that light reaches sees light in almost all directions.
const TRIES: u32 = 4;

/// Flux and surface area of each cell and orientation.
pub struct PhotonGrid {
    /// Position of the outer corner of cell (0, 0, 0).
    pub origin: Vec3,
    /// Number of cells along each axis.
    pub cells: UVec3,
    /// Side of a cell.
    pub cell_size: f32,
    /// [red, green, blue flux, area] at `PhotonGrid::index_of`.
    pub sums: Vec<[f32; 4]>,
}

impl PhotonGrid {
    /// An empty grid over `mesh` with `cells` cells along its longest side.
    pub fn new(mesh: &Mesh, cells: u32) -> Self {
        let bounds = mesh.bounds();
        let cell_size = bounds.extent().max_element() / cells as f32;
        // Look-ups interpolate between two cells. One more cell on each side keeps them off the tiles of other bins in the texture.
        let cells = (bounds.extent() / cell_size).ceil().as_uvec3() + 2;
        let origin = bounds.center() - 0.5 * cell_size * cells.as_vec3();
        Self { origin, cells, cell_size, sums: vec![[0.0; 4]; BINS * cells.element_product() as usize] }
    }

    /// Bytes that [`Self::new`] takes at most. A scene as wide as it is long takes so many.
    pub fn bytes(cells: u32) -> usize {
        BINS * (cells as usize + 2).pow(3) * size_of::<[f32; 4]>()
    }

    /// Bytes that [`Self::add_area`] takes meanwhile, where most triangles pass through one to four cells.
    pub fn area_bytes(triangles: usize) -> usize {
        triangles * (size_of::<Vec<CellArea>>() + 2 * 4 * size_of::<CellArea>())
    }

    /// `axis` is that of the triangle's geometric normal, as in the shaders.
    fn index_of(&self, cell: UVec3, axis: usize, side: Vec3) -> usize {
        let bin = 2 * axis + usize::from(side[axis] <= 0.0);
        let [x, y, z] = cell.min(self.cells - 1).to_array().map(|c| c as usize);
        let [width, height] = [self.cells.x as usize, self.cells.y as usize];
        bin * self.cells.element_product() as usize + (z * height + y) * width + x
    }

    /// Irradiance at `position` on the side of a surface that faces along the positive or negative `axis`. Flux and area are interpolated between
    /// the centres of cells, then divided. The twin of `photon_irradiance` in `glsl/include/photon_grid.glsl`.
    pub fn irradiance(&self, position: Vec3, axis: usize, positive: bool) -> Vec3 {
        let side = if positive { Vec3::AXES[axis] } else { -Vec3::AXES[axis] };
        // In units of cells, with 0 at the centre of the first.
        let place = ((position - self.origin) / self.cell_size - 0.5).clamp(Vec3::ZERO, self.cells.as_vec3() - 1.0);
        let (first, share) = (place.floor(), place.fract());
        let mut sums = Vec4::ZERO;
        for corner in 0..8 {
            let step = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
            let weight = Vec3::select(step.cmpeq(UVec3::ONE), share, 1.0 - share).element_product();
            sums += weight * Vec4::from(self.sums[self.index_of(first.as_uvec3() + step, axis, side)]);
        }
        if sums.w > 0.0 { sums.truncate() / sums.w } else { Vec3::ZERO }
    }

    /// Adds the area of `scene` that light reaches, times its opacity. Call it once, after flux was added.
    pub fn add_area(&mut self, scene: &Scene, bvh: &Bvh, seed: u64) {
        let (mesh, rays) = (&scene.mesh, Rays::new(scene, bvh));
        // Clipped and probed in parallel, summed in the order of triangles: any number of threads gives the same sums.
        let pieces: Vec<Vec<CellArea>> = (0..mesh.triangles.len())
            .into_par_iter()
            .map(|triangle| {
                let mut random = Random::new(seed, triangle as u64);
                let normal = mesh.geometric_normal(triangle);
                let mut pieces = Vec::new();
                for (cell, polygon) in self.clip(mesh.corners(triangle)) {
                    let opaque = if scene.is_cut_out(triangle) {
                        let positions = even_points(&polygon, OPACITY_POINTS).map(|place| self.origin + self.cell_size * place);
                        scene.mean_opacity(triangle, positions)
                    } else {
                        1.0
                    };
                    for side in [normal, -normal] {
                        pieces.push(CellArea {
                            index: self.index_of(cell, dominant_axis(normal), side),
                            area: area(&polygon) * self.cell_size * self.cell_size * opaque,
                            probes: self.probe(mesh, &rays, triangle, side, &polygon, &mut random),
                        });
                    }
                }
                pieces
            })
            .collect();
        let mut probes = vec![[0u32; 2]; self.sums.len()];
        for piece in pieces.into_iter().flatten() {
            self.sums[piece.index][3] += piece.area;
            let [lit, all] = &mut probes[piece.index];
            *lit += piece.probes[0];
            *all += piece.probes[1];
        }
        for (index, [lit, probes]) in probes.into_iter().enumerate() {
            if probes > 0 {
                // If photons arrived, light reaches some of the area, even if no probe found it.
                let lit = lit.max(u32::from(self.is_lit(index)));
                self.sums[index][3] *= lit as f32 / probes as f32;
            }
        }
        self.settle();
    }

    fn is_lit(&self, index: usize) -> bool {
        self.sums[index][..3].iter().any(|&flux| flux > 0.0)
    }

    /// Probes points on one side of a part of a triangle, in proportion to its area. Returns how many of them see the outside of the scene or a
    /// surface that received photons, and how many there are.
    fn probe(&self, mesh: &Mesh, rays: &Rays, triangle: usize, side: Vec3, polygon: &[Vec3], random: &mut Random) -> [u32; 2] {
        let probes = (area(polygon) * PROBES + random.uniform()) as u32;
        let lit = (0..probes).filter(|&probe| {
            let origin = self.origin + self.cell_size * point_in(polygon, random) + RAY_OFFSET * side;
            (0..TRIES).any(|turn| {
                let direction = cosine_direction(side, random.uniform(), random.uniform());
                let chance = Chance::of_pixel(triangle as u32, probe, turn);
                rays.nearest(origin, direction, Some(triangle), chance).is_none_or(|hit| {
                    self.is_lit(self.index_of_hit(mesh, hit.triangle, origin + hit.distance * direction, direction))
                })
            })
        });
        [lit.count() as u32, probes]
    }

    /// The cells that a triangle passes through and its part in each, in lengths of cells from the origin.
    fn clip(&self, corners: [Vec3; 3]) -> Vec<(UVec3, Vec<Vec3>)> {
        let mut pieces = vec![(UVec3::ZERO, corners.map(|corner| (corner - self.origin) / self.cell_size).to_vec())];
        for axis in 0..3 {
            pieces = pieces.into_iter().flat_map(|(cell, polygon)| slice(cell, polygon, axis)).collect();
        }
        pieces
    }
}

impl PhotonStore for PhotonGrid {
    fn index_of_hit(&self, mesh: &Mesh, triangle: usize, position: Vec3, direction: Vec3) -> usize {
        let side = mesh.side_met(triangle, direction);
        let cell = ((position - self.origin) / self.cell_size).as_uvec3();
        self.index_of(cell, dominant_axis(side), side)
    }

    fn add_flux(&mut self, index: usize, flux: Vec3) {
        for (sum, flux) in self.sums[index].iter_mut().zip(flux.to_array()) {
            *sum += flux;
        }
    }

    /// Moves flux in cells without area to the nearest cell with area. A surface on the border of two cells has its area in one of them, but
    /// rounding puts some of its photons into the other. Readers near such a cell would divide by almost no area. Does nothing before area is added.
    fn settle(&mut self) {
        let size = self.cells.as_ivec3();
        for bin in 0..BINS {
            let first = bin * self.cells.element_product() as usize;
            let index = |cell: IVec3| first + ((cell.z * size.y + cell.y) * size.x + cell.x) as usize;
            // Nearest cells first; of these, those across the surface before those along it.
            let mut steps: Vec<IVec3> = (0..27).map(|step| IVec3::new(step % 3, step / 3 % 3, step / 9) - 1).collect();
            steps.sort_by_key(|step| (step.length_squared(), step[bin / 2] == 0));
            for at in 0..size.element_product() {
                let cell = IVec3::new(at % size.x, at / size.x % size.y, at / (size.x * size.y));
                let [red, green, blue, area] = self.sums[index(cell)];
                if area > 0.0 || !self.is_lit(index(cell)) {
                    continue;
                }
                let mut near = steps.iter().map(|&step| cell + step);
                let has_area =
                    |near: &IVec3| near.cmpge(IVec3::ZERO).all() && near.cmplt(size).all() && self.sums[index(*near)][3] > 0.0;
                if let Some(near) = near.find(has_area) {
                    self.sums[index(cell)] = [0.0; 4];
                    self.add_flux(index(near), Vec3::new(red, green, blue));
                }
            }
        }
    }

    fn clear_flux(&mut self) {
        for sums in &mut self.sums {
            sums[..3].fill(0.0);
        }
    }

    fn irradiance_of_hit(&self, mesh: &Mesh, triangle: usize, position: Vec3, front: bool) -> Vec3 {
        let normal = mesh.geometric_normal(triangle);
        let side = if front { normal } else { -normal };
        let axis = dominant_axis(side);
        self.irradiance(position, axis, side[axis] > 0.0)
    }
}

/// One side of a triangle's part in one cell.
struct CellArea {
    index: usize,
    area: f32,
    /// See [`PhotonGrid::probe`].
    probes: [u32; 2],
}

/// A uniformly distributed random point of a convex polygon.
fn point_in(polygon: &[Vec3], random: &mut Random) -> Vec3 {
    let mut rest = random.uniform() * area(polygon);
    let mut chosen = [polygon[0], polygon[1], polygon[2]];
    for pair in polygon[1..].windows(2) {
        chosen = [polygon[0], pair[0], pair[1]];
        rest -= area(&chosen);
        if rest <= 0.0 {
            break;
        }
    }
    let [a, b, c] = chosen;
    let (u, v) = (random.uniform(), random.uniform());
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    a + u * (b - a) + v * (c - a)
}
