//! Caustics: light that reaches diffuse surfaces by mirrors and glass alone. It is estimated at the gather points.
//!
//! Cells of the grid are too coarse for the edge of a caustic. Instead, E(x) = Σ Φ k(r) over the photons within a disc of radius R on x's side of
//! the surface, with k(r) = 2/(πR²) (1 - r²/R²). Each block of a picture traces new photons. R falls from block to block, so slowly that both
//! noise and blur of the mean vanish (Knaus and Zwicker 2011, "Progressive photon mapping: a probabilistic approach").

use std::collections::HashMap;
use std::f32::consts::PI;
use std::ops::Range;

use glam::{IVec3, Vec3};

/// The first block's radius, in unit space. With a million photons, a smaller one is too noisy.
const RADIUS: f32 = 0.02;
/// Rate at which the radius falls, as Knaus and Zwicker recommend: 1 keeps the radius, a lower rate gives less blur and more noise.
const ALPHA: f32 = 2.0 / 3.0;
/// Greatest distance of a photon from the disc's plane, in radii. Surfaces may bend, but objects on the surface must not count.
const THICKNESS: f32 = 0.25;

/// A photon that reached a diffuse surface by mirrors and glass alone.
#[derive(Clone, Copy, Debug)]
pub struct CausticPhoton {
    pub position: Vec3,
    /// Unit normal of the side that the photon hit.
    pub side: Vec3,
    /// Unit vector along which it came.
    pub direction: Vec3,
    pub flux: Vec3,
}

/// The photons of one block.
pub struct CausticMap {
    radius: f32,
    /// Sorted by cells, which are two radii wide.
    photons: Vec<CausticPhoton>,
    cells: HashMap<IVec3, Range<usize>>,
}

impl CausticMap {
    /// The map of block `block`, with its radius.
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

    /// Irradiance at a point of a surface with this unit normal.
    pub fn irradiance(&self, position: Vec3, normal: Vec3) -> Vec3 {
        let [irradiance] = self.weighted(position, normal, |_| [Vec3::ONE]);
        irradiance
    }

    /// Sums of irradiance there, with weights by the unit vector to where the light comes from.
    pub fn weighted<const N: usize>(&self, position: Vec3, normal: Vec3, weights: impl Fn(Vec3) -> [Vec3; N]) -> [Vec3; N] {
        let [low, high] = [-self.radius, self.radius].map(|reach| cell_of(position + reach, self.radius));
        let squared_radius = self.radius * self.radius;
        let mut sums = [Vec3::ZERO; N];
        for corner in 0..8 {
            let cell = IVec3::from_array([0, 1, 2].map(|axis| if corner >> axis & 1 == 1 { high[axis] } else { low[axis] }));
            let Some(range) = self.cells.get(&cell) else { continue };
            for photon in &self.photons[range.clone()] {
                let offset = photon.position - position;
                let squared = offset.length_squared();
                let beside = squared < squared_radius && offset.dot(normal).abs() < THICKNESS * self.radius;
                if beside && photon.side.dot(normal) > 0.0 {
                    let flux = photon.flux * (1.0 - squared / squared_radius);
                    let weights = weights(-photon.direction);
                    sums.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += flux * weight);
                }
            }
        }
        sums.map(|sum| sum * 2.0 / (PI * squared_radius))
    }
}

fn cell_of(position: Vec3, radius: f32) -> IVec3 {
    (position / (2.0 * radius)).floor().as_ivec3()
}
