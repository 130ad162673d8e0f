//! Global directions: uniform on the sphere, each shared by all gather points (Szirmay-Kalos 1998, "Global ray-bundle tracing").
//!
//! [`Directions::get`] maps a point (u, v) of a sequence on the unit square to z = 1 - 2u, φ = 2πv, which preserves area. Each direction also has a
//! random rotation and shift of its projection plane, so that aliasing of the layers averages out.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use crate::random::{Random, Recurrence, sobol};
use crate::settings::Sequence;

/// A seeded sequence of directions.
pub struct Directions {
    sequence: Sequence,
    seed: u64,
    r2: Recurrence<2>,
}

/// One direction of a sequence.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Direction {
    /// Unit vector from a gather point towards the surfaces that it sees.
    pub vector: Vec3,
    /// Rotation of the projection plane in [0, 2π).
    pub turn: f32,
    /// Shift of the projection plane in texels, each in [0, 1).
    pub shift: Vec2,
    /// Its place in the sequence, by which partly opaque surfaces stop it or let it pass.
    pub number: u32,
}

impl Directions {
    pub fn new(sequence: Sequence, seed: u64) -> Self {
        Self { sequence, seed, r2: Recurrence::new(seed) }
    }

    /// Direction `index`. It does not depend on the directions that were asked for before.
    pub fn get(&self, index: u32) -> Direction {
        let mut random = Random::new(self.seed, u64::from(index));
        let [u, v] = match self.sequence {
            Sequence::Random => [random.uniform(), random.uniform()],
            Sequence::R2 => self.r2.point(index.into()),
            Sequence::Sobol => sobol(index, self.seed),
        };
        Direction {
            vector: sphere(u, v),
            turn: TAU * random.uniform(),
            shift: Vec2::new(random.uniform(), random.uniform()),
            number: index,
        }
    }
}

/// The point of the unit sphere at (u, v) in [0, 1)².
fn sphere(u: f32, v: f32) -> Vec3 {
    let z = 1.0 - 2.0 * u;
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (TAU * v).sin_cos();
    Vec3::new(radius * cos, radius * sin, z)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEQUENCES: [Sequence; 3] = [Sequence::Random, Sequence::R2, Sequence::Sobol];

    #[test]
    fn moments_are_those_of_the_uniform_sphere() {
        // E[d] = 0 and E[d dᵀ] = I/3. With N independent directions, a component of the mean has a standard error of 0.58/√N, and one of the second
        // moment less than 0.3/√N. Chance does not reach five standard errors.
        const N: u32 = 4096;
        let bound = 5.0 * 0.58 / (N as f32).sqrt();
        for sequence in SEQUENCES {
            for seed in 0..4 {
                let directions = Directions::new(sequence, seed);
                let vectors: Vec<Vec3> = (0..N).map(|i| directions.get(i).vector).collect();
                let mean = vectors.iter().sum::<Vec3>() / N as f32;
                let squares = vectors.iter().map(|v| v * v).sum::<Vec3>() / N as f32;
                assert!(mean.abs().max_element() < bound, "{sequence:?}: mean {mean}");
                assert!((squares - 1.0 / 3.0).abs().max_element() < bound, "{sequence:?}: second moment {squares}");
                assert!(vectors.iter().all(|v| (v.length() - 1.0).abs() < 1e-6));
            }
        }
    }

    #[test]
    fn low_discrepancy_sequences_fill_strata_evenly() {
        // 1024 Sobol points have exactly one in each of 32 x 32 elementary squares. R2 points have 16 ± 2 in each of 8 x 8 squares.
        let mut counts = vec![0; 1024];
        for i in 0..1024 {
            let [u, v] = sobol(i, 7);
            counts[(u * 32.0) as usize * 32 + (v * 32.0) as usize] += 1;
        }
        assert!(counts.iter().all(|&count| count == 1), "{counts:?}");
        let r2 = Recurrence::<2>::new(7);
        let mut counts = [0_i32; 64];
        for i in 0..1024 {
            let [u, v] = r2.point(i);
            counts[(u * 8.0) as usize * 8 + (v * 8.0) as usize] += 1;
        }
        assert!(counts.iter().all(|&count| (count - 16).abs() <= 2), "{counts:?}");
    }

    #[test]
    fn seeds_and_indices_give_different_directions() {
        for sequence in SEQUENCES {
            let (a, b) = (Directions::new(sequence, 1), Directions::new(sequence, 2));
            assert_eq!(a.get(5), a.get(5));
            assert_ne!(a.get(5).vector, b.get(5).vector, "{sequence:?}");
            assert_ne!(a.get(5).vector, a.get(6).vector, "{sequence:?}");
            assert_ne!(a.get(5).turn, a.get(6).turn, "{sequence:?}");
        }
    }
}
