//! A scene made ready for gathering: in unit space, with what answers rays and what shaders read.

use std::rc::Rc;

use crate::error::{Error, Result};
use crate::geometry::Geometry;
use crate::gpu::Gpu;
use crate::photon::{PhotonCounts, PhotonGrid, PhotonTexture, PhotonTracer};
use crate::scene::{Bvh, Lights, Scene, UnitSpace};
use crate::settings::Settings;

/// What bakes of one scene share. Glass is left out of it: gather rays go straight through, and nothing is baked on it.
pub struct Prepared {
    /// In unit space.
    pub scene: Scene,
    pub space: UnitSpace,
    pub bvh: Rc<Bvh>,
    pub lights: Lights,
    pub geometry: Geometry,
}

impl Prepared {
    /// # Errors
    /// [`Error::Usage`] when the scene's sizes are beyond the device's limits, [`Error::Gl`] when it fails.
    pub fn new(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let (scene, space) = UnitSpace::enter(scene);
        let scene = scene.without_glass().unwrap_or(scene);
        if scene.mesh.triangles.is_empty() {
            return Err(Error::usage("all surfaces are glass, so that there is nothing to bake", "add a surface that is not"));
        }
        let (bvh, lights) = (Rc::new(Bvh::new(&scene.mesh)), Lights::new(&scene));
        Ok(Self { geometry: Geometry::upload(gpu, &scene)?, scene, space, bvh, lights })
    }
}

/// The photon map: one after the other, each of fresh photons.
pub struct Photons {
    pub grid: PhotonGrid,
    pub texture: PhotonTexture,
    /// Of all maps so far.
    pub counts: PhotonCounts,
    /// Which of the maps it is.
    pub number: u64,
}

impl Photons {
    /// Traces the first map, which also tells for all of them which surfaces light reaches.
    ///
    /// # Errors
    /// [`Error::Usage`] when there is no light to trace from, or a grid beyond the device's limits.
    pub fn new(gpu: &Gpu, prepared: &Prepared, settings: &Settings) -> Result<Self> {
        if prepared.lights.count() == 0 && !prepared.scene.has_sky() {
            return Err(Error::usage(
                "all lights are too small beside the scene to be told from points",
                "enlarge the lights, or leave out what lies far away",
            ));
        }
        let mut grid = PhotonGrid::new(&prepared.scene.mesh, settings.grid_cells);
        let counts = trace(prepared, settings, 0, &mut grid);
        grid.add_area(&prepared.scene.mesh, &prepared.bvh, settings.seed);
        Ok(Self { texture: PhotonTexture::upload(gpu, &grid)?, grid, counts, number: 0 })
    }

    /// Makes it the map of this number.
    ///
    /// # Errors
    /// When the device fails.
    pub fn renew(&mut self, gpu: &Gpu, prepared: &Prepared, settings: &Settings, number: u64) -> Result<()> {
        if number != self.number {
            self.grid.clear_flux();
            self.counts += trace(prepared, settings, number, &mut self.grid);
            self.texture = PhotonTexture::upload(gpu, &self.grid)?;
            self.number = number;
        }
        Ok(())
    }
}

fn trace(prepared: &Prepared, settings: &Settings, number: u64, grid: &mut PhotonGrid) -> PhotonCounts {
    let tracer = PhotonTracer::new(&prepared.scene, &prepared.bvh, &prepared.lights, settings.seed, settings.bounces);
    tracer.trace(number * settings.photons..(number + 1) * settings.photons, grid)
}
