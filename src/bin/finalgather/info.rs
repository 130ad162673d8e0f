//! `finalgather info`: the OpenGL that a render would get, or what is in a scene. For the OpenGL it opens contexts.

use std::path::PathBuf;

use finalgather::error::{Error, Result};
use finalgather::gpu::{self, Backend, DeviceChoice, Gpu};
use serde_json::{Value, json};

use crate::args::SceneArgs;
use crate::{about_scene, report};

/// Show the OpenGL of this machine: backends that work, devices, renderer, limits. Or show what is in a scene, with all warnings
#[derive(Debug, clap::Args)]
pub struct InfoArgs {
    /// Scene file (.toml) or model (.obj with its .mtl, .glb, .gltf, .ply, .stl)
    scene: Option<PathBuf>,

    #[command(flatten)]
    files: SceneArgs,

    /// Print one JSON object on stdout
    #[arg(long)]
    json: bool,
}

/// Returns exit code 0 for a scene that can be read, or if a render can get a context, else an error with the exit code of a render.
pub fn run(args: &InfoArgs) -> Result<u8> {
    if let Some(scene) = &args.scene {
        about_scene::show(&args.files.scene(scene)?, args.json)?;
        return Ok(0);
    }
    let probe = |name, backend| match Gpu::headless(backend, DeviceChoice::Auto) {
        Ok(gpu) => json!({ "name": name, "works": true, "gl": gpu.info() }),
        Err(error) => json!({ "name": name, "works": false, "problem": error.to_string() }),
    };
    let backends = [probe("egl", Backend::Egl), probe("osmesa", Backend::OsMesa)];
    // Without EGL there are no devices. The problem of the EGL backend already says why.
    let devices = gpu::list_devices().unwrap_or_default();
    if args.json {
        report::print_json(&json!({ "backends": backends, "devices": devices }))?;
    } else {
        let mut lines: Vec<_> = backends.iter().flat_map(lines_of).collect();
        lines.push(format!("EGL devices: {}", devices.len()));
        lines.extend(devices.iter().map(|device| {
            let kind = if device.software { " (software)" } else { "" };
            format!("  --gl-device {}  {}{kind}", device.index, device.name)
        }));
        report::print(&lines.join("\n"))?;
    }
    if backends.iter().any(|backend| backend["works"] == true) {
        Ok(0)
    } else {
        Err(Error::gl("no backend gives an OpenGL 3.3 context", "mend one of the problems listed above, or run scripts/setup.sh"))
    }
}

/// Lines about a backend for the user: all facts from the driver, or why it does not work.
fn lines_of(backend: &Value) -> Vec<String> {
    let name = backend["name"].as_str().unwrap_or_default();
    if let Some(problem) = backend["problem"].as_str() {
        let problem = problem.lines().map(|line| format!("  {line}"));
        return [format!("{name}: does not work")].into_iter().chain(problem).collect();
    }
    let entries = |value: &Value| value.as_object().cloned().unwrap_or_default().into_iter();
    let about = entries(&backend["gl"]).chain(entries(&backend["gl"]["limits"])).filter(|(name, _)| name != "limits");
    let line = |(name, value): (String, Value)| {
        let name = if name == "glsl" { "GLSL".to_owned() } else { name.replace('_', " ").replace("3d", "3D") };
        format!("  {name:<21} {}", value.as_str().map_or(value.to_string(), str::to_owned))
    };
    [format!("{name}: works")].into_iter().chain(about.filter(|(name, _)| name != "backend").map(line)).collect()
}
