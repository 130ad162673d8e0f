//! Final gathering: the irradiance at many points from many shared directions, by depth peeling.
//!
//! For a direction d, the ray from each point along +d is a line of one orthographic projection. Peeling the scene along d gives layers; a
//! point's hit is the nearest layer beyond it:
//!
//! E(x) = π Σ L(x, d) w / Σ w, w = max(n·d, 0), over N directions uniform on the sphere.
//!
//! The weights' own sum in the denominator, in place of its expected value N/4, makes a constant radiance exact. The cost of a direction is one pass over
//! the triangles and one over the points for each layer, and does not depend on how the rays of other directions went.
//!
//! Source: Hachisuka 2004, "Final Gathering on GPU". [`KillGather`] is the method; the other [`Gather`]s find the same sums in other ways.

mod accumulate;
mod bundle;
mod fused;
mod hit_pass;
mod kill;
mod layer_store;
mod peel;
mod rays;

pub use bundle::Bundle;
pub use kill::Kill;
pub use layer_store::LayerStore;
pub use peel::Peel;
pub use rays::RayGather;

use glam::{Vec3, Vec4};

use crate::direction::Direction;
use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::Gpu;
use crate::photon::PhotonTexture;
use crate::points::{Points, Sums};
use crate::scene::Scene;
use accumulate::Accumulate;
use fused::Fused;

/// What a gather reads, and the sums that it adds to: rgb Σ radiance × weight, a Σ weight.
#[derive(Clone, Copy)]
pub struct Work<'a> {
    /// In unit space.
    pub scene: &'a Scene,
    pub geometry: &'a Geometry,
    pub photons: &'a PhotonTexture,
    pub points: Points<'a>,
    pub sums: &'a Sums,
}

impl Work<'_> {
    /// What rays along unit vectors bring that meet no surface, and rays against them: the same to all points.
    fn beyond(&self, directions: impl Iterator<Item = Vec3> + Clone) -> [Vec<Vec4>; 2] {
        [1.0, -1.0].map(|side| directions.clone().map(|direction| self.scene.beyond(side * direction).extend(0.0)).collect())
    }
}

/// A way to gather on the GL side.
pub trait Gather {
    /// How many directions it takes at once; a call may have more, or fewer.
    fn batch(&self) -> usize;

    /// Whether a direction counts at both its ends, each point on its own side: w = |n·d|.
    fn both_ends(&self) -> bool;

    /// Gathers along `directions` and adds to the sums. Returns the most layers that were peeled for one of them, 0 where none were.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] when the device is too small for the scene.
    fn add(&mut self, work: Work, directions: &[Direction]) -> Result<u32>;
}

/// The 2004 method, for one layer size and one size of point textures.
pub struct KillGather {
    gpu: Gpu,
    layer_size: u32,
    peel: Peel,
    kill: Kill,
    accumulate: Accumulate,
    stop_fraction: f32,
}

impl KillGather {
    /// Peeling ends with the layer that fewer than `stop_fraction` of the points sample, or none.
    ///
    /// # Errors
    /// When a size is beyond the device's limits.
    pub fn new(gpu: &Gpu, layer_size: u32, points: [u32; 2], stop_fraction: f32) -> Result<Self> {
        Self::with(gpu, layer_size, Kill::new(gpu, points)?, stop_fraction)
    }

    /// The same with early KILL: points that a layer culled are not shaded again.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn early(gpu: &Gpu, layer_size: u32, points: [u32; 2], stop_fraction: f32) -> Result<Self> {
        Self::with(gpu, layer_size, Kill::early(gpu, points)?, stop_fraction)
    }

    fn with(gpu: &Gpu, layer_size: u32, kill: Kill, stop_fraction: f32) -> Result<Self> {
        let (peel, accumulate) = (Peel::new(gpu, layer_size)?, Accumulate::new(gpu)?);
        Ok(Self { gpu: gpu.clone(), layer_size, peel, kill, accumulate, stop_fraction })
    }

    fn direction(&mut self, work: Work, direction: &Direction) -> u32 {
        let bundle = Bundle::new(direction, &work.geometry.positions, self.layer_size);
        // A point samples every layer beyond it and none after, so the number of points that sample falls from layer to layer.
        let enough = (self.stop_fraction * work.points.count as f32).max(1.0);
        let mut layers = 0;
        self.peel.start();
        self.kill.start();
        loop {
            let layer = self.gpu.stage("peel", || self.peel.next(work.geometry, &bundle));
            let sampled = self.gpu.stage("gather", || self.kill.sample(work.points, &bundle, layer, layers));
            layers += 1;
            if (sampled as f32) < enough {
                break;
            }
        }
        self.gpu.stage("gather", || self.accumulate.add(work, &bundle, self.kill.hits()));
        layers
    }
}

impl Gather for KillGather {
    fn batch(&self) -> usize {
        1
    }

    fn both_ends(&self) -> bool {
        false
    }

    fn add(&mut self, work: Work, directions: &[Direction]) -> Result<u32> {
        Ok(directions.iter().map(|direction| self.direction(work, direction)).max().unwrap_or(0))
    }
}

/// The fused method: all layers of a batch of directions are kept, and one pass over the points samples them for the rays at both ends.
/// E(x) = π Σ L w / Σ w with w = |n·d|: every direction serves every point, which halves the geometry's share of the work.
pub struct FusedGather {
    gpu: Gpu,
    store: LayerStore,
    fused: Fused,
}

impl FusedGather {
    /// # Errors
    /// When a size is beyond the device's limits.
    pub fn new(gpu: &Gpu, layer_size: u32) -> Result<Self> {
        Ok(Self { gpu: gpu.clone(), store: LayerStore::new(gpu, layer_size)?, fused: Fused::new(gpu)? })
    }
}

impl Gather for FusedGather {
    fn batch(&self) -> usize {
        self.store.tiles() as usize
    }

    fn both_ends(&self) -> bool {
        true
    }

    fn add(&mut self, work: Work, directions: &[Direction]) -> Result<u32> {
        let size = self.store.layer_size();
        let bundle = |direction| Bundle::new(direction, &work.geometry.positions, size);
        let mut most = 0;
        for batch in directions.chunks(self.batch()) {
            let bundles: Vec<Bundle> = batch.iter().map(bundle).collect();
            most = most.max(self.gpu.stage("peel", || self.store.fill(work.geometry, &bundles))?);
            self.gpu.stage("gather", || self.fused.add(work, &bundles, &self.store));
        }
        Ok(most)
    }
}
