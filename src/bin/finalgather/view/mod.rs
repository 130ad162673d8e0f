//! `finalgather view`: an interactive window. [`worker`] renders on its own thread, [`app`] lays out the interface, [`window`] draws it.

mod app;
mod camera;
mod latency;
mod layers;
mod panel;
mod picture;
mod window;
mod worker;

use std::path::Path;
use std::{fs, io};

use finalgather::error::{Error, Result};
use serde_json::json;
use signal_hook::low_level;
use tempfile::TempDir;
use winit::event_loop::EventLoop;

use crate::args::ViewArgs;
use crate::report;
use app::App;
use window::{Window, WindowSummary};
use worker::WorkerOptions;

/// Runs the window until it closes. Returns the exit code.
pub fn run(args: &ViewArgs) -> Result<u8> {
    let events = EventLoop::<()>::with_user_event().build().map_err(|error| {
        // The last part is the cause. The parts before it name places in winit's source.
        let why = error.to_string();
        let problem = format!("no window system can be reached: {}", why.rsplit(": ").next().unwrap_or(&why));
        Error::gl(problem, "run it in a session on X11 or Wayland (DISPLAY, WAYLAND_DISPLAY); render works without one")
    })?;
    let embedded = unpack_cornell_box().map_err(|error| {
        Error::usage(format!("no temporary folder can be made: {error}"), "set TMPDIR to a folder that can be written")
    })?;
    let scene = args.scene.clone().unwrap_or_else(|| embedded.path().join("cornell.toml"));
    // A development build reloads the shaders of its source tree.
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl");
    let shaders = args.shaders.clone().or_else(|| Some(own).filter(|own| cfg!(debug_assertions) && own.is_dir()));
    let options = WorkerOptions { backend: args.backend, device: args.gl_device, overrides: args.overrides.clone(), shaders };
    let app = App::new(options, scene, args.layers, events.create_proxy())?;
    let mut window = Window::new(args, app);
    let ended =
        events.run_app(&mut window).map_err(|error| Error::gl(format!("the window system failed: {error}"), "start again"));
    let WindowSummary { outcome, times: [frames, answers], api, directions, left } = window.end();
    let outcome = ended.and(outcome).and_then(|()| {
        let json = json!({ "api": api, "directions": directions, "frame": frames, "answer": answers });
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
