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
//! Source: Hachisuka 2004, "Final Gathering on GPU". [`Gather::direction`] is the method.

mod accumulate;
mod bundle;
mod fused;
mod kill;
mod peel;

pub use bundle::Bundle;
pub use peel::{Layer, Peel};

use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::{Gpu, SampleQuery};
use crate::photon::PhotonTexture;
use crate::points::{Points, Sums};
use accumulate::Accumulate;
use fused::Fused;
use kill::Kill;

/// The passes of the 2004 method, for one layer size and one size of point textures.
pub struct Gather {
    peel: Peel,
    kill: Kill,
    accumulate: Accumulate,
    stop_fraction: f32,
}

impl Gather {
    /// Peeling ends with the layer that fewer than `stop_fraction` of the points sample, or none.
    ///
    /// # Errors
    /// When a size is beyond the device's limits.
    pub fn new(gpu: &Gpu, layer_size: u32, points: [u32; 2], stop_fraction: f32) -> Result<Self> {
        Ok(Self {
            peel: Peel::new(gpu, layer_size, 2)?,
            kill: Kill::new(gpu, points)?,
            accumulate: Accumulate::new(gpu)?,
            stop_fraction,
        })
    }

    /// Gathers along one direction and adds to `sums`. Returns the number of layers peeled.
    pub fn direction(
        &mut self,
        geometry: &Geometry,
        photons: &PhotonTexture,
        points: Points,
        bundle: &Bundle,
        sums: &Sums,
    ) -> u32 {
        // A point samples every layer beyond it and none after, so the number of points that sample falls from layer to layer.
        let enough = (self.stop_fraction * points.count as f32).max(1.0);
        let mut layers = 0;
        self.peel.start();
        self.kill.start();
        loop {
            let layer = self.peel.next(geometry, bundle);
            let sampled = self.kill.sample(points, bundle, layer, layers);
            layers += 1;
            if (sampled as f32) < enough {
                break;
            }
        }
        self.accumulate.add(geometry, photons, points, bundle, self.kill.hits(), sums);
        layers
    }
}

/// The passes of the fused method: all layers of a direction are kept, and one pass over the points samples them for the rays at both ends.
/// E(x) = π Σ L w / Σ w with w = |n·d|: every direction serves every point, which halves the geometry's share of the work.
pub struct FusedGather {
    gpu: Gpu,
    peel: Peel,
    any: SampleQuery,
    fused: Fused,
}

/// Layers kept at first; deeper scenes double it.
const KEPT: u32 = 8;

impl FusedGather {
    /// # Errors
    /// When a size is beyond the device's limits.
    pub fn new(gpu: &Gpu, layer_size: u32) -> Result<Self> {
        Ok(Self {
            gpu: gpu.clone(),
            peel: Peel::new(gpu, layer_size, KEPT)?,
            any: SampleQuery::new(gpu)?,
            fused: Fused::new(gpu)?,
        })
    }

    /// Gathers along one direction and against it, each point on its own side, and adds to `sums`, which are cleared when new and get nothing
    /// from elsewhere. Returns the number of layers.
    ///
    /// # Errors
    /// When the scene has more layers than the device has memory or array elements for: 16 bytes a texel each.
    pub fn direction(
        &mut self,
        geometry: &Geometry,
        photons: &PhotonTexture,
        points: Points,
        bundle: &Bundle,
        sums: &Sums,
    ) -> Result<u32> {
        let layers = loop {
            if let Some(layers) = self.peel_all(geometry, bundle) {
                break layers;
            }
            self.peel.keep_twice_as_many(&self.gpu)?;
        };
        self.fused.add(geometry, photons, points, bundle, (&self.peel, layers), sums);
        Ok(layers)
    }

    /// Peels until nothing is left and returns the number of layers, or `None` when more are left than can be kept.
    fn peel_all(&mut self, geometry: &Geometry, bundle: &Bundle) -> Option<u32> {
        self.peel.start();
        (0..self.peel.kept()).find(|_| self.any.count(|| _ = self.peel.next(geometry, bundle)) == 0)
    }
}
