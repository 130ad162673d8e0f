//! Stand-in for the renderer: 5 ms a direction, a grey picture.

use serde::Serialize;

use crate::error::Result;
use crate::gpu::Gpu;
use crate::image::{Channel, Image};
use crate::photon::PhotonCounts;
use crate::scene::Scene;
use crate::settings::Settings;

pub struct Render<'a> {
    _gpu: &'a Gpu,
    settings: Settings,
    done: u32,
    statistics: Statistics,
}

impl<'a> Render<'a> {
    pub fn new(gpu: &'a Gpu, scene: &'a Scene, settings: &Settings) -> Result<Self> {
        std::thread::sleep(std::time::Duration::from_millis(300));
        let mut statistics = Statistics::default();
        statistics.scene.triangles = scene.mesh.triangles.len();
        Ok(Self { _gpu: gpu, settings: settings.clone(), done: 0, statistics })
    }

    pub fn directions_done(&self) -> u32 {
        self.done
    }

    pub fn is_done(&self) -> bool {
        self.done == self.settings.directions
    }

    pub fn step(&mut self) -> Result<()> {
        std::thread::sleep(std::time::Duration::from_millis(5));
        self.done += 1;
        Ok(())
    }

    pub fn picture(&mut self) -> Image {
        let [width, height] = self.settings.size.map(|side| side as usize);
        let mut state = 1_u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 16_777_216.0
        };
        let channels = ["R", "G", "B", "A", "Direct.R", "Z"]
            .map(|name| Channel { name: name.into(), samples: (0..width * height).map(|_| noise()).collect() });
        Image { width, height, channels: channels.into() }
    }

    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct Statistics {
    pub scene: SceneCounts,
    pub seconds: StageSeconds,
    pub gather: GatherCounts,
    pub photons: PhotonCounts,
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct SceneCounts {
    pub triangles: usize,
    pub lights: usize,
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct StageSeconds {
    pub photons: f64,
    pub visible_points: f64,
    pub direct: f64,
    pub gather: f64,
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct GatherCounts {
    pub points: u64,
    pub directions: u32,
    pub layer_size: u32,
    pub layers_mean: f64,
    pub layers_max: u32,
    pub ms_per_direction: f64,
    pub samples_per_second: f64,
}
