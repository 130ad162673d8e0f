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
mod exact;
mod fused;
mod hit_pass;
mod hits;
mod kill;
mod layer_store;
mod peel;
mod rays;

pub use bundle::Bundle;
pub use exact::ExactFind;
pub use hits::{Begun, Find, HIT_BYTES, Hits, KeptHits};
pub use kill::Kill;
pub use layer_store::{Filled, LayerStore};
pub use peel::Peel;
pub use rays::{RayFind, RayGather};

use glam::{Vec3, Vec4};

use crate::direction::Direction;
use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::{Format, Gpu, Texture, Uniform};
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

/// What rays bring that meet no surface: the same to all points.
pub struct Beyond {
    /// Radiance along each direction of a batch, and against it.
    along: Vec<Vec4>,
    against: Vec<Vec4>,
}

impl Beyond {
    /// Of unit vectors.
    pub fn new(scene: &Scene, directions: impl Iterator<Item = Vec3> + Clone) -> Self {
        let seen = |side: f32| directions.clone().map(|direction| scene.beyond(side * direction).extend(0.0)).collect();
        Self { along: seen(1.0), against: seen(-1.0) }
    }

    /// The uniforms that shaders of batches read.
    pub fn uniforms(&self) -> [(&'static str, Uniform<'_>); 2] {
        [("beyond", Uniform::Vec4s(&self.along)), ("behind", Uniform::Vec4s(&self.against))]
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
    /// [`crate::Error::Gl`] when the device is too small for the scene.
    fn add(&mut self, work: Work, directions: &[Direction]) -> Result<u32>;

    /// Gives memory back that it can do without, if any.
    fn shrink(&mut self) -> bool {
        false
    }
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
        let layers = self.hits(work.geometry, work.points, &bundle);
        self.gpu.stage("gather", || self.accumulate.add(work, &bundle, self.kill.hits()));
        layers
    }

    /// Leaves what the points see in `self.kill`. Returns the number of layers.
    fn hits(&mut self, geometry: &Geometry, points: Points, bundle: &Bundle) -> u32 {
        // A point samples every layer beyond it and none after, so the number of points that sample falls from layer to layer.
        let enough = (self.stop_fraction * points.count as f32).max(1.0);
        let mut layers = 0;
        self.peel.start();
        self.kill.start();
        loop {
            let layer = self.gpu.stage("peel", || self.peel.next(geometry, bundle));
            let sampled = self.gpu.stage("gather", || self.kill.sample(points, bundle, layer, layers));
            layers += 1;
            if (sampled as f32) < enough {
                break;
            }
        }
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
        let bundles: Vec<Bundle> = directions.iter().map(bundle).collect();
        let (mut most, mut left) = (0, &bundles[..]);
        while !left.is_empty() {
            let filled = self.gpu.stage("peel", || self.store.fill(work.geometry, left))?;
            let (batch, later) = left.split_at(filled.bundles);
            self.gpu.stage("gather", || self.fused.add(work, batch, &self.store));
            (most, left) = (most.max(filled.layers), later);
        }
        Ok(most)
    }

    fn shrink(&mut self) -> bool {
        self.store.halve()
    }
}

/// Hits by KILL, direction by direction.
pub struct KillFind {
    gather: KillGather,
    /// The one begun with.
    direction: Option<Direction>,
    vector: [Vec4; 1],
}

impl KillFind {
    pub fn new(gather: KillGather) -> Self {
        Self { gather, direction: None, vector: [Vec4::ZERO] }
    }
}

impl Find for KillFind {
    fn batch(&self) -> usize {
        1
    }

    fn begin(&mut self, _: &Geometry, directions: &[Direction]) -> Result<Begun> {
        self.direction = directions.first().copied();
        Ok(Begun { directions: 1, layers: 0 })
    }

    fn find(&mut self, geometry: &Geometry, points: Points) -> Result<Hits<'_>> {
        if let Some(direction) = self.direction {
            let bundle = Bundle::new(&direction, &geometry.positions, self.gather.layer_size);
            self.gather.hits(geometry, points, &bundle);
            self.vector = [direction.vector.extend(0.0)];
        }
        Ok(Hits::new(self.gather.kill.hits(), &self.vector, false))
    }

    fn keep(&mut self) -> Result<KeptHits> {
        // What KILL overwrites stays its own.
        let hits = self.gather.kill.hits();
        let texels = hits.read::<[f32; 2]>();
        let copy = Texture::array_of_one(&self.gather.gpu, Format::Rg32F, [hits.width(), hits.height()], &texels)?;
        Ok(KeptHits::new(copy, &self.vector, false))
    }
}

/// Hits in all layers at once.
pub struct FusedFind {
    gpu: Gpu,
    store: LayerStore,
    fused: fused::FusedFind,
    /// Of the batch begun with.
    bundles: Vec<Bundle>,
    directions: Vec<Vec4>,
}

impl FusedFind {
    /// For points in textures of one size.
    ///
    /// # Errors
    /// When a size is beyond the device's limits.
    pub fn new(gpu: &Gpu, layer_size: u32, points: [u32; 2]) -> Result<Self> {
        // The store makes do with what memory is left.
        let fused = fused::FusedFind::new(gpu, points)?;
        let store = LayerStore::new(gpu, layer_size)?;
        Ok(Self { gpu: gpu.clone(), store, fused, bundles: Vec::new(), directions: Vec::new() })
    }
}

impl Find for FusedFind {
    fn batch(&self) -> usize {
        self.store.tiles() as usize
    }

    fn begin(&mut self, geometry: &Geometry, directions: &[Direction]) -> Result<Begun> {
        let size = self.store.layer_size();
        self.bundles = directions.iter().map(|direction| Bundle::new(direction, &geometry.positions, size)).collect();
        let filled = self.gpu.stage("peel", || self.store.fill(geometry, &self.bundles))?;
        self.bundles.truncate(filled.bundles);
        self.directions = self.bundles.iter().map(|bundle| bundle.direction.extend(0.0)).collect();
        Ok(Begun { directions: filled.bundles, layers: filled.layers })
    }

    fn find(&mut self, _: &Geometry, points: Points) -> Result<Hits<'_>> {
        let texture = self.gpu.stage("gather", || self.fused.find(points, &self.bundles, &self.store));
        Ok(Hits::new(texture, &self.directions, true))
    }

    fn keep(&mut self) -> Result<KeptHits> {
        self.fused.keep(&self.gpu, &self.directions)
    }

    fn shrink(&mut self) -> bool {
        self.store.halve()
    }
}
