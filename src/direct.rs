//! Direct light: irradiance from samples on the lights, with exact shadow rays. On a GPU by a shader
//! (`on_gl.rs`), with a software driver by the program itself (`on_cpu.rs`).
//!
//! E(x) = 1/S Σ L A/p cos θ cos θ' / r² V over S samples of the area lights. A bright part of the environment has no distance: there the term is
//! L Ω/p cos θ V. A point or spot has an intensity I and no area: I/p cos θ c / r² V, where c is the share of it in this direction.
//!
//! Of many lamps most are far, and rays to them would be wasted. So several samples share a ray: a point casts it to one of them, chosen by the light
//! that it would bring, and what the ray finds counts for all. The mean is the same (Talbot, Cline and Egbert 2005, "Importance resampling for global
//! illumination").
//!
//! Of very many lamps few samples by power matter at a point. So each point chooses its samples itself, by a [tree](crate::scene::LightTree) over the
//! lamps, and fewer of them share a ray.
//!
//! Samples are points of one Sobol' sequence, of which each pixel of a square of 4 × 4 takes a run of its own. So neighbours have different samples,
//! a soft shadow has fine grain and no bands, and a square together has sixteen times the samples of a point.

mod on_cpu;
mod on_gl;

use crate::random::{shuffled, sobol};
use crate::scene::{LightChoice, LightSample, Lights};

pub use on_cpu::direct_light_on_cpu;
pub use on_gl::Direct;

/// Side in pixels of the squares whose pixels have different samples.
pub const STRIDE: u32 = 4;
/// Most samples in a batch: `LIGHTS` in the shader.
const LIGHTS: usize = 32;
/// Emitting triangles for each sample that shares a ray. One lamp of two triangles needs no choice.
const EMITTERS: usize = 4;
/// Samples by the tree that share a ray.
const TREE_SAMPLES: usize = 4;
/// Multiples of the golden ratio fill the unit interval evenly.
const GOLDEN: f32 = 0.618_034;

/// A part of the samples of each point. All parts together cover the lights evenly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleShare {
    /// Number of shadow rays of a point, in all parts.
    pub samples: u32,
    pub part: u32,
    pub parts: u32,
}

impl SampleShare {
    /// All samples in one part.
    pub fn whole(samples: u32) -> Self {
        Self { samples, part: 0, parts: 1 }
    }

    /// Rays of a point in each part.
    fn rays(self) -> u32 {
        self.samples.div_ceil(self.parts)
    }

    /// Places in the sequence for a square's pixel of this rank, `of_ray` for each ray. Aligned runs of a power of two are spread evenly.
    fn places(self, rank: u32, of_ray: u32) -> impl Iterator<Item = u32> {
        let each = self.rays() * of_ray;
        let run = u64::from(each) * u64::from(self.parts);
        let first = u64::from(rank) * run.next_power_of_two() + u64::from(self.part) * u64::from(each);
        // After 2^32 places the sequence begins anew.
        (first..first + u64::from(each)).map(|place| place as u32)
    }
}

/// Which samples points have.
struct SamplePlan<'a> {
    lights: &'a Lights,
    share: SampleShare,
    seed: u64,
    /// Samples that share a ray.
    of_ray: usize,
    /// The exact ones.
    exact: Vec<LightSample>,
}

/// Samples of all points of a subset.
struct LightBatch {
    samples: BatchSamples,
    of_ray: usize,
    /// In [0, 1): to which of its samples the first ray goes.
    choice: f32,
}

enum BatchSamples {
    /// Uniform numbers, and the factor of each sample. Each point chooses its lamps by the tree.
    Tree(Vec<[f32; 3]>),
    Chosen(Vec<LightSample>),
}

impl<'a> SamplePlan<'a> {
    fn new(lights: &'a Lights, share: SampleShare, seed: u64) -> Self {
        let share = if lights.are_chosen() { share } else { SampleShare { samples: share.parts, ..share } };
        let of_ray = match lights.tree() {
            Some(_) => TREE_SAMPLES,
            None => lights.pieces().div_ceil(EMITTERS).clamp(1, LIGHTS),
        };
        let mut plan = Self { lights, share, seed: seed ^ 0xd1ec7, of_ray, exact: Vec::new() };
        // The sum of each point is divided by the number of its samples. Exact ones count whole in each part.
        let whole = |sample: LightSample| LightSample { weight: plan.samples() as f32 * sample.weight, ..sample };
        plan.exact = lights.exact().into_iter().map(whole).collect();
        plan
    }

    /// The number of samples by which the sum of a point is divided.
    fn samples(&self) -> u32 {
        self.share.rays() * self.of_ray as u32
    }

    /// Those of the pixels at this offset in their square.
    fn batches(&self, offset: [u32; 2]) -> Vec<LightBatch> {
        // Lamps and environment share no ray: indoors nearly all rays would go to a sun that walls hide.
        let (mut numbers, mut lamps, mut sky) = (Vec::new(), Vec::new(), Vec::new());
        let places = self.lights.are_chosen().then(|| self.share.places(rank(offset), self.of_ray as u32));
        for place in places.into_iter().flatten() {
            // The sub-pixel offsets of blocks use the same sequence. Without the shuffle, blocks of one light sample each would always pair the same
            // part of the pixel with the same part of the light.
            match self.lights.choose(sobol(shuffled(place, self.seed), self.seed)) {
                LightChoice::Tree { numbers: [u, v], share } => numbers.push([u, v, 1.0 / share]),
                LightChoice::Sample(sample) if sample.place.w > 0.0 => lamps.push(sample),
                LightChoice::Sample(sample) => sky.push(sample),
            }
        }
        let in_batch = LIGHTS / self.of_ray * self.of_ray;
        // A point's choices are spread evenly over its rays, by multiples of the golden ratio.
        let batch = |(index, samples)| LightBatch {
            samples,
            of_ray: self.of_ray,
            choice: (GOLDEN * (index * in_batch / self.of_ray) as f32).fract(),
        };
        let chosen = lamps.chunks(in_batch).chain(sky.chunks(in_batch)).map(|samples| BatchSamples::Chosen(samples.to_vec()));
        let by_tree = numbers.chunks(in_batch).map(|numbers| BatchSamples::Tree(numbers.to_vec()));
        let exact = self.exact.chunks(LIGHTS);
        let exact = exact.map(|samples| LightBatch { samples: BatchSamples::Chosen(samples.to_vec()), of_ray: 1, choice: 0.0 });
        by_tree.enumerate().chain(chosen.enumerate()).map(batch).chain(exact).collect()
    }
}

/// The offsets of all pixels of a square.
fn offsets() -> impl Iterator<Item = [u32; 2]> {
    (0..STRIDE).flat_map(|y| (0..STRIDE).map(move |x| [x, y]))
}

/// The rank of a pixel of a square, in Morton order: each quarter of a square has a run of ranks, so its pixels too are spread evenly together.
fn rank([x, y]: [u32; 2]) -> u32 {
    (0..STRIDE.ilog2()).map(|bit| (x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1)).sum()
}
