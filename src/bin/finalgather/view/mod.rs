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

use crate::args::ViewArgs;
use crate::report;
use app::App;
use window::{End, Window};
use worker::Start;

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
    let start = Start { backend: args.backend, device: args.gl_device, overrides: args.overrides.clone(), shaders };
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
