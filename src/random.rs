//! Pseudo-random and low-discrepancy numbers. They depend on a seed and an index alone, so work can be split in any way.

/// A stream of independent uniform numbers (SplitMix64; Steele, Lea, Flood 2014, "Fast splittable pseudorandom number generators").
#[derive(Clone, Debug)]
pub struct Random {
    state: u64,
}

impl Random {
    /// The stream of `index` under `seed`. Streams of different indices are independent.
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

/// An additive recurrence, a low-discrepancy sequence in `D` dimensions: point i is the fractional part of offset + i α, with the generalised
/// golden ratios as α (Roberts 2018, "The unreasonable effectiveness of quasirandom sequences"). D = 2 is R2.
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
        // 64-bit fixed point wraps around by itself. It is as exact for the billionth point as for the first.
        let alpha = std::array::from_fn(|k| (root.powi(-(k as i32) - 1) * 2f64.powi(64)) as u64);
        Self { alpha, offset: std::array::from_fn(|_| random.bits()) }
    }

    /// Point `index`, each coordinate in [0, 1).
    pub fn point(&self, index: u64) -> [f32; D] {
        std::array::from_fn(|k| unit(self.offset[k].wrapping_add(index.wrapping_mul(self.alpha[k]))))
    }
}

/// Point `index` of the first two Sobol dimensions, each Owen-scrambled (the hash of Burley 2020, "Practical hash-based Owen scrambling").
pub fn sobol(index: u32, seed: u64) -> [f32; 2] {
    // The first dimension reverses the bits. The second has the direction numbers of x + 1: a column is the previous one xor itself shifted by 1.
    let mut second = 0u32;
    let mut column = 1u32 << 31;
    for bit in 0..32 {
        if index >> bit & 1 == 1 {
            second ^= column;
        }
        column ^= column >> 1;
    }
    let keys = mix(seed ^ 0x0b5e_55ed);
    // The hash works on reversed bits. The first dimension is the reversed index, so there the two reversals cancel.
    let scramble = |reversed: u32, key: u32| unit(u64::from(owen_hash(reversed, key).reverse_bits()) << 32);
    [scramble(index, keys as u32), scramble(second.reverse_bits(), (keys >> 32) as u32)]
}

/// Shuffles indices (Burley 2020). Aligned runs of a power of two map to such runs, so sequences stay even, but two of them do not correlate.
pub fn shuffled(index: u32, seed: u64) -> u32 {
    owen_hash(index.reverse_bits(), mix(seed ^ 0x5f1e) as u32).reverse_bits()
}

/// Point `number` of the sequence `key`, uniform in [0, 1). An aligned run of a power of two has one point in each of as many equal parts. Sequences of
/// different keys are independent of each other and of [`sobol`]: it is van der Corput's sequence, shuffled as in [`shuffled`].
/// `glsl/include/opacity.glsl` has a twin.
pub fn stratified(number: u32, key: u32) -> f32 {
    unit(u64::from(owen_hash(number.reverse_bits(), key)) << 32)
}

/// A bijection of 32-bit integers, as `mix` is of longer ones (Wellons 2018, "Prospecting for hash functions"). `glsl/include/opacity.glsl` has a twin.
pub fn hash(mut bits: u32) -> u32 {
    bits = (bits ^ (bits >> 16)).wrapping_mul(0x7feb_352d);
    bits = (bits ^ (bits >> 15)).wrapping_mul(0x846c_a68b);
    bits ^ (bits >> 16)
}

/// The permutation of Laine and Karras, which scrambles each bit by the bits below it.
fn owen_hash(mut x: u32, key: u32) -> u32 {
    x = x.wrapping_add(key);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^ x.wrapping_mul(0x8d22_f6e6)
}

/// A discrete distribution: slots with probabilities in proportion to weights.
#[derive(Clone, Debug)]
pub struct Distribution {
    /// For each slot, the probability of it and all slots before it.
    cumulative: Vec<f32>,
}

impl Distribution {
    pub fn new(weights: Vec<f64>) -> Self {
        let total: f64 = weights.iter().sum();
        let mut sum = 0.0;
        let add = |weight: f64| {
            sum += weight / total;
            sum as f32
        };
        Self { cumulative: weights.into_iter().map(add).collect() }
    }

    /// Picks a slot by a uniform number. Returns the slot, a new uniform number from the rest of the given one, and the slot's probability.
    pub fn pick(&self, number: f32) -> (usize, f32, f32) {
        let slot = self.cumulative.partition_point(|&sum| sum <= number).min(self.cumulative.len() - 1);
        let before = if slot == 0 { 0.0 } else { self.cumulative[slot - 1] };
        let probability = self.cumulative[slot] - before;
        (slot, ((number - before) / probability).clamp(0.0, 1.0), probability)
    }
}

/// The upper 24 bits as a number in [0, 1). An f32 holds 24 bits exactly.
fn unit(bits: u64) -> f32 {
    (bits >> 40) as f32 / (1u64 << 24) as f32
}

/// A bijection of 64-bit integers. Every input bit changes every output bit with probability near 1/2.
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shuffled_indices_stay_in_runs_and_go_their_own_way() {
        for (seed, run) in [(1, 0), (2, 64), (3, 1024)] {
            let mut found: Vec<u32> = (run..run + 64).map(|index| shuffled(index, seed)).collect();
            found.sort_unstable();
            assert!(found[0].is_multiple_of(64) && found.windows(2).all(|pair| pair[1] == pair[0] + 1), "{found:?}");
            // Points of the two sequences lie in the same half about half of the time.
            let half = |index| sobol(index, seed)[0] < 0.5;
            let other = |index| sobol(index, seed ^ 0xd1ec7)[0] < 0.5;
            let together = |order: &dyn Fn(u32) -> u32| (0..1024).filter(|&i| half(i) == other(order(i))).count();
            assert!((400..624).contains(&together(&|i| shuffled(i, seed))), "{}", together(&|i| shuffled(i, seed)));
            assert!([0, 1024].contains(&together(&|i| i)), "without it there is nothing to mend");
        }
    }
}
