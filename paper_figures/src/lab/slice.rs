//! A vertical slice of the Cornell box with one direction in it, and the layers of that direction's bundle as gather points sample them.

use std::collections::VecDeque;

use finalgather::Direction;
use finalgather::gather::{Bundle, Kill, Peel};
use finalgather::geometry::Geometry;
use finalgather::math::frame;
use finalgather::points::PointList;
use finalgather::scene::{Bvh, Mesh, RAY_OFFSET, Scene};
use glam::{Vec2, Vec3, Vec4, vec2, vec3};
use serde::{Deserialize, Serialize};

use crate::figure::Result;
use crate::lab::cornell::cornell;
use crate::lab::library::{GatherPoint, gpu};

/// To the right and up in the slice, in unit space.
pub type Place = [f32; 2];

/// What is measured. Lengths are in unit space.
#[derive(Serialize, Deserialize)]
pub struct Slice {
    pub layer_size: u32,
    /// From gather points towards what they gather.
    pub direction: Place,
    pub surfaces: Vec<Surface>,
    /// The middle of each column of texels, through the whole depth of the bundle.
    pub rays: Vec<[Place; 2]>,
    /// The row of texels in the slice, the farthest layer first.
    pub layers: Vec<Vec<Texel>>,
    pub points: Vec<Point>,
}

/// Where the slice cuts surfaces of one albedo that are joined.
#[derive(Serialize, Deserialize)]
pub struct Surface {
    pub albedo: [f32; 3],
    pub line: Vec<Place>,
}

/// Depth and slope, as places.
#[derive(Serialize, Deserialize)]
pub struct Texel {
    pub column: usize,
    pub center: Place,
    /// From the centre to where the surface's plane is in the middle of the next column.
    pub step: Place,
}

#[derive(Serialize, Deserialize)]
pub struct Point {
    pub place: Place,
    pub normal: Place,
    pub column: usize,
    /// One for each layer; `None` where nothing is in its texel.
    pub sights: Vec<Option<Sight>>,
}

/// What a point sees of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sight {
    /// Or culled by KILL.
    pub sampled: bool,
    /// Along the direction from the point, negative behind it.
    pub distance: f32,
}

/// Where a point is looked for: from a place, in shares of the slice's width and height, to the first surface along an axis.
#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Look {
    from: Place,
    towards: Place,
}

impl Point {
    /// The last layer up to this one that it samples, and how far ahead that is.
    pub fn last_sample(&self, layer: usize) -> Option<(usize, f32)> {
        let sampled = |(layer, sight): (usize, &Option<Sight>)| Some((layer, sight.filter(|sight| sight.sampled)?.distance));
        self.sights.iter().take(layer + 1).enumerate().filter_map(sampled).next_back()
    }

    /// The distance at which the point's ray ends.
    fn hit(&self) -> Option<f32> {
        self.last_sample(self.sights.len()).map(|(_, distance)| distance)
    }
}

/// The Cornell box with a vertical plane through it and a direction in the plane.
pub struct Stage {
    pub scene: Scene,
    pub bvh: Bvh,
    plane: Plane,
    /// The direction, in the slice and in space.
    flat: Vec2,
    pub vector: Vec3,
}

impl Stage {
    /// `depths` are where the slice leaves the walls on the left and on the right, as shares of the box's depth from the near side.
    pub fn new(depths: [f32; 2], elevation_degrees: f32) -> Result<Self> {
        let mut scene = cornell()?;
        // The lamp hangs a tenth of a millimetre below the ceiling: two layers that no drawing can tell apart.
        let Scene { mesh, materials, .. } = &mut scene;
        mesh.triangles.retain(|triangle| !materials[triangle.material as usize].is_emissive());
        let plane = Plane::of(mesh, depths);
        let flat = Vec2::from_angle(elevation_degrees.to_radians());
        Ok(Self { bvh: Bvh::new(mesh), vector: plane.vector(flat), flat, plane, scene })
    }

    pub fn points_at(&self, looks: &[Look]) -> Result<Vec<GatherPoint>> {
        looks.iter().map(|&look| self.plane.look(&self.scene.mesh, &self.bvh, look)).collect()
    }

    /// In the slice, at even distances on the fronts of all surfaces that are not enclosed.
    pub fn points_every(&self, distance: f32) -> Vec<GatherPoint> {
        let mesh = &self.scene.mesh;
        let of_triangle = |triangle| {
            let [a, b] = self.plane.cut(mesh.corners(triangle))?;
            let count = (a.distance(b) / distance).round();
            let place = move |i: u32| a.lerp(b, (i as f32 + 0.5) / count);
            let point = move |i| GatherPoint::flat(self.plane.position(place(i)), mesh.geometric_normal(triangle));
            Some((0..count as u32).map(point))
        };
        let is_open = |point: &GatherPoint| {
            let above = self.bvh.nearest(point.position + RAY_OFFSET * point.normal, point.normal, None);
            above.is_none_or(|hit| mesh.geometric_normal(hit.triangle).dot(point.normal) < 0.0 && hit.distance > 0.01)
        };
        (0..mesh.triangles.len()).filter_map(of_triangle).flatten().filter(is_open).collect()
    }

    /// How far ahead the exact ray of each point ends; `None` for points that face away from the direction.
    pub fn ends(&self, points: &[GatherPoint]) -> Vec<Option<f32>> {
        let hit = |point: &GatherPoint| self.bvh.nearest(point.position + RAY_OFFSET * point.normal, self.vector, None);
        let end = |point: &GatherPoint| (point.cosine(self.vector) > 0.0).then(|| hit(point)).flatten();
        points.iter().map(|point| end(point).map(|hit| hit.distance)).collect()
    }
}

impl Slice {
    /// Peels layers down to the first that is empty in the slice, and lets points in it sample each by KILL.
    pub fn measure(stage: &Stage, layer_size: u32, points: &[GatherPoint]) -> Result<Self> {
        let Stage { scene, plane, flat, vector, .. } = stage;
        let gpu = gpu()?;
        let geometry = Geometry::upload(&gpu, scene)?;
        let (bundle, row) = plane.bundle(*vector, &geometry.positions, layer_size);

        let from_layer = bundle.to_layer.inverse();
        let in_layer = |x: f32, depth: f32| from_layer.transform_point3(vec3(x, row as f32 + 0.5, depth));
        let texel = |(column, texel): (usize, &Vec4)| {
            let center = column as f32 + 0.5;
            let [here, next] = [in_layer(center, texel.x), in_layer(center + 1.0, texel.x + texel.y)];
            Texel { column, center: plane.place(here).into(), step: plane.flat(next - here).into() }
        };
        let point = |point: &GatherPoint| Point {
            place: plane.place(point.position).into(),
            normal: plane.flat(point.normal).into(),
            column: bundle.to_layer.transform_point3(point.position).x as usize,
            sights: Vec::new(),
        };
        let ray = |column| [0.0, 1.0].map(|depth| plane.place(in_layer(column as f32 + 0.5, depth)).into());
        let mut slice = Self {
            layer_size,
            direction: (*flat).into(),
            surfaces: plane.surfaces(scene),
            rays: (0..layer_size).map(ray).collect(),
            layers: Vec::new(),
            points: points.iter().map(point).collect(),
        };

        let list = PointList::upload(&gpu, points)?;
        let (mut peel, kill) = (Peel::new(&gpu, layer_size)?, Kill::new(&gpu, list.points().size())?);
        let size = layer_size as usize;
        peel.start();
        kill.start();
        for index in 0.. {
            let before = kill.hits().read::<[f32; 2]>();
            let layer = peel.next(&geometry, &bundle);
            kill.sample(list.points(), &bundle, layer, index);
            // Of each texel the depth and the slope along the row; w is 0 where there is nothing.
            let texels: Vec<Vec4> = layer.read()[row * size..][..size].to_vec();
            if texels.iter().all(|texel| texel.w == 0.0) {
                break;
            }
            let hits = kill.hits().read::<[f32; 2]>().into_iter().zip(before);
            for ((point, found), (hit, before)) in points.iter().zip(&mut slice.points).zip(list.in_order(hits.collect())) {
                let place = bundle.to_layer.transform_point3(point.position);
                let texel = texels[found.column];
                let ahead = texel.x + texel.y * (place.x.fract() - 0.5) - place.z;
                found.sights.push(match hit != before {
                    true => Some(Sight { sampled: true, distance: hit[0] }),
                    false => (texel.w > 0.0).then_some(Sight { sampled: false, distance: ahead * from_layer.z_axis.length() }),
                });
            }
            slice.layers.push(texels.iter().enumerate().filter(|(_, texel)| texel.w > 0.0).map(texel).collect());
        }
        gpu.check("sampling layers")?;
        Ok(slice)
    }

    /// Fails unless each point's last sample is where its ray ends, to a hundredth of a texel's width: the point evaluates the texel's plane
    /// on its own ray, so that only rounding is left, unless the texel's centre sees another surface.
    pub fn check(&self, ends: &[Option<f32>]) -> Result<()> {
        let [first, second] = [0, 1].map(|column| Vec2::from(self.rays[column][0]));
        let limit = 0.01 * first.distance(second);
        for (point, &end) in self.points.iter().zip(ends) {
            let is_there = match (point.hit(), end) {
                (Some(hit), Some(end)) => (hit - end).abs() <= limit,
                (hit, end) => hit == end,
            };
            if !is_there {
                return Err(
                    format!("the point at {:?} samples {:?}, and its ray ends at {end:?}", point.place, point.hit()).into()
                );
            }
        }
        Ok(())
    }
}

/// A vertical plane.
struct Plane {
    origin: Vec3,
    right: Vec3,
    /// Width and height.
    size: Vec2,
}

impl Plane {
    /// Seen from the camera's side, on which the box is open.
    fn of(mesh: &Mesh, [left, right]: [f32; 2]) -> Self {
        let bounds = mesh.bounds();
        // The camera looks along +z with y up, so that x grows to the left.
        let [left, right] = [(bounds.max.x, left), (bounds.min.x, right)]
            .map(|(x, depth)| Vec3::new(x, bounds.min.y, bounds.min.z + depth * bounds.extent().z));
        Self { origin: left, right: (right - left).normalize(), size: vec2((right - left).length(), bounds.extent().y) }
    }

    fn vector(&self, flat: Vec2) -> Vec3 {
        flat.x * self.right + flat.y * Vec3::Y
    }

    fn flat(&self, vector: Vec3) -> Vec2 {
        vec2(vector.dot(self.right), vector.y)
    }

    fn position(&self, place: Vec2) -> Vec3 {
        self.origin + self.vector(place)
    }

    fn place(&self, position: Vec3) -> Vec2 {
        self.flat(position - self.origin)
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

    /// All surfaces that the plane meets. Those of one albedo that touch are one.
    fn surfaces(&self, scene: &Scene) -> Vec<Surface> {
        let part = |triangle| Some((scene.material(triangle).albedo, self.cut(scene.mesh.corners(triangle))?));
        let mut parts: Vec<(Vec3, [Vec2; 2])> = (0..scene.mesh.triangles.len()).filter_map(part).collect();
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
            surfaces.push(Surface { albedo: albedo.to_array(), line: line.into_iter().map(Place::from).collect() });
        }
        surfaces
    }

    /// The surface point that is looked for, on the side that is met.
    fn look(&self, mesh: &Mesh, bvh: &Bvh, look: Look) -> Result<GatherPoint> {
        let [from, towards] = [look.from, look.towards].map(Vec2::from);
        let (from, towards) = (self.origin + self.vector(from * self.size), self.vector(towards));
        let hit = bvh.nearest(from, towards, None).ok_or("a gather point has no surface to lie on")?;
        Ok(GatherPoint::flat(from + hit.distance * towards, mesh.side_met(hit.triangle, towards)))
    }

    /// The bundle along a vector in the plane, with the middles of a row of texels in the plane; and the number of the row.
    fn bundle(&self, vector: Vec3, positions: &[Vec3], layer_size: u32) -> (Bundle, usize) {
        let [x, y, _] = frame(vector).to_cols_array_2d().map(Vec3::from);
        let across = self.right.cross(Vec3::Y).cross(vector);
        let turn = across.dot(y).atan2(across.dot(x));
        let with = |shift| Bundle::new(&Direction { vector, turn, shift, number: 0 }, positions, layer_size);
        let row = |bundle: &Bundle| bundle.to_layer.transform_point3(self.origin).y;
        let bundle = with(vec2(0.5, (0.5 - row(&with(Vec2::ZERO))).rem_euclid(1.0)));
        (bundle, row(&bundle) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What figure 1 declares.
    fn declared<T: serde::de::DeserializeOwned>(name: &str) -> T {
        let file: toml::Table = include_str!("../../figures/figure1.toml").parse().unwrap();
        file["parameters"][name].clone().try_into().unwrap()
    }

    /// And where exact rays end.
    fn figure() -> (Slice, Vec<Option<f32>>) {
        let looks: Vec<Look> = declared("points");
        let stage = Stage::new(declared("depths"), declared("elevation_degrees")).unwrap();
        let points = stage.points_at(&looks).unwrap();
        (Slice::measure(&stage, declared("layer_size"), &points).unwrap(), stage.ends(&points))
    }

    #[test]
    fn layers_come_far_to_near_and_points_sample_those_ahead() {
        let (figure, _) = figure();
        let along = |place: Place| Vec2::from(place).dot(figure.direction.into());
        for column in 0..figure.layer_size as usize {
            let texels: Vec<_> = figure.layers.iter().flatten().filter(|texel| texel.column == column).collect();
            assert!(texels.is_sorted_by(|far, near| along(far.center) > along(near.center)), "column {column}");
        }
        for point in &figure.points {
            let sights: Vec<_> = point.sights.iter().flatten().collect();
            assert!(sights.is_sorted_by(|far, near| far.distance > near.distance), "{:?}", point.sights);
            // Its own surface is as far as rounding.
            assert!(sights.iter().all(|sight| sight.sampled == (sight.distance > 1e-5)), "{:?}", point.sights);
            assert!(sights.iter().any(|sight| sight.sampled) && sights.iter().any(|sight| !sight.sampled));
        }
    }

    #[test]
    fn a_hit_off_its_ray_is_an_error() {
        let (figure, ends) = figure();
        assert!(figure.check(&ends).is_ok());
        let moved: Vec<_> = ends.iter().map(|end| end.map(|end| end + 0.001)).collect();
        assert!(figure.check(&moved).is_err());
        assert!(figure.check(&vec![None; ends.len()]).is_err());
    }

    #[test]
    fn points_spread_over_open_surfaces_alone() {
        let stage = Stage::new(declared("depths"), declared("elevation_degrees")).unwrap();
        let points = stage.points_every(0.1);
        assert!(points.len() > 20, "{}", points.len());
        for point in &points {
            // Nothing is above a side of a block that looks out of the open box.
            let above = stage.bvh.nearest(point.position + RAY_OFFSET * point.normal, point.normal, None);
            let normal = above.map(|hit| stage.scene.mesh.geometric_normal(hit.triangle));
            assert!(normal.is_none_or(|normal| normal.dot(point.normal) < 0.0), "{point:?} is under a block");
        }
    }
}
