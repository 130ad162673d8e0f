//! Direct light: irradiance from samples on the lights, with exact shadow rays. Mirrors `glsl/direct.frag`.
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

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use glam::{Vec3, Vec4};

use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::{Gpu, Program, Uniform};
use crate::points::{Accumulator, Interleave, Points, Subset};
use crate::random::{shuffled, sobol};
use crate::scene::{LightChoice, LightSample, Lights};
use crate::shaders::DirectVariant;

/// Side in pixels of the squares whose pixels have different samples.
const STRIDE: u32 = 4;

/// Most samples in one draw: `LIGHTS` in the shader.
const LIGHTS: usize = 32;
/// Most draws before a wait for the device.
const DRAWS: usize = 2;
/// Emitting triangles for each sample that shares a ray. One lamp of two triangles needs no choice.
const EMITTERS: usize = 4;
/// Samples by the tree that share a ray.
const TREE_SAMPLES: usize = 4;

/// Computes the irradiance from the lights at gather points.
pub struct Direct {
    gpu: Gpu,
    /// Compiled when the first scene needs them.
    programs: RefCell<HashMap<DirectVariant, Rc<Program>>>,
    seed: u64,
}

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

impl Direct {
    /// # Errors
    /// When the program does not compile.
    pub fn new(gpu: &Gpu, seed: u64) -> Result<Self> {
        let direct = Self { gpu: gpu.clone(), programs: RefCell::default(), seed: seed ^ 0xd1ec7 };
        direct.program(DirectVariant::default())?;
        Ok(direct)
    }

    fn program(&self, variant: DirectVariant) -> Result<Rc<Program>> {
        let known = self.programs.borrow().get(&variant).map(Rc::clone);
        known.map_or_else(
            || {
                let program = Rc::new(Program::new(&self.gpu, &variant.source())?);
                self.programs.borrow_mut().insert(variant, Rc::clone(&program));
                Ok(program)
            },
            Ok,
        )
    }

    /// The mean irradiance of a share of the samples at each of `points`, row by row.
    ///
    /// # Errors
    /// When the device has no memory left, the scene exceeds its limits, or its program does not compile.
    pub fn irradiance(&self, geometry: &Geometry, lights: &Lights, share: SampleShare, points: Points) -> Result<Vec<Vec3>> {
        let [irradiance, _] = self.light(geometry, lights, share, points)?;
        Ok(irradiance)
    }

    /// The same, and the radiance that the lobes of points with gloss reflect. Their irradiance is what passes the lobe. Without gloss the second is empty.
    ///
    /// # Errors
    /// As [`Self::irradiance`].
    pub fn light(&self, geometry: &Geometry, lights: &Lights, share: SampleShare, points: Points) -> Result<[Vec<Vec3>; 2]> {
        let outputs = if points.gloss.is_some() { 2 } else { 1 };
        if !lights.are_sampled() {
            let [width, height] = points.size();
            let dark = |output: usize| vec![Vec3::ZERO; if output < outputs { (width * height) as usize } else { 0 }];
            return Ok([dark(0), dark(1)]);
        }
        let (exact, are_chosen) = (lights.exact(), lights.are_chosen());
        let share = if are_chosen { share } else { SampleShare { samples: share.parts, ..share } };
        let tables = geometry.ray_tables()?;
        let (gloss, cut_outs) = (points.gloss.is_some(), geometry.cut_outs().is_some());
        let program = self.program(DirectVariant { punctual: lights.have_points(), gloss, cut_outs, many: false })?;
        let light_tables = geometry.light_tables(lights)?;
        let many = light_tables.as_ref().map(|tables| -> Result<_> {
            let program = self.program(DirectVariant { punctual: false, gloss, cut_outs, many: true })?;
            Ok((program, tables.uniforms()))
        });
        let many = many.transpose()?;
        let of_ray = if many.is_some() { TREE_SAMPLES } else { lights.pieces().div_ceil(EMITTERS).clamp(1, LIGHTS) };
        // The sum of each point is divided by the number of its samples. Exact ones count whole in each part.
        let samples = share.rays() * of_ray as u32;
        let exact: Vec<LightSample> =
            exact.into_iter().map(|sample| LightSample { weight: samples as f32 * sample.weight, ..sample }).collect();
        let in_draw = LIGHTS / of_ray * of_ray;
        let squares = Interleave::new(STRIDE, points.size(), self.seed);
        let sums = Accumulator::several(&self.gpu, squares.sums_size(), outputs)?;
        sums.clear();
        let mut draws = 0;
        let mut draw = |program: &Program, offset: [u32; 2], uniforms: &[(&'static str, Uniform)]| {
            sums.add(
                points.only(Subset { stride: STRIDE, offset }),
                program,
                &[uniforms, &tables.uniforms(), &geometry.uniforms()].concat(),
            );
            // Draws of few points are not measured, but their rays take long on slow devices.
            draws += 1;
            if draws % DRAWS == 0 {
                self.gpu.finish();
            }
        };
        for (x, y) in (0..STRIDE).flat_map(|y| (0..STRIDE).map(move |x| (x, y))) {
            // Lamps and environment share no ray: indoors nearly all rays would go to a sun that walls hide.
            let (mut numbers, mut lamps, mut sky) = (Vec::new(), Vec::new(), Vec::new());
            let places = are_chosen.then(|| share.places(rank([x, y]), of_ray as u32));
            for place in places.into_iter().flatten() {
                match self.choose(lights, place) {
                    LightChoice::Tree { numbers: [u, v], share } => numbers.push(Vec4::new(u, v, 1.0 / share, 0.0)),
                    LightChoice::Sample(sample) if sample.place.w > 0.0 => lamps.push(sample),
                    LightChoice::Sample(sample) => sky.push(sample),
                }
            }
            let common = |index: usize, count: usize, of_ray: usize| {
                [
                    ("sample_count", Uniform::Int(count as i32)),
                    ("ray_samples", Uniform::Int(of_ray as i32)),
                    // A point's choices are spread evenly over its rays, by multiples of the golden ratio.
                    ("choice", Uniform::Float((0.618_034 * (index * in_draw / of_ray) as f32).fract())),
                ]
            };
            for (index, batch) in numbers.chunks(in_draw).enumerate() {
                let (program, uniforms) = many.as_ref().expect("a tree has its tables");
                let own = [("lamp_numbers", Uniform::Vec4s(batch))];
                draw(program, [x, y], &[&own[..], &common(index, batch.len(), of_ray), uniforms].concat());
            }
            let chosen =
                lamps.chunks(in_draw).chain(sky.chunks(in_draw)).enumerate().map(|(index, batch)| (index, batch, of_ray));
            for (index, batch, of_ray) in chosen.chain(exact.chunks(LIGHTS).map(|batch| (0, batch, 1))) {
                let each = |value: fn(&LightSample) -> Vec4| batch.iter().map(value).collect::<Vec<_>>();
                let places = each(|sample| sample.place);
                let normals = each(|sample| sample.normal.extend(sample.cone[0]));
                let weights = each(|sample| sample.weight.extend(sample.cone[1]));
                let own = [
                    ("light_places", Uniform::Vec4s(&places)),
                    ("light_normals", Uniform::Vec4s(&normals)),
                    ("light_weights", Uniform::Vec4s(&weights)),
                ];
                draw(&program, [x, y], &[&own[..], &common(index, batch.len(), of_ray)].concat());
            }
        }
        let mean = 1.0 / samples as f32;
        let mut all = sums.read_all().map(|sums| squares.in_order(sums).into_iter().map(|sum| mean * sum.truncate()).collect());
        Ok([all.next().unwrap_or_default(), all.next().unwrap_or_default()])
    }

    fn choose(&self, lights: &Lights, place: u32) -> LightChoice {
        // The sub-pixel offsets of blocks use the same sequence. Without the shuffle, blocks of one light sample each would always pair the same part
        // of the pixel with the same part of the light.
        lights.choose(sobol(shuffled(place, self.seed), self.seed))
    }
}

/// The rank of a pixel of a square, in Morton order: each quarter of a square has a run of ranks, so its pixels too are spread evenly together.
fn rank([x, y]: [u32; 2]) -> u32 {
    (0..STRIDE.ilog2()).map(|bit| (x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1)).sum()
}
