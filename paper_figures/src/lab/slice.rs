//! A vertical slice of the Cornell box with one direction in it, and the layers of that direction's bundle as gather points sample them.

use std::collections::VecDeque;

use finalgather::gather::{Bundle, Kill, Peel};
use finalgather::geometry::Geometry;
use finalgather::math::frame;
use finalgather::points::PointList;
use finalgather::scene::{Bvh, RAY_OFFSET};
use finalgather::{Direction, Scene};
use glam::{Vec2, Vec3, Vec4, vec2, vec3};
use serde::{Deserialize, Serialize};

use crate::figure::Result;
use crate::lab::cornell::cornell;
use crate::lab::library::{GatherPoint, Gpu, gpu};

/// A vertical plane through a scene, and the bundle of a direction in it. Flat places and vectors are to the right and up, in unit space.
pub struct Slice {
    scene: Scene,
    bvh: Bvh,
    gpu: Gpu,
    geometry: Geometry,
    /// Of the plane: where it leaves the wall on the left, at the bottom.
    origin: Vec3,
    right: Vec3,
    /// Width and height.
    size: Vec2,
    direction: Vec3,
    bundle: Bundle,
    layer_size: u32,
    /// The row of texels whose middles are in the plane.
    row: u32,
}

/// What a point sees of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sight {
    /// Or culled by KILL.
    pub sampled: bool,
    /// Along the direction from the point, negative behind it.
    pub distance: f32,
}

impl Slice {
    /// `depths` are where the plane leaves the walls on the left and on the right, as shares of the box's depth from the near side.
    pub fn new([left, right]: [f32; 2], elevation_degrees: f32, layer_size: u32) -> Result<Self> {
        let mut scene = cornell()?;
        // The lamp hangs a tenth of a millimetre below the ceiling: two layers that no drawing can tell apart.
        let Scene { mesh, materials, .. } = &mut scene;
        mesh.triangles.retain(|triangle| !materials[triangle.material as usize].is_emissive());
        let (bvh, gpu) = (Bvh::new(mesh), gpu()?);
        let geometry = Geometry::upload(&gpu, &scene)?;

        // Seen from the camera's side, on which the box is open. The camera looks along +z with y up, so that x grows to the left.
        let bounds = scene.mesh.bounds();
        let [origin, end] = [(bounds.max.x, left), (bounds.min.x, right)]
            .map(|(x, depth)| vec3(x, bounds.min.y, bounds.min.z + depth * bounds.extent().z));
        let (right, size) = ((end - origin).normalize(), vec2((end - origin).length(), bounds.extent().y));

        let flat = Vec2::from_angle(elevation_degrees.to_radians());
        let direction = flat.x * right + flat.y * Vec3::Y;
        let [x, y, _] = frame(direction).to_cols_array_2d().map(Vec3::from);
        let across = right.cross(Vec3::Y).cross(direction);
        let turn = across.dot(y).atan2(across.dot(x));
        let with = |shift| Bundle::new(&Direction { vector: direction, turn, shift }, &geometry.positions, layer_size);
        let row = |bundle: &Bundle| bundle.to_layer.transform_point3(origin).y;
        let bundle = with(vec2(0.5, (0.5 - row(&with(Vec2::ZERO))).rem_euclid(1.0)));
        let row = row(&bundle) as u32;
        Ok(Self { scene, bvh, gpu, geometry, origin, right, size, direction, bundle, layer_size, row })
    }

    fn vector(&self, flat: Vec2) -> Vec3 {
        flat.x * self.right + flat.y * Vec3::Y
    }

    pub fn flat(&self, vector: Vec3) -> Vec2 {
        vec2(vector.dot(self.right), vector.y)
    }

    pub fn place(&self, position: Vec3) -> Vec2 {
        self.flat(position - self.origin)
    }

    pub fn direction(&self) -> Vec2 {
        self.flat(self.direction)
    }

    /// The two places where the plane leaves a triangle, if it meets it.
    fn cut(&self, corners: [Vec3; 3]) -> Option<[Vec2; 2]> {
        let side = |corner: Vec3| (corner - self.origin).dot(self.right.cross(Vec3::Y));
        let crossing = |k: usize| {
            let [from, to] = [corners[k], corners[(k + 1) % 3]];
            let [a, b] = [from, to].map(side);
            (a.signum() != b.signum()).then(|| self.place(from.lerp(to, a / (a - b))))
        };
        let mut crossings = (0..3).filter_map(crossing);
        crossings.next().zip(crossings.next()).map(|(a, b)| [a, b])
    }

    /// The albedos and lines of all surfaces that the plane meets. Surfaces of one albedo that touch are one line.
    pub fn surfaces(&self) -> Vec<(Vec3, Vec<Vec2>)> {
        let Scene { mesh, .. } = &self.scene;
        let part = |triangle| Some((self.scene.material(triangle).albedo, self.cut(mesh.corners(triangle))?));
        let mut parts: Vec<(Vec3, [Vec2; 2])> = (0..mesh.triangles.len()).filter_map(part).collect();
        let near = |a: Vec2, b: Vec2| a.distance(b) < 1e-5;
        let touches = |line: &VecDeque<Vec2>, end: Vec2| near(end, line[0]) || near(end, line[line.len() - 1]);
        let mut surfaces = Vec::new();
        while let Some((albedo, ends)) = parts.pop() {
            let mut line = VecDeque::from(ends);
            let joins = |line: &_, &(of, ends): &(Vec3, [Vec2; 2])| of == albedo && ends.iter().any(|&end| touches(line, end));
            while let Some(next) = parts.iter().position(|part| joins(&line, part)) {
                let (_, [a, b]) = parts.swap_remove(next);
                let (end, other) = if touches(&line, a) { (a, b) } else { (b, a) };
                if near(end, line[0]) { line.push_front(other) } else { line.push_back(other) }
            }
            surfaces.push((albedo, line.into()));
        }
        surfaces
    }

    /// The first surface point from a place, in shares of the plane's width and height, towards an axis, on the side that is met.
    pub fn look(&self, from: Vec2, towards: Vec2) -> Result<GatherPoint> {
        let (from, towards) = (self.origin + self.vector(from * self.size), self.vector(towards));
        let hit = self.bvh.nearest(from, towards, None).ok_or("a gather point has no surface to lie on")?;
        Ok(GatherPoint::flat(from + hit.distance * towards, self.scene.mesh.side_met(hit.triangle, towards)))
    }

    /// The column of texels of a point, and its place in the layer's coordinates: texels, and depth.
    pub fn in_layer(&self, point: &GatherPoint) -> (usize, Vec3) {
        let place = self.bundle.to_layer.transform_point3(point.position);
        (place.x as usize, place)
    }

    /// The position at a place in the row: texels, and depth.
    pub fn in_row(&self, x: f32, depth: f32) -> Vec3 {
        self.bundle.to_layer.inverse().transform_point3(vec3(x, self.row as f32 + 0.5, depth))
    }

    /// How far along the direction a point's ray goes.
    pub fn exact(&self, point: &GatherPoint) -> Option<f32> {
        let origin = point.position + RAY_OFFSET * point.normal;
        self.bvh.nearest(origin, self.direction, None).map(|hit| hit.distance)
    }

    /// Peels layers down to the first that is empty in the row. Returns the row of each: depth, slope along the row, and w = 0 where there is
    /// nothing; and what each point sees of each, `None` where nothing is in its texel.
    #[expect(clippy::type_complexity, reason = "two lists of lists")]
    pub fn sample(&self, points: &[GatherPoint]) -> Result<(Vec<Vec<Vec4>>, Vec<Vec<Option<Sight>>>)> {
        let list = PointList::upload(&self.gpu, points)?;
        let (mut peel, kill) = (Peel::new(&self.gpu, self.layer_size)?, Kill::new(&self.gpu, list.points().size())?);
        let (mut layers, mut sights) = (Vec::new(), vec![Vec::new(); points.len()]);
        let length = self.bundle.to_layer.inverse().z_axis.length();
        let size = self.layer_size as usize;
        peel.start();
        kill.start();
        for index in 0.. {
            let before = kill.hits().read::<[f32; 2]>();
            let layer = peel.next(&self.geometry, &self.bundle);
            kill.sample(list.points(), &self.bundle, layer, index);
            let texels: Vec<Vec4> = layer.read()[self.row as usize * size..][..size].to_vec();
            if texels.iter().all(|texel| texel.w == 0.0) {
                break;
            }
            let hits = kill.hits().read::<[f32; 2]>().into_iter().zip(before);
            for ((point, sights), (hit, before)) in points.iter().zip(&mut sights).zip(list.in_order(hits.collect())) {
                let (column, place) = self.in_layer(point);
                let texel = texels[column];
                let ahead = texel.x + texel.y * (place.x.fract() - 0.5) - place.z;
                sights.push(match hit != before {
                    true => Some(Sight { sampled: true, distance: hit[0] }),
                    false => (texel.w > 0.0).then_some(Sight { sampled: false, distance: ahead * length }),
                });
            }
            layers.push(texels);
        }
        self.gpu.check("sampling layers")?;
        Ok((layers, sights))
    }
}
