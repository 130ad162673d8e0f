//! Gathers irradiance from the photon map, by any pipeline. Mirrors `glsl/consumer/irradiance.glsl`.
//!
//! [`Pipeline::Raycast`] uses no shader: the oracle finds hits and looks up their radiance. So drivers add no rounding, such as that of their
//! texture decoding (6e-5 of a textured picture's mean on llvmpipe).

use std::rc::Rc;

use glam::Vec4;
use rayon::prelude::*;

use super::{GatherPass, HitFinder, MissRadiance, hit_finder, shader_of};
use crate::direction::Direction;
use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::Gpu;
use crate::photon::PhotonTexture;
use crate::points::{Accumulator, GatherPoint, Interleave, Points};
use crate::reference::Reference;
use crate::scene::{Bvh, Scene};
use crate::settings::{Pipeline, Settings};
use crate::shaders::{Consumer, HitRadiance};

/// Inputs of [`IrradianceGather::add`].
#[derive(Clone, Copy)]
pub struct GatherInputs<'a> {
    /// In unit space.
    pub scene: &'a Scene,
    pub geometry: &'a Geometry,
    pub photons: &'a PhotonTexture,
    /// Of the same scene and photons.
    pub oracle: Reference<'a>,
    pub points: Points<'a>,
}

/// Sums over directions at each point. rgb: Σ radiance × weight; a: Σ weight.
pub struct IrradianceGather {
    interleave: Interleave,
    method: Method,
}

enum Method {
    Shader {
        finder: Box<dyn HitFinder>,
        pass: GatherPass,
        sums: Accumulator,
    },
    /// Points and sums are row by row from the bottom.
    Oracle {
        points: Vec<Option<GatherPoint>>,
        sums: Vec<Vec4>,
    },
}

impl IrradianceGather {
    /// Uses the settings' pipeline, its photon map, and point textures of `interleave`. `scene` is in unit space, `bvh` of its mesh.
    ///
    /// # Errors
    /// When a size is beyond the device's limits.
    pub fn new(gpu: &Gpu, settings: &Settings, scene: &Scene, bvh: &Rc<Bvh>, interleave: Interleave) -> Result<Self> {
        let method = match settings.gather.pipeline {
            Pipeline::Raycast => Method::Oracle { points: Vec::new(), sums: Vec::new() },
            pipeline => {
                // The finder comes last: it adapts to the memory that is left.
                let sums = Accumulator::new(gpu, interleave.sums_size())?;
                let radiance = HitRadiance { source: settings.photons.map.into(), textured: scene.is_textured() };
                let pass = GatherPass::new(gpu, shader_of(pipeline, scene), Consumer::Irradiance(radiance))?;
                Method::Shader {
                    finder: hit_finder(gpu, &settings.gather, settings.layers(), scene, bvh, interleave.tile())?,
                    pass,
                    sums,
                }
            }
        };
        Ok(Self { interleave, method })
    }

    /// The most directions in a batch.
    pub fn batch(&self) -> usize {
        match &self.method {
            Method::Shader { finder, .. } => finder.batch(),
            Method::Oracle { .. } => 1,
        }
    }

    /// As [`HitFinder::both_ends`].
    pub fn both_ends(&self) -> bool {
        matches!(&self.method, Method::Shader { finder, .. } if finder.both_ends())
    }

    /// As [`HitFinder::shrink`].
    pub fn shrink(&mut self) -> bool {
        match &mut self.method {
            Method::Shader { finder, .. } => finder.shrink(),
            Method::Oracle { .. } => false,
        }
    }

    /// Clears the sums. `points` are all points, row by row from the bottom; layers and the oracle ask for them.
    pub fn begin(&mut self, points: impl Fn() -> Vec<Option<GatherPoint>>) {
        match &mut self.method {
            Method::Shader { finder, sums, .. } => {
                finder.fit(&|| points().into_iter().flatten().map(|point| point.position).collect());
                sums.clear();
            }
            Method::Oracle { points: places, sums } => {
                *places = points();
                *sums = vec![Vec4::ZERO; places.len()];
            }
        }
    }

    /// Gathers along `directions` at the points of one subset. Returns the most layers peeled for a direction, 0 when the pipeline peels none.
    ///
    /// # Errors
    /// [`crate::Error::Gl`] when the device is too small for the scene.
    pub fn add(&mut self, inputs: GatherInputs, directions: &[Direction]) -> Result<u32> {
        let GatherInputs { scene, geometry, photons, oracle, points } = inputs;
        let (mut most, mut left) = (0, directions);
        match &mut self.method {
            Method::Shader { finder, pass, sums } => {
                while !left.is_empty() {
                    let begun = finder.begin(geometry, &left[..left.len().min(finder.batch())])?;
                    let (batch, later) = left.split_at(begun);
                    let miss = MissRadiance::new(scene, batch);
                    let found = finder.find(geometry, points)?;
                    let uniforms = [&geometry.uniforms()[..], &photons.uniforms(), &miss.uniforms()].concat();
                    pass.add(&found, points, sums, &uniforms);
                    (most, left) = (most.max(found.layers), later);
                }
            }
            // The outer loop is over directions, so that neighbouring rays are parallel.
            Method::Oracle { points: places, sums } => directions.iter().for_each(|direction| {
                let cast = |(i, (point, sum)): (usize, (&Option<GatherPoint>, &mut Vec4))| match point {
                    Some(point) if self.interleave.subset_of(i) == points.subset => {
                        *sum += oracle.sample(point, direction.vector, direction.number).as_vec4();
                    }
                    _ => {}
                };
                places.par_iter().zip(sums.par_iter_mut()).enumerate().for_each(cast);
            }),
        }
        Ok(most)
    }

    /// The sums, row by row from the bottom.
    pub fn read(&self) -> Vec<Vec4> {
        match &self.method {
            Method::Shader { sums, .. } => self.interleave.in_order(sums.read()),
            Method::Oracle { sums, .. } => sums.clone(),
        }
    }
}
