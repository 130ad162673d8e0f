//! A scene as stages read it, and as gather rays see it.

use std::rc::Rc;

use crate::error::{Error, Result};
use crate::geometry::Geometry;
use crate::gpu::Gpu;
use crate::scene::{Bvh, Scene};

/// A scene's surfaces in the three forms that stages read.
pub struct Surfaces {
    /// In unit space.
    pub scene: Scene,
    pub bvh: Bvh,
    pub geometry: Geometry,
}

impl Surfaces {
    fn new(gpu: &Gpu, scene: Scene) -> Result<Rc<Self>> {
        Ok(Rc::new(Self { bvh: Bvh::new(&scene.mesh), geometry: Geometry::upload(gpu, &scene)?, scene }))
    }

    /// All of `scene`, which is in unit space; and what gather rays see of it, [`Scene::without_glass`].
    ///
    /// # Errors
    /// When the device has no memory or its limits are below the scene's sizes; when there is nothing but glass.
    pub fn of(gpu: &Gpu, scene: Scene) -> Result<[Rc<Self>; 2]> {
        let rest = scene.without_glass();
        if rest.as_ref().is_some_and(|rest| rest.mesh.triangles.is_empty()) {
            return Err(Error::usage("all surfaces are glass, so that no light is to be seen", "add a surface that is not"));
        }
        let all = Self::new(gpu, scene)?;
        let gathered = rest.map_or_else(|| Ok(Rc::clone(&all)), |rest| Self::new(gpu, rest))?;
        Ok([all, gathered])
    }
}
