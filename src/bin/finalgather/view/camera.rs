//! Moves the camera by mouse, touchpad and keys, in world space.

use std::f32::consts::PI;

use egui::{Key, Modifiers, PointerButton, Response, Ui};
use finalgather::scene::WorldCamera;
use glam::{Quat, Vec2, Vec3};

/// Keys and their effects, for the list that F1 shows.
pub const KEYS: [(&str, &str); 22] = [
    ("left drag", "orbit"),
    ("right drag", "look around"),
    ("middle or Shift + left drag", "pan"),
    ("wheel", "move nearer or farther"),
    ("W A S D, arrows", "fly forward, left, back, right"),
    ("Q E", "fly down, up"),
    ("Shift", "fly faster"),
    ("R", "the scene's own view"),
    ("Ctrl + wheel, pinch", "enlarge the picture at the pointer"),
    ("Ctrl or Space + left drag", "move the enlarged picture"),
    ("1, F", "one pixel to one of the screen; all of the picture"),
    ("X, held", "the reference in place of the picture"),
    ("L", "layer view"),
    (", .", "direction before, next"),
    ("Ctrl + C", "copy the view as options of a command"),
    ("Ctrl + O", "open a scene"),
    ("Ctrl + R", "open a reference"),
    ("Ctrl + S", "save the picture"),
    ("Ctrl + Shift + S", "save a scene file with this view"),
    ("Ctrl + Q", "end"),
    ("P", "hide or show the panel"),
    ("F1", "this list"),
];

/// The least distance of the eye from its target, as a fraction of the scene's diagonal.
const NEAREST: f32 = 1e-3;

/// Moves `camera` by the frame's input over the picture. `diagonal` is that of the scene. `busy`: the left button does something else. Returns
/// whether there was such input.
pub fn move_camera(ui: &Ui, response: &Response, camera: &mut WorldCamera, diagonal: f32, busy: bool) -> bool {
    let before = *camera;
    let (shift, time) = ui.input(|input| (input.modifiers.shift, input.stable_dt.min(0.1)));
    let height = response.rect.height().max(1.0);
    let drag = Vec2::from(<[f32; 2]>::from(response.drag_delta())) / height;
    let mut held = true;
    if response.dragged_by(PointerButton::Middle) || (shift && response.dragged_by(PointerButton::Primary)) {
        pan(camera, drag);
    } else if response.dragged_by(PointerButton::Primary) && !busy {
        orbit(camera, drag);
    } else if response.dragged_by(PointerButton::Secondary) {
        look(camera, drag);
    } else {
        held = false;
    }
    if response.contains_pointer() {
        let factor = (-ui.input(|input| input.smooth_scroll_delta().y) / 400.0).exp();
        if factor != 1.0 {
            zoom(camera, factor, NEAREST * diagonal);
        }
    }
    if !ui.ctx().egui_wants_keyboard_input() {
        let toward = ui.input(|input| {
            // With Ctrl or Alt, keys have other meanings.
            let free = input.modifiers.matches_logically(Modifiers::SHIFT) || input.modifiers.is_none();
            let key = |keys: [Key; 2]| f32::from(free && keys.into_iter().any(|key| input.key_down(key)));
            let along = key([Key::W, Key::ArrowUp]) - key([Key::S, Key::ArrowDown]);
            let right = key([Key::D, Key::ArrowRight]) - key([Key::A, Key::ArrowLeft]);
            Vec3::new(right, key([Key::E; 2]) - key([Key::Q; 2]), -along)
        });
        if toward != Vec3::ZERO {
            held = true;
            ui.ctx().request_repaint();
            let speed = diagonal * if shift { 1.0 } else { 0.25 };
            shift_camera(camera, camera.axes() * toward.normalize() * speed * time);
        }
    }
    held || *camera != before
}

fn shift_camera(camera: &mut WorldCamera, step: Vec3) {
    camera.eye += step.as_dvec3();
    camera.target += step.as_dvec3();
}

/// Turns the eye about the target. `drag` is in heights of the picture; one height is half a turn.
fn orbit(camera: &mut WorldCamera, drag: Vec2) {
    let offset = (camera.eye - camera.target).as_vec3();
    camera.eye = camera.target + turned(camera, offset, -PI * drag).as_dvec3();
}

/// Turns the target about the eye. One height of the picture is its field of view.
fn look(camera: &mut WorldCamera, drag: Vec2) {
    let ahead = (camera.target - camera.eye).as_vec3();
    camera.target = camera.eye + turned(camera, ahead, drag * camera.fov_y_degrees.to_radians()).as_dvec3();
}

/// Turns `arm` about the upright axis and tilts it about the camera's right axis, but not as far as the poles.
fn turned(camera: &WorldCamera, arm: Vec3, by: Vec2) -> Vec3 {
    let up = camera.up.normalize();
    let right = camera.axes().x_axis;
    let back = (camera.eye - camera.target).normalize().as_vec3();
    let height = back.dot(up).clamp(-1.0, 1.0).asin();
    let limit = (0.49 * PI).max(height.abs());
    let tilt = height - (height - by.y).clamp(-limit, limit);
    Quat::from_axis_angle(up, by.x) * (Quat::from_axis_angle(right, tilt) * arm)
}

/// Moves eye and target so that points as far away as the target stay under the pointer.
fn pan(camera: &mut WorldCamera, drag: Vec2) {
    let distance = camera.eye.distance(camera.target) as f32;
    let height = 2.0 * distance * (0.5 * camera.fov_y_degrees.to_radians()).tan();
    shift_camera(camera, camera.axes() * Vec3::new(-drag.x, drag.y, 0.0) * height);
}

fn zoom(camera: &mut WorldCamera, factor: f32, nearest: f32) {
    let offset = camera.eye - camera.target;
    let distance = (offset.length() * f64::from(factor)).max(f64::from(nearest));
    camera.eye = camera.target + offset.normalize() * distance;
}
