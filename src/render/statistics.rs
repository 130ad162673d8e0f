//! Counts and times of a render.

use serde::Serialize;

use crate::photon::PhotonCounts;
use crate::points::Interleave;
use crate::settings::Settings;

/// Counts and times of a render. Times include the work of the device.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RenderStatistics {
    pub scene: SceneCounts,
    pub seconds: StageSeconds,
    pub gather: GatherCounts,
    pub photons: PhotonCounts,
    /// Last estimate of the picture's relative standard error, as [`target_error`](crate::settings::DirectionSettings::target_error) defines it.
    pub error: Option<f64>,
}

#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct SceneCounts {
    pub triangles: usize,
    /// Emissive triangles.
    pub lights: usize,
}

/// Wall-clock seconds.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct StageSeconds {
    /// The scene's tree, what the device needs of the scene, programs, the choice of a pipeline.
    pub prepare: f64,
    pub photons: f64,
    pub visible_points: f64,
    pub direct: f64,
    pub caustics: f64,
    pub gather: f64,
    /// Sums of blocks, and the estimate of their error.
    pub film: f64,
    /// Blocks whose sums were not kept, to choose the number of directions for a time.
    pub probes: f64,
}

#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct GatherCounts {
    /// Points of one block: pixels that see a surface.
    pub points: u32,
    /// Eye rays cut off among mirrors and glass, in all blocks.
    pub cut: u64,
    pub directions: u32,
    /// Directions of the sequence: more than `directions` where neighbouring pixels have different ones.
    pub distinct_directions: u32,
    /// Rays of a point: those of the directions that fall to its pixel.
    pub rays_per_point: f64,
    /// Side of the layers; 0 for exact rays.
    pub layer_size: u32,
    /// Mean number of layers peeled for a direction. In a batch, each direction counts as the deepest one.
    pub layers_mean: f64,
    pub layers_max: u32,
    pub ms_per_direction: f64,
    /// Points × directions, divided by the seconds of the gather.
    pub samples_per_second: f64,
    #[serde(skip)]
    layers_sum: u64,
    #[serde(skip)]
    samples: u64,
}

impl GatherCounts {
    /// Adds a batch: `directions` of the sequence, of which `interleave` spreads a number for each of the settings', at `points` points.
    pub(super) fn add(&mut self, points: u32, directions: u32, interleave: &Interleave, layers: u32, seconds: f64) {
        self.distinct_directions += directions;
        self.directions = interleave.directions(self.distinct_directions);
        self.rays_per_point = f64::from(self.distinct_directions) / interleave.subsets() as f64;
        self.layers_sum += u64::from(layers) * u64::from(directions);
        self.samples += u64::from(points) * u64::from(directions);
        self.layers_max = self.layers_max.max(layers);
        self.layers_mean = self.layers_sum as f64 / f64::from(self.distinct_directions);
        self.ms_per_direction = 1e3 * seconds / f64::from(self.directions.max(1));
        self.samples_per_second = self.samples as f64 / seconds;
    }
}

/// Side of the layers that the settings' pipeline peels, 0 for exact rays.
pub(super) fn layer_size(settings: &Settings) -> u32 {
    if settings.gather.pipeline.has_layers() { settings.layers() } else { 0 }
}
