//! What a person does with a picture in the window: read its values, compare it, save its view, and change its files.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::thread::sleep;
use std::time::Duration;

use finalgather::image::Image;
use serde_json::Value;

use crate::common::tool::{cornell_with, folder, scene, success, text, tool};
use crate::screen::{BAD, Display, HEIGHT, SIDE, SMALL, STRIP, TOP, View, view};

/// The settings of `SMALL` in a scene file. With photons in a grid, a moved camera gives the bits of a new render.
const SETTINGS: &str = "size = [128, 128]\ndirections = 16\nlayer_size = 64\nphotons = 10000\n";

/// The window on a scene of `folder`, in which dialogs begin.
fn view_in(display: &Display, folder: &Path, scene: &Path) -> Command {
    let mut command = tool(folder);
    command.args(["view", "--window", "392x560", "--photon-map", "grid"]).arg(scene);
    command.env("DISPLAY", &display.name).env_remove("WAYLAND_DISPLAY");
    command
}

#[test]
fn values_under_the_cursor_are_those_of_the_file() {
    let (display, folder) = (Display::start(), folder());
    let file = folder.path().join("box.exr");
    success(tool(&folder).arg("render").arg(scene("cornell.toml")).args(SMALL).arg("-o").arg(&file));
    let mut view = View::start(&display, view(&display).arg(scene("cornell.toml")).arg("--json"));
    view.until_done();
    let [x, y] = [45, 80];
    view.xdotool(&["mousemove", &x.to_string(), &(TOP + y).to_string()]);
    // The names of the surface come from the renderer.
    sleep(Duration::from_millis(500));
    let output = view.end();
    let cursor = &serde_json::from_slice::<Value>(&output.stdout).unwrap()["cursor"];
    assert_eq!(cursor["pixel"], serde_json::json!([x, y]), "{cursor}");
    let picture = Image::read(&file).unwrap();
    let near = |value: &Value, channel: &str| {
        let expected = picture.channel(channel).unwrap()[y * SIDE + x];
        let value = value.as_f64().unwrap() as f32;
        assert!((value - expected).abs() <= 1e-5 * expected.abs(), "{channel}: {value} is not {expected}");
    };
    for (k, channel) in ["R", "G", "B"].into_iter().enumerate() {
        near(&cursor["radiance"][k], channel);
    }
    let surface = &cursor["surface"];
    for (k, channel) in ["P.X", "P.Y", "P.Z"].into_iter().enumerate() {
        near(&surface["position"][k], channel);
    }
    near(&surface["depth"], "Z");
    assert_eq!((&surface["object"], &surface["material"]), (&"tall_block".into(), &"white".into()), "{surface}");
}

#[test]
fn keys_stay_in_the_dialog_and_escape_closes_it() {
    let display = Display::start();
    let mut view = View::start(&display, view(&display).arg(scene("cornell.toml")));
    view.until_done();
    let plain = view.whole();
    // No text is edited at the first key after ctrl+o. The name of the file to save is edited from the beginning.
    for (dialog, keys) in [("ctrl+o", "pwl"), ("ctrl+o", "wpl"), ("ctrl+s", "plw")] {
        view.key(dialog);
        view.until("the dialog", |view| view.whole() != plain);
        let middle = view.whole();
        view.xdotool(&["type", "--delay", "40", keys]);
        view.until("what is typed", |view| view.whole() != middle);
        view.key("Escape");
        view.until("the picture as before: nothing has moved, no panel is hidden", |view| view.whole() == plain);
    }
    assert!(view.end().status.success());
}

#[test]
fn a_saved_scene_renders_the_picture_of_the_window() {
    let (display, folder) = (Display::start(), folder());
    let path = cornell_with(folder.path(), "box.toml", SETTINGS);
    let mut view = View::start(&display, &mut view_in(&display, folder.path(), &path));
    let start = view.until_done();
    view.xdotool(&["mousemove", "64", &(TOP + 64).to_string(), "click", "4", "click", "4"]);
    let moved = view.until_other(&start);
    view.save("ctrl+shift+s", &folder.path().join("box-view.toml"));
    view.save("ctrl+s", &folder.path().join("box.png"));
    assert!(view.end().status.success());
    let saved = fs::read_to_string(folder.path().join("box-view.toml")).unwrap();
    success(tool(&folder).args(["render", "box-view.toml", "-o", "again.png"]));
    let [window, again] = ["box.png", "again.png"].map(|name| fs::read(folder.path().join(name)).unwrap());
    assert!(window == again, "another picture than in the window, by {saved}");
    assert!(crate::screen::Pixels::of_png(&folder.path().join("again.png")).difference(&moved).0 <= 1);
}

#[test]
fn changed_files_are_read_again() {
    let (display, folder) = (Display::start(), folder());
    let path = cornell_with(folder.path(), "box.toml", SETTINGS);
    let mut view = View::start(&display, &mut view_in(&display, folder.path(), &path));
    let start = view.until_done();
    view.xdotool(&["mousemove", "64", &(TOP + 64).to_string(), "click", "4", "click", "4"]);
    let moved = view.until_other(&start);
    // The lower part, which no notice hides.
    let lower = [0, SIDE - 12, SIDE, 12];

    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, &text[..text.len() / 2]).unwrap();
    view.until("the error", |view| view.whole().has(BAD));
    assert!(view.picture().crop(lower) == moved.crop(lower), "a half-written file leaves the picture");

    fs::write(&path, &text).unwrap();
    let materials = folder.path().join("cornell.mtl");
    let dark: String = fs::read_to_string(&materials)
        .unwrap()
        .lines()
        .map(|line| if line.starts_with("Kd") { "Kd 0.1 0.2 0.7\n".to_owned() } else { format!("{line}\n") })
        .collect();
    fs::write(&materials, dark).unwrap();
    let blue = view.until_other(&moved);
    view.until("no error", |view| !view.whole().has(BAD));
    view.key("r");
    assert!(view.until_other(&blue).crop(lower) != blue.crop(lower), "the camera was kept, and R is another view");
    assert!(view.end().status.success());
}

#[test]
fn a_reference_is_shown_while_a_key_is_held() {
    let (display, folder) = (Display::start(), folder());
    let file = folder.path().join("reference.exr");
    let small = ["--size", "128", "--directions", "2", "--layer-size", "64", "--photons", "1e3"];
    success(tool(&folder).arg("render").arg(scene("cornell.toml")).args(small).arg("-o").arg(&file));
    let mut view = View::start(&display, view(&display).arg(scene("cornell.toml")).arg("--reference").arg(&file));
    let start = view.until_done();
    view.xdotool(&["keydown", "x"]);
    view.until("the reference", |view| view.picture() != start);
    // Its name lies over the picture's area, below the picture.
    let name = [0, HEIGHT - STRIP - 40, SIDE, 30];
    assert!(view.whole().crop(name).rgb.iter().any(|&pixel| pixel != [16; 3]));
    view.xdotool(&["keyup", "x"]);
    view.until("the picture", |view| view.picture() == start);
    assert!(view.end().status.success());

    let none = tool(&folder).args(["view", "--reference", "none.exr"]).env("DISPLAY", &display.name).output().unwrap();
    assert_eq!(none.status.code(), Some(65));
    assert!(text(&none.stderr).contains("none.exr"));
}
