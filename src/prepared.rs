//! A scene made ready for gathering, and its photon map.
//!
//! [`Prepared`] is the CPU side; it needs no GL device and traces no photons. Its counterpart on the GL side is [`Geometry`](crate::geometry::Geometry),
//! uploaded from [`Prepared::scene`].

use std::rc::Rc;

use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::photon::{PhotonCounts, PhotonGrid, PhotonTexture, PhotonTracer};
use crate::scene::{Bvh, Lights, Scene, World};
use crate::settings::PhotonSettings;

/// A scene with its tree and its lights.
pub struct Prepared {
    pub scene: Scene,
    pub bvh: Rc<Bvh>,
    pub lights: Lights,
}

impl Prepared {
    /// For bakes, without glass: gather rays go straight through it, and nothing is baked on it.
    ///
    /// # Errors
    /// [`Error::Usage`] when there is nothing but glass.
    pub fn without_glass(world: &World) -> Result<Self> {
        let scene = world.flatten();
        Ok(Self::of(rest_of(&scene)?.unwrap_or(scene)))
    }

    /// Twice: for eyes and photons, and for gather rays, without glass. Where there is no glass both are the same.
    ///
    /// # Errors
    /// As [`Self::without_glass`].
    pub fn both(world: &World) -> Result<[Rc<Self>; 2]> {
        let scene = world.flatten();
        let rest = rest_of(&scene)?;
        let all = Rc::new(Self::of(scene));
        let gathered = rest.map_or_else(|| Rc::clone(&all), |rest| Rc::new(Self::of(rest)));
        Ok([all, gathered])
    }

    fn of(scene: Scene) -> Self {
        Self { bvh: Rc::new(Bvh::new(&scene.mesh)), lights: Lights::new(&scene), scene }
    }

    /// Traces photons through all of it.
    pub fn photons(&self, settings: &PhotonSettings, seed: u64) -> PhotonTracer<'_> {
        PhotonTracer::new(&self.scene, &self.bvh, &self.lights, seed, settings.depth)
    }
}

/// The scene without glass, if it has any.
fn rest_of(scene: &Scene) -> Result<Option<Scene>> {
    let rest = scene.without_glass();
    if rest.as_ref().is_some_and(|rest| rest.mesh.triangles.is_empty()) {
        return Err(Error::usage("all surfaces are glass, on which no light is gathered", "add a surface that is not"));
    }
    Ok(rest)
}

/// The photon map: one after the other, each of fresh photons.
pub struct Photons {
    pub grid: PhotonGrid,
    pub texture: PhotonTexture,
    /// Of all maps so far.
    pub counts: PhotonCounts,
    /// Which of the maps it is.
    pub number: u64,
    settings: PhotonSettings,
    seed: u64,
}

impl Photons {
    /// Traces the first map through `all`, which also tells for all of them which surfaces of `gathered` light reaches. Where the device has no memory
    /// left, `make_room` may find some, or say that there is none.
    ///
    /// # Errors
    /// [`Error::Usage`] when there is no light to trace from, or a grid beyond the device's limits; [`Error::Gl`] when it fails.
    pub fn new(
        gpu: &Gpu,
        [all, gathered]: [&Prepared; 2],
        (settings, seed): (&PhotonSettings, u64),
        mut make_room: impl FnMut() -> bool,
    ) -> Result<Self> {
        if all.lights.is_dark() {
            return Err(Error::usage(
                "all lights are too small beside the scene to be told from points",
                "enlarge the lights, or leave out what lies far away",
            ));
        }
        let mut grid = PhotonGrid::new(&all.scene.mesh, settings.grid_cells);
        let counts = all.photons(settings, seed).trace(settings.numbers(0), &mut grid);
        grid.add_area(&gathered.scene.mesh, &gathered.bvh, seed);
        let texture = loop {
            match PhotonTexture::upload(gpu, &grid) {
                Err(error) if gpu.goes_on(&error) && make_room() => {}
                uploaded => break uploaded?,
            }
        };
        Ok(Self { texture, grid, counts, number: 0, settings: *settings, seed })
    }

    /// Makes it the map of this number.
    ///
    /// # Errors
    /// When the device fails.
    pub fn renew(&mut self, gpu: &Gpu, all: &Prepared, number: u64) -> Result<()> {
        if number != self.number {
            // Neither the one nor the other, should this fail.
            self.number = u64::MAX;
            self.grid.clear_flux();
            let counts = all.photons(&self.settings, self.seed).trace(self.settings.numbers(number), &mut self.grid);
            self.texture = PhotonTexture::upload(gpu, &self.grid)?;
            self.counts += counts;
            self.number = number;
        }
        Ok(())
    }
}
