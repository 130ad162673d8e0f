//! One direction of a gather, as the camera's pixels meet it: its layers, what each pixel samples of them, and the light of the last sample.

use finalgather::Direction;
use finalgather::gather::{Bundle, Kill, Peel};
use finalgather::geometry::Geometry;
use finalgather::math::frame;
use finalgather::points::{CameraPoints, PointList};
use finalgather::reference::Reference;
use glam::{Vec2, Vec3, Vec4};

use crate::figure::Result;
use crate::lab::cornell::PhotonGrid;
use crate::lab::library::{GatherPoint, Image, Scene, gpu};
use crate::lab::pictures::rgb;
use crate::lab::slice::Stage;

/// What surfaces and pixels without a value look like.
const NOTHING: Vec3 = Vec3::splat(0.03);

/// A layer as the direction sees it, and the camera's picture after it: each pixel has the colour of what it sampled last.
pub struct Peeled {
    pub layer: Image,
    pub sampled: Image,
    /// Pixels that sample this layer.
    pub samples: usize,
}

/// The direction of a slice, for the pixels of a camera.
pub struct OneDirection<'a> {
    stage: &'a Stage,
    side: usize,
    /// Of all pixels, row by row from the bottom.
    pixels: Vec<Option<GatherPoint>>,
}

impl<'a> OneDirection<'a> {
    pub fn new(stage: &'a Stage, side: u32) -> Result<Self> {
        let gpu = gpu()?;
        let geometry = Geometry::upload(&gpu, &stage.scene)?;
        let camera = CameraPoints::new(&gpu, [side; 2])?;
        let pixels = camera.see(&geometry, &stage.scene.camera([side; 2]), Vec2::splat(0.5), 0).pixels();
        Ok(Self { stage, side: side as usize, pixels })
    }

    fn points(&self) -> Vec<GatherPoint> {
        self.pixels.iter().flatten().copied().collect()
    }

    /// How many pixels gather, and how many of them along this direction: those that face it.
    pub fn counts(&self) -> [usize; 2] {
        let points = self.points();
        [points.len(), points.iter().filter(|point| point.cosine(self.stage.vector) > 0.0).count()]
    }

    /// All layers, far to near.
    pub fn peel(&self, layer_size: u32) -> Result<Vec<Peeled>> {
        let Stage { scene, vector, .. } = self.stage;
        let (gpu, points) = (gpu()?, self.points());
        let geometry = Geometry::upload(&gpu, scene)?;
        // Turned so that up is up in the pictures of layers.
        let [x, y, _] = frame(*vector).to_cols_array_2d().map(Vec3::from);
        let turn = Vec3::Y.dot(-x).atan2(Vec3::Y.dot(y));
        let bundle =
            Bundle::new(&Direction { vector: *vector, turn, shift: Vec2::ZERO, number: 0 }, &geometry.positions, layer_size);
        let list = PointList::upload(&gpu, &points)?;
        let (mut peel, kill) = (Peel::new(&gpu, layer_size)?, Kill::new(&gpu, list.points().size())?);
        peel.start();
        kill.start();
        let mut sampled = vec![NOTHING; points.len()];
        let mut peeled = Vec::new();
        for index in 0.. {
            let before = kill.hits().read::<Vec2>();
            let layer = peel.next(&geometry, &bundle);
            kill.sample(list.points(), &bundle, layer, index);
            let texels: Vec<Vec4> = layer.read();
            if texels.iter().all(|texel| texel.w == 0.0) {
                break;
            }
            let changes = kill.hits().read::<Vec2>().into_iter().zip(before).map(|(hit, before)| (hit != before).then_some(hit));
            let changes = list.in_order(changes.collect());
            for (color, hit) in sampled.iter_mut().zip(&changes) {
                if let Some(hit) = hit {
                    *color = color_of(scene, hit.y, *vector);
                }
            }
            // The layer's x grows to the left of one who looks along the direction.
            let seen = texels.chunks(layer_size as usize).flat_map(|row| row.iter().rev());
            let colors = seen.map(|texel| color_of(scene, texel.w, *vector)).collect();
            let samples = changes.iter().flatten().count();
            peeled.push(Peeled { layer: picture(layer_size as usize, colors), sampled: self.picture(&sampled), samples });
        }
        gpu.check("sampling layers")?;
        Ok(peeled)
    }

    /// The radiance that points find along the direction, by exact rays.
    pub fn light(&self, grid: &PhotonGrid, points: &[GatherPoint]) -> Vec<Vec3> {
        let Stage { scene, bvh, vector, .. } = self.stage;
        let sums = Reference::new(scene, bvh, grid).gather(points, &[*vector]);
        sums.into_iter().map(|sum| if sum.w > 0.0 { sum.truncate() / sum.w } else { Vec3::ZERO }).collect()
    }

    /// The same at the pixels, times the cosine: what the direction adds to each sum.
    pub fn light_at_pixels(&self, grid: &PhotonGrid) -> Image {
        let points = self.points();
        let added = |(light, point): (Vec3, &GatherPoint)| light * point.cosine(self.stage.vector);
        self.picture(&self.light(grid, &points).into_iter().zip(&points).map(added).collect::<Vec<_>>())
    }

    /// From a colour for each point.
    fn picture(&self, of_points: &[Vec3]) -> Image {
        let mut colors = of_points.iter().copied();
        picture(self.side, self.pixels.iter().map(|pixel| pixel.and_then(|_| colors.next()).unwrap_or(NOTHING)).collect())
    }
}

/// The albedo of a triangle, counted from 1, brighter where it faces the direction.
fn color_of(scene: &Scene, triangle: f32, direction: Vec3) -> Vec3 {
    let Some(triangle) = (triangle as usize).checked_sub(1) else { return NOTHING };
    let cosine = scene.mesh.geometric_normal(triangle).dot(direction).abs();
    (0.35 + 0.65 * cosine) * scene.material(triangle).albedo
}

/// A square picture from rows that begin at the bottom.
fn picture(side: usize, colors: Vec<Vec3>) -> Image {
    let rows: Vec<Vec3> = colors.chunks(side).rev().flatten().copied().collect();
    rgb(side, [0, 1, 2].map(|k| rows.iter().map(|color| color[k]).collect()))
}
