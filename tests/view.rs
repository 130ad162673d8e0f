//! The window of `finalgather view`. Each test starts an X server, sends key and mouse events (xdotool), and compares the server's frame buffer with
//! the file of `finalgather render`. One test runs under Wayland.
#![cfg(all(target_os = "linux", feature = "window"))]

mod common;

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, PoisonError};
use std::thread::sleep;
use std::time::{Duration, Instant};

use common::tool::{ended, folder, scene, stderr, success, text, tool, wait_for};
use finalgather::image::Image;
use serde_json::Value;
use tempfile::TempDir;

/// Of what is waited for; a loaded machine may take some seconds.
const PATIENCE: Duration = Duration::from_secs(60);
/// Side of the picture, and height of a window with room for it and the panel.
const SIDE: usize = 128;
const HEIGHT: usize = 560;
const SMALL: [&str; 8] = ["--size", "128", "--directions", "16", "--layer-size", "64", "--photons", "1e4"];
/// Of the frame around what went wrong.
const BAD: [u8; 3] = [240, 100, 90];

/// 8-bit pixels, row by row from the top.
#[derive(Clone, PartialEq)]
struct Pixels {
    width: usize,
    rgb: Vec<[u8; 3]>,
}

impl Pixels {
    /// A part of it.
    fn crop(&self, [x, y, width, height]: [usize; 4]) -> Self {
        let row = |row: usize| self.rgb[row * self.width + x..][..width].to_vec();
        Self { width, rgb: (y..y + height).flat_map(row).collect() }
    }

    /// The bytes that the file has.
    fn of_png(path: &Path) -> Self {
        let encode = |x: f32| if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
        let image = Image::read(path).unwrap();
        let rgb = image.rgb().unwrap();
        let byte = |channel: &[f32], pixel: usize| (255.0 * encode(channel[pixel])).round() as u8;
        Self { width: image.width, rgb: (0..rgb[0].len()).map(|pixel| rgb.map(|channel| byte(channel, pixel))).collect() }
    }

    /// The largest difference of a channel, and the mean.
    fn difference(&self, other: &Self) -> (u8, f64) {
        assert_eq!((self.width, self.rgb.len()), (other.width, other.rgb.len()));
        let pairs = || self.rgb.as_flattened().iter().zip(other.rgb.as_flattened()).map(|(&a, &b)| a.abs_diff(b));
        (pairs().max().unwrap_or(0), pairs().map(f64::from).sum::<f64>() / pairs().count() as f64)
    }

    fn has(&self, color: [u8; 3]) -> bool {
        self.rgb.contains(&color)
    }
}

/// An X server without a screen; ends with the test.
struct Display {
    _server: Server,
    name: String,
    folder: TempDir,
}

/// Ends with the test, however that ends.
struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// What it printed, once it has ended by itself.
fn output(command: &mut Command) -> Output {
    let mut child = Server(start(command.stdout(Stdio::piped()).stderr(Stdio::piped())));
    let status = ended(&mut child.0, PATIENCE);
    // It ended, so its pipes hold all that it wrote.
    let (mut stdout, mut stderr) = (Vec::new(), Vec::new());
    child.0.stdout.take().unwrap().read_to_end(&mut stdout).unwrap();
    child.0.stderr.take().unwrap().read_to_end(&mut stderr).unwrap();
    Output { status, stdout, stderr }
}

fn start(command: &mut Command) -> Child {
    let name = command.get_program().to_string_lossy().into_owned();
    command.spawn().unwrap_or_else(|error| panic!("{name} does not start: {error}; scripts/setup.sh --tests installs it"))
}

impl Display {
    fn start() -> Self {
        // Two that start at once may choose one number.
        static ONE: Mutex<()> = Mutex::new(());
        let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        let folder = folder();
        let mut server = Server(start(
            Command::new("Xvfb")
                .args(["-displayfd", "1", "-screen", "0", "1024x768x24", "-noreset", "-nolisten", "tcp", "-fbdir"])
                .arg(folder.path())
                .stdout(Stdio::piped())
                .stderr(Stdio::null()),
        ));
        let mut number = String::new();
        BufReader::new(server.0.stdout.take().unwrap()).read_line(&mut number).unwrap();
        Self { _server: server, name: format!(":{}", number.trim()), folder }
    }

    /// What the screen shows, from the server's memory: an XWD file, of which each pixel is blue, green, red and nothing.
    fn pixels(&self) -> Pixels {
        let bytes = fs::read(self.folder.path().join("Xvfb_screen0")).unwrap();
        let word = |index: usize| u32::from_be_bytes(bytes[4 * index..][..4].try_into().unwrap()) as usize;
        let (header, width, height, stride, colors) = (word(0), word(4), word(5), word(12), word(19));
        let row = |y: usize| bytes[header + 12 * colors + y * stride..][..4 * width].chunks(4).map(|p| [p[2], p[1], p[0]]);
        Pixels { width, rgb: (0..height).flat_map(row).collect() }
    }

    fn xdotool(&self, args: &[&str]) -> String {
        let output =
            start(Command::new("xdotool").args(args).env("DISPLAY", &self.name).stdout(Stdio::piped()).stderr(Stdio::null()));
        text(&output.wait_with_output().unwrap().stdout).trim().to_owned()
    }
}

/// `finalgather view` with a window of `SIDE` + the panel's width, at the upper left of the screen.
struct View<'a> {
    display: &'a Display,
    tool: Child,
    window: String,
}

fn glsl(name: &str) -> String {
    fs::read_to_string(Path::new("glsl").join(name)).unwrap()
}

fn view(display: &Display) -> Command {
    let mut command = tool(env!("CARGO_MANIFEST_DIR"));
    command.args(["view", "--window", "392x560"]).env("DISPLAY", &display.name).env_remove("WAYLAND_DISPLAY").args(SMALL);
    command
}

impl<'a> View<'a> {
    /// Waits until all directions are done, if there is to be a picture.
    fn start(display: &'a Display, command: &mut Command) -> Self {
        let tool = start(command.stdout(Stdio::piped()).stderr(Stdio::piped()));
        let mut view = Self { display, tool, window: String::new() };
        view.until("a window", |view| {
            view.window = display.xdotool(&["search", "--onlyvisible", "--name", "finalgather"]);
            !view.window.is_empty()
        });
        // There is no window manager to give it the keys.
        view.xdotool(&["windowfocus", "--sync", &view.window]);
        view
    }

    fn until(&mut self, what: &str, mut condition: impl FnMut(&mut Self) -> bool) {
        let begun = Instant::now();
        while !condition(self) {
            assert!(begun.elapsed() < PATIENCE, "waited in vain for {what}; the title is {:?}", self.title());
            if let Some(status) = self.tool.try_wait().unwrap() {
                let said = std::io::read_to_string(self.tool.stderr.take().unwrap()).unwrap();
                panic!("ended with {status} while waited for {what}: {said}");
            }
            sleep(Duration::from_millis(30));
        }
    }

    fn xdotool(&self, args: &[&str]) -> String {
        self.display.xdotool(args)
    }

    fn title(&self) -> String {
        self.xdotool(&["getwindowname", &self.window])
    }

    fn key(&self, key: &str) {
        self.xdotool(&["key", key]);
    }

    /// Where the picture is, in the middle of what the panel leaves.
    fn picture(&self) -> Pixels {
        self.display.pixels().crop([0, (HEIGHT - SIDE) / 2, SIDE, SIDE])
    }

    fn whole(&self) -> Pixels {
        self.display.pixels().crop([0, 0, 392, HEIGHT])
    }

    fn until_done(&mut self) -> Pixels {
        self.until("all directions", |view| view.title().contains("16 directions, done"));
        let mut last = self.picture();
        // The title may come before the last frame is on the screen.
        self.until("a still picture", |view| std::mem::replace(&mut last, view.picture()) == view.picture());
        last
    }

    /// The picture that all directions make, once it is another than `before`.
    fn until_other(&mut self, before: &Pixels) -> Pixels {
        self.until("another picture", |view| view.picture() != *before);
        self.until_done()
    }

    fn end(mut self) -> Output {
        self.key("ctrl+q");
        ended(&mut self.tool, PATIENCE);
        let tool = std::mem::replace(&mut self.tool, start(&mut Command::new("true")));
        tool.wait_with_output().unwrap()
    }

    /// By the dialog: its path is edited after /.
    fn choose(&mut self, path: &Path) {
        let before = self.picture();
        self.key("ctrl+o");
        self.until("the dialog", |view| view.picture() != before);
        self.key("slash");
        sleep(Duration::from_millis(300));
        self.key("ctrl+a");
        self.xdotool(&["type", path.to_str().unwrap()]);
        self.key("Return");
    }
}

impl Drop for View<'_> {
    fn drop(&mut self) {
        let _ = self.tool.kill();
        let _ = self.tool.wait();
    }
}

fn rendered(folder: &TempDir) -> Pixels {
    let path = folder.path().join("render.png");
    success(tool(folder).arg("render").arg(scene("cornell.toml")).args(SMALL).arg("-o").arg(&path));
    Pixels::of_png(&path)
}

/// Runs it unattended and returns where the picture is in its screenshot, and what it printed.
fn unattended(command: &mut Command, folder: &TempDir) -> (Pixels, Value) {
    let path = folder.path().join("window.png");
    let output = output(command.arg(scene("cornell.toml")).args(["--frames", "2", "--json", "--screenshot"]).arg(&path));
    assert!(output.status.success(), "{command:?}: {}", stderr(&output));
    let shot = Pixels::of_png(&path);
    assert_eq!((shot.width, shot.rgb.len()), (392, 392 * HEIGHT));
    (shot.crop([0, (HEIGHT - SIDE) / 2, SIDE, SIDE]), serde_json::from_slice(&output.stdout).unwrap())
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
    let bottom = [0, HEIGHT - 100, SIDE, 90];
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

    view.choose(&broken);
    view.until("the error", |view| view.whole().has(BAD));
    view.until("the old picture", |view| view.picture() == start);
    assert!(view.title().contains("cornell.toml"), "{}", view.title());
    view.key("Escape");
    view.until("no error", |view| !view.whole().has(BAD));
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
    let row = [0, HEIGHT - 100, SIDE, 90];
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
