//! Drawings of a slice of the Cornell box: surfaces, rays, layers and points.

use glam::{Vec2, vec2};
use svg::node::element::{Circle, Group, Line, Polygon, Polyline, Text};

use crate::lab::{Place, Point, Sight, Slice, Surface, Texel};

/// Far to near, in even steps of lightness, which any kind of colour vision can tell apart: plasma of S. van der Walt and N. Smith, without
/// its brightest part.
pub const COLORS: [&str; 6] = ["#f99a3e", "#e56b5d", "#c5407e", "#9410a2", "#5601a4", "#0d0887"];
pub const INK: &str = "#222";
const SOLID: &str = "#ececec";

/// The section somewhere on the page.
pub struct View<'a> {
    pub figure: &'a Slice,
    /// Of the section's (0, 0).
    pub origin: Vec2,
    /// Pixels to a unit.
    pub scale: f32,
}

/// Width and height of what the slice shows.
pub fn extent(figure: &Slice) -> Vec2 {
    figure.surfaces.iter().flat_map(|surface| &surface.line).fold(Vec2::ZERO, |most, &place| most.max(place.into()))
}

impl View<'_> {
    pub fn at(&self, place: Place) -> Vec2 {
        self.origin + self.step_of(place.into())
    }

    pub fn step_of(&self, step: Vec2) -> Vec2 {
        self.scale * step * vec2(1.0, -1.0)
    }

    pub fn on_ray(&self, point: &Point, distance: f32) -> Vec2 {
        self.at(point.place) + distance * self.step_of(self.figure.direction.into())
    }

    /// Which way is against a point's normal.
    pub fn below(&self, point: &Point) -> Vec2 {
        -self.step_of(point.normal.into()).normalize()
    }

    /// Solid bodies, and a hint of what their surfaces look like.
    pub fn bodies(&self, width: f32) -> Group {
        let outline =
            |surface: &Surface| Polyline::new().set("points", corners(surface.line.iter().map(|&place| self.at(place))));
        let bodies =
            self.figure.surfaces.iter().fold(Group::new(), |group, surface| group.add(outline(surface).set("fill", SOLID)));
        self.figure.surfaces.iter().fold(bodies, |group, surface| {
            let [r, g, b] = surface.albedo.map(|share| (120.0 + 100.0 * share.powf(1.0 / 2.2)).round());
            let line = outline(surface).set("fill", "none").set("stroke", format!("rgb({r},{g},{b})"));
            group.add(line.set("stroke-width", width).set("stroke-linejoin", "round"))
        })
    }

    /// The middles of columns, as far as there is something on them.
    pub fn rays(&self) -> Group {
        let group = Group::new().set("stroke", INK).set("stroke-width", 1).set("stroke-opacity", 0.15);
        let beyond = 20.0 * self.step_of(self.figure.direction.into()).normalize();
        (0..self.figure.rays.len()).fold(group, |group, column| {
            let mut texels = self.figure.layers.iter().flatten().filter(|texel| texel.column == column);
            let Some(far) = texels.next() else { return group };
            let near = texels.next_back().unwrap_or(far);
            group.add(line(self.at(near.center) - beyond, self.at(far.center) + beyond))
        })
    }

    pub fn texel(&self, texel: &Texel, share: f32) -> Line {
        let (center, half) = (self.at(texel.center), 0.5 * share * self.step_of(texel.step.into()));
        line(center - half, center + half)
    }

    pub fn layer(&self, layer: usize, width: f32) -> Group {
        let group = Group::new().set("stroke", COLORS[layer]).set("stroke-width", width);
        self.figure.layers[layer].iter().fold(group, |group, texel| group.add(self.texel(texel, 0.86)))
    }
}

/// Whether it is not the point's own surface.
pub fn is_apart(sight: Sight) -> bool {
    sight.distance.abs() > 1e-3
}

/// To a tenth of a pixel.
fn pixels(length: f32) -> f32 {
    (10.0 * length).round() / 10.0
}

fn corners(places: impl IntoIterator<Item = Vec2>) -> String {
    let corner = |at: Vec2| format!("{},{}", pixels(at.x), pixels(at.y));
    places.into_iter().map(corner).collect::<Vec<_>>().join(" ")
}

pub fn line(from: Vec2, to: Vec2) -> Line {
    Line::new().set("x1", pixels(from.x)).set("y1", pixels(from.y)).set("x2", pixels(to.x)).set("y2", pixels(to.y))
}

pub fn dotted(from: Vec2, to: Vec2) -> Line {
    line(from, to).set("stroke", INK).set("stroke-width", 1.5).set("stroke-dasharray", "2 5")
}

pub fn text(at: Vec2, content: &str) -> Text {
    Text::new(content).set("x", pixels(at.x)).set("y", pixels(at.y))
}

pub fn dot(at: Vec2, radius: f32, fill: &str) -> Circle {
    let circle = Circle::new().set("cx", pixels(at.x)).set("cy", pixels(at.y)).set("r", radius);
    circle.set("fill", fill).set("stroke", INK).set("stroke-width", 2)
}

pub fn arrow(from: Vec2, to: Vec2, color: &str, width: f32) -> Group {
    let along = (to - from).normalize_or_zero();
    let (base, side) = (to - 4.0 * width * along, 1.8 * width * along.perp());
    Group::new()
        .add(line(from, base).set("stroke", color).set("stroke-width", width))
        .add(Polygon::new().set("points", corners([to, base + side, base - side])).set("fill", color))
}

pub fn cross(at: Vec2, radius: f32) -> Group {
    let [down, up] = [vec2(radius, radius), vec2(radius, -radius)].map(|arm| line(at - arm, at + arm));
    Group::new().set("stroke", INK).set("stroke-width", 0.4 * radius).add(down).add(up)
}
