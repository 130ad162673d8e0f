//! The method of the poster (Hachisuka 2004): peels layers from far to near. Every point samples each layer unless KILL culls the sample. The last
//! sample is the point's nearest hit; the irradiance consumer adds its radiance.

use glam::Vec4;

use super::{Bundle, Found, HitFinder, Kill, Peel};
use crate::direction::Direction;
use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::Gpu;
use crate::points::Points;

/// Finds hits by KILL, one direction at a time.
pub struct KillFinder {
    gpu: Gpu,
    layer_size: u32,
    peel: Peel,
    kill: Kill,
    stop_fraction: f32,
    direction: Direction,
    vector: [Vec4; 1],
}

impl KillFinder {
    /// For the point textures of `kill`. Peeling stops when no point samples a layer, or fewer than the share `stop_fraction` of the points.
    ///
    /// # Errors
    /// When the size is beyond the device's limits.
    pub fn new(gpu: &Gpu, layer_size: u32, kill: Kill, stop_fraction: f32) -> Result<Self> {
        let (peel, direction) = (Peel::new(gpu, layer_size)?, Direction::default());
        Ok(Self { gpu: gpu.clone(), layer_size, peel, kill, stop_fraction, direction, vector: [Vec4::ZERO] })
    }
}

impl HitFinder for KillFinder {
    fn batch(&self) -> usize {
        1
    }

    fn both_ends(&self) -> bool {
        false
    }

    fn begin(&mut self, _: &Geometry, directions: &[Direction]) -> Result<usize> {
        self.direction = directions[0];
        self.vector = [directions[0].vector.extend(0.0)];
        Ok(1)
    }

    fn find(&mut self, geometry: &Geometry, points: Points) -> Result<Found<'_>> {
        let bundle = Bundle::new(&self.direction, &geometry.positions, self.layer_size);
        // Layers come far to near. A point samples each layer beyond it and no later one, so the number of sampling points falls.
        let enough = (self.stop_fraction * points.count as f32).max(1.0);
        let mut layers = 0;
        self.peel.start();
        self.kill.start();
        loop {
            let layer = self.gpu.stage("peel", || self.peel.next(geometry, &bundle));
            let sampled = self.gpu.stage("gather", || self.kill.sample(points, &bundle, layer, layers));
            layers += 1;
            if (sampled as f32) < enough {
                break;
            }
        }
        Ok(Found::stored(self.kill.hits(), &self.vector, self.both_ends(), layers))
    }
}
