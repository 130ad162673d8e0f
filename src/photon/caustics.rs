//! Caustics: light that mirrors and glass throw on diffuse surfaces, estimated at the points themselves.
//!
//! A grid's cell is far too coarse for the edge of a caustic. E(x) = Σ Φ k(r) over the photons on x's side of its surface within a disc of
//! radius R, k(r) = 2/(πR²) (1 - r²/R²). Photons are traced afresh for each block of a picture and R falls from block to block, slowly enough
//! that noise and blur of their mean both vanish (Knaus and Zwicker 2011, "Progressive photon mapping: a probabilistic approach").

use std::collections::HashMap;
use std::f32::consts::PI;
use std::ops::Range;

use glam::{IVec3, Vec3};

/// The first block's radius, in unit space: the sharpest that a million photons bear.
const RADIUS: f32 = 0.02;
/// Of what a smaller radius costs in noise, how much more photons make up for: what Knaus and Zwicker recommend.
const ALPHA: f32 = 2.0 / 3.0;
/// How far off the disc's plane a photon may lie, in radii: surfaces bend, and what stands on them is another surface.
const THICKNESS: f32 = 0.25;

/// What one photon brings to a diffuse surface by way of mirrors and glass alone.
#[derive(Clone, Copy, Debug)]
pub struct CausticPhoton {
    pub position: Vec3,
    /// Unit normal of the side that it met.
    pub side: Vec3,
    pub flux: Vec3,
}

/// The photons of one block.
pub struct CausticMap {
    radius: f32,
    /// Cell by cell, the cells two radii wide.
    photons: Vec<CausticPhoton>,
    cells: HashMap<IVec3, Range<usize>>,
}

impl CausticMap {
    /// With the radius of block `block`.
    pub fn new(mut photons: Vec<CausticPhoton>, block: u32) -> Self {
        let shrink: f32 = (1..=block).map(|i| (i as f32 - 1.0 + ALPHA) / i as f32).product();
        let radius = RADIUS * shrink.sqrt();
        let cell = |photon: &CausticPhoton| cell_of(photon.position, radius);
        photons.sort_by_key(|photon| cell(photon).to_array());
        let mut cells = HashMap::new();
        let mut first = 0;
        for run in photons.chunk_by(|a, b| cell(a) == cell(b)) {
            cells.insert(cell(&run[0]), first..first + run.len());
            first += run.len();
        }
        Self { radius, photons, cells }
    }

    /// At a point of a surface with this unit normal.
    pub fn irradiance(&self, position: Vec3, normal: Vec3) -> Vec3 {
        let [low, high] = [-self.radius, self.radius].map(|reach| cell_of(position + reach, self.radius));
        let squared_radius = self.radius * self.radius;
        let mut sum = Vec3::ZERO;
        for corner in 0..8 {
            let cell = IVec3::from_array([0, 1, 2].map(|axis| if corner >> axis & 1 == 1 { high[axis] } else { low[axis] }));
            let Some(range) = self.cells.get(&cell) else { continue };
            for photon in &self.photons[range.clone()] {
                let offset = photon.position - position;
                let squared = offset.length_squared();
                let beside = squared < squared_radius && offset.dot(normal).abs() < THICKNESS * self.radius;
                if beside && photon.side.dot(normal) > 0.0 {
                    sum += photon.flux * (1.0 - squared / squared_radius);
                }
            }
        }
        sum * 2.0 / (PI * squared_radius)
    }
}

fn cell_of(position: Vec3, radius: f32) -> IVec3 {
    (position / (2.0 * radius)).floor().as_ivec3()
}
