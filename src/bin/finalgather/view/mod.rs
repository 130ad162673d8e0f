//! `finalgather view`: a window on the renderer. [`worker`] renders on a thread of its own; [`window`] draws what [`app`] lays out.

mod app;
mod camera;
mod latency;
mod layers;
mod panel;
mod picture;
mod window;
mod worker;

use std::path::{Path, PathBuf};
use std::{fs, io};

use finalgather::error::{Error, Result};
use serde_json::json;
use signal_hook::low_level;
use tempfile::TempDir;
use winit::event_loop::EventLoop;

use crate::args::{DeviceArgs, Overrides, checked, count, size};
use crate::report;
use app::App;
use window::{End, Window};
use worker::Start;

/// Open a window on a scene: the picture while it gathers, a camera to move, the layers of a direction
///
/// It renders as `render` does, by the same settings. F1 in the window lists the keys.
#[derive(Debug, clap::Args)]
#[command(after_help = include_str!("../help/view.txt"), args_override_self = true, allow_negative_numbers = true)]
#[command(mut_arg("photon_depth", |arg| arg.alias("bounces")))]
pub struct ViewArgs {
    /// Scene file: .toml, or a bare .obj with its .mtl [default: the Cornell box]
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

    /// Prefer GLX to EGL, on X11
    #[arg(long)]
    pub glx: bool,

    /// Once all directions are done, draw this many frames, write --screenshot and end
    #[arg(long, value_name = "N", value_parser = count::<u32>)]
    pub frames: Option<u32>,

    /// Where --frames writes the window as PNG
    #[arg(long, value_name = "FILE", requires = "frames")]
    pub screenshot: Option<PathBuf>,

    /// Print one JSON object at the end: times of frames and of answers to input since the first picture, in milliseconds
    #[arg(long)]
    json: bool,

    /// Read shaders from this folder, laid out as glsl/, and read them again when a file changes
    #[arg(long, value_name = "FOLDER", hide_short_help = true)]
    shaders: Option<PathBuf>,

    #[command(flatten)]
    overrides: Overrides,

    #[command(flatten)]
    device: DeviceArgs,
}

/// The exit code, unless it failed.
pub fn run(args: &ViewArgs) -> Result<u8> {
    let events = EventLoop::<()>::with_user_event().build().map_err(|error| {
        // The last part says why; before it stands where in winit's source.
        let why = error.to_string();
        let problem = format!("no window system can be reached: {}", why.rsplit(": ").next().unwrap_or(&why));
        Error::gl(problem, "run it in a session on X11 or Wayland (DISPLAY, WAYLAND_DISPLAY); render works without one")
    })?;
    let embedded = Embedded::unpack().map_err(|error| {
        Error::usage(format!("no temporary folder can be made: {error}"), "set TMPDIR to a folder that can be written")
    })?;
    let scene = args.scene.clone().unwrap_or_else(|| embedded.scene());
    // In a development build the shaders at hand are the ones worth seeing.
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl");
    let shaders = args.shaders.clone().or_else(|| Some(own).filter(|own| cfg!(debug_assertions) && own.is_dir()));
    let start = Start { device: args.device.request(), scene: args.overrides.scene(&scene)?, shaders };
    let app = App::new(start, scene, args.layers, events.create_proxy())?;
    let mut window = Window::new(args, app);
    let ended =
        events.run_app(&mut window).map_err(|error| Error::gl(format!("the window system failed: {error}"), "start again"));
    let End { outcome, times: [frames, answers], api, directions, left } = window.end();
    let outcome = ended.and(outcome).and_then(|()| {
        let json = json!({ "api": api, "directions": directions, "frame": frames, "answer": answers });
        if args.json { report::print_json(&json) } else { Ok(()) }
    });
    if !left {
        // As for signals: the handlers of process::exit would take the GL driver down under the renderer.
        let code = outcome.as_ref().map_or_else(crate::exit_code, |()| 0);
        outcome.unwrap_or_else(|error| report::say(&format!("error: {error}")));
        drop(embedded);
        low_level::exit(code.into());
    }
    outcome.map(|()| 0)
}

/// Far from where numbers or windows end.
fn factor(text: &str) -> Result<f32, String> {
    checked(text, |factor| (0.25..=8.0).contains(factor), "not a factor from 0.25 to 8")
}

/// The Cornell box, wherever the tool is.
struct Embedded(TempDir);

impl Embedded {
    fn unpack() -> io::Result<Self> {
        let folder = tempfile::tempdir()?;
        for (name, text) in [
            ("cornell.toml", include_str!("../../../../scenes/cornell.toml")),
            ("cornell.obj", include_str!("../../../../scenes/cornell.obj")),
            ("cornell.mtl", include_str!("../../../../scenes/cornell.mtl")),
        ] {
            fs::write(folder.path().join(name), text)?;
        }
        Ok(Self(folder))
    }

    fn scene(&self) -> PathBuf {
        self.0.path().join("cornell.toml")
    }
}
