//! The window of `finalgather view`. Each test starts an X server, sends key and mouse events (xdotool), and compares the server's frame buffer with
//! the file of `finalgather render`. One test runs under Wayland.
#![cfg(all(target_os = "linux", feature = "window"))]

#[path = "../common/mod.rs"]
mod common;
mod inspect;
mod screen;

use std::fs;
use std::process::{Command, Stdio};

use common::tool::{folder, scene, stderr, tool, wait_for};
use screen::{
    BAD, Display, HEIGHT, PATIENCE, Pixels, SIDE, SMALL, STRIP, Server, TOP, View, glsl, output, rendered, start, view,
};
use serde_json::Value;
use tempfile::TempDir;

/// Runs it unattended and returns where the picture is in its screenshot, and what it printed.
fn unattended(command: &mut Command, folder: &TempDir) -> (Pixels, Value) {
    let path = folder.path().join("window.png");
    let output = output(command.arg(scene("cornell.toml")).args(["--frames", "2", "--json", "--screenshot"]).arg(&path));
    assert!(output.status.success(), "{command:?}: {}", stderr(&output));
    let shot = Pixels::of_png(&path);
    assert_eq!((shot.width, shot.rgb.len()), (392, 392 * HEIGHT));
    (shot.crop([0, TOP, SIDE, SIDE]), serde_json::from_slice(&output.stdout).unwrap())
}

#[test]
fn shows_what_render_writes_by_egl_and_glx() {
    let (display, folder) = (Display::start(), folder());
    let expected = rendered(&folder);
    for (args, api) in [(&[][..], "EGL"), (&["--glx"], "GLX")] {
        let (shown, json) = unattended(view(&display).args(args), &folder);
        assert_eq!(json["api"], api);
        assert_eq!(json["directions"], 16);
        let (most, _) = shown.difference(&expected);
        assert!(most <= 1, "{api}: a pixel is {most} off");
    }
}

#[test]
fn shows_the_same_under_wayland() {
    let (folder, runtime) = (folder(), folder());
    let expected = rendered(&folder);
    let _weston = Server(start(
        Command::new("weston")
            .args(["--backend=headless-backend.so", "--socket=wayland-test", "--idle-time=0", "--no-config"])
            .env("XDG_RUNTIME_DIR", runtime.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null()),
    ));
    wait_for("weston", PATIENCE, || runtime.path().join("wayland-test").exists().then_some(()));
    let mut command = tool(&folder);
    command.args(["view", "--window", "392x560"]).args(SMALL);
    command.env("XDG_RUNTIME_DIR", runtime.path()).env("WAYLAND_DISPLAY", "wayland-test").env_remove("DISPLAY");
    let (shown, json) = unattended(&mut command, &folder);
    assert_eq!(json["api"], "EGL");
    assert!(shown.difference(&expected).0 <= 1);
}

#[test]
fn mouse_and_keys_move_the_camera() {
    let display = Display::start();
    let mut view = View::start(&display, view(&display).arg(scene("cornell.toml")).arg("--json"));
    let start = view.until_done();

    // At the pace of a hand: what is pressed and released within a frame is a click.
    view.xdotool(&[
        "mousemove",
        "40",
        "280",
        "sleep",
        "0.1",
        "mousedown",
        "1",
        "sleep",
        "0.1",
        "mousemove",
        "60",
        "290",
        "sleep",
        "0.1",
    ]);
    view.xdotool(&["mousemove", "80", "300", "sleep", "0.1", "mouseup", "1"]);
    let orbited = view.until_other(&start);
    assert!(orbited.difference(&start).1 > 5.0, "an orbit changes all of the picture: {:?}", orbited.difference(&start));
    view.key("r");
    assert!(view.until_other(&orbited) == start, "R is the way back to the same picture");

    view.xdotool(&["mousemove", "64", "280", "click", "4", "click", "4"]);
    let zoomed = view.until_other(&start);
    view.key("r");
    assert!(view.until_other(&zoomed) == start);

    view.xdotool(&["keydown", "w"]);
    view.until("flight", |view| view.picture() != start);
    view.xdotool(&["keyup", "w"]);
    let flown = view.until_done();
    assert!(flown.difference(&start).1 > 1.0);
    view.key("r");
    assert!(view.until_other(&flown) == start);

    // To almost nothing and back.
    view.xdotool(&["windowsize", &view.window, "1", "1"]);
    view.until("less", |view| view.picture() != start);
    view.xdotool(&["windowsize", &view.window, "392", "560"]);
    view.until("the same again", |view| view.picture() == start);

    let output = view.end();
    assert!(output.status.success(), "{:?}", output.status);
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(json["answer"]["count"].as_u64() > Some(5), "{json}");
}

#[test]
fn keys_and_switches_show_other_things() {
    let display = Display::start();
    let mut view = View::start(&display, view(&display).arg(scene("cornell.toml")));
    let start = view.until_done();
    let plain = view.whole();

    view.key("F1");
    view.until("help", |view| view.whole() != plain);
    view.key("F1");
    view.until("no help", |view| view.whole() == plain);

    // Without the panel the picture has all of the width.
    view.key("p");
    // And its corner is empty.
    let corner = [300, 0, 92, 20];
    view.until("no panel", |view| view.whole().crop(corner).rgb.iter().all(|&pixel| pixel == [16; 3]));
    view.until("a larger picture", |view| {
        view.display.pixels().crop([330, 280, 20, 20]).difference(&plain.crop([330, 280, 20, 20])).1 > 5.0
    });
    view.key("p");
    view.until("the panel", |view| view.picture() == start);

    view.key("l");
    // Thumbnails of the layers at the bottom, where nothing was.
    let bottom = [0, HEIGHT - STRIP - 100, SIDE, 90];
    let nothing = plain.crop(bottom);
    view.until("layers", |view| view.whole().crop(bottom).difference(&nothing).1 > 5.0);
    view.key("l");
    view.until("no layers", |view| view.picture() == start);
    assert!(view.end().status.success());
}

#[test]
fn a_broken_scene_is_said_and_the_old_one_stays() {
    let (display, folder) = (Display::start(), folder());
    let broken = folder.path().join("broken.toml");
    fs::write(&broken, "mesh = \"none.obj\"\n").unwrap();
    let mut view = View::start(&display, view(&display).arg(scene("cornell.toml")));
    let start = view.until_done();
    assert!(!view.whole().has(BAD));

    view.choose(&broken, |view| view.whole().has(BAD));
    view.until("the error", |view| view.whole().has(BAD));
    assert!(view.title().contains("cornell.toml"), "{}", view.title());
    // The error is over the picture.
    view.key("Escape");
    view.until("no error", |view| !view.whole().has(BAD));
    view.until("the old picture", |view| view.picture() == start);
    assert!(view.end().status.success());
}

#[test]
fn a_broken_shader_is_said_and_the_old_picture_stays() {
    let (display, folder) = (Display::start(), folder());
    let text = glsl("visible_points.frag");
    let file = folder.path().join("visible_points.frag");
    fs::write(&file, &text).unwrap();
    let mut view = View::start(&display, view(&display).arg(scene("cornell.toml")).arg("--shaders").arg(folder.path()));
    let start = view.until_done();

    fs::write(&file, format!("{text}\nbroken")).unwrap();
    view.until("the compiler's log", |view| view.whole().has(BAD));
    // The log is over the upper part of the picture.
    let lower = [0, SIDE - 8, SIDE, 8];
    assert!(view.picture().crop(lower) == start.crop(lower), "the old picture stays");

    fs::write(&file, text.replace("void main()\n{", "void main()\n{\n    if (int(gl_FragCoord.x) % 2 == 0)\n        discard;"))
        .unwrap();
    view.until("the changed shader's picture", |view| view.picture().crop(lower).difference(&start.crop(lower)).1 > 2.0);
    assert!(view.end().status.success());
}

#[test]
fn broken_layers_are_said_and_the_picture_goes_on() {
    let (display, folder) = (Display::start(), folder());
    let file = folder.path().join("peel.frag");
    fs::write(&file, "broken").unwrap();
    let mut view =
        View::start(&display, view(&display).arg(scene("cornell.toml")).args(["--layers", "--shaders"]).arg(folder.path()));
    view.until("all directions", |view| view.title().contains("16 directions, done"));
    view.until("the compiler's log", |view| view.whole().has(BAD));

    // What is embedded takes the place of a file that is gone.
    let row = [0, HEIGHT - STRIP - 100, SIDE, 90];
    let empty = view.whole().crop(row);
    fs::remove_file(&file).unwrap();
    view.until("layers", |view| view.whole().crop(row).difference(&empty).1 > 5.0);
    assert!(view.end().status.success());
}

/// One with other photons, so that neither is rendered by the other's camera and settings.
#[test]
fn failures_have_exit_codes() {
    let display = Display::start();
    let refusal = |command: &mut Command, code: i32, words: &str| {
        let output = output(command.args(["--frames", "1"]));
        let stderr = stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{command:?}: {stderr}");
        assert!(stderr.contains(words) && stderr.contains("cure: "), "{stderr}");
    };
    refusal(view(&display).env_remove("DISPLAY"), 69, "no window system");
    refusal(view(&display).args(["--gl-device", "99"]), 69, "no EGL device 99");
    refusal(view(&display).arg("none.toml"), 65, "none.toml");
    refusal(view(&display).args(["--show", "difference"]), 2, "no picture to differ from");

    // A panic on the renderer's thread, and what goes wrong while the window is already there.
    let folder = folder();
    let changed = |name: &str, from: &str, to: &str| {
        let text = glsl(name);
        assert!(text.contains(from), "{name}");
        fs::write(folder.path().join(name), text.replace(from, to)).unwrap();
    };
    let shaders = || ["--shaders".as_ref(), folder.path().as_os_str()];
    changed(
        "visible_points.frag",
        "void main()\n{",
        "uniform float unknown;\nvoid main()\n{\n    if (unknown > 0.0)\n        discard;",
    );
    refusal(
        view(&display).arg(scene("cornell.toml")).args(shaders()),
        69,
        "panicked: shader visible_points reads the uniform unknown",
    );
    fs::remove_file(folder.path().join("visible_points.frag")).unwrap();
    fs::write(folder.path().join("peel.frag"), "broken").unwrap();
    refusal(view(&display).arg(scene("cornell.toml")).arg("--layers").args(shaders()), 69, "shader peel does not compile");
}
