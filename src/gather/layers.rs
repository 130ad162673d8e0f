//! A hit finder that keeps all layers of a batch of directions (the pipeline "fused"). Mirrors `glsl/finder/layers.glsl`.
//!
//! One pass over the points samples the layers for both ends of each direction. So every direction serves every point: half the work on the geometry.

use glam::{Mat4, Vec3, Vec4};

use super::outline::outline;
use super::{Bundle, Found, HitFinder, LayerStore};
use crate::direction::Direction;
use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::{Gpu, Uniform};
use crate::points::Points;
use crate::shaders::Finder;

/// Samples the layers of a [`LayerStore`].
pub struct LayerFinder {
    gpu: Gpu,
    store: LayerStore,
    /// The outline of the receivers; empty before they are told. Bundles then fit the whole scene.
    receivers: Vec<Vec3>,
    layers: u32,
    directions: Vec<Vec4>,
    to_layer: Vec<Mat4>,
    metric: Vec<Vec4>,
}

impl LayerFinder {
    /// # Errors
    /// When the size is beyond the device's limits, or it has no memory for the layers of one direction.
    pub fn new(gpu: &Gpu, layer_size: u32) -> Result<Self> {
        let store = LayerStore::new(gpu, layer_size)?;
        Ok(Self {
            gpu: gpu.clone(),
            store,
            receivers: Vec::new(),
            layers: 0,
            directions: Vec::new(),
            to_layer: Vec::new(),
            metric: Vec::new(),
        })
    }
}

impl HitFinder for LayerFinder {
    fn batch(&self) -> usize {
        self.store.tiles() as usize
    }

    fn fit(&mut self, receivers: &dyn Fn() -> Vec<Vec3>) {
        self.receivers = outline(&receivers());
    }

    fn begin(&mut self, geometry: &Geometry, directions: &[Direction]) -> Result<usize> {
        let size = self.store.layer_size();
        let receivers = if self.receivers.is_empty() { &geometry.positions } else { &self.receivers };
        let fitted = |direction| Bundle::fitted(direction, receivers, &geometry.positions, size);
        let mut bundles: Vec<Bundle> = directions.iter().map(fitted).collect();
        let filled = self.gpu.stage("peel", || self.store.fill(geometry, &bundles))?;
        bundles.truncate(filled.bundles);
        self.layers = filled.layers;
        self.directions = bundles.iter().map(|bundle| bundle.direction.extend(bundle.depth_bias)).collect();
        self.to_layer = bundles.iter().map(|bundle| bundle.to_layer).collect();
        self.metric = bundles.iter().map(|bundle| bundle.metric().extend(0.0)).collect();
        Ok(filled.bundles)
    }

    fn find(&mut self, _: &Geometry, _: Points) -> Result<Found<'_>> {
        let own = [("to_layer", Uniform::Mat4s(&self.to_layer)), ("metric", Uniform::Vec4s(&self.metric))];
        let uniforms = [&own[..], &self.store.uniforms()].concat();
        Ok(Found { finder: Finder::Layers, layers: self.layers, directions: &self.directions, both_ends: true, uniforms })
    }

    fn shrink(&mut self) -> bool {
        self.store.halve()
    }
}
