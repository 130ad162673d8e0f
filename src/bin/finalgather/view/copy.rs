//! The view as text, to use it elsewhere.

use finalgather::scene::WorldCamera;

/// As options of `finalgather render`. A lens has no options: it stays that of the scene.
pub fn options(camera: &WorldCamera) -> String {
    let WorldCamera { eye, target, up, fov_y_degrees, .. } = camera;
    format!(
        "--eye {} --target {} --up {} --fov {fov_y_degrees}",
        list(eye.to_array()),
        list(target.to_array()),
        list(up.to_array())
    )
}

/// As the table of a scene file.
pub fn toml(camera: &WorldCamera) -> String {
    let WorldCamera { eye, target, up, fov_y_degrees, lens } = camera;
    let mut text = format!("[camera]\neye = [{}]\n", list(eye.to_array()).replace(',', ", "));
    text += &format!("target = [{}]\n", list(target.to_array()).replace(',', ", "));
    text += &format!("up = [{}]\nfov_y_degrees = {fov_y_degrees}\n", list(up.to_array()).replace(',', ", "));
    if let Some(lens) = lens {
        text += &format!("aperture = {}\nfocus_distance = {}\n", lens.radius, lens.focus_distance);
    }
    text
}

fn list<T: ToString>(numbers: [T; 3]) -> String {
    numbers.map(|number| number.to_string()).join(",")
}
