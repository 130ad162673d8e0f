//! `finalgather info`: which OpenGL a render would get, found by asking for it.

use std::fmt::{self, Display};

use finalgather::error::{Error, Result};
use finalgather::gpu::{self, Backend, DeviceChoice, Gpu, GpuInfo};
use serde::Serialize;

use crate::report;

/// Show the OpenGL of this machine: backends that work, devices, renderer, limits
#[derive(Debug, clap::Args)]
pub struct InfoArgs {
    /// Print one JSON object on stdout
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Info {
    backends: Vec<BackendInfo>,
    devices: Vec<Device>,
}

#[derive(Serialize)]
struct BackendInfo {
    name: &'static str,
    works: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    gl: Option<GpuInfo>,
    #[serde(skip_serializing_if = "Option::is_none")]
    problem: Option<String>,
}

#[derive(Serialize)]
struct Device {
    index: usize,
    name: String,
    software: bool,
}

/// The exit code: 0 if a render can have a context, else the one that it would fail with.
pub fn run(args: &InfoArgs) -> Result<u8> {
    let probe = |name, backend| match Gpu::headless(backend, DeviceChoice::Auto) {
        Ok(gpu) => BackendInfo { name, works: true, gl: Some(gpu.info().clone()), problem: None },
        Err(error) => BackendInfo { name, works: false, gl: None, problem: Some(error.to_string()) },
    };
    let info = Info {
        backends: vec![probe("egl", Backend::Egl), probe("osmesa", Backend::OsMesa)],
        // Without EGL there are no devices to list, which its backend's problem says already.
        devices: gpu::list_devices()
            .unwrap_or_default()
            .into_iter()
            .map(|device| Device { index: device.index, name: device.name, software: device.software })
            .collect(),
    };
    if args.json {
        report::print_json(&info)?;
    } else {
        report::print(info.to_string().trim_end())?;
    }
    if info.backends.iter().any(|backend| backend.works) {
        Ok(0)
    } else {
        Err(Error::gl("no backend gives an OpenGL 3.3 context", "mend one of the problems listed above, or run scripts/setup.sh"))
    }
}

impl Display for Info {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for backend in &self.backends {
            match (&backend.gl, &backend.problem) {
                (Some(gl), _) => {
                    writeln!(f, "{}: works", backend.name)?;
                    for (name, value) in [
                        ("renderer", &gl.renderer),
                        ("vendor", &gl.vendor),
                        ("version", &gl.version),
                        ("GLSL", &gl.glsl),
                        ("device", &gl.device),
                    ] {
                        writeln!(f, "  {name:<21} {value}")?;
                    }
                    for (name, value) in [
                        ("max texture size", gl.limits.max_texture_size),
                        ("max 3D texture size", gl.limits.max_3d_texture_size),
                        ("max renderbuffer size", gl.limits.max_renderbuffer_size),
                        ("max draw buffers", gl.limits.max_draw_buffers),
                        ("max texture units", gl.limits.max_texture_units),
                    ] {
                        writeln!(f, "  {name:<21} {value}")?;
                    }
                }
                (None, problem) => {
                    writeln!(f, "{}: does not work", backend.name)?;
                    problem.iter().flat_map(|problem| problem.lines()).try_for_each(|line| writeln!(f, "  {line}"))?;
                }
            }
        }
        writeln!(f, "EGL devices: {}", self.devices.len())?;
        for device in &self.devices {
            let kind = if device.software { " (software)" } else { "" };
            writeln!(f, "  --gl-device {}  {}{kind}", device.index, device.name)?;
        }
        Ok(())
    }
}
