//! The place of the picture: enlarges it, shows the reference in its stead, and tells the values under the cursor.

use egui::{
    Align2, Color32, FontId, PointerButton, Pos2, Rect, Response, TextureFilter, TextureHandle, TextureOptions, Ui, pos2, vec2,
};
use finalgather::image::Image;
use finalgather::render::SeenSurface;
use glam::{DVec3, Vec2};

use super::picture::Developed;
use super::probe::PixelValues;
use super::worker::{DisplayPicture, ReferenceView};
use super::zoom::{Room, Zoom};

/// Height of a line of values.
const LINE: f32 = 17.0;

#[derive(Default)]
pub struct Canvas {
    pub zoom: Zoom,
    pub picture: Option<Box<DisplayPicture>>,
    pub reference: Option<Box<ReferenceView>>,
    /// Whether the reference is shown in place of the picture.
    pub flipped: bool,
    /// The same while a key is held.
    pub held: bool,
    /// Those of the picture and of the reference, and whether pixels are shown as squares.
    textures: [Option<(TextureHandle, bool)>; 2],
    /// Where the picture was in the last frame.
    room: Option<Room>,
    /// The place in the picture under the cursor, both coordinates in [0, 1).
    pub cursor: Option<Vec2>,
    /// The surface at a place.
    pub surface: Option<(Vec2, SeenSurface)>,
    /// The values under the cursor, or those that were there last.
    pub values: Option<PixelValues>,
}

impl Canvas {
    pub fn set_picture(&mut self, picture: Option<Box<DisplayPicture>>) {
        self.textures[0] = None;
        self.picture = picture;
    }

    pub fn set_reference(&mut self, reference: Option<Box<ReferenceView>>) {
        self.textures[1] = None;
        self.flipped &= reference.is_some();
        self.reference = reference;
    }

    /// Drops all textures, because their context is lost.
    pub fn forget_textures(&mut self) {
        self.textures = [None, None];
    }

    /// Whether the reference is shown.
    fn shows_reference(&self) -> bool {
        self.reference.is_some() && self.flipped != self.held
    }

    /// What is shown, with its reason if it cannot be.
    pub fn developed(&self) -> Option<&Result<Developed, String>> {
        match (&self.reference, &self.picture) {
            (Some(reference), _) if self.shows_reference() => Some(&reference.developed),
            (_, picture) => picture.as_ref().map(|picture| &picture.developed),
        }
    }

    /// Splits `area` into the place of the picture and a strip below it for the values and the scale. What is shown does not change the place: with a
    /// picture as large as it, the render would begin again.
    pub fn split(area: Rect) -> (Rect, Rect) {
        let lines = match area.width() {
            ..420.0 => 5.0,
            ..720.0 => 4.0,
            ..1000.0 => 3.0,
            _ => 2.0,
        };
        let height = LINE * lines + 11.0;
        area.split_top_bottom_at_y(area.bottom() - height.min(0.5 * area.height()))
    }

    /// Moves the picture by the mouse. Returns whether it did.
    pub fn navigate(&mut self, ui: &Ui, response: &Response) -> bool {
        let Some(room) = self.room else { return false };
        if response.contains_pointer()
            && let Some(pointer) = response.hover_pos()
        {
            let by = ui.input(egui::InputState::zoom_delta);
            if by != 1.0 {
                self.zoom.enlarge(by, pointer, &room);
            }
        }
        let pans = ui.input(|input| input.modifiers.ctrl || input.key_down(egui::Key::Space));
        if pans && response.dragged_by(PointerButton::Primary) {
            self.zoom.pan(response.drag_delta(), &room);
        }
        pans
    }

    /// Shows one pixel as `scale` pixels of the screen, about the pointer or the middle.
    pub fn enlarge_to(&mut self, scale: f32, pointer: Option<Pos2>) {
        if let Some(room) = self.room {
            let pointer = pointer.filter(|&at| room.area.contains(at)).unwrap_or(room.area.center());
            self.zoom.set(scale, pointer, &room);
        }
    }

    /// Pixels of the screen to one of the picture.
    pub fn factor(&self) -> f32 {
        self.room.map_or(1.0, |room| self.zoom.factor(&room))
    }

    /// Shows the picture, of this size, and returns its place.
    pub fn show(&mut self, ui: &Ui, area: Rect, size: [u32; 2], response: &Response) -> Rect {
        let room = Room { area, size, pixels_per_point: ui.pixels_per_point() };
        self.room = Some(room);
        let place = self.zoom.place(&room);
        self.cursor = response.hover_pos().and_then(|pointer| self.zoom.pixel(pointer, &room)).map(|[x, y]| {
            // The middle of the pixel, so that a smaller picture has the same one there.
            Vec2::new((x as f32 + 0.5) / size[0] as f32, (y as f32 + 0.5) / size[1] as f32)
        });
        let painter = ui.painter_at(area);
        let squares = self.zoom.scale.is_some_and(|scale| scale >= 1.0);
        let which = usize::from(self.shows_reference());
        let say = |words: String| {
            let weak = ui.visuals().weak_text_color();
            let galley = painter.layout(words, FontId::proportional(14.0), weak, area.width() - 24.0);
            painter.galley(area.center() - 0.5 * galley.size(), galley, weak);
            place
        };
        let most = ui.input(|input| input.max_texture_side);
        match self.developed() {
            None => return place,
            Some(Err(words)) => return say(words.clone()),
            Some(Ok(Developed { image, .. })) if image.size.into_iter().any(|side| side > most) => {
                let [width, height] = image.size;
                return say(format!("{width} x {height} pixels: this window shows at most {most} a side"));
            }
            Some(Ok(Developed { image, .. })) => {
                // A reference of another size keeps its shape.
                let own =
                    if which == 1 && image.size != size.map(|side| side as usize) { fitted(image.size, place) } else { place };
                let magnification = if squares { TextureFilter::Nearest } else { TextureFilter::Linear };
                let load = || {
                    ui.ctx().load_texture("picture", image.clone(), TextureOptions { magnification, ..TextureOptions::LINEAR })
                };
                let texture = match &self.textures[which] {
                    Some((texture, as_squares)) if *as_squares == squares => texture.clone(),
                    _ => load(),
                };
                painter.image(texture.id(), own, Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0)), Color32::WHITE);
                self.textures[which] = Some((texture, squares));
            }
        }
        if let Some(reference) = self.reference.as_ref().filter(|_| self.shows_reference()) {
            let name = reference.path.file_name().unwrap_or_default().to_string_lossy();
            let at = area.left_bottom() + vec2(10.0, -10.0);
            let galley = painter.layout_no_wrap(format!("Reference: {name}"), FontId::proportional(13.0), Color32::WHITE);
            let place = Align2::LEFT_BOTTOM.anchor_size(at, galley.size());
            painter.rect_filled(place.expand(4.0), 3.0, Color32::from_black_alpha(180));
            painter.galley(place.min, galley, Color32::WHITE);
        }
        place
    }

    /// Shows the scale of false colours and the values under the cursor. Positions of pictures are relative to `origin`.
    pub fn strip(&mut self, ui: &Ui, area: Rect, origin: DVec3) {
        let painter = ui.painter_at(area);
        painter.rect_filled(area, 0.0, ui.visuals().panel_fill);
        let mut values = area.shrink2(vec2(12.0, 4.0));
        if let Some(Ok(Developed { scale: Some(scale), .. })) = self.developed() {
            let (left, bar) = area.split_left_right_at_fraction(0.58);
            scale.draw(&painter, bar, ui.visuals().text_color());
            values = left.shrink2(vec2(12.0, 4.0));
        }
        let weak = ui.visuals().weak_text_color();
        let font = FontId::proportional(12.5);
        let factor = self.factor();
        let zoom = if self.zoom.scale == Some(1.0) { "1:1".to_owned() } else { format!("{:.0} %", 100.0 * factor) };
        let zoom = painter.text(values.right_top(), Align2::RIGHT_TOP, zoom, font.clone(), weak);
        let width = zoom.left() - values.left() - 12.0;
        let same = |image: &Image| {
            self.picture
                .as_ref()
                .is_some_and(|picture| [image.width, image.height] == [picture.image.width, picture.image.height])
        };
        let other = self.reference.as_ref().filter(|reference| self.shows_reference() && !same(&reference.image)).is_some();
        let at_cursor = self.cursor.filter(|_| !other).and_then(|place| {
            let picture = self.picture.as_ref()?;
            let seen = self.surface.as_ref().filter(|(at, _)| *at == place).map(|(_, seen)| seen);
            let reference = self.reference.as_ref().map(|reference| &*reference.image).filter(|image| same(image));
            PixelValues::new(&picture.image, place, origin, seen, reference)
        });
        match &at_cursor {
            Some(at_cursor) => {
                let galley = ui.fonts_mut(|fonts| fonts.layout_job(at_cursor.text(ui.visuals(), width)));
                painter.galley(values.min, galley, weak);
            }
            None => {
                let words = if other {
                    "The reference has another size than the picture: its pixels have no values here."
                } else {
                    "Point at the picture to read its values."
                };
                let galley = painter.layout(words.into(), font, weak, width);
                painter.galley(values.min, galley, weak);
            }
        }
        self.values = at_cursor.or(self.values.take());
    }
}

/// The largest place of this shape in the middle of `place`.
fn fitted(size: [usize; 2], place: Rect) -> Rect {
    let sides = vec2(size[0] as f32, size[1] as f32);
    Rect::from_center_size(place.center(), sides * (place.size() / sides).min_elem())
}
