//! Density estimation: E = flux / area for each grid cell and each of six orientations.
//!
//! A cell sums the photons' flux and the true area of the surfaces inside it, triangles clipped to the cell. A disc around a photon would
//! reach beyond a corner and darken it; the clipped area does not. Each of the six dominant normal directions has a bin of its
//! own, and every surface counts in two, one a side: light on one side of a wall never shows on the other.
//! Readers interpolate flux and area between cells and divide last.

use glam::{UVec3, Vec3};
use rayon::prelude::*;

use crate::math::{Aabb, dominant_axis};
use crate::scene::Mesh;

/// Orientations told apart: the two signs of each axis.
pub const BINS: usize = 6;

/// Flux and surface area of each cell and orientation.
pub struct PhotonGrid {
    /// Position of the outer corner of cell (0, 0, 0).
    pub origin: Vec3,
    /// Number of cells along each axis.
    pub cells: UVec3,
    /// Side of a cell.
    pub cell_size: f32,
    /// [red, green, blue flux, area] by [`PhotonGrid::index`].
    pub sums: Vec<[f32; 4]>,
}

impl PhotonGrid {
    /// A grid over `mesh` with `cells` cells along its longest side: area filled in, flux zero.
    pub fn new(mesh: &Mesh, cells: u32) -> Self {
        let bounds = Aabb::from_points(mesh.positions.iter().copied());
        let cell_size = bounds.extent().max_element() / cells as f32;
        // Half a cell of margin on each side: surfaces on the bounds lie inside cells, not between two.
        let cells = (bounds.extent() / cell_size).ceil().as_uvec3() + 1;
        let origin = bounds.center() - 0.5 * cell_size * cells.as_vec3();
        let mut grid = Self { origin, cells, cell_size, sums: vec![[0.0; 4]; BINS * cells.element_product() as usize] };
        grid.add_area(mesh);
        grid
    }

    /// The bin of the side with unit normal `side` at `position`. The axis is that of the triangle's geometric normal, so that the CPU
    /// and the shaders agree.
    pub fn index(&self, position: Vec3, axis: usize, side: Vec3) -> usize {
        let bin = 2 * axis + usize::from(side[axis] <= 0.0);
        self.index_of(((position - self.origin) / self.cell_size).as_uvec3().min(self.cells - 1), bin)
    }

    fn index_of(&self, cell: UVec3, bin: usize) -> usize {
        let [x, y, z] = cell.to_array().map(|c| c as usize);
        let [width, height] = [self.cells.x as usize, self.cells.y as usize];
        bin * self.cells.element_product() as usize + (z * height + y) * width + x
    }

    /// Adds the flux of a photon that met the surface of bin `index`.
    pub fn add_flux(&mut self, index: usize, flux: Vec3) {
        for (sum, flux) in self.sums[index].iter_mut().zip(flux.to_array()) {
            *sum += flux;
        }
    }

    fn add_area(&mut self, mesh: &Mesh) {
        // Clipped in parallel, summed in the order of triangles: the same sums for any number of threads.
        let pieces: Vec<Vec<(UVec3, f32)>> =
            (0..mesh.triangles.len()).into_par_iter().map(|triangle| self.clip(mesh.corners(triangle))).collect();
        for (triangle, pieces) in pieces.into_iter().enumerate() {
            let axis = dominant_axis(mesh.geometric_normal(triangle));
            for (cell, area) in pieces {
                for bin in [2 * axis, 2 * axis + 1] {
                    let index = self.index_of(cell, bin);
                    self.sums[index][3] += area;
                }
            }
        }
    }

    /// The cells that a triangle passes through and its area in each.
    fn clip(&self, corners: [Vec3; 3]) -> Vec<(UVec3, f32)> {
        let mut pieces = vec![(UVec3::ZERO, corners.map(|corner| (corner - self.origin) / self.cell_size).to_vec())];
        for axis in 0..3 {
            pieces = pieces.into_iter().flat_map(|(cell, polygon)| slice(cell, polygon, axis)).collect();
        }
        let square = self.cell_size * self.cell_size;
        pieces.into_iter().map(|(cell, polygon)| (cell.min(self.cells - 1), square * area(&polygon))).collect()
    }
}

/// Cuts a convex polygon into slabs of unit thickness along `axis`, each with its coordinate put into `cell`.
fn slice(cell: UVec3, polygon: Vec<Vec3>, axis: usize) -> Vec<(UVec3, Vec<Vec3>)> {
    let bounds = Aabb::from_points(polygon.iter().copied());
    let [first, last] = [bounds.min, bounds.max].map(|corner| corner[axis].max(0.0) as u32);
    let mut slabs = Vec::new();
    let mut rest = polygon;
    for slab in first..=last {
        let mut cell = cell;
        cell[axis] = slab;
        let (below, above) =
            if slab == last { (std::mem::take(&mut rest), Vec::new()) } else { split(&rest, axis, (slab + 1) as f32) };
        rest = above;
        if below.len() >= 3 {
            slabs.push((cell, below));
        }
    }
    slabs
}

/// The parts of a convex polygon below and above a plane across `axis`.
fn split(polygon: &[Vec3], axis: usize, plane: f32) -> (Vec<Vec3>, Vec<Vec3>) {
    let (mut below, mut above) = (Vec::new(), Vec::new());
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (to_a, to_b) = (a[axis] - plane, b[axis] - plane);
        if to_a <= 0.0 {
            below.push(a);
        }
        if to_a >= 0.0 {
            above.push(a);
        }
        if to_a * to_b < 0.0 {
            let crossing = a + (b - a) * (to_a / (to_a - to_b));
            below.push(crossing);
            above.push(crossing);
        }
    }
    (below, above)
}

fn area(polygon: &[Vec3]) -> f32 {
    let fan = polygon[1..].windows(2).map(|pair| (pair[0] - polygon[0]).cross(pair[1] - polygon[0]));
    0.5 * fan.sum::<Vec3>().length()
}
