//! The scene with its ray tree and lights, ready for gathering, and its photon map.
//!
//! [`Prepared`] is the CPU side. It needs no GL device and traces no photons. [`Geometry`](crate::geometry::Geometry) is the GL side,
//! uploaded from [`Prepared::scene`].

use std::rc::Rc;

use glam::Vec3;

use crate::error::{Error, Result};
use crate::geometry::triangle_order;
use crate::gpu::Gpu;
use crate::photon::{Guide, PhotonAtlas, PhotonCounts, PhotonGrid, PhotonStore, PhotonTexture, PhotonTracer};
use crate::scene::{Bvh, Lights, Scene, World, reversed_lamps};
use crate::settings::{PhotonMapKind, PhotonSettings};

/// A scene in unit space, with its ray tree and its lights.
pub struct Prepared {
    pub scene: Scene,
    pub bvh: Rc<Bvh>,
    pub lights: Lights,
}

impl Prepared {
    /// The scene without glass, for bakes. Gather rays pass straight through glass, and no bake covers it.
    ///
    /// # Errors
    /// [`Error::Usage`] when all surfaces are glass.
    pub fn without_glass(world: &World) -> Result<Self> {
        let scene = world.flatten();
        Ok(Self::of(rest_of(&scene)?.unwrap_or(scene)))
    }

    /// The whole scene for eye rays and photons, and the scene without glass for gather rays. A scene without glass returns the same [`Rc`] twice.
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

    /// `scene` is in unit space.
    pub fn of(scene: Scene) -> Self {
        Self { bvh: Rc::new(Bvh::new(&scene.mesh)), lights: Lights::new(&scene), scene }
    }

    /// Warnings for the user: lamps that look turned the wrong way.
    pub fn warnings(&self) -> Vec<String> {
        reversed_lamps(&self.scene, &self.bvh)
    }

    /// A tracer of photons through this scene.
    pub fn photons(&self, settings: &PhotonSettings, seed: u64) -> PhotonTracer<'_> {
        PhotonTracer::new(&self.scene, &self.bvh, &self.lights, seed, settings.depth)
    }
}

/// The scene without its glass; `None` when it has no glass.
fn rest_of(scene: &Scene) -> Result<Option<Scene>> {
    let rest = scene.without_glass();
    if rest.as_ref().is_some_and(|rest| rest.mesh.triangles.is_empty()) {
        return Err(Error::usage("all surfaces are glass, on which no light is gathered", "add a surface that is not"));
    }
    Ok(rest)
}

/// The flux of photons, on surfaces or in a grid.
pub enum FluxMap {
    Atlas(Box<PhotonAtlas>),
    Grid(PhotonGrid),
}

impl FluxMap {
    pub fn store(&self) -> &dyn PhotonStore {
        match self {
            Self::Atlas(atlas) => &**atlas,
            Self::Grid(grid) => grid,
        }
    }

    fn store_mut(&mut self) -> &mut dyn PhotonStore {
        match self {
            Self::Atlas(atlas) => &mut **atlas,
            Self::Grid(grid) => grid,
        }
    }
}

/// The current photon map. A long render uses several maps in turn, each with fresh photons.
pub struct Photons {
    pub map: FluxMap,
    pub texture: PhotonTexture,
    /// Sum over all maps so far.
    pub counts: PhotonCounts,
    /// Number of the current map, from 0.
    pub number: u64,
    guide: Option<Guide>,
    settings: PhotonSettings,
    seed: u64,
}

impl Photons {
    /// Traces the first map through `all`. Its flux decides, for all maps, which surface area of `gathered` light reaches. Photons are guided to what
    /// `points` see, each with its unit normal; without points they are not guided. When the device has no memory left, `make_room` frees some and
    /// returns true, or returns false.
    ///
    /// # Errors
    /// [`Error::Usage`] when all lights are too small to trace from, or the grid exceeds the device's limits; [`Error::Gl`] when the device fails.
    pub fn new(
        gpu: &Gpu,
        [all, gathered]: [&Prepared; 2],
        (settings, seed): (&PhotonSettings, u64),
        points: &[(Vec3, Vec3)],
        mut make_room: impl FnMut() -> bool,
    ) -> Result<Self> {
        if all.lights.is_dark() {
            return Err(Error::usage(
                "all lights are too small beside the scene to be told from points",
                "enlarge the lights, or leave out what lies far away",
            ));
        }
        let guided = settings.map == PhotonMapKind::Surface && !points.is_empty();
        let tracer = all.photons(settings, seed);
        let guide = guided.then(|| Guide::new(&tracer, &gathered.scene, &gathered.bvh, points));
        let tracer = tracer.guided(guide.as_ref());
        let mut map = match settings.map {
            PhotonMapKind::Surface => {
                let Prepared { scene, bvh, .. } = all;
                let arrivals = |groups: &[u32], count| tracer.arrivals(settings.count, groups, count);
                let kept = (all.scene.mesh.triangles.len() != gathered.scene.mesh.triangles.len()).then(|| scene.not_glass());
                FluxMap::Atlas(Box::new(PhotonAtlas::new(scene, bvh, kept, arrivals)))
            }
            PhotonMapKind::Grid => FluxMap::Grid(PhotonGrid::new(&all.scene.mesh, settings.grid_cells)),
        };
        let counts = tracer.trace(settings.numbers(0), map.store_mut());
        if let FluxMap::Grid(grid) = &mut map {
            grid.add_area(&gathered.scene, &gathered.bvh, seed);
        }
        let upload = || match &map {
            FluxMap::Atlas(atlas) => PhotonTexture::of_atlas(gpu, atlas, &triangle_order(&gathered.scene)),
            FluxMap::Grid(grid) => PhotonTexture::upload(gpu, grid),
        };
        let texture = loop {
            match upload() {
                Err(error) if gpu.goes_on(&error) && make_room() => {}
                uploaded => break uploaded?,
            }
        };
        Ok(Self { texture, map, counts, number: 0, guide, settings: *settings, seed })
    }

    /// Replaces the map by the one with this number, unless it is that one already.
    ///
    /// # Errors
    /// When the device fails.
    pub fn renew(&mut self, gpu: &Gpu, all: &Prepared, number: u64) -> Result<()> {
        if number != self.number {
            // If the upload fails, the map has no valid number, so the next call traces again.
            self.number = u64::MAX;
            let store = self.map.store_mut();
            store.clear_flux();
            let tracer = all.photons(&self.settings, self.seed).guided(self.guide.as_ref());
            let counts = tracer.trace(self.settings.numbers(number), store);
            match &self.map {
                FluxMap::Atlas(atlas) => self.texture.renew(gpu, atlas)?,
                FluxMap::Grid(grid) => self.texture = PhotonTexture::upload(gpu, grid)?,
            }
            self.counts += counts;
            self.number = number;
        }
        Ok(())
    }
}
