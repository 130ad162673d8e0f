//! Final gathering: the irradiance at many points from many shared directions, by depth peeling.
//!
//! For a direction d, the rays from all points along +d are lines of one orthographic projection. Peeling the scene along d gives layers; a
//! point's hit is the nearest layer beyond it:
//!
//! E(x) = π Σ L(x, d) w / Σ w, w = max(n·d, 0), over N directions uniform on the sphere.
//!
//! Dividing by the sum of the weights, not by its expected value N/4, makes a constant radiance exact. A direction that counts at both ends has
//! w = |n·d|. A direction costs one pass over the triangles and one over the points for each layer, independent of other directions.
//!
//! A [`HitFinder`] finds hits, and a [`GatherPass`] gives them to a [`Consumer`](crate::shaders::Consumer). Each finder works with each consumer.
//! [`KillFinder`] is the method of the source: Hachisuka 2004, "Final Gathering on GPU".

mod bundle;
mod choice;
mod cpu_rays;
mod irradiance;
mod kill;
mod kill_finder;
mod layer_store;
mod layers;
mod outline;
mod pass;
mod peel;
mod rays;
mod stored;

use std::rc::Rc;

use glam::{Vec3, Vec4};

pub use bundle::Bundle;
pub use choice::{chosen_for_bake, chosen_for_picture};
pub use cpu_rays::CpuRayFinder;
pub use irradiance::{GatherInputs, IrradianceGather};
pub use kill::Kill;
pub use kill_finder::KillFinder;
pub use layer_store::{Filled, LayerStore};
pub use layers::LayerFinder;
pub use pass::GatherPass;
pub use peel::Peel;
pub use rays::RayFinder;
pub use stored::{HIT_BYTES, Recorder, StoredHits};

use crate::direction::Direction;
use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::{Gpu, Uniform};
use crate::points::Points;
use crate::scene::{Bvh, Scene};
use crate::settings::{GatherSettings, Pipeline};
use crate::shaders::Finder;

/// A way to find the hit of each point along each direction of a batch.
pub trait HitFinder {
    /// The most directions in a batch.
    fn batch(&self) -> usize;

    /// Whether both ends of a direction count: a point looks along the end on its side of its surface. Else only points that face it have a weight.
    fn both_ends(&self) -> bool {
        true
    }

    /// Tells the positions of the receivers of all later batches, if the finder asks. Points that [`Self::find`] is asked for are among them.
    fn fit(&mut self, _receivers: &dyn Fn() -> Vec<Vec3>) {}

    /// Does the work that all points share, for the first of at most [`Self::batch`] directions, as memory allows. Returns how many, 1 or more.
    ///
    /// # Errors
    /// [`crate::Error::Gl`] when the device is too small for the scene.
    ///
    /// # Panics
    /// When `directions` is empty.
    fn begin(&mut self, geometry: &Geometry, directions: &[Direction]) -> Result<usize>;

    /// The hits of `points` along the directions of the last [`Self::begin`].
    ///
    /// # Errors
    /// When the device has no memory for the hits.
    fn find(&mut self, geometry: &Geometry, points: Points) -> Result<Found<'_>>;

    /// Frees memory that the finder does not need. Returns whether it freed any.
    fn shrink(&mut self) -> bool {
        false
    }
}

/// The hits that a [`GatherPass`] reads: from a texture, or found by its own shader. Mirrors `glsl/include/hits.glsl`.
#[derive(Clone)]
pub struct Found<'a> {
    finder: Finder,
    /// The most layers peeled for a direction; 0 when the finder peels none.
    pub layers: u32,
    /// Unit vectors.
    directions: &'a [Vec4],
    both_ends: bool,
    /// Uniforms of the finder.
    uniforms: Vec<(&'static str, Uniform<'a>)>,
}

impl<'a> Found<'a> {
    fn uniforms(&self) -> Vec<(&'static str, Uniform<'a>)> {
        let directions = ("directions", Uniform::Vec4s(self.directions));
        [&[directions, ("direction_count", Uniform::Int(self.directions.len() as i32))], &self.uniforms[..]].concat()
    }
}

const UNRESOLVED: &str = "auto is replaced when a job begins";

/// The shader file that finds the hits of a pipeline in a scene.
fn shader_of(pipeline: Pipeline, scene: &Scene) -> Finder {
    match pipeline {
        Pipeline::Fused => Finder::Layers,
        Pipeline::RaycastGl if scene.has_cut_outs() => Finder::CutRays,
        Pipeline::RaycastGl => Finder::Rays,
        Pipeline::Kill | Pipeline::EarlyKill | Pipeline::Raycast => Finder::Stored,
        Pipeline::Auto => unreachable!("{UNRESOLVED}"),
    }
}

/// The hit finder of the settings' pipeline, for point textures of size `points` and layers of [`GatherSettings::layers`]. `scene` is in unit space;
/// `bvh` belongs to its mesh.
///
/// # Errors
/// When a size is beyond the device's limits.
///
/// # Panics
/// For [`Pipeline::Auto`].
pub fn hit_finder(
    gpu: &Gpu,
    settings: &GatherSettings,
    layers: u32,
    scene: &Scene,
    bvh: &Rc<Bvh>,
    points: [u32; 2],
) -> Result<Box<dyn HitFinder>> {
    let kill = |kill| KillFinder::new(gpu, layers, kill, settings.stop_fraction);
    Ok(match settings.pipeline {
        Pipeline::Fused => Box::new(LayerFinder::new(gpu, layers)?),
        Pipeline::Kill => Box::new(kill(Kill::new(gpu, points)?)?),
        Pipeline::EarlyKill => Box::new(kill(Kill::early(gpu, points)?)?),
        Pipeline::RaycastGl => Box::new(RayFinder::default()),
        Pipeline::Raycast => Box::new(CpuRayFinder::new(gpu, scene, Rc::clone(bvh))),
        Pipeline::Auto => unreachable!("{UNRESOLVED}"),
    })
}

/// Miss radiance: the radiance of rays that meet no surface, equal for all points.
pub struct MissRadiance {
    along: Vec<Vec4>,
    against: Vec<Vec4>,
}

impl MissRadiance {
    /// Along and against each direction of a batch: what the gather alone brings. Direct light has the bright parts of the environment.
    pub fn new(scene: &Scene, directions: &[Direction]) -> Self {
        Self::by(directions, |direction| scene.gathered_radiance(direction))
    }

    /// The same with the bright parts of the environment, for sums without direct light.
    pub fn whole(scene: &Scene, directions: &[Direction]) -> Self {
        Self::by(directions, |direction| scene.miss_radiance(direction))
    }

    fn by(directions: &[Direction], radiance: impl Fn(Vec3) -> Vec3) -> Self {
        let seen = |side: f32| directions.iter().map(|direction| radiance(side * direction.vector).extend(0.0)).collect();
        Self { along: seen(1.0), against: seen(-1.0) }
    }

    /// The uniforms of `glsl/include/hits.glsl`.
    pub fn uniforms(&self) -> [(&'static str, Uniform<'_>); 2] {
        [("miss_along", Uniform::Vec4s(&self.along)), ("miss_against", Uniform::Vec4s(&self.against))]
    }
}
