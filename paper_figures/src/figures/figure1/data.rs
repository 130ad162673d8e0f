//! The data of figure 1: the slice, its layers, and what points sample.

use serde::{Deserialize, Serialize};

use crate::figure::Result;
use crate::lab::slice::Sight;

/// In the slice: to the right and up, in unit space.
pub type Place = [f32; 2];

#[derive(Serialize, Deserialize)]
pub struct Figure1 {
    pub layer_size: u32,
    /// From gather points towards what they gather.
    pub direction: Place,
    pub surfaces: Vec<Surface>,
    /// The middle of each column of texels, through the whole depth of the bundle.
    pub rays: Vec<[Place; 2]>,
    /// The row of texels in the slice, the farthest layer first.
    pub layers: Vec<Vec<Texel>>,
    pub points: Vec<Point>,
}

/// Where the slice cuts surfaces of one albedo that are joined.
#[derive(Serialize, Deserialize)]
pub struct Surface {
    pub albedo: [f32; 3],
    pub line: Vec<Place>,
}

/// Depth and slope, as places.
#[derive(Serialize, Deserialize)]
pub struct Texel {
    pub column: usize,
    pub center: Place,
    /// From the centre to where the surface's plane is in the middle of the next column.
    pub step: Place,
}

#[derive(Serialize, Deserialize)]
pub struct Point {
    pub place: Place,
    pub normal: Place,
    pub column: usize,
    /// One for each layer; `None` where nothing is in its texel.
    pub sights: Vec<Option<Sight>>,
}

impl Point {
    /// The last layer up to this one that it samples, and how far ahead that is. Of all layers, this is where the point's ray ends.
    pub fn last_sample(&self, layer: usize) -> Option<(usize, f32)> {
        let sampled = |(layer, sight): (usize, &Option<Sight>)| Some((layer, sight.filter(|sight| sight.sampled)?.distance));
        self.sights.iter().take(layer + 1).enumerate().filter_map(sampled).next_back()
    }

    pub fn hit(&self) -> Option<f32> {
        self.last_sample(self.sights.len()).map(|(_, distance)| distance)
    }
}

impl Figure1 {
    /// Fails unless each point's last sample is where its ray ends, to a hundredth of a texel's width: the point evaluates the texel's plane
    /// on its own ray, so that only rounding is left.
    pub fn check(&self, exact: &[Option<f32>], texel: f32) -> Result<()> {
        for (point, &exact) in self.points.iter().zip(exact) {
            let hit = point.hit();
            let off = hit.zip(exact).map_or(f32::INFINITY, |(hit, exact)| (hit - exact).abs());
            if off > 0.01 * texel {
                return Err(format!("the point at {:?} samples {hit:?}, and its ray ends at {exact:?}", point.place).into());
            }
        }
        Ok(())
    }
}
