//! The four steps of one direction for a student, from real layers: a slice of the Cornell box beside what the camera's pixels do. The page's
//! script shows a step's frames one after the other. Without it each step stands still in its last frame.

use std::fmt::Write;

use glam::{Vec2, Vec3, vec2};
use serde::{Deserialize, Serialize};
use svg::Document;
use svg::node::element::{Group, Title};

use crate::draw::several;
use crate::figure::{Figure, Format, Result, Task};
use crate::figures::slices::{COLORS, INK, View, arrow, cross, dot, dotted, extent, is_apart};
use crate::lab::{
    Cornell, Image, LayerSize, OneDirection, Peeled, Pictures, Pipeline, Point, Settings, Sight, Slice, Stage, WriteOptions,
    sum_of,
};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// As figure 1 has them.
    layer_size: u32,
    depths: [f32; 2],
    elevation_degrees: f32,
    /// Between points of the slice, in unit space.
    spacing: f32,
    /// Side of the camera's pictures, and of the layers beside them.
    size: u32,
    picture_layers: u32,
    pipeline: Pipeline,
    /// The sums are shown after so many.
    directions: Vec<u32>,
}

#[derive(Serialize, Deserialize)]
pub struct FourSteps {
    slice: Slice,
    /// Radiance that each point of the slice finds.
    light: Vec<[f32; 3]>,
    /// Pixels of the camera that see a surface, and those of them that face the direction.
    pixels: usize,
    facing: usize,
    /// Of the whole box, far to near.
    layers: Vec<LayerPictures>,
    /// Files: direct light, and what the direction adds.
    direct: String,
    added: String,
    sums: Vec<Sum>,
}

#[derive(Serialize, Deserialize)]
struct LayerPictures {
    layer: String,
    sampled: String,
    samples: usize,
}

#[derive(Serialize, Deserialize)]
struct Sum {
    directions: u32,
    picture: String,
}

impl Figure for FourSteps {
    const FORMAT: Format = Format::Html;
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let scale = task.scale;
        let stage = Stage::new(parameters.depths, parameters.elevation_degrees)?;
        let points = stage.points_every(parameters.spacing);
        let slice = Slice::measure(&stage, parameters.layer_size, &points)?;
        slice.check(&stage.ends(&points))?;

        let write = |name: &str, picture: &Image, exposure: f32| -> Result<String> {
            let (file, path) = task.picture_file(name);
            picture.write(&path, &WriteOptions { exposure, ..WriteOptions::default() })?;
            Ok(file)
        };
        let size = scale.of(parameters.size, 64);
        let direction = OneDirection::new(&stage, size)?;
        let [pixels, facing] = direction.counts();
        let peeled = direction.peel(parameters.picture_layers)?;
        let of_layer = |(i, peeled): (usize, &Peeled)| -> Result<LayerPictures> {
            Ok(LayerPictures {
                layer: write(&format!("layer-{}", i + 1), &peeled.layer, 0.0)?,
                sampled: write(&format!("sampled-{}", i + 1), &peeled.sampled, 0.0)?,
                samples: peeled.samples,
            })
        };
        let layers = peeled.iter().enumerate().map(of_layer).collect::<Result<_>>()?;

        let default = Settings::default();
        let photons = scale.of(default.photons.count as u32, 1000).into();
        let grid = Cornell::load()?.photon_grid(&default, 0..photons);
        let light = direction.light(&grid, &points).into_iter().map(|light| light.to_array()).collect();
        let added = write("added", &direction.light_at_pixels(&grid), 1.0)?;

        let pictures = Pictures::new()?;
        let mut counts: Vec<_> = parameters.directions.iter().map(|&count| scale.of(count, 1)).collect();
        counts.dedup();
        let (mut direct, mut sums) = (String::new(), Vec::new());
        for directions in counts {
            let settings = pictures.settings(directions).with(|s| {
                (s.film.size, s.photons.count) = ([size; 2], photons);
                (s.gather.pipeline, s.gather.layer_size) = (parameters.pipeline, LayerSize::Texels(parameters.picture_layers));
            });
            let exposure = settings.display.exposure.given();
            let picture = pictures.render(&settings)?.0;
            if direct.is_empty() {
                direct = write("direct", &sum_of(&picture, &["Direct", "Emission"])?, exposure)?;
            }
            sums.push(Sum { directions, picture: write(&format!("sum-{directions}"), &picture, exposure)? });
        }
        Ok(Self { slice, light, pixels, facing, layers, direct, added, sums })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let steps = [self.points(), self.peeling(), self.sampling(), self.adding()];
        let steps: String = (1..).zip(steps).map(|(number, step)| step.html(number)).collect();
        Ok(format!("<div class=\"story\">\n{steps}</div>\n"))
    }
}

/// A step of the story.
struct Step {
    title: &'static str,
    text: String,
    /// The slice's drawing; groups of [`Step::during`] come and go.
    slice: Group,
    size: Vec2,
    /// Beside it, one picture for each frame: its file and what it is.
    pictures: Vec<(String, String)>,
    /// The frame that is seen without scripts.
    still: usize,
}

impl Step {
    fn html(self, number: u32) -> String {
        let Self { title, text, slice, size, pictures, still } = self;
        let drawing = Document::new()
            .set("viewBox", (0, 0, size.x.round(), size.y.round()))
            .set("font-family", "sans-serif")
            .set("font-size", 20)
            .set("fill", INK)
            .set("role", "img")
            .add(Title::new(format!("Step {number} in a slice of the Cornell box")))
            .add(slice);
        let mut html = format!(
            "<section class=\"step\" data-frames=\"{}\">\n<h4><span>{number}</span> {title}</h4>\n<p>{text}</p>\n\
             <div class=\"slice\">{drawing}</div>\n<div class=\"view\">\n",
            pictures.len()
        );
        for (frame, (file, label)) in pictures.into_iter().enumerate() {
            let hidden = if frame == still { "" } else { " class=\"hidden\"" };
            // Writing to a string does not fail.
            let _ = writeln!(
                html,
                "<figure data-from=\"{frame}\" data-to=\"{frame}\"{hidden}><img src=\"{file}\" alt=\"{label}\"><figcaption>{label}</figcaption></figure>"
            );
        }
        html + "</div>\n</section>\n"
    }

    /// A group that is seen from one frame to another.
    fn during(group: Group, [from, to]: [usize; 2], still: usize) -> Group {
        let group = group.set("data-from", from).set("data-to", to);
        if (from..=to).contains(&still) { group } else { group.set("class", "hidden") }
    }
}

/// Width of the slice's drawing, and the space around the slice.
const WIDTH: f32 = 640.0;
const MARGIN: f32 = 24.0;

impl FourSteps {
    fn view(&self) -> (View<'_>, Vec2) {
        let extent = extent(&self.slice);
        let scale = (WIDTH - 2.0 * MARGIN) / extent.x;
        let height = scale * extent.y + 2.0 * MARGIN;
        (View { figure: &self.slice, origin: vec2(MARGIN, height - MARGIN), scale }, vec2(WIDTH, height))
    }

    fn frames(&self) -> usize {
        self.layers.len().max(self.slice.layers.len())
    }

    /// Whether a point of the slice faces the direction.
    fn faces(&self, point: usize) -> bool {
        Vec2::from(self.slice.points[point].normal).dot(self.slice.direction.into()) > 0.0
    }

    fn away(&self) -> usize {
        (0..self.slice.points.len()).filter(|&point| !self.faces(point)).count()
    }

    fn points(&self) -> Step {
        let (view, size) = self.view();
        let along = view.step_of(self.slice.direction.into()).normalize();
        let mut slice = view.bodies(10.0);
        for (i, point) in self.slice.points.iter().enumerate() {
            let at = view.at(point.place);
            if self.faces(i) {
                slice = slice.add(arrow(at, at + 46.0 * along, INK, 2.0)).add(dot(at, 5.0, INK));
            } else {
                slice = slice.add(dot(at, 5.0, "white"));
            }
        }
        Step {
            title: "All points, one direction",
            text: format!(
                "Every surface point that the camera sees needs the light that arrives from all sides. Here these are {} pixels; the slice shows {} \
                 points like them. All look along the same direction. The {} hollow ones face away from it and get nothing from it.",
                self.pixels,
                self.slice.points.len(),
                self.away()
            ),
            slice,
            size,
            pictures: vec![(self.direct.clone(), "What is known so far: direct light. Every pixel is a point.".into())],
            still: 0,
        }
    }

    fn peeling(&self) -> Step {
        let (view, size) = self.view();
        let last = self.frames() - 1;
        let mut slice = Group::new().add(view.bodies(10.0)).add(view.rays());
        for layer in 0..self.slice.layers.len() {
            slice = slice.add(Step::during(view.layer(layer, 5.0), [layer, last], last));
            slice = slice.add(Step::during(view.layer(layer, 11.0), [layer, layer], last));
        }
        let label = |layer: usize| format!("Layer {} of {}, as the direction sees it", layer + 1, self.layers.len());
        let pictures = self.layers.iter().enumerate().map(|(layer, pictures)| (pictures.layer.clone(), label(layer)));
        Step {
            title: "Peel from far to near",
            text: format!(
                "Parallel rays are a parallel projection, and that is what a GPU draws fast. The first drawing keeps the farthest surface in every \
                 texel. The second keeps the farthest of what is nearer than that, and so on: {} layers, each a picture of depths.",
                self.layers.len()
            ),
            slice,
            size,
            pictures: pictures.collect(),
            still: last,
        }
    }

    fn sampling(&self) -> Step {
        let (view, size) = self.view();
        // The layer that KILL discards for most points explains it best.
        let discarded = |layer: &usize| self.slice.points.iter().filter(|point| culled(point, *layer).is_some()).count();
        let still = (0..self.frames()).max_by_key(discarded).unwrap_or_default();
        let slice = (0..self.frames())
            .fold(view.bodies(10.0), |slice, layer| slice.add(Step::during(self.sampled(&view, layer), [layer, layer], still)));
        let label = |(layer, pictures): (usize, &LayerPictures)| {
            let LayerPictures { sampled, samples, .. } = pictures;
            let text = format!(
                "After layer {}, which {samples} of the {} pixels that face the direction sampled. Each shows its last sample.",
                layer + 1,
                self.facing
            );
            (sampled.clone(), text)
        };
        Step {
            title: "Sample ahead, KILL behind",
            text: format!(
                "After each layer, every point looks at the texel on its ray. If that lies ahead, it overwrites what the point sampled before. If it \
                 lies behind (a cross), KILL discards it. So the last sample is the nearest surface ahead: where a ray would have ended. Exact rays \
                 end at the same places for all {} points of this slice.",
                self.slice.points.len()
            ),
            slice,
            size,
            pictures: self.layers.iter().enumerate().map(label).collect(),
            still,
        }
    }

    /// What the slice's points do with a layer.
    fn sampled(&self, view: &View, layer: usize) -> Group {
        let last = self.slice.layers.len() - 1;
        let mut group = Group::new();
        if layer <= last {
            group = group.add(view.layer(layer, 9.0));
        }
        for (_, point) in self.slice.points.iter().enumerate().filter(|&(i, _)| self.faces(i)) {
            let at = view.at(point.place);
            if let Some((from, distance)) = point.last_sample(layer) {
                group = group.add(arrow(at, view.on_ray(point, distance), COLORS[from.min(COLORS.len() - 1)], 2.0));
            }
            let sight = point.sights.get(layer).copied().flatten();
            if let Some(sight) = culled(point, layer) {
                let culled = view.on_ray(point, sight.distance);
                group = group.add(dotted(at, culled)).add(cross(culled, 5.0));
            }
            group = group.add(dot(at, 5.0, if sight.is_some_and(|sight| sight.sampled) { INK } else { "white" }));
        }
        group
    }

    fn adding(&self) -> Step {
        let (view, size) = self.view();
        let most = self.light.iter().map(|&light| Vec3::from(light).max_element()).fold(1e-6, f32::max);
        let mut slice = view.bodies(10.0);
        for (point, &light) in self.slice.points.iter().zip(&self.light) {
            let (at, color) = (view.at(point.place), shown(Vec3::from(light) / most));
            let Some((_, distance)) = point.last_sample(self.slice.layers.len()) else {
                slice = slice.add(dot(at, 5.0, "white"));
                continue;
            };
            slice =
                slice.add(arrow(view.on_ray(point, distance), at, &color, 4.0).set("class", "light")).add(dot(at, 6.0, &color));
        }
        let sums = self.sums.iter().map(|Sum { directions, picture }| {
            (picture.clone(), format!("The sums after {}, with direct light", several(*directions, "direction")))
        });
        let first = (self.added.clone(), "What this direction adds to each pixel, brightened by one stop".into());
        Step {
            title: "Add light, next direction",
            text: "A rough photon map tells how much light each hit sends back along the ray (the colours of the arrows). Each point weighs it by the \
                   cosine and adds it to its sum. Then the next direction begins with step 1. Hundreds of directions later the sums are a picture."
                .into(),
            slice,
            size,
            pictures: [first].into_iter().chain(sums).collect(),
            still: self.sums.len(),
        }
    }
}

/// What KILL discards of a layer for a point that faces the direction, unless it is the point's own surface.
fn culled(point: &Point, layer: usize) -> Option<Sight> {
    point.sights.get(layer).copied().flatten().filter(|sight| !sight.sampled && is_apart(*sight))
}

/// A radiance from 0 to 1 as a colour of the page.
fn shown(radiance: Vec3) -> String {
    let [r, g, b] = radiance.to_array().map(|share| (255.0 * share.max(0.0).powf(1.0 / 2.2)).round());
    format!("rgb({r},{g},{b})")
}
