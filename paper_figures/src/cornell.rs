//! The scene that figures are measured on, the Cornell box in unit space, and what several of them ask of it.

use std::f64::consts::PI;
use std::ops::Range;
use std::path::{Path, PathBuf};

use finalgather::Directions;
use finalgather::geometry::Geometry;
use finalgather::photon::{PhotonGrid, PhotonTracer};
use finalgather::points::{CameraPoints, GatherPoint};
use finalgather::scene::{Bvh, Lights, Loaded, Scene, World};
use finalgather::settings::Settings;
use glam::{DVec3, DVec4, Vec2, Vec3, Vec4};

use crate::figure::Result;
use crate::machine::gpu;

pub struct Cornell {
    pub scene: Scene,
    pub bvh: Bvh,
    pub lights: Lights,
}

impl Cornell {
    pub fn load() -> Result<Self> {
        let scene = load()?.world.flatten();
        Ok(Self { bvh: Bvh::new(&scene.mesh), lights: Lights::new(&scene), scene })
    }

    /// The photon grid that a render of these settings looks at, of the photons with these numbers.
    pub fn photon_grid(&self, settings: &Settings, photons: Range<u64>) -> PhotonGrid {
        let mut grid = self.traced(settings, photons);
        grid.add_area(&self.scene.mesh, &self.bvh, settings.seed);
        grid
    }

    /// Its flux alone.
    pub fn traced(&self, settings: &Settings, photons: Range<u64>) -> PhotonGrid {
        let mut grid = PhotonGrid::new(&self.scene.mesh, settings.grid_cells);
        PhotonTracer::new(&self.scene, &self.bvh, &self.lights, settings.seed, settings.bounces).trace(photons, &mut grid);
        grid
    }

    /// What the camera sees in the middles of `side` × `side` pixels.
    pub fn camera_points(&self, side: u32) -> Result<Vec<GatherPoint>> {
        let gpu = gpu()?;
        let geometry = Geometry::upload(&gpu, &self.scene)?;
        let camera = CameraPoints::new(&gpu, [side; 2])?;
        Ok(camera.see(&geometry, &self.scene.camera([side; 2]), Vec2::splat(0.5)).gather_points())
    }
}

/// The scene file, not yet in unit space.
pub fn load() -> Result<Loaded> {
    Ok(World::load(&in_repository("scenes/cornell.toml"))?)
}

pub fn in_repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// The first `count` of a sequence.
pub fn directions(sequence: &Directions, count: u32) -> Vec<Vec3> {
    (0..count).map(|index| sequence.get(index).vector).collect()
}

/// π Σ L w / Σ w of what the oracle sums.
pub fn irradiance(sums: &[Vec4]) -> Vec<DVec3> {
    let of = |sum: DVec4| if sum.w > 0.0 { PI * sum.truncate() / sum.w } else { DVec3::ZERO };
    sums.iter().map(|sum| of(sum.as_dvec4())).collect()
}

/// Mean over points and channels.
pub fn mean(values: &[DVec3]) -> f64 {
    values.iter().map(|value| value.element_sum()).sum::<f64>() / (3 * values.len()) as f64
}

/// Root mean squared difference over points and channels, as a share of the mean of `truth`.
pub fn relative_rmse(values: &[DVec3], truth: &[DVec3]) -> f64 {
    let squares: Vec<_> = values.iter().zip(truth).map(|(value, truth)| (value - truth).powf(2.0)).collect();
    mean(&squares).sqrt() / mean(truth)
}
