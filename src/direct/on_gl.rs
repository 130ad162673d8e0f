//! Direct light by a shader. Mirrors `glsl/direct.frag`.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use glam::{Vec3, Vec4};

use super::{BatchSamples, LightBatch, STRIDE, SamplePlan, SampleShare, offsets};
use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::{Gpu, Program, Uniform};
use crate::points::{Accumulator, Interleave, Points, Subset};
use crate::scene::{LightSample, Lights};
use crate::shaders::DirectVariant;

/// Most draws before a wait for the device.
const DRAWS: usize = 2;

/// Computes the irradiance from the lights at gather points.
pub struct Direct {
    gpu: Gpu,
    /// Compiled when the first scene needs them.
    programs: RefCell<HashMap<DirectVariant, Rc<Program>>>,
    seed: u64,
}

impl Direct {
    /// # Errors
    /// When the program does not compile.
    pub fn new(gpu: &Gpu, seed: u64) -> Result<Self> {
        let direct = Self { gpu: gpu.clone(), programs: RefCell::default(), seed };
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
        let plan = SamplePlan::new(lights, share, self.seed);
        let tables = geometry.ray_tables()?;
        let (gloss, cut_outs) = (points.gloss.is_some(), geometry.cut_outs().is_some());
        let program = self.program(DirectVariant { punctual: lights.have_points(), gloss, cut_outs, many: false })?;
        let light_tables = geometry.light_tables(lights)?;
        let many = light_tables.as_ref().map(|tables| -> Result<_> {
            let program = self.program(DirectVariant { punctual: false, gloss, cut_outs, many: true })?;
            Ok((program, tables.uniforms()))
        });
        let many = many.transpose()?;
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
        for offset in offsets() {
            for LightBatch { samples, of_ray, choice } in plan.batches(offset) {
                let common = |count: usize| {
                    [
                        ("sample_count", Uniform::Int(count as i32)),
                        ("ray_samples", Uniform::Int(of_ray as i32)),
                        ("choice", Uniform::Float(choice)),
                    ]
                };
                match samples {
                    BatchSamples::Tree(numbers) => {
                        let (program, uniforms) = many.as_ref().expect("a tree has its tables");
                        let numbers: Vec<Vec4> = numbers.iter().map(|&[u, v, factor]| Vec4::new(u, v, factor, 0.0)).collect();
                        let own = [("lamp_numbers", Uniform::Vec4s(&numbers))];
                        draw(program, offset, &[&own[..], &common(numbers.len()), uniforms].concat());
                    }
                    BatchSamples::Chosen(samples) => {
                        let each = |value: fn(&LightSample) -> Vec4| samples.iter().map(value).collect::<Vec<_>>();
                        let places = each(|sample| sample.place);
                        let normals = each(|sample| sample.normal.extend(sample.cone[0]));
                        let weights = each(|sample| sample.weight.extend(sample.cone[1]));
                        let own = [
                            ("light_places", Uniform::Vec4s(&places)),
                            ("light_normals", Uniform::Vec4s(&normals)),
                            ("light_weights", Uniform::Vec4s(&weights)),
                        ];
                        draw(&program, offset, &[&own[..], &common(samples.len())].concat());
                    }
                }
            }
        }
        let mean = 1.0 / plan.samples() as f32;
        let mut all = sums.read_all().map(|sums| squares.in_order(sums).into_iter().map(|sum| mean * sum.truncate()).collect());
        Ok([all.next().unwrap_or_default(), all.next().unwrap_or_default()])
    }
}
