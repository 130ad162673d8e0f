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
use crate::points::{Accumulator, GatherPoint, Interleave, PointGloss, Points};
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
        /// The gloss of each point, and the sums of its lobe. Empty without gloss.
        gloss: Vec<PointGloss>,
        lobes: Vec<[Vec4; 2]>,
    },
}

impl IrradianceGather {
    /// Uses the settings' pipeline, its photon map, and point textures of `interleave`. `scene` is in unit space, `bvh` of its mesh.
    ///
    /// # Errors
    /// When a size is beyond the device's limits.
    pub fn new(gpu: &Gpu, settings: &Settings, scene: &Scene, bvh: &Rc<Bvh>, interleave: Interleave) -> Result<Self> {
        Self::with(gpu, settings, (scene, bvh), interleave, false)
    }

    /// The same for points with gloss, if `glossy` is true.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with(
        gpu: &Gpu,
        settings: &Settings,
        (scene, bvh): (&Scene, &Rc<Bvh>),
        interleave: Interleave,
        glossy: bool,
    ) -> Result<Self> {
        let method = match settings.gather.pipeline {
            Pipeline::Raycast => Method::Oracle { points: Vec::new(), sums: Vec::new(), gloss: Vec::new(), lobes: Vec::new() },
            pipeline => {
                // The finder comes last: it adapts to the memory that is left.
                let sums = Accumulator::several(gpu, interleave.sums_size(), if glossy { 3 } else { 1 })?;
                let radiance = HitRadiance { source: settings.photons.map.into(), textured: scene.is_textured() };
                let consumer = if glossy { Consumer::Gloss(radiance) } else { Consumer::Irradiance(radiance) };
                let pass = GatherPass::new(gpu, shader_of(pipeline), consumer)?;
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
        self.begin_glossy(points, &[]);
    }

    /// The same for points with gloss, which only the oracle reads here; empty without it.
    pub fn begin_glossy(&mut self, points: impl Fn() -> Vec<Option<GatherPoint>>, of_points: &[PointGloss]) {
        match &mut self.method {
            Method::Shader { finder, sums, .. } => {
                finder.fit(&|| points().into_iter().flatten().map(|point| point.position).collect());
                sums.clear();
            }
            Method::Oracle { points: places, sums, gloss, lobes } => {
                *places = points();
                *sums = vec![Vec4::ZERO; places.len()];
                *gloss = of_points.to_vec();
                *lobes = vec![[Vec4::ZERO; 2]; gloss.len()];
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
            Method::Oracle { points: places, sums, gloss, .. } if gloss.is_empty() => directions.iter().for_each(|direction| {
                let cast = |(i, (point, sum)): (usize, (&Option<GatherPoint>, &mut Vec4))| match point {
                    Some(point) if self.interleave.subset_of(i) == points.subset => {
                        *sum += oracle.sample(point, direction.vector).as_vec4();
                    }
                    _ => {}
                };
                places.par_iter().zip(sums.par_iter_mut()).enumerate().for_each(cast);
            }),
            Method::Oracle { points: places, sums, gloss, lobes } => directions.iter().for_each(|direction| {
                let all = places.par_iter().zip(&mut *sums).zip(&*gloss).zip(&mut *lobes).enumerate();
                all.for_each(|(i, (((point, sum), gloss), lobes))| match point {
                    Some(point) if self.interleave.subset_of(i) == points.subset => {
                        let [base, lobe, weight] =
                            oracle.sample_glossy(point, gloss, direction.vector).map(|term| term.as_vec4());
                        *sum += base;
                        *lobes = [lobes[0] + lobe, lobes[1] + weight];
                    }
                    _ => {}
                });
            }),
        }
        Ok(most)
    }

    /// Of points with gloss the sums of their lobes: rgb of the first is Σ radiance × weight, of the second Σ weight. `None` without gloss.
    pub fn read_lobes(&self) -> Option<[Vec<Vec4>; 2]> {
        match &self.method {
            Method::Shader { sums, .. } => {
                let mut lobes = sums.read_all().skip(1).map(|sums| self.interleave.in_order(sums));
                Some([lobes.next()?, lobes.next()?])
            }
            Method::Oracle { lobes, .. } if lobes.is_empty() => None,
            Method::Oracle { lobes, .. } => Some([0, 1].map(|part| lobes.iter().map(|sums| sums[part]).collect())),
        }
    }

    /// The sums, row by row from the bottom.
    pub fn read(&self) -> Vec<Vec4> {
        match &self.method {
            Method::Shader { sums, .. } => self.interleave.in_order(sums.read()),
            Method::Oracle { sums, .. } => sums.clone(),
        }
    }
}
