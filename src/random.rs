//! Numbers that look random and depend on nothing but a seed and an index, so that work may be split in any way.

/// A stream of independent uniform numbers (SplitMix64; Steele, Lea, Flood 2014, "Fast splittable pseudorandom number
/// generators").
#[derive(Clone, Debug)]
pub struct Random {
    state: u64,
}

impl Random {
    /// The stream of `index` under `seed`; streams of different indices are unrelated.
    pub fn new(seed: u64, index: u64) -> Self {
        Self { state: mix(seed ^ mix(index.wrapping_add(0x9e37_79b9_7f4a_7c15))) }
    }

    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.state)
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f32 {
        unit(self.bits())
    }
}

/// An additive recurrence: point i is the fractional part of (offset + i α), a low-discrepancy sequence in `D` dimensions with
/// the generalised golden ratios as α (Roberts 2018, "The unreasonable effectiveness of quasirandom sequences"). D = 2 is R2.
#[derive(Clone, Debug)]
pub struct Recurrence<const D: usize> {
    alpha: [u64; D],
    offset: [u64; D],
}

impl<const D: usize> Recurrence<D> {
    /// `seed` shifts the whole sequence, modulo 1 in each dimension.
    pub fn new(seed: u64) -> Self {
        // The root of x^(D + 1) = x + 1, by fixed-point iteration.
        let mut root = 1.5_f64;
        for _ in 0..64 {
            root = (1.0 + root).powf(1.0 / (D as f64 + 1.0));
        }
        let mut random = Random::new(seed, 0);
        // 64-bit fixed point wraps by itself and is as exact for the billionth point as for the first.
        let alpha = std::array::from_fn(|k| (root.powi(-(k as i32) - 1) * 2f64.powi(64)) as u64);
        Self { alpha, offset: std::array::from_fn(|_| random.bits()) }
    }

    /// Point `index`, each coordinate in [0, 1).
    pub fn point(&self, index: u64) -> [f32; D] {
        std::array::from_fn(|k| unit(self.offset[k].wrapping_add(index.wrapping_mul(self.alpha[k]))))
    }
}

/// The upper 24 bits as a number in [0, 1); all of them are representable in an f32.
pub fn unit(bits: u64) -> f32 {
    (bits >> 40) as f32 / (1u64 << 24) as f32
}

/// A bijection of 64-bit integers in which every input bit changes every output bit with probability near 1/2.
pub fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
