//! The poster's figure 1, "relation between depth layer and final gathering", from a slice of a real bundle.
//!
//! A vertical plane cuts the Cornell box through both blocks. The direction lies in the plane, and so does one row of texels of its
//! layers. Each layer is peeled and read back, and a few points in the plane sample it by KILL.
//!
//! The drawing has the whole slice above, and below it a small one for each layer in peeling order. It is 800 wide with a smallest text
//! of 20, so that text is still readable at half the size, on a telephone.

use glam::{Vec2, vec2};
use serde::Deserialize;
use svg::Document;
use svg::node::element::{Group, Rectangle, Title};

use crate::figure::{Figure, Result, Task};
use crate::figures::slices::{COLORS, INK, View, arrow, cross, dot, dotted, extent, is_apart, line, text};
use crate::lab::{Look, Slice, Stage};

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

impl Figure for Slice {
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, _: &Task) -> Result<Self> {
        let Parameters { layer_size, depths, elevation_degrees, points } = parameters;
        let stage = Stage::new(*depths, *elevation_degrees)?;
        let points = stage.points_at(points)?;
        let slice = Slice::measure(&stage, *layer_size, &points)?;
        slice.check(&stage.ends(&points))?;
        Ok(slice)
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        draw(self)
    }
}

const WIDTH: f32 = 800.0;
/// Left and right of everything.
const MARGIN: f32 = 20.0;
/// From one line of text to the next.
const LINE: f32 = 28.0;
/// Pixels to a unit of the whole slice.
const SCALE: f32 = 490.0;
/// Small slices in a row, and the height of the text above each.
const COLUMNS: usize = 3;
const STEP_TEXT: f32 = 3.2 * LINE;

const TITLE: &str = "Relation between depth layer and final gathering";
const STEPS: [&str; 2] = [
    "Layer by layer, from far to near: each point samples what lies",
    "ahead of it. What it samples last is the nearest: its hit.",
];

fn draw(figure: &Slice) -> Result<String> {
    let layers = figure.layers.len();
    if layers > COLORS.len() {
        return Err(format!("{layers} layers, and colours for {}", COLORS.len()).into());
    }
    let extent = extent(figure);
    let whole = View { figure, origin: vec2(0.5 * (WIDTH - SCALE * extent.x), 150.0 + SCALE * extent.y), scale: SCALE };
    let key = whole.origin.y + 75.0;
    let steps = key + 3.0 * LINE;
    let mut page = Group::new().add(heading(layers)).add(whole.slice()).add(whole.order()).add(self::key(key));
    for (line, content) in STEPS.into_iter().enumerate() {
        page = page.add(text(vec2(MARGIN, steps + LINE * line as f32), content));
    }

    let column = (WIDTH - MARGIN) / COLUMNS as f32;
    // Beside the left wall there is room for a point's name.
    let scale = (column - MARGIN - 12.0) / extent.x;
    let row = STEP_TEXT + scale * extent.y + 40.0;
    let top = steps + 2.0 * LINE;
    for layer in 0..layers {
        let corner = vec2(MARGIN + (layer % COLUMNS) as f32 * column, top + (layer / COLUMNS) as f32 * row);
        let view = View { figure, origin: corner + vec2(12.0, STEP_TEXT + scale * extent.y), scale };
        page = page.add(view.step(layer, corner));
    }

    let height = (top + layers.div_ceil(COLUMNS) as f32 * row).round();
    let document = Document::new()
        .set("width", WIDTH)
        .set("height", height)
        .set("viewBox", (0, 0, WIDTH, height))
        .set("font-family", "sans-serif")
        .set("font-size", 20)
        .set("fill", INK)
        .add(Title::new(TITLE))
        .add(Rectangle::new().set("width", WIDTH).set("height", height).set("fill", "white"))
        .add(page);
    Ok(document.to_string() + "\n")
}

/// What this is, and which layer has which colour.
fn heading(layers: usize) -> Group {
    let mut group = Group::new()
        .add(text(vec2(MARGIN, 36.0), TITLE).set("font-size", 26))
        .add(text(vec2(MARGIN, 72.0), "A slice of the Cornell box, one direction, and its layers:"))
        .add(text(vec2(MARGIN, 108.0), "far"));
    for layer in 0..layers {
        group = group.add(swatch(vec2(75.0 + 82.0 * layer as f32, 108.0), layer, &(layer + 1).to_string()));
    }
    group.add(text(vec2(75.0 + 82.0 * layers as f32, 108.0), "near"))
}

/// A layer's colour, and text beside it.
fn swatch(at: Vec2, layer: usize, name: &str) -> Group {
    let square = Rectangle::new().set("x", at.x).set("y", at.y - 16.0).set("width", 26).set("height", 18);
    Group::new().add(square.set("fill", COLORS[layer])).add(text(at + vec2(34.0, 0.0), name))
}

/// What the signs in the slice mean.
fn key(top: f32) -> Group {
    let middle = |column: f32, row: f32| vec2(MARGIN + 20.0 + 400.0 * column, top + LINE * row - 7.0);
    let name = |at: Vec2, name| text(at + vec2(34.0, 7.0), name);
    let [point, sample, texel, culled] = [middle(0.0, 0.0), middle(0.0, 1.0), middle(1.0, 0.0), middle(1.0, 1.0)];
    let piece =
        |from: f32| line(texel + vec2(from, 0.0), texel + vec2(from + 16.0, 0.0)).set("stroke", COLORS[2]).set("stroke-width", 7);
    Group::new()
        .add(arrow(point - vec2(10.0, 0.0), point + vec2(20.0, 0.0), INK, 1.5))
        .add(dot(point - vec2(10.0, 0.0), 7.0, INK))
        .add(name(point, "gather point and normal"))
        .add(arrow(sample - vec2(18.0, 0.0), sample + vec2(20.0, 0.0), COLORS[2], 3.5))
        .add(name(sample, "the layer that it samples"))
        .add(piece(-18.0))
        .add(piece(2.0))
        .add(name(texel, "texels: depth and slope"))
        .add(line(culled - vec2(18.0, 0.0), culled + vec2(18.0, 0.0)).set("stroke", COLORS[2]).set("stroke-width", 7))
        .add(line(culled - vec2(15.0, 0.0), culled + vec2(15.0, 0.0)).set("stroke", "white").set("stroke-width", 3))
        .add(cross(culled, 7.0))
        .add(name(culled, "behind a point: KILL"))
}

impl View<'_> {
    fn slice(&self) -> Group {
        let layers = self.figure.layers.len();
        let behind = Group::new().add(self.bodies(14.0)).add(self.rays());
        let mut group = (0..layers).fold(behind, |group, layer| group.add(self.layer(layer, 7.0)));
        for (name, point) in ('A'..).zip(&self.figure.points) {
            let at = self.at(point.place);
            let culled = || {
                (0_usize..).zip(&point.sights).filter_map(|(layer, sight)| Some((layer, sight.filter(|sight| !sight.sampled)?)))
            };
            if let Some((_, last)) = culled().last() {
                group = group.add(dotted(at, self.on_ray(point, last.distance)));
            }
            for (layer, sight) in culled() {
                if let Some(texel) = self.figure.layers[layer].iter().find(|texel| texel.column == point.column) {
                    group = group.add(self.texel(texel, 0.7).set("stroke", "white").set("stroke-width", 3));
                }
                if is_apart(sight) {
                    group = group.add(cross(self.on_ray(point, sight.distance), 7.0));
                }
            }
            if let Some((layer, distance)) = point.last_sample(layers) {
                group = group.add(arrow(at, self.on_ray(point, distance), COLORS[layer], 3.5));
            }
            let name = text(at + 26.0 * self.below(point) + vec2(0.0, 9.0), &name.to_string());
            group = group
                .add(arrow(at, at - 35.0 * self.below(point), INK, 1.5))
                .add(dot(at, 7.0, INK))
                .add(name.set("text-anchor", "middle").set("font-size", 24).set("font-weight", "bold"));
        }
        group
    }

    /// An arrow against the direction.
    fn order(&self) -> Group {
        let along = self.step_of(self.figure.direction.into()).normalize();
        let middle = self.at([0.5, 0.9]);
        let turn = along.y.atan2(along.x).to_degrees();
        let label = text(Vec2::ZERO, "peeled from far to near").set("text-anchor", "middle");
        let place = middle + 16.0 * vec2(along.y, -along.x);
        Group::new()
            .add(arrow(middle + 140.0 * along, middle - 140.0 * along, INK, 5.0))
            .add(label.set("transform", format!("translate({:.1} {:.1}) rotate({turn:.2})", place.x, place.y)))
    }

    /// After a layer: what each point has sampled last, and what of this layer is culled.
    fn step(&self, layer: usize, corner: Vec2) -> Group {
        let mut group = Group::new().add(self.bodies(6.0)).add(self.layer(layer, 5.0));
        let mut names = [String::new(), String::new()];
        for (name, point) in ('A'..).zip(&self.figure.points) {
            let at = self.at(point.place);
            let sight = point.sights[layer];
            if let Some((from, distance)) = point.last_sample(layer) {
                group = group.add(arrow(at, self.on_ray(point, distance), COLORS[from], 2.5));
            }
            let sampled = sight.is_some_and(|sight| sight.sampled);
            if sight.is_some() {
                names[usize::from(!sampled)] += &format!(" {name}");
            }
            if let Some(sight) = sight.filter(|sight| is_apart(*sight)).filter(|sight| !sight.sampled) {
                let culled = self.on_ray(point, sight.distance);
                group = group.add(dotted(at, culled)).add(cross(culled, 5.0));
            }
            let name = text(at + 17.0 * self.below(point) + vec2(0.0, 7.0), &name.to_string()).set("text-anchor", "middle");
            group = group.add(dot(at, 5.0, if sampled { INK } else { "white" })).add(name);
        }
        let said = ["sampled by", "KILL:"].iter().zip(&names).filter(|(_, names)| !names.is_empty());
        let lines = (1_u8..)
            .zip(said)
            .map(|(row, (says, names))| text(corner + vec2(0.0, 16.0 + LINE * f32::from(row)), &format!("{says}{names}")));
        lines.fold(group.add(swatch(corner + vec2(0.0, 16.0), layer, &format!("layer {}", layer + 1))), Group::add)
    }
}
