//! One direction of a render taken apart, for people to look at: its layers, and what a point samples of them by the poster's rule.

use glam::{Mat4, Vec2, Vec3, Vec4};

use super::Render;
use crate::direction::Direction;
use crate::error::Result;
use crate::gather::{Bundle, Kill, Peel};
use crate::geometry::triangle_order;
use crate::gpu::Gpu;
use crate::points::{GatherPoint, PointList};

/// One of a render's directions, at either end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct End {
    pub number: u32,
    /// Against the direction: the end that pipelines with both add.
    pub opposite: bool,
}

/// The layers of one direction, the farthest first, in unit space.
#[derive(Clone, Debug)]
pub struct Layers {
    pub end: End,
    /// Unit vector of the rays.
    pub direction: Vec3,
    /// From texel x, texel y and depth of the projection.
    pub from_layer: Mat4,
    pub to_layer: Mat4,
    /// Side of the layers in texels.
    pub size: u32,
    /// Row by row from texel (0, 0).
    pub layers: Vec<Vec<Option<LayerTexel>>>,
}

/// A surface that a layer holds.
#[derive(Clone, Copy, Debug)]
pub struct LayerTexel {
    /// Depth at the texel's centre, and how it changes to the next in x and y.
    pub depth: f32,
    pub slopes: Vec2,
    pub albedo: Vec3,
    pub emissive: bool,
    /// Of the angle between the surface's normal and the rays, unsigned.
    pub cosine: f32,
}

/// What the point behind a pixel finds along a direction.
#[derive(Clone, Debug)]
pub struct Probe {
    /// In the picture, from the upper left corner, both in [0, 1).
    pub place: Vec2,
    pub point: GatherPoint,
    /// For each layer, whether it was sampled: KILL let it pass.
    pub sampled: Vec<bool>,
    /// Where the last sample that was kept lies.
    pub hit: Option<Vec3>,
}

/// Most texels that are kept of a direction: 64 layers of 512², half a gigabyte.
const MOST_TEXELS: usize = 1 << 24;

/// The poster's two passes, for all directions and one point.
pub(super) struct Apart {
    peel: Peel,
    kill: Kill,
}

impl Apart {
    /// What is there, or else made.
    fn of<'a>(shown: &'a mut Option<Self>, gpu: &Gpu, layer_size: u32) -> Result<&'a mut Self> {
        let made = match shown.take() {
            Some(made) => made,
            None => Self { peel: Peel::new(gpu, layer_size)?, kill: Kill::new(gpu, [1, 1])? },
        };
        Ok(shown.insert(made))
    }
}

impl Render {
    /// Peels one direction for show, as [`crate::gather::KillFinder`] peels it: the farthest layers, as many as are kept.
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
        Ok(Layers { end, direction: bundle.direction, from_layer, to_layer: bundle.to_layer, size, layers })
    }

    /// What the point seen at `place`, as [`Probe::place`], samples of these layers; `None` where no surface is seen.
    ///
    /// # Errors
    /// When a program does not compile or the device fails.
    pub fn probe(&mut self, layers: &Layers, place: Vec2) -> Result<Option<Probe>> {
        let camera = self.camera;
        let [width, height] = self.settings.film.size.map(|side| side as f32);
        let ray = camera.ray(place, width / height);
        let Some(seen) = self.gathered.bvh.nearest(camera.eye, ray, None) else { return Ok(None) };
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
        // The hit may lie in a layer that is not kept.
        if sampled.last() == Some(&true) {
            all.find(|&index| !sample(index));
        }
        let hit = kill.hits().read::<Vec2>()[0];
        self.gpu.check("sampling for show")?;
        let hit = (hit.y > 0.0).then(|| point.position + hit.x * bundle.direction);
        Ok(Some(Probe { place, point, sampled, hit }))
    }

    fn bundle(&self, end: End) -> Bundle {
        let direction = self.directions.get(end.number);
        let vector = self.camera.axes() * direction.vector;
        let vector = if end.opposite { -vector } else { vector };
        Bundle::new(&Direction { vector, ..direction }, &self.gathered_geometry.positions, self.settings.layers())
    }
}
