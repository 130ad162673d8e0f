//! The options of a bake.

use std::path::Path;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::integrals::{Values, Wanted};
use super::lights::add_lights;
use crate::blocks::{Blocks, Part};
use crate::error::{Error, Result};
use crate::harmonics::MAX_ORDER;
use crate::image::Channel;
use crate::points::GatherPoint;
use crate::prepared::Prepared;
use crate::quantity::Quantity;
use crate::scene::Scene;
use crate::settings::{DirectionSettings, Pipeline, Settings};
use crate::shaders::BATCH;

/// The quantities and options of a bake, in addition to [`Settings`](crate::settings::Settings).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    pub what: Vec<Quantity>,
    /// Bands of spherical harmonics.
    pub order: usize,
    /// Number of gathers at the scene's vertices before the last gather. Each adds a bounce. [`Quantity::Prt`] allows any number,
    /// [`RadianceCache::Vertices`] needs at least one. Other bakes ignore it.
    pub gather_bounces: u32,
    /// In world space. Surfaces beyond it leave a point open. `None`: all surfaces count.
    pub ao_distance: Option<f32>,
    pub radiance_cache: RadianceCache,
    /// MiB on the GL side for points and their sums at a time. The sum of a point does not depend on it.
    #[serde(skip, default = "memory")]
    pub memory: usize,
}

/// Source of the radiance of surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RadianceCache {
    /// The photon map.
    #[default]
    Photons,
    /// Earlier gathers at the scene's vertices.
    #[serde(rename = "gathered", alias = "vertices")]
    Vertices,
}

fn memory() -> usize {
    Plan::MEMORY
}

impl Plan {
    /// The default of [`Self::memory`], in MiB.
    pub const MEMORY: usize = 1024;

    /// # Errors
    /// [`Error::Usage`] when a number is out of range.
    pub fn validate(&self) -> Result<()> {
        if self.what.is_empty() {
            return Err(Error::usage("nothing is to be baked", "name one quantity or more"));
        }
        if !(1..=MAX_ORDER).contains(&self.order) {
            return Err(Error::usage(format!("order is {}", self.order), format!("give 1 to {MAX_ORDER} bands")));
        }
        if self.caches_radiance() && self.gather_bounces == 0 {
            return Err(Error::usage("light gathered in place of photons, and no bounce to gather", "give 1 bounce or more"));
        }
        if self.ao_distance.is_some_and(|distance| !(distance > 0.0 && distance.is_finite())) {
            return Err(Error::usage(
                "--ao-distance is no length above 0",
                "give one in the scene's units, or leave it out for any distance",
            ));
        }
        Ok(())
    }

    /// The plan with the memory of `part`, a file at `path`.
    pub(super) fn by(&self, path: &Path, part: &Part) -> Result<Self> {
        let memory: u32 = Part::parse_value(path, &part.state["memory"])?;
        Ok(Self { memory: memory as usize, ..self.clone() })
    }

    pub(super) fn wants(&self, quantity: Quantity) -> bool {
        self.what.contains(&quantity)
    }

    fn needs_radiance(&self) -> bool {
        self.wants(Quantity::Irradiance) || self.wants(Quantity::Sh)
    }

    pub(super) fn needs_photons(&self) -> bool {
        self.needs_radiance() && self.radiance_cache == RadianceCache::Photons
    }

    /// Whether the vertex cache holds radiance.
    pub(super) fn caches_radiance(&self) -> bool {
        self.needs_radiance() && self.radiance_cache == RadianceCache::Vertices
    }

    /// Hits beyond this distance in unit space leave a point open.
    pub(super) fn open_distance(&self, scene: &Scene) -> f32 {
        self.ao_distance.map_or(f32::MAX, |length| scene.space.length_to_unit(length))
    }

    /// Whether packets of rays on the CPU make all sums. They read photons, but no vertex cache, and make no spherical harmonics: the hits for these serve
    /// all sums.
    pub(super) fn is_on_cpu(&self, pipeline: Pipeline) -> bool {
        let harmonics = self.wants(Quantity::Sh) || self.wants(Quantity::Prt);
        pipeline == Pipeline::Raycast && !harmonics && !self.caches_radiance()
    }

    /// Number of gathers at vertices before the gather of the receivers.
    pub(super) fn stages(&self) -> u32 {
        if self.caches_radiance() || self.wants(Quantity::Prt) { self.gather_bounces } else { 0 }
    }

    /// The columns of all quantities, from sums of points and their direct light. Also [`Values::inside`].
    pub(super) fn columns(
        &self,
        values: &Values,
        direct: &[Vec3],
        points: &[GatherPoint],
        prepared: &Prepared,
        settings: &Settings,
    ) -> (Vec<Channel>, Vec<f32>) {
        let columns = |&quantity: &Quantity| values.columns(quantity, self.order, points, direct);
        let mut columns: Vec<_> = self.what.iter().flat_map(columns).collect();
        if self.wants(Quantity::Sh) && !prepared.scene.lights.is_empty() {
            add_lights(&mut columns, self.order, prepared, points, settings.direct.light_samples);
        }
        (columns, values.inside())
    }

    /// Sums of the last stage, or of an earlier one.
    pub(super) fn wanted(&self, last: bool) -> Wanted {
        Wanted {
            radiance: if last { self.needs_radiance() } else { self.caches_radiance() },
            sh: self.wants(Quantity::Sh) && last,
            prt: self.wants(Quantity::Prt),
            order: self.order,
        }
    }
}

/// Distance in unit space from a vertex to its gather point. Closer to the foot of a wall than half a texel, layers lose light. Rays need the distance
/// only to tell the two sides of an edge apart: at a tenth of it, rays on the GL side and on the CPU differ by 0.6 % in transfer. Before
/// [`Pipeline::Auto`] has chosen, the points are those for rays.
pub fn vertex_inset(settings: &Settings) -> f32 {
    match settings.gather.pipeline {
        Pipeline::Kill | Pipeline::EarlyKill | Pipeline::Fused => 1.0 / settings.layers() as f32,
        Pipeline::Raycast | Pipeline::RaycastGl | Pipeline::Auto => 1e-4,
    }
}

/// The blocks of a bake's directions. Each has at least a batch for each of `turns`: see [`Turn`](super::Turn).
pub fn blocks_of(directions: &DirectionSettings, turns: u32) -> Blocks {
    Blocks::new(directions.count, BATCH as u32 * turns)
}
