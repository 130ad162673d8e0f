//! `finalgather view`: an interactive window. [`worker`] renders on its own thread, [`app`] lays out the interface, [`window`] draws it.

mod app;
mod camera;
mod canvas;
mod copy;
mod dialogs;
mod false_color;
mod histogram;
mod latency;
mod layers;
mod overlays;
mod panel;
mod picture;
mod probe;
mod progressive;
mod quads;
mod reference;
mod watch;
mod window;
mod worker;
mod zoom;

use std::path::{Path, PathBuf};
use std::time::Instant;
use std::{fs, io};

use egui::ThemePreference;
use finalgather::error::{Error, Result};
use serde_json::json;
use signal_hook::low_level;
use tempfile::TempDir;
use winit::event_loop::EventLoop;

use crate::args::{DeviceArgs, Overrides, PhotonMapArg, checked, count, size};
use crate::report;
use app::App;
use picture::DisplayContent;
use reference::ReferencePicture;
use window::{Window, WindowSummary};
use worker::WorkerOptions;

/// Open a window on a scene: the picture while it gathers, a camera to move, the layers of a direction
///
/// It renders as `render` does, by the same settings. F1 in the window lists the keys.
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/view.txt"), args_override_self = true, allow_negative_numbers = true)]
#[command(mut_arg("photon_depth", |arg| arg.alias("bounces")))]
pub struct ViewArgs {
    /// Scene file (.toml) or model (.obj with its .mtl, .glb, .gltf, .ply, .stl) [default: the Cornell box]
    scene: Option<PathBuf>,

    /// Inner size of the window in points; N is N by N [default: room for the panel and a picture of --size, or 512x512 without]
    #[arg(long, value_name = "WxH|N", value_parser = size)]
    pub window: Option<[u32; 2]>,

    /// Pixels per point, for screens with small pixels [default: the system's]
    #[arg(long, value_name = "FACTOR", value_parser = factor)]
    pub scale: Option<f32>,

    /// Begin in the layer view
    #[arg(long)]
    layers: bool,

    /// Picture to compare with, .exr or .png: hold X to see it
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,

    /// What to show first
    #[arg(long, value_enum, default_value_t)]
    show: ShownFirst,

    /// Colours of the window
    #[arg(long, value_enum, default_value_t)]
    theme: Theme,

    /// Render a picture as large as the window has room for
    #[arg(long)]
    fill: bool,

    /// Prefer GLX to EGL, on X11
    #[arg(long)]
    pub glx: bool,

    /// Once all directions are done, draw this many frames, write --screenshot and end
    #[arg(long, value_name = "N", value_parser = count::<u32>)]
    pub frames: Option<u32>,

    /// Where --frames writes the window as PNG
    #[arg(long, value_name = "FILE", requires = "frames")]
    pub screenshot: Option<PathBuf>,

    /// Print one JSON object at the end: times until the first picture, of frames and of answers to input, in milliseconds
    #[arg(long)]
    json: bool,

    /// Read shaders from this folder, laid out as glsl/, and read them again when a file changes
    #[arg(long, value_name = "FOLDER", hide_short_help = true)]
    shaders: Option<PathBuf>,

    #[command(flatten)]
    overrides: Overrides,

    #[command(flatten)]
    photon_map: PhotonMapArg,

    #[command(flatten)]
    device: DeviceArgs,
}

#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum Theme {
    #[default]
    System,
    Light,
    Dark,
}

#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum ShownFirst {
    #[default]
    Radiance,
    /// Radiance in false colours
    FalseColors,
    PhotonMap,
    Albedo,
    Normals,
    /// Ambient occlusion
    Ao,
    /// The relative error of each pixel
    Error,
    /// The difference from the reference
    Difference,
}

/// Runs the window until it closes. Returns the exit code.
pub fn run(args: &ViewArgs) -> Result<u8> {
    let begun = Instant::now();
    let events = EventLoop::<()>::with_user_event().build().map_err(|error| {
        // The last part is the cause. The parts before it name places in winit's source.
        let why = error.to_string();
        let problem = format!("no window system can be reached: {}", why.rsplit(": ").next().unwrap_or(&why));
        Error::gl(problem, "run it in a session on X11 or Wayland (DISPLAY, WAYLAND_DISPLAY); render works without one")
    })?;
    let embedded = unpack_cornell_box().map_err(|error| {
        Error::usage(format!("no temporary folder can be made: {error}"), "set TMPDIR to a folder that can be written")
    })?;
    if args.reference.is_none() && matches!(args.show, ShownFirst::Difference) {
        return Err(Error::usage("--show difference: there is no picture to differ from", "add --reference FILE"));
    }
    // A picture that cannot be read is an error at once, not only in the window.
    args.reference.as_deref().map(ReferencePicture::open).transpose()?;
    let scene = args.scene.clone().unwrap_or_else(|| embedded.path().join("cornell.toml"));
    // A development build reloads the shaders of its source tree.
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl");
    let shaders = args.shaders.clone().or_else(|| Some(own).filter(|own| cfg!(debug_assertions) && own.is_dir()));
    let request = args.photon_map.choose(args.overrides.scene(&scene)?);
    let options = WorkerOptions { device: args.device.request(), scene: request, shaders };
    let mut app = App::new(options, scene, events.create_proxy())?;
    args.prepare(&mut app);
    let mut window = Window::new(args, app, begun);
    let ended =
        events.run_app(&mut window).map_err(|error| Error::gl(format!("the window system failed: {error}"), "start again"));
    let WindowSummary { outcome, first_picture_ms, times: [frames, answers], api, directions, cursor, left } = window.end();
    let outcome = ended.and(outcome).and_then(|()| {
        let json = json!({
            "api": api,
            "directions": directions,
            "first_picture_ms": first_picture_ms,
            "frame": frames,
            "answer": answers,
            "cursor": cursor,
        });
        if args.json { report::print_json(&json) } else { Ok(()) }
    });
    if !left {
        // The handlers of process::exit would shut down the GL driver while the renderer uses it. This exit runs none.
        let code = outcome.as_ref().map_or_else(crate::exit_code, |()| 0);
        outcome.unwrap_or_else(|error| report::say(&format!("error: {error}")));
        drop(embedded);
        low_level::exit(code.into());
    }
    outcome.map(|()| 0)
}

impl ViewArgs {
    /// Sets up the window as the options ask.
    fn prepare(&self, app: &mut App) {
        app.layers = self.layers;
        app.fill = self.fill;
        app.theme = match self.theme {
            Theme::System => ThemePreference::System,
            Theme::Light => ThemePreference::Light,
            Theme::Dark => ThemePreference::Dark,
        };
        app.shown.content = match self.show {
            ShownFirst::Radiance | ShownFirst::FalseColors | ShownFirst::Difference => DisplayContent::Radiance,
            ShownFirst::PhotonMap => DisplayContent::PhotonMap,
            ShownFirst::Albedo => DisplayContent::Albedo,
            ShownFirst::Normals => DisplayContent::Normals,
            ShownFirst::Ao => DisplayContent::Openness,
            ShownFirst::Error => DisplayContent::Error,
        };
        app.shown.false_color = matches!(self.show, ShownFirst::FalseColors);
        if self.reference.is_some() {
            app.compare_with(self.reference.clone());
            app.shown.difference = matches!(self.show, ShownFirst::Difference);
        }
    }
}

/// Far from where numbers or windows end.
fn factor(text: &str) -> Result<f32, String> {
    checked(text, |factor| (0.25..=8.0).contains(factor), "not a factor from 0.25 to 8")
}

/// Writes the embedded Cornell box to a temporary folder, so that the tool needs no scene files.
fn unpack_cornell_box() -> io::Result<TempDir> {
    let folder = tempfile::tempdir()?;
    for (name, text) in [
        ("cornell.toml", include_str!("../../../../scenes/cornell.toml")),
        ("cornell.obj", include_str!("../../../../scenes/cornell.obj")),
        ("cornell.mtl", include_str!("../../../../scenes/cornell.mtl")),
    ] {
        fs::write(folder.path().join(name), text)?;
    }
    Ok(folder)
}
