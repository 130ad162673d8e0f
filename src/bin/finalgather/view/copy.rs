//! The view as text, to use it elsewhere.

use finalgather::scene::WorldCamera;

use crate::scene_file::camera_keys;

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
    let keys = camera_keys(camera).into_iter().map(|(key, value)| format!("{key} = {value}\n"));
    format!("[camera]\n{}", keys.collect::<String>())
}

fn list<T: ToString>(numbers: [T; 3]) -> String {
    numbers.map(|number| number.to_string()).join(",")
}
