//! The layer view, an interactive version of the poster's figure 1. It shows the layers of a direction as thumbnails and as a stack in space, the
//! bundle of rays, and the layers that the point under the mouse samples.

use std::f32::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use egui::epaint::{Vertex, WHITE_UV};
use egui::{
    Align2, Color32, ColorImage, FontId, Mesh, Painter, Pos2, Rect, Response, Sense, Shape, Stroke, StrokeKind, TextureHandle,
    TextureOptions, Ui, pos2, vec2,
};
use finalgather::math::frame;
use finalgather::render::{LayerTexel, Layers, Probe};
use glam::{Mat3, Vec2, Vec3};

use super::quads::{LayerQuad, middles, quads};

/// The approximate number of quads in a stack. Each frame projects, sorts and draws all of them.
const QUADS: f32 = 60e3;
/// The longest side of a thumbnail, in pixels.
const THUMBNAIL: u32 = 320;
/// The distance between two layers of a stack that is fully apart, in unit space, where the scene's radius is 1.
const GAP: f32 = 0.9;
/// Height of the row of thumbnails.
const ROW: f32 = 132.0;

/// Side of the thumbnail under the pointer, in points.
const ENLARGED: f32 = 360.0;

/// Colours that stand out from the background.
struct Colors {
    kept: Color32,
    sampled: Color32,
    culled: Color32,
    ray: Color32,
    frame: Color32,
    text: Color32,
}

impl Colors {
    fn of(ui: &Ui) -> Self {
        let rgb = Color32::from_rgb;
        let text = ui.visuals().strong_text_color();
        if ui.visuals().dark_mode {
            Self {
                kept: rgb(120, 220, 120),
                sampled: rgb(120, 170, 240),
                culled: rgb(235, 110, 95),
                ray: rgb(255, 225, 120),
                frame: Color32::from_gray(90),
                text,
            }
        } else {
            Self {
                kept: rgb(0, 120, 30),
                sampled: rgb(30, 80, 190),
                culled: rgb(190, 40, 20),
                ray: rgb(190, 95, 0),
                frame: Color32::from_gray(140),
                text,
            }
        }
    }
}

/// A request for the layers of a direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LayerRequest {
    /// The direction's number; `None` for the direction that was gathered last.
    pub number: Option<u32>,
    /// Whether the rays run against the direction.
    pub opposite: bool,
    /// The point to probe, as in [`Probe::place`].
    pub place: Option<Vec2>,
}

/// The layers of a direction, prepared for display.
pub struct LayerImages {
    pub layers: Arc<Layers>,
    /// One thumbnail for each layer.
    images: Vec<Arc<ColorImage>>,
    quads: Vec<LayerQuad>,
}

pub struct LayerView {
    pub request: LayerRequest,
    images: Option<LayerImages>,
    pub probe: Option<Probe>,
    textures: Vec<TextureHandle>,
    /// The distance between layers, as a multiple of [`GAP`].
    pub explode: f32,
    /// The stack's view angles about the direction.
    yaw: f32,
    pitch: f32,
    zoom: f32,
    /// Whether the pointer is over it. Then it shows the same direction until the pointer leaves.
    watched: bool,
}

impl Default for LayerView {
    fn default() -> Self {
        let (request, images, probe, textures) = Default::default();
        Self { request, images, probe, textures, explode: Self::EXPLODE, yaw: -0.5, pitch: 0.35, zoom: 1.0, watched: false }
    }
}

impl LayerImages {
    pub fn new(layers: Arc<Layers>) -> Self {
        let size = layers.size;
        let places = || middles(size, size.div_ceil(THUMBNAIL));
        let color = |texel: &Option<LayerTexel>| texel.as_ref().map_or(Color32::from_gray(30), color);
        // Texel (0, 0) is at the lower left.
        let image = |layer: &Vec<Option<LayerTexel>>| {
            let pixels = places().rev().flat_map(|y| places().map(move |x| (y * size + x) as usize));
            Arc::new(ColorImage::new([places().len(); 2], pixels.map(|at| color(&layer[at])).collect()))
        };
        Self { images: layers.layers.iter().map(image).collect(), quads: quads(&layers, QUADS), layers }
    }
}

/// The texel's albedo, brighter where the surface faces the rays.
pub fn color(texel: &LayerTexel) -> Color32 {
    let shade = 0.35 + 0.65 * texel.cosine;
    let [r, g, b] = (if texel.emissive { Vec3::ONE } else { shade * texel.albedo }).to_array();
    egui::Rgba::from_rgb(r, g, b).into()
}

impl LayerView {
    /// The distance between layers at first.
    pub const EXPLODE: f32 = 0.6;

    /// The request to send: it waits while the layers are looked at.
    pub fn wanted(&self) -> LayerRequest {
        let waits = self.watched && self.images.is_some();
        LayerRequest { number: self.request.number.or(waits.then(|| self.number())), ..self.request }
    }

    /// Replaces the shown layers.
    pub fn set(&mut self, images: Option<LayerImages>) {
        self.textures.clear();
        self.probe = None;
        self.images = images;
    }

    pub fn forget_textures(&mut self) {
        self.textures.clear();
    }

    /// Number of the shown direction.
    pub fn number(&self) -> u32 {
        self.request.number.or(self.images.as_ref().map(|images| images.layers.end.number)).unwrap_or(0)
    }

    /// Number of layers.
    pub fn count(&self) -> usize {
        self.images.as_ref().map_or(0, |images| images.images.len())
    }

    /// Requests the next or the previous direction.
    pub fn step(&mut self, by: i32, directions: u32) {
        self.request.number = Some(self.number().saturating_add_signed(by).min(directions.saturating_sub(1)));
    }

    /// Splits `area` into the parts for the picture, the stack and the row of thumbnails.
    pub fn split(area: Rect) -> (Rect, Rect, Rect) {
        let (upper, row) = area.split_top_bottom_at_y(area.bottom() - ROW.min(0.3 * area.height()));
        let (picture, stack) = if upper.width() > upper.height() {
            upper.split_left_right_at_fraction(0.45)
        } else {
            upper.split_top_bottom_at_fraction(0.45)
        };
        (picture.shrink(8.0), stack, row)
    }

    /// Requests a probe of the point at `cursor`, a place in the picture, and marks the probed point. `shown` is the picture's place.
    pub fn point(&mut self, ui: &Ui, shown: Rect, cursor: Option<Vec2>) {
        self.watched = cursor.is_some();
        self.request.place = cursor.or(self.request.place);
        if let Some(probe) = &self.probe {
            let at = shown.min + vec2(probe.place.x, probe.place.y) * shown.size();
            ui.painter().circle(at, 4.0, Color32::TRANSPARENT, Stroke::new(2.0, Colors::of(ui).ray));
        }
    }

    /// Draws the row of thumbnails, the farthest layer first.
    pub fn row(&mut self, ui: &mut Ui, area: Rect) {
        let Some(images) = &self.images else { return };
        if self.textures.is_empty() {
            let load = |(i, image): (usize, &Arc<ColorImage>)| {
                ui.ctx().load_texture(format!("layer {i}"), image.clone(), TextureOptions::NEAREST)
            };
            self.textures = images.images.iter().enumerate().map(load).collect();
        }
        let colors = Colors::of(ui);
        let count = self.textures.len().max(1) as f32;
        let side = (area.height() - 30.0).min((area.width() - 12.0) / count - 8.0).max(8.0);
        let pointer = ui.input(|input| input.pointer.hover_pos()).filter(|&at| area.contains(at));
        self.watched |= pointer.is_some();
        for (index, texture) in self.textures.iter().enumerate() {
            let min = pos2(area.left() + 12.0 + index as f32 * (side + 8.0), area.top() + 20.0);
            let place = Rect::from_min_size(min, vec2(side, side));
            let (border, word) = self.probe.as_ref().map_or((colors.frame, ""), |probe| verdict(probe, index, &colors));
            let draw = |painter: &Painter, place: Rect| {
                painter.image(texture.id(), place, Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0)), Color32::WHITE);
                painter.rect_stroke(place, 2.0, Stroke::new(2.0, border), StrokeKind::Outside);
                if let Some(probe) = &self.probe {
                    let at = images.layers.to_layer.transform_point3(probe.point.position) / images.layers.size as f32;
                    let center = place.left_bottom() + vec2(at.x, -at.y) * place.width();
                    painter.circle_stroke(center, 3.5, Stroke::new(1.5, colors.ray));
                }
            };
            let painter = ui.painter_at(area);
            draw(&painter, place);
            let text = format!("{} {word}", index + 1);
            painter.text(min - vec2(0.0, 4.0), Align2::LEFT_BOTTOM, text, FontId::proportional(12.0), border);
            if pointer.is_some_and(|at| place.expand(4.0).contains(at)) {
                // Above the row, in the window.
                let all = ui.ctx().content_rect();
                let large = ENLARGED.min(area.top() - all.top() - 24.0).max(side);
                let left =
                    (place.center().x - 0.5 * large).clamp(all.left() + 8.0, (area.right() - large - 8.0).max(all.left() + 8.0));
                let over = Rect::from_min_size(pos2(left, area.top() - large - 8.0), vec2(large, large));
                let layer = egui::LayerId::new(egui::Order::Tooltip, ui.id().with("thumbnail"));
                draw(&ui.ctx().layer_painter(layer), over);
            }
        }
    }

    /// Draws the stack of layers in space.
    pub fn stack(&mut self, ui: &Ui, area: Rect, half_extents: Vec3) {
        let response = ui.interact(area, ui.id().with("stack"), Sense::click_and_drag());
        self.turn(ui, &response);
        self.watched |= response.contains_pointer();
        let colors = Colors::of(ui);
        let painter = ui.painter_at(area);
        let Some(LayerImages { layers, quads, .. }) = &self.images else { return };
        let count = layers.layers.len();
        let apart_by = |index: usize| layers.direction * (self.explode * GAP * (count - 1 - index) as f32);
        let reach = self.explode * GAP * count.saturating_sub(1) as f32;
        let text =
            self.probe.as_ref().map_or("Point at the picture to follow a ray.".to_owned(), |probe| sentence(probe, layers));
        let galley = painter.layout(text, FontId::proportional(13.0), colors.text, area.width() - 24.0);
        let (words, room) = area.split_top_bottom_at_y(area.top() + galley.size().y + 16.0);
        painter.galley(words.min + vec2(12.0, 8.0), galley, colors.text);
        let view = Projection::new(self, room, layers.direction, reach, half_extents);

        for [a, b] in box_edges(half_extents) {
            view.line(&painter, a, b, Stroke::new(1.0, colors.frame));
        }
        view.bundle(&painter, layers, reach, colors.ray);
        // Drawn from the back to the front, because egui has no depth test.
        let shifts: Vec<Vec3> = (0..count).map(apart_by).collect();
        let projected = |quad: &LayerQuad| {
            let ends = quad.corners.map(|corner| view.project(corner + shifts[quad.layer]));
            let depth: f32 = ends.iter().map(|(_, depth)| depth).sum();
            (depth.to_bits(), ends.map(|(at, _)| at), quad.color)
        };
        let mut quads: Vec<_> = quads.iter().map(projected).collect();
        // Depths are positive, so their bits have the same order.
        quads.sort_unstable_by_key(|&(depth, ..)| std::cmp::Reverse(depth));
        let mut mesh = Mesh::default();
        for (_, corners, color) in quads {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(corners.map(|pos| Vertex { pos, uv: WHITE_UV, color }));
            mesh.indices.extend([0, 1, 2, 0, 2, 3].map(|index| first + index));
        }
        painter.add(Shape::mesh(mesh));

        if let Some(probe) = &self.probe {
            let start = probe.point.position;
            let kept = probe.sampled.iter().rposition(|&sampled| sampled);
            if let (Some(hit), Some(kept)) = (probe.hit, kept) {
                let end = hit + apart_by(kept);
                view.line(&painter, start, end, Stroke::new(2.5, colors.ray));
                view.dot(&painter, end, colors.kept);
            } else {
                view.line(&painter, start, start + layers.direction * 0.4, Stroke::new(2.0, colors.culled));
            }
            view.dot(&painter, start, colors.ray);
        }
    }

    fn turn(&mut self, ui: &Ui, response: &Response) {
        if response.dragged() {
            let drag = response.drag_delta() / response.rect.height().max(1.0);
            self.yaw -= PI * drag.x;
            self.pitch = (self.pitch + PI * drag.y).clamp(-0.49 * PI, 0.49 * PI);
        }
        if response.contains_pointer() {
            let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
            self.zoom = (self.zoom * (scroll / 400.0).exp() * pinch).clamp(0.2, 8.0);
        }
    }
}

/// What the point does with a layer, as a colour and a word.
fn verdict(probe: &Probe, index: usize, colors: &Colors) -> (Color32, &'static str) {
    let kept = probe.sampled.iter().rposition(|&sampled| sampled);
    match probe.sampled.get(index) {
        Some(true) if kept == Some(index) => (colors.kept, "kept"),
        Some(true) => (colors.sampled, "overwritten"),
        _ => (colors.culled, "culled"),
    }
}

fn sentence(probe: &Probe, layers: &Layers) -> String {
    if probe.point.cosine(layers.direction) == 0.0 {
        return "The point's surface faces away from these rays: this end of the direction says nothing to it.".to_owned();
    }
    let sampled = probe.sampled.iter().filter(|&&sampled| sampled).count();
    match sampled {
        0 => "The point's ray leaves the scene: all layers lie behind it and are culled (KILL).".to_owned(),
        1 => "The point samples the farthest layer; all others lie behind it and are culled (KILL).".to_owned(),
        _ => format!(
            "The point samples {sampled} layers, far to near, and keeps the last, the nearest ahead; those behind it are culled (KILL)."
        ),
    }
}

/// A perspective projection from unit space to the window.
struct Projection {
    eye: Vec3,
    to_view: Mat3,
    center: Pos2,
    scale: f32,
}

impl Projection {
    /// The stack of a scene with these half extents fills `area`. It reaches `reach` beyond the scene along `direction`.
    fn new(view: &LayerView, area: Rect, direction: Vec3, reach: f32, half_extents: Vec3) -> Self {
        // The direction points to the right, and y points up as far as it can.
        let right = direction;
        let up = (Vec3::Y - Vec3::Y.dot(right) * right).try_normalize().unwrap_or(frame(right).x_axis);
        let base = Mat3::from_cols(right, up, right.cross(up));
        let turned = Mat3::from_rotation_y(view.yaw) * Mat3::from_rotation_x(-view.pitch);
        let axes = base * turned;
        let distance = 4.0 * (1.0 + 0.5 * reach);
        let eye = 0.5 * reach * direction + axes.z_axis * distance;
        let unit = Self { eye, to_view: axes.transpose(), center: Pos2::ZERO, scale: 1.0 };
        let corners = || box_edges(half_extents).flatten();
        let ends = corners().chain(corners().map(|corner| corner + reach * direction));
        let bounds = Rect::from_points(&ends.map(|end| unit.project(end).0).collect::<Vec<_>>());
        let fits = (area.width() / bounds.width()).min(area.height() / bounds.height());
        let scale = 0.94 * fits * view.zoom;
        Self { center: area.center() - scale * bounds.center().to_vec2(), scale, ..unit }
    }

    /// Returns the place in the window and the depth.
    fn project(&self, position: Vec3) -> (Pos2, f32) {
        let at = self.to_view * (position - self.eye);
        let depth = (-at.z).max(0.05);
        (self.center + vec2(at.x, -at.y) * (self.scale / depth), depth)
    }

    fn line(&self, painter: &Painter, a: Vec3, b: Vec3, stroke: Stroke) {
        painter.line_segment([self.project(a).0, self.project(b).0], stroke);
    }

    fn dot(&self, painter: &Painter, at: Vec3, color: Color32) {
        painter.circle(self.project(at).0, 4.0, color, Stroke::new(1.0, Color32::BLACK));
    }

    /// Draws some of the bundle's rays through the whole stack.
    fn bundle(&self, painter: &Painter, layers: &Layers, reach: f32, color: Color32) {
        const RAYS: u32 = 5;
        let stroke = Stroke::new(1.0, color.gamma_multiply(0.35));
        for i in 0..RAYS * RAYS {
            let place = Vec2::new((i % RAYS) as f32 + 0.5, (i / RAYS) as f32 + 0.5) * layers.size as f32 / RAYS as f32;
            let end = |depth: f32| layers.from_layer.transform_point3(place.extend(depth));
            let (start, end) = (end(-0.1), end(1.1) + reach * layers.direction);
            self.line(painter, start, end, stroke);
            let tip = self.project(end).0;
            let ahead = (tip - self.project(start).0).normalized();
            for side in [FRAC_PI_2 * 1.7, -FRAC_PI_2 * 1.7] {
                painter.line_segment([tip, tip + 7.0 * (egui::emath::Rot2::from_angle(side) * ahead)], stroke);
            }
        }
    }
}

/// The twelve edges of a box around the origin.
fn box_edges(half: Vec3) -> impl Iterator<Item = [Vec3; 2]> {
    let corner = move |bits: usize| half * Vec3::from([0, 1, 2].map(|axis| if bits >> axis & 1 == 1 { 1.0 } else { -1.0 }));
    (0..8).flat_map(move |bits: usize| {
        let ends = [1, 2, 4].into_iter().filter(move |axis| bits & axis == 0);
        ends.map(move |axis| [corner(bits), corner(bits | axis)])
    })
}

#[cfg(test)]
mod tests {
    use finalgather::render::End;
    use glam::Mat4;

    use super::*;

    #[test]
    fn it_waits_while_it_is_looked_at() {
        let layers = Layers {
            end: End { number: 5, opposite: false },
            direction: Vec3::Z,
            from_layer: Mat4::IDENTITY,
            to_layer: Mat4::IDENTITY,
            size: 1,
            layers: vec![vec![None]],
            corners: [].into(),
        };
        let mut view = LayerView::default();
        view.set(Some(LayerImages::new(Arc::new(layers))));
        assert_eq!(view.wanted().number, None, "the direction that was gathered last");
        view.watched = true;
        assert_eq!(view.wanted().number, Some(5), "the direction that is shown");
        view.step(1, 16);
        assert_eq!(view.wanted().number, Some(6), "the direction that was asked for");
    }

    #[test]
    fn the_stack_fills_its_area() {
        let area = Rect::from_min_size(pos2(100.0, 50.0), vec2(400.0, 300.0));
        let half = Vec3::new(0.5, 0.6, 0.7).normalize();
        for (reach, yaw, pitch) in [(0.0, 0.0, 0.0), (3.0, -0.5, 0.35), (6.0, 1.2, -1.0)] {
            let view = LayerView { yaw, pitch, ..LayerView::default() };
            let projection = Projection::new(&view, area, Vec3::X, reach, half);
            let corners = || box_edges(half).flatten();
            let ends = corners().chain(corners().map(|corner| corner + reach * Vec3::X));
            let bounds = Rect::from_points(&ends.map(|end| projection.project(end).0).collect::<Vec<_>>());
            assert!(area.contains_rect(bounds), "{bounds:?}");
            let fills = (bounds.width() / area.width()).max(bounds.height() / area.height());
            assert!((fills - 0.94).abs() < 0.01, "{fills} of a side");
            assert!(bounds.center().distance(area.center()) < 0.5);
        }
    }
}
