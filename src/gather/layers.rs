//! A hit finder that keeps all layers of a batch of directions (the pipeline "fused"). Mirrors `glsl/finder/layers.glsl`.
//!
//! One pass over the points samples the layers for both ends of each direction. So every direction serves every point: half the work on the geometry.

use glam::{Mat4, Vec4};

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
        Ok(Self { gpu: gpu.clone(), store, layers: 0, directions: Vec::new(), to_layer: Vec::new(), metric: Vec::new() })
    }
}

impl HitFinder for LayerFinder {
    fn batch(&self) -> usize {
        self.store.tiles() as usize
    }

    fn begin(&mut self, geometry: &Geometry, directions: &[Direction]) -> Result<usize> {
        let size = self.store.layer_size();
        let mut bundles: Vec<Bundle> =
            directions.iter().map(|direction| Bundle::new(direction, &geometry.positions, size)).collect();
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
