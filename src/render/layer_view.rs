//! What a window asks of a render. The layer view: the layers of one direction, and how a point samples them by KILL, for people to look at. And
//! what lies behind a pixel.

use std::collections::{HashMap, HashSet};
use std::rc::Rc;

use glam::{Mat4, Vec2, Vec3, Vec4};

use super::Render;
use crate::direction::Direction;
use crate::error::Result;
use crate::gather::{Bundle, Kill, Peel};
use crate::geometry::{Geometry, triangle_order};
use crate::gpu::Gpu;
use crate::points::{GatherPoint, PointList};
use crate::prepared::Prepared;
use crate::scene::{Camera, Chance, Rays, WorldCamera};

/// One end of one of a render's directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct End {
    pub number: u32,
    /// Rays go against the direction. Pipelines that gather along both ends add this end.
    pub opposite: bool,
}

/// The layers of one direction in unit space, the farthest first.
#[derive(Clone, Debug)]
pub struct Layers {
    pub end: End,
    /// Unit vector of the rays.
    pub direction: Vec3,
    /// Layer space (texel x, texel y, depth) to unit space.
    pub from_layer: Mat4,
    pub to_layer: Mat4,
    /// Side of the layers in texels.
    pub size: u32,
    /// Each layer row by row from texel (0, 0).
    pub layers: Vec<Vec<Option<LayerTexel>>>,
    /// Corners of the triangles in them, in layer space.
    pub corners: HashMap<u32, [Vec3; 3]>,
}

/// A surface in a texel of a layer.
#[derive(Clone, Copy, Debug)]
pub struct LayerTexel {
    /// Depth at the texel's centre, and its change to the next texel in x and y.
    pub depth: f32,
    pub slopes: Vec2,
    /// Index of its triangle, for [`Layers::corners`].
    pub triangle: u32,
    pub albedo: Vec3,
    pub emissive: bool,
    /// Cosine of the angle between the surface's normal and the rays, unsigned.
    pub cosine: f32,
}

/// The samples and the hit of the point behind a pixel, along one direction.
#[derive(Clone, Debug)]
pub struct Probe {
    /// Place in the picture, from the upper left corner, both coordinates in [0, 1).
    pub place: Vec2,
    pub point: GatherPoint,
    /// For each layer, whether the point sampled it: KILL let it pass.
    pub sampled: Vec<bool>,
    /// Position of the last sample.
    pub hit: Option<Vec3>,
}

/// The names of the surface behind a pixel, as its files give them. They may be empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SeenSurface {
    pub object: String,
    pub material: String,
}

/// Most texels that [`Layers`] keeps: 64 layers of 512², half a gigabyte.
const MOST_TEXELS: usize = 1 << 24;

/// The peel and KILL passes, for any direction and one point.
pub(super) struct Apart {
    peel: Peel,
    kill: Kill,
}

impl Apart {
    /// The passes, made at first use.
    fn of<'a>(shown: &'a mut Option<Self>, gpu: &Gpu, layer_size: u32) -> Result<&'a mut Self> {
        let made = match shown.take() {
            Some(made) => made,
            None => Self { peel: Peel::new(gpu, layer_size)?, kill: Kill::new(gpu, [1, 1])? },
        };
        Ok(shown.insert(made))
    }
}

impl Render {
    /// Peels one direction as [`crate::gather::KillFinder`] does, and returns its farthest layers, at most 2²⁴ texels.
    ///
    /// # Errors
    /// When a program does not compile or the device fails.
    pub fn layers(&mut self, end: End) -> Result<Layers> {
        let (bundle, size) = (self.bundle(end), self.settings.layers());
        let scene = &self.gathered.scene;
        let order = triangle_order(scene);
        let from_layer = bundle.to_layer.inverse();
        let read = |(at, texel): (usize, Vec4)| {
            let triangle = *order.get((texel.w as usize).checked_sub(1)?)?;
            let place = Vec2::new((at as u32 % size) as f32 + 0.5, (at as u32 / size) as f32 + 0.5);
            let position = from_layer.transform_point3(place.extend(texel.x));
            let mesh = &scene.mesh;
            Some(LayerTexel {
                depth: texel.x,
                slopes: Vec2::new(texel.y, texel.z),
                triangle: triangle as u32,
                albedo: scene.albedo(triangle, mesh.barycentric(triangle, position)),
                emissive: scene.material(triangle).is_emissive(),
                cosine: mesh.geometric_normal(triangle).dot(bundle.direction).abs(),
            })
        };
        let Apart { peel, .. } = Apart::of(&mut self.passes.shown, &self.gpu, size)?;
        peel.start();
        let mut layers = Vec::new();
        while (layers.len() + 1) * (size * size) as usize <= MOST_TEXELS {
            let texels: Vec<Vec4> = peel.next(&self.gathered_geometry, &bundle).read();
            let layer: Vec<_> = texels.into_iter().enumerate().map(read).collect();
            if layer.iter().all(Option::is_none) {
                break;
            }
            layers.push(layer);
        }
        self.gpu.check("peeling for show")?;
        let corners = |triangle: u32| {
            let vertices = scene.mesh.triangles[triangle as usize].vertices;
            (triangle, vertices.map(|vertex| bundle.to_layer.transform_point3(scene.mesh.positions[vertex as usize])))
        };
        let seen: HashSet<u32> = layers.iter().flatten().flatten().map(|texel: &LayerTexel| texel.triangle).collect();
        let corners = seen.into_iter().map(corners).collect();
        Ok(Layers { end, direction: bundle.direction, from_layer, to_layer: bundle.to_layer, size, layers, corners })
    }

    /// Samples these layers at the point seen at `place`, as [`Probe::place`]; `None` where the camera sees no surface.
    ///
    /// # Errors
    /// When a program does not compile or the device fails.
    pub fn probe(&mut self, layers: &Layers, place: Vec2) -> Result<Option<Probe>> {
        let camera = self.camera;
        let [width, height] = self.settings.film.size.map(|side| side as f32);
        let ray = camera.ray(place, width / height);
        let rays = Rays::new(&self.gathered.scene, &self.gathered.bvh);
        let Some(seen) = rays.nearest(camera.eye, ray, None, Chance::default()) else { return Ok(None) };
        let normal = self.gathered.scene.mesh.side_met(seen.triangle, ray);
        let point = GatherPoint::flat(camera.eye + seen.distance * ray, normal);

        let bundle = self.bundle(layers.end);
        let list = PointList::upload(&self.gpu, &[point])?;
        let Apart { peel, kill } = Apart::of(&mut self.passes.shown, &self.gpu, layers.size)?;
        peel.start();
        kill.start();
        let mut sample = |index| kill.sample(list.points(), &bundle, peel.next(&self.gathered_geometry, &bundle), index) > 0;
        let mut all = 0..;
        let sampled: Vec<bool> = all.by_ref().take(layers.layers.len()).map(&mut sample).collect();
        // The hit may lie in a layer beyond those kept.
        if sampled.last() == Some(&true) {
            all.find(|&index| !sample(index));
        }
        let hit = kill.hits().read::<Vec2>()[0];
        self.gpu.check("sampling for show")?;
        let hit = (hit.y > 0.0).then(|| point.position + hit.x * bundle.direction);
        Ok(Some(Probe { place, point, sampled, hit }))
    }

    /// The surface that a camera sees at `place`, as [`Probe::place`], of a picture of this size. Mirrors and glass count as surfaces.
    pub fn surface_at(&self, camera: WorldCamera, size: [u32; 2], place: Vec2) -> Option<SeenSurface> {
        let [width, height] = size.map(|side| side as f32);
        let Prepared { scene, bvh, .. } = &*self.all;
        let camera = scene.space.enter_camera(camera);
        let ray = camera.ray(place, width / height);
        let triangle = Rays::new(scene, bvh).nearest(camera.eye, ray, None, Chance::default())?.triangle;
        let vertex = scene.mesh.triangles[triangle].vertices[0];
        let instance = scene.mesh.sources.get(vertex as usize).and_then(|source| scene.instances.get(source.instance as usize));
        let object = instance.map_or_else(String::new, |instance| instance.name.clone());
        Some(SeenSurface { object, material: scene.material(triangle).name.clone() })
    }

    /// The scene that gather rays meet, its GL side, and the camera in unit space: for a bake beside the render.
    pub fn gathered(&self) -> (Rc<Prepared>, Rc<Geometry>, Camera) {
        (Rc::clone(&self.gathered), Rc::clone(&self.gathered_geometry), self.camera)
    }

    fn bundle(&self, end: End) -> Bundle {
        let direction = self.directions.get(end.number);
        let vector = self.camera.axes() * direction.vector;
        let vector = if end.opposite { -vector } else { vector };
        Bundle::new(&Direction { vector, ..direction }, &self.gathered_geometry.positions, self.settings.layers())
    }
}
