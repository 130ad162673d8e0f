//! An X server without a screen, the window on it, and what it shows.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, PoisonError};
use std::thread::sleep;
use std::time::{Duration, Instant};

use finalgather::image::Image;
use tempfile::TempDir;

use crate::common::tool::{ended, folder, scene, success, text, tool};

/// Of what is waited for; a loaded machine may take some seconds.
pub const PATIENCE: Duration = Duration::from_secs(60);
/// Side of the picture, and height of a window with room for it and the panel.
pub const SIDE: usize = 128;
pub const HEIGHT: usize = 560;
pub const SMALL: [&str; 8] = ["--size", "128", "--directions", "16", "--layer-size", "64", "--photons", "1e4"];
/// Where the picture is: in the middle of what the panel and the strip of values leave.
pub const TOP: usize = (HEIGHT - STRIP - SIDE) / 2;
/// Height of the strip of values of so narrow a picture.
pub const STRIP: usize = 5 * 17 + 11;
/// Of the frame around what went wrong.
pub const BAD: [u8; 3] = [240, 100, 90];

/// 8-bit pixels, row by row from the top.
#[derive(Clone, PartialEq)]
pub struct Pixels {
    pub width: usize,
    pub rgb: Vec<[u8; 3]>,
}

impl Pixels {
    /// A part of it.
    pub fn crop(&self, [x, y, width, height]: [usize; 4]) -> Self {
        let row = |row: usize| self.rgb[row * self.width + x..][..width].to_vec();
        Self { width, rgb: (y..y + height).flat_map(row).collect() }
    }

    /// The bytes that the file has.
    pub fn of_png(path: &Path) -> Self {
        let encode = |x: f32| if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
        let image = Image::read(path).unwrap();
        let rgb = image.rgb().unwrap();
        let byte = |channel: &[f32], pixel: usize| (255.0 * encode(channel[pixel])).round() as u8;
        Self { width: image.width, rgb: (0..rgb[0].len()).map(|pixel| rgb.map(|channel| byte(channel, pixel))).collect() }
    }

    /// The largest difference of a channel, and the mean.
    pub fn difference(&self, other: &Self) -> (u8, f64) {
        assert_eq!((self.width, self.rgb.len()), (other.width, other.rgb.len()));
        let pairs = || self.rgb.as_flattened().iter().zip(other.rgb.as_flattened()).map(|(&a, &b)| a.abs_diff(b));
        (pairs().max().unwrap_or(0), pairs().map(f64::from).sum::<f64>() / pairs().count() as f64)
    }

    pub fn has(&self, color: [u8; 3]) -> bool {
        self.rgb.contains(&color)
    }
}

/// An X server without a screen; ends with the test.
pub struct Display {
    _server: Server,
    pub name: String,
    folder: TempDir,
}

/// Ends with the test, however that ends.
pub struct Server(pub Child);

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// What it printed, once it has ended by itself.
pub fn output(command: &mut Command) -> Output {
    let mut child = Server(start(command.stdout(Stdio::piped()).stderr(Stdio::piped())));
    let status = ended(&mut child.0, PATIENCE);
    // It ended, so its pipes hold all that it wrote.
    let (mut stdout, mut stderr) = (Vec::new(), Vec::new());
    child.0.stdout.take().unwrap().read_to_end(&mut stdout).unwrap();
    child.0.stderr.take().unwrap().read_to_end(&mut stderr).unwrap();
    Output { status, stdout, stderr }
}

pub fn start(command: &mut Command) -> Child {
    let name = command.get_program().to_string_lossy().into_owned();
    command.spawn().unwrap_or_else(|error| panic!("{name} does not start: {error}; scripts/setup.sh --tests installs it"))
}

impl Display {
    pub fn start() -> Self {
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
    pub fn pixels(&self) -> Pixels {
        let bytes = fs::read(self.folder.path().join("Xvfb_screen0")).unwrap();
        let word = |index: usize| u32::from_be_bytes(bytes[4 * index..][..4].try_into().unwrap()) as usize;
        let (header, width, height, stride, colors) = (word(0), word(4), word(5), word(12), word(19));
        let row = |y: usize| bytes[header + 12 * colors + y * stride..][..4 * width].chunks(4).map(|p| [p[2], p[1], p[0]]);
        Pixels { width, rgb: (0..height).flat_map(row).collect() }
    }

    pub fn xdotool(&self, args: &[&str]) -> String {
        let output =
            start(Command::new("xdotool").args(args).env("DISPLAY", &self.name).stdout(Stdio::piped()).stderr(Stdio::null()));
        text(&output.wait_with_output().unwrap().stdout).trim().to_owned()
    }
}

/// `finalgather view` with a window of `SIDE` + the panel's width, at the upper left of the screen.
pub struct View<'a> {
    pub display: &'a Display,
    tool: Child,
    pub window: String,
}

pub fn glsl(name: &str) -> String {
    fs::read_to_string(Path::new("glsl").join(name)).unwrap()
}

pub fn view(display: &Display) -> Command {
    let mut command = tool(env!("CARGO_MANIFEST_DIR"));
    command.args(["view", "--window", "392x560"]).env("DISPLAY", &display.name).env_remove("WAYLAND_DISPLAY").args(SMALL);
    command
}

impl<'a> View<'a> {
    /// Waits until all directions are done, if there is to be a picture.
    pub fn start(display: &'a Display, command: &mut Command) -> Self {
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

    pub fn until(&mut self, what: &str, mut condition: impl FnMut(&mut Self) -> bool) {
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

    pub fn xdotool(&self, args: &[&str]) -> String {
        self.display.xdotool(args)
    }

    pub fn title(&self) -> String {
        self.xdotool(&["getwindowname", &self.window])
    }

    pub fn key(&self, key: &str) {
        self.xdotool(&["key", key]);
    }

    pub fn picture(&self) -> Pixels {
        self.display.pixels().crop([0, TOP, SIDE, SIDE])
    }

    pub fn whole(&self) -> Pixels {
        self.display.pixels().crop([0, 0, 392, HEIGHT])
    }

    pub fn until_done(&mut self) -> Pixels {
        self.until("all directions", |view| view.title().contains("16 directions, done"));
        let mut last = self.picture();
        // The title may come before the last frame is on the screen.
        self.until("a still picture", |view| std::mem::replace(&mut last, view.picture()) == view.picture());
        last
    }

    /// The picture that all directions make, once it is another than `before`.
    pub fn until_other(&mut self, before: &Pixels) -> Pixels {
        self.until("another picture", |view| view.picture() != *before);
        self.until_done()
    }

    pub fn end(mut self) -> Output {
        self.key("ctrl+q");
        ended(&mut self.tool, PATIENCE);
        let tool = std::mem::replace(&mut self.tool, start(&mut Command::new("true")));
        tool.wait_with_output().unwrap()
    }

    /// Saves by the dialog that a key opens, under the name that it proposes.
    pub fn save(&mut self, key: &str, path: &Path) {
        // Beside the picture, which the pointer would hide in part.
        self.xdotool(&["mousemove", "10", "20"]);
        let before = self.whole();
        self.key(key);
        self.until("the dialog", |view| view.picture() != before.crop([0, TOP, SIDE, SIDE]));
        self.until("the file", |view| {
            // The first ends the editing of the name.
            view.key("Return");
            sleep(Duration::from_millis(200));
            path.exists()
        });
        self.until("no dialog", |view| view.picture() == before.crop([0, TOP, SIDE, SIDE]));
    }

    /// By the dialog: its path is edited after /.
    /// Opens a scene by the dialog, until `opened` shows that it has the path: keys may come before a field takes them, where frames are slow.
    pub fn choose(&mut self, path: &Path, opened: impl Fn(&mut Self) -> bool) {
        for _ in 0..5 {
            self.try_to_choose(path);
            if (0..50).any(|_| {
                sleep(Duration::from_millis(100));
                opened(self)
            }) {
                return;
            }
            self.key("Escape");
            sleep(Duration::from_secs(1));
        }
    }

    fn try_to_choose(&mut self, path: &Path) {
        let before = self.picture();
        self.key("ctrl+o");
        self.until("the dialog", |view| view.picture() != before);
        // Frames are slow while many tests draw, and the field has the keys a few frames after.
        sleep(Duration::from_millis(500));
        self.key("slash");
        sleep(Duration::from_millis(1500));
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

pub fn rendered(folder: &TempDir) -> Pixels {
    let path = folder.path().join("render.png");
    success(tool(folder).arg("render").arg(scene("cornell.toml")).args(SMALL).arg("-o").arg(&path));
    Pixels::of_png(&path)
}
