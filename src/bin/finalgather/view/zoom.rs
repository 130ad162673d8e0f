//! Where the picture lies in its area: as large as fits, or enlarged.

use egui::{Pos2, Rect, Vec2, pos2, vec2};

/// The largest and smallest enlargement.
const SCALES: [f32; 2] = [1.0 / 16.0, 64.0];

/// The enlargement of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Zoom {
    /// Pixels of the screen to one of the picture; `None`: the picture is as large as fits.
    pub scale: Option<f32>,
    /// The place of the picture, from 0 to 1, that lies in the middle of the area.
    middle: Pos2,
}

/// The area for a picture, and its size.
#[derive(Clone, Copy, Debug)]
pub struct Room {
    /// In points.
    pub area: Rect,
    /// In pixels of the picture.
    pub size: [u32; 2],
    pub pixels_per_point: f32,
}

impl Default for Zoom {
    fn default() -> Self {
        Self { scale: None, middle: pos2(0.5, 0.5) }
    }
}

impl Room {
    fn sides(&self) -> Vec2 {
        vec2(self.size[0] as f32, self.size[1] as f32)
    }

    /// The enlargement at which all of the picture fits.
    fn fitting(&self) -> f32 {
        let room = self.area.size() * self.pixels_per_point;
        (room.x / self.sides().x).min(room.y / self.sides().y).max(1e-6)
    }
}

impl Zoom {
    /// Pixels of the screen to one of the picture.
    pub fn factor(&self, room: &Room) -> f32 {
        self.scale.unwrap_or_else(|| room.fitting())
    }

    /// The place of the whole picture, with its corners on pixels of the screen. It may be larger than the area.
    pub fn place(&self, room: &Room) -> Rect {
        let size = (room.sides() * self.factor(room)).round();
        let middle = (room.area * room.pixels_per_point).center();
        let min = (middle - size * self.middle.to_vec2()).round();
        Rect::from_min_size(min, size) / room.pixels_per_point
    }

    /// Enlarges by `by` and keeps what is at `pointer` there.
    pub fn enlarge(&mut self, by: f32, pointer: Pos2, room: &Room) {
        let scale = self.factor(room) * by;
        self.set(scale, pointer, room);
    }

    /// Sets the enlargement and keeps what is at `pointer` there.
    pub fn set(&mut self, scale: f32, pointer: Pos2, room: &Room) {
        let held = self.at(pointer, room);
        let scale = scale.clamp(SCALES[0].min(room.fitting()), SCALES[1]);
        self.scale = Some(scale);
        let shown = room.sides() * scale / room.pixels_per_point;
        let away = (pointer - room.area.center()) / shown;
        self.middle = (held - away).clamp(Pos2::ZERO, pos2(1.0, 1.0));
    }

    /// Moves the picture by `by` points.
    pub fn pan(&mut self, by: Vec2, room: &Room) {
        if self.scale.is_some() {
            let shown = self.place(room).size();
            self.middle = (self.middle - by / shown).clamp(Pos2::ZERO, pos2(1.0, 1.0));
        }
    }

    /// The place in the picture at `pointer`, from 0 to 1 within it.
    fn at(&self, pointer: Pos2, room: &Room) -> Pos2 {
        let place = self.place(room);
        ((pointer - place.min) / place.size()).to_pos2()
    }

    /// The pixel at `pointer`, if it is on the picture and in the area.
    pub fn pixel(&self, pointer: Pos2, room: &Room) -> Option<[usize; 2]> {
        let (at, [width, height]) = (self.at(pointer, room), room.size);
        let inside = |part: f32| (0.0..1.0).contains(&part);
        let side = |part: f32, side: u32| ((part * side as f32) as usize).min(side as usize - 1);
        (room.area.contains(pointer) && inside(at.x) && inside(at.y)).then(|| [side(at.x, width), side(at.y, height)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOM: Room =
        Room { area: Rect { min: pos2(10.0, 20.0), max: pos2(410.0, 220.0) }, size: [100, 100], pixels_per_point: 2.0 };

    #[test]
    fn the_whole_picture_fits() {
        let zoom = Zoom::default();
        assert_eq!(zoom.factor(&ROOM), 4.0, "400 pixels of the screen for 100");
        assert_eq!(zoom.place(&ROOM), Rect::from_min_size(pos2(110.0, 20.0), vec2(200.0, 200.0)));
        assert_eq!(zoom.pixel(pos2(111.0, 21.0), &ROOM), Some([0, 0]));
        assert_eq!(zoom.pixel(pos2(309.0, 219.0), &ROOM), Some([99, 99]));
        assert_eq!(zoom.pixel(pos2(100.0, 21.0), &ROOM), None, "beside the picture");
    }

    #[test]
    fn one_pixel_is_one_of_the_screen() {
        let mut zoom = Zoom::default();
        zoom.set(1.0, ROOM.area.center(), &ROOM);
        assert_eq!(zoom.place(&ROOM).size() * ROOM.pixels_per_point, vec2(100.0, 100.0));
        assert_eq!(zoom.place(&ROOM).center(), ROOM.area.center());
    }

    #[test]
    fn what_is_under_the_pointer_stays_there() {
        let mut zoom = Zoom::default();
        let pointer = pos2(150.0, 60.0);
        let before = zoom.pixel(pointer, &ROOM);
        for by in [1.5, 2.0, 3.0, 0.5] {
            zoom.enlarge(by, pointer, &ROOM);
            assert_eq!(zoom.pixel(pointer, &ROOM), before, "{zoom:?}");
        }
        assert_eq!(zoom.pixel(pos2(405.0, 300.0), &ROOM), None, "outside of the area");
        let pixel = zoom.pixel(pos2(200.0, 100.0), &ROOM);
        zoom.pan(vec2(20.0, -10.0), &ROOM);
        assert_eq!(zoom.pixel(pos2(220.0, 90.0), &ROOM), pixel);
    }
}
