//! The poster's figure 1, "relation between depth layer and final gathering", from a slice of a real bundle.
//!
//! A vertical plane cuts the Cornell box through both blocks. The direction lies in the plane, and so does one row of texels of its
//! layers. Each layer is peeled and read back, and a few points in the plane sample it by KILL.

mod data;
mod drawing;

use glam::{Vec2, Vec3, Vec4};
use serde::Deserialize;

use crate::figure::{Figure, Result, Task};
use crate::figures::figure1::data::{Place, Point, Surface, Texel};
use crate::figures::figure1::drawing::draw;
use crate::lab::library::GatherPoint;
use crate::lab::slice::Slice;

pub use data::Figure1;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Texels on a side: so few that they can be seen.
    layer_size: u32,
    /// Where the slice leaves the walls on the left and on the right, as shares of the box's depth from the near side.
    depths: [f32; 2],
    /// Of the direction above the horizontal.
    elevation_degrees: f32,
    points: Vec<Look>,
}

/// Where a point is looked for: from a place, in shares of the slice's width and height, to the first surface along an axis.
#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct Look {
    from: Place,
    towards: Place,
}

impl Figure for Figure1 {
    type Parameters = Parameters;

    fn measure(&Parameters { layer_size, depths, elevation_degrees, ref points }: &Parameters, _: &Task) -> Result<Self> {
        let slice = Slice::new(depths, elevation_degrees, layer_size)?;
        let points: Vec<_> =
            points.iter().map(|look| slice.look(look.from.into(), look.towards.into())).collect::<Result<_>>()?;
        let (layers, sights) = slice.sample(&points)?;
        let texel = |(column, texel): (usize, &Vec4)| {
            let center = column as f32 + 0.5;
            let [here, next] = [slice.in_row(center, texel.x), slice.in_row(center + 1.0, texel.x + texel.y)];
            Texel { column, center: slice.place(here).into(), step: slice.flat(next - here).into() }
        };
        let layer = |row: &Vec<Vec4>| row.iter().enumerate().filter(|(_, texel)| texel.w > 0.0).map(texel).collect();
        let ray = |column| [0.0, 1.0].map(|depth| slice.place(slice.in_row(column as f32 + 0.5, depth)).into());
        let point = |(point, sights): (&GatherPoint, Vec<_>)| Point {
            place: slice.place(point.position).into(),
            normal: slice.flat(point.normal).into(),
            column: slice.in_layer(point).0,
            sights,
        };
        let line = |line: Vec<Vec2>| line.into_iter().map(Place::from).collect();
        let surface = |(albedo, places): (Vec3, _)| Surface { albedo: albedo.into(), line: line(places) };
        let figure = Self {
            layer_size,
            direction: slice.direction().into(),
            surfaces: slice.surfaces().into_iter().map(surface).collect(),
            rays: (0..layer_size).map(ray).collect(),
            layers: layers.iter().map(layer).collect(),
            points: points.iter().zip(sights).map(point).collect(),
        };
        let exact: Vec<_> = points.iter().map(|point| slice.exact(point)).collect();
        figure.check(&exact, slice.in_row(1.0, 0.0).distance(slice.in_row(0.0, 0.0)))?;
        Ok(figure)
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        draw(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::{Scale, folder};

    fn figure() -> Figure1 {
        let declared: toml::Table = include_str!("../../../figures/figure1.toml").parse().unwrap();
        let parameters = declared["parameters"].clone().try_into().unwrap();
        Figure1::measure(&parameters, &Task { scale: Scale(1.0), figure: "figure1", out: folder() }).unwrap()
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
