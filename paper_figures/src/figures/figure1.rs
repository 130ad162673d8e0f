//! The poster's figure 1, "relation between depth layer and final gathering", from a slice of a real bundle.
//!
//! A vertical plane cuts the Cornell box through both blocks. The direction lies in the plane, and so does one row of texels of its
//! layers; each layer is peeled, offered to a few points on the section by KILL, and read back.

mod drawing;

use std::collections::VecDeque;

use finalgather::gather::{Bundle, Kill, Peel};
use finalgather::geometry::Geometry;
use finalgather::math::frame;
use finalgather::points::{GatherPoint, PointList};
use finalgather::scene::{Bvh, Mesh, RAY_OFFSET, Scene};
use finalgather::{Direction, Gpu};
use glam::{Vec2, Vec3, Vec4, vec2, vec3};
use serde::{Deserialize, Serialize};

use crate::cornell::Cornell;
use crate::figure::{Figure, Result, Task};
use crate::machine::gpu;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Texels on a side: so few that they can be seen.
    layer_size: u32,
    /// Where the section leaves the walls on the left and on the right, as shares of the box's depth from the near side.
    depths: [f32; 2],
    /// Of the direction above the horizontal.
    elevation_degrees: f32,
    points: Vec<Look>,
}

/// Where a point is looked for: from a place, in shares of the section's width and height, to the first surface along an axis.
#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct Look {
    from: [f32; 2],
    towards: [f32; 2],
}

/// In the section: to the right and up, in unit space.
type Place = [f32; 2];
/// What a point sees of each layer; `None` where nothing is in its texel.
type Sights = Vec<Option<Sight>>;

#[derive(Serialize, Deserialize)]
pub struct Figure1 {
    layer_size: u32,
    /// From gather points towards what they gather.
    direction: Place,
    surfaces: Vec<Surface>,
    /// The middle of each column of texels, through the whole depth of the bundle.
    rays: Vec<[Place; 2]>,
    /// The row of texels in the section, the farthest layer first.
    layers: Vec<Vec<Texel>>,
    points: Vec<Point>,
}

/// Where the section cuts surfaces of one albedo that are joined.
#[derive(Serialize, Deserialize)]
struct Surface {
    albedo: [f32; 3],
    line: Vec<Place>,
}

/// Depth and slope, as places.
#[derive(Serialize, Deserialize)]
struct Texel {
    column: usize,
    center: Place,
    /// From the centre to where the surface's plane is in the middle of the next column.
    step: Place,
}

#[derive(Serialize, Deserialize)]
struct Point {
    place: Place,
    normal: Place,
    column: usize,
    sights: Sights,
}

/// What a point sees of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Sight {
    /// Or culled by KILL.
    sampled: bool,
    /// Along the direction from the point, negative behind it.
    distance: f32,
}

impl Point {
    /// The distance at which the point's ray ends.
    fn hit(&self) -> Option<f32> {
        self.sights.iter().flatten().filter(|sight| sight.sampled).map(|sight| sight.distance).next_back()
    }
}

impl Figure1 {
    /// Fails unless each point's last sample is where its ray ends, to a hundredth of a texel's width: the point evaluates the texel's plane on its
    /// own ray, so that what is left is rounding.
    fn check(&self, exact: &[Option<f32>], texel: f32) -> Result<()> {
        for (point, &exact) in self.points.iter().zip(exact) {
            let hit = point.hit();
            let off = hit.zip(exact).map_or(f32::INFINITY, |(hit, exact)| (hit - exact).abs());
            if off > 0.01 * texel {
                return Err(format!("the point at {:?} samples {hit:?}, and its ray ends at {exact:?}", point.place).into());
            }
        }
        Ok(())
    }
}

/// A vertical plane.
struct Section {
    origin: Vec3,
    right: Vec3,
    /// Width and height.
    size: Vec2,
}

impl Section {
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

    fn place(&self, position: Vec3) -> Place {
        self.flat(position - self.origin).to_array()
    }

    /// The two places where the plane leaves a triangle, if it meets it.
    fn cut(&self, corners: [Vec3; 3]) -> Option<[Vec2; 2]> {
        let side = |corner: Vec3| (corner - self.origin).dot(self.right.cross(Vec3::Y));
        let crossing = |k: usize| {
            let [from, to] = [corners[k], corners[(k + 1) % 3]];
            let [a, b] = [from, to].map(side);
            (a.signum() != b.signum()).then(|| self.flat(from.lerp(to, a / (a - b)) - self.origin))
        };
        let mut crossings = (0..3).filter_map(crossing);
        crossings.next().zip(crossings.next()).map(|(a, b)| [a, b])
    }

    /// All that the plane meets; what is of one albedo and touches is one.
    fn surfaces(&self, scene: &Scene) -> Vec<Surface> {
        let part = |triangle| Some((scene.material(triangle).albedo, self.cut(scene.mesh.corners(triangle))?));
        let mut parts: Vec<(Vec3, [Vec2; 2])> = (0..scene.mesh.triangles.len()).filter_map(part).collect();
        let mut surfaces = Vec::new();
        while let Some((albedo, ends)) = parts.pop() {
            let mut line = VecDeque::from(ends);
            let near = |a: Vec2, b: Vec2| a.distance(b) < 1e-5;
            let touches = |line: &VecDeque<Vec2>, end: Vec2| near(end, line[0]) || near(end, line[line.len() - 1]);
            while let Some(next) =
                parts.iter().position(|&(of, ends)| of == albedo && ends.iter().any(|&end| touches(&line, end)))
            {
                let (_, [a, b]) = parts.swap_remove(next);
                let (end, other) = if touches(&line, a) { (a, b) } else { (b, a) };
                if near(end, line[0]) { line.push_front(other) } else { line.push_back(other) }
            }
            surfaces.push(Surface { albedo: albedo.to_array(), line: line.into_iter().map(Place::from).collect() });
        }
        surfaces
    }

    /// The surface point that is first met from a place towards an axis, on the side that is met.
    fn look(&self, mesh: &Mesh, bvh: &Bvh, look: Look) -> Result<GatherPoint> {
        let [from, towards] = [look.from, look.towards].map(Vec2::from);
        let (from, towards) = (self.origin + self.vector(from * self.size), self.vector(towards));
        let hit = bvh.nearest(from, towards, None).ok_or("a gather point has no surface to lie on")?;
        Ok(GatherPoint::flat(from + hit.distance * towards, mesh.side_met(hit.triangle, towards)))
    }
}

/// The bundle along the section's direction, with the middles of a row of texels in the plane; and the number of the row.
fn bundle(section: &Section, vector: Vec3, positions: &[Vec3], layer_size: u32) -> (Bundle, usize) {
    let [x, y, _] = frame(vector).to_cols_array_2d().map(Vec3::from);
    let across = section.right.cross(Vec3::Y).cross(vector);
    let turn = across.dot(y).atan2(across.dot(x));
    let with = |shift| Bundle::new(&Direction { vector, turn, shift }, positions, layer_size);
    let row = |bundle: &Bundle| bundle.to_layer.transform_point3(section.origin).y;
    let bundle = with(vec2(0.5, (0.5 - row(&with(Vec2::ZERO))).rem_euclid(1.0)));
    (bundle, row(&bundle) as usize)
}

/// The row of each layer down to the first that is empty there, and what each point saw of each.
fn sample(
    gpu: &Gpu,
    geometry: &Geometry,
    bundle: &Bundle,
    (row, layer_size): (usize, u32),
    points: &[GatherPoint],
) -> Result<(Vec<Vec<Vec4>>, Vec<Sights>)> {
    let list = PointList::upload(gpu, points)?;
    let (mut peel, kill) = (Peel::new(gpu, layer_size)?, Kill::new(gpu, list.points().size())?);
    let (mut layers, mut sights) = (Vec::new(), vec![Sights::new(); points.len()]);
    let length = bundle.to_layer.inverse().z_axis.length();
    peel.start();
    kill.start();
    for index in 0.. {
        let before = kill.hits().read::<[f32; 2]>();
        let layer = peel.next(geometry, bundle);
        kill.sample(list.points(), bundle, layer, index);
        let size = layer_size as usize;
        let texels: Vec<Vec4> = layer.read()[row * size..][..size].to_vec();
        if texels.iter().all(|texel| texel.w == 0.0) {
            break;
        }
        let hits = kill.hits().read::<[f32; 2]>().into_iter().zip(before);
        for ((point, sights), (hit, before)) in points.iter().zip(&mut sights).zip(list.in_order(hits.collect())) {
            let place = bundle.to_layer.transform_point3(point.position);
            let texel = texels[place.x as usize];
            let ahead = texel.x + texel.y * (place.x.fract() - 0.5) - place.z;
            sights.push(match hit != before {
                true => Some(Sight { sampled: true, distance: hit[0] }),
                false => (texel.w > 0.0).then_some(Sight { sampled: false, distance: ahead * length }),
            });
        }
        layers.push(texels);
    }
    gpu.check("sampling layers")?;
    Ok((layers, sights))
}

/// How far along a direction a point's ray goes.
fn exact(bvh: &Bvh, point: &GatherPoint, direction: Vec3) -> Option<f32> {
    bvh.nearest(point.position + RAY_OFFSET * point.normal, direction, None).map(|hit| hit.distance)
}

impl Figure for Figure1 {
    const KIND: &'static str = "layers_of_a_slice";
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, _: &Task) -> Result<Self> {
        let layer_size = parameters.layer_size;
        let mut cornell = Cornell::load()?;
        // The lamp hangs a tenth of a millimetre below the ceiling: two layers that no drawing can tell apart.
        let Scene { mesh, materials, .. } = &mut cornell.scene;
        mesh.triangles.retain(|triangle| !materials[triangle.material as usize].is_emissive());
        let (scene, bvh) = (&cornell.scene, Bvh::new(&cornell.scene.mesh));

        let section = Section::of(&scene.mesh, parameters.depths);
        let vector = section.vector(Vec2::from_angle(parameters.elevation_degrees.to_radians()));
        let points = parameters.points.iter().map(|&look| section.look(&scene.mesh, &bvh, look)).collect::<Result<Vec<_>>>()?;
        let gpu = gpu()?;
        let geometry = Geometry::upload(&gpu, scene)?;
        let (bundle, row) = bundle(&section, vector, &geometry.positions, layer_size);
        let (layers, sights) = sample(&gpu, &geometry, &bundle, (row, layer_size), &points)?;

        let from_layer = bundle.to_layer.inverse();
        let in_layer = |x: f32, depth: f32| from_layer.transform_point3(vec3(x, row as f32 + 0.5, depth));
        let texel = |(column, texel): (usize, &Vec4)| {
            let center = column as f32 + 0.5;
            let [here, next] = [in_layer(center, texel.x), in_layer(center + 1.0, texel.x + texel.y)];
            Texel { column, center: section.place(here), step: section.flat(next - here).into() }
        };
        let layer = |row: &Vec<Vec4>| row.iter().enumerate().filter(|(_, texel)| texel.w > 0.0).map(texel).collect();
        let ray = |column| [0.0, 1.0].map(|depth| section.place(in_layer(column as f32 + 0.5, depth)));
        let point = |(point, sights): (&GatherPoint, Vec<_>)| Point {
            place: section.place(point.position),
            normal: section.flat(point.normal).into(),
            column: bundle.to_layer.transform_point3(point.position).x as usize,
            sights,
        };
        let figure = Self {
            layer_size,
            direction: section.flat(vector).into(),
            surfaces: section.surfaces(scene),
            rays: (0..layer_size).map(ray).collect(),
            layers: layers.iter().map(layer).collect(),
            points: points.iter().zip(sights).map(point).collect(),
        };
        let exact: Vec<_> = points.iter().map(|point| exact(&bvh, point, vector)).collect();
        figure.check(&exact, in_layer(1.0, 0.0).distance(in_layer(0.0, 0.0)))?;
        Ok(figure)
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        drawing::draw(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::Declaration;

    fn figure() -> Figure1 {
        let out = tempfile::tempdir().unwrap();
        let document = Declaration::load("figure1").unwrap().measure("1".parse().unwrap(), out.path()).unwrap();
        document.data().unwrap()
    }

    #[test]
    fn layers_come_far_to_near_and_points_sample_those_ahead() {
        let figure = figure();
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
        let figure = figure();
        let exact: Vec<_> = figure.points.iter().map(Point::hit).collect();
        assert!(figure.check(&exact, 0.04).is_ok());
        let moved: Vec<_> = exact.iter().map(|hit| hit.map(|hit| hit + 0.001)).collect();
        assert!(figure.check(&moved, 0.04).is_err());
        assert!(figure.check(&vec![None; exact.len()], 0.04).is_err());
    }
}
