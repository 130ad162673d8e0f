//! Contexts with no window: an EGL device through glutin, or OSMesa.

use std::ffi::CString;
use std::fmt;
use std::str::FromStr;

use glutin::api::egl::{context::PossiblyCurrentContext, device::Device, display::Display};
use glutin::config::{Api, ConfigSurfaceTypes, ConfigTemplateBuilder};
use glutin::context::{ContextApi, ContextAttributesBuilder, GlProfile, PossiblyCurrentGlContext, Robustness, Version};
use glutin::display::GlDisplay;
use serde::Serialize;

use super::osmesa::OsMesa;
use super::reset::ResetStatus;
use crate::error::{Error, Result};

/// Which library makes the context.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// EGL, and OSMesa where EGL cannot.
    #[default]
    Auto,
    Egl,
    OsMesa,
}

/// Which EGL device renders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// The first device that gives a context; EGL lists hardware first.
    #[default]
    Auto,
    /// The software device.
    Software,
    /// Counted from 0, as [`list_devices`] lists them.
    Index(usize),
}

/// One EGL device.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceInfo {
    pub index: usize,
    pub name: String,
    pub software: bool,
}

/// A context, its functions, and how it tells that it is lost.
pub(super) type Created = (Platform, glow::Context, ResetStatus);

/// What keeps a context alive.
pub(super) enum Platform {
    Egl { context: PossiblyCurrentContext, device: String },
    OsMesa(OsMesa),
}

impl FromStr for Backend {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        match s {
            "auto" => Ok(Self::Auto),
            "egl" => Ok(Self::Egl),
            "osmesa" => Ok(Self::OsMesa),
            _ => Err("auto, egl or osmesa".into()),
        }
    }
}

impl FromStr for DeviceChoice {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        match s {
            "auto" => Ok(Self::Auto),
            "sw" => Ok(Self::Software),
            _ => s.parse().map(Self::Index).map_err(|_| "auto, sw or the index of a device".into()),
        }
    }
}

impl fmt::Display for DeviceInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.index, self.name)
    }
}

impl Platform {
    pub fn backend(&self) -> &'static str {
        match self {
            Self::Egl { .. } => "egl",
            Self::OsMesa(_) => "osmesa",
        }
    }

    pub fn device(&self) -> &str {
        match self {
            Self::Egl { device, .. } => device,
            Self::OsMesa(_) => "software",
        }
    }

    /// Whether it can; else none is current, so that what is meant for this one meets no other.
    pub fn make_current(&self) -> bool {
        let made = match self {
            Self::Egl { context, .. } => context.make_current_surfaceless().is_ok(),
            Self::OsMesa(context) => context.make_current().is_ok(),
        };
        if let (false, Self::Egl { context, .. }) = (made, self) {
            // Where it cannot even be let go, it is not current either.
            let _ = context.make_not_current_in_place();
        }
        made
    }
}

/// The EGL devices of this machine, in EGL's order.
///
/// # Errors
/// [`Error::Gl`] when libEGL is missing or too old to list devices.
pub fn list_devices() -> Result<Vec<DeviceInfo>> {
    Ok(devices()?.into_iter().map(|(info, _)| info).collect())
}

/// Makes a context and leaves it current.
pub(super) fn create(backend: Backend, device: DeviceChoice) -> Result<Created> {
    match backend {
        Backend::Egl => egl(device),
        Backend::OsMesa => osmesa(),
        // A named device is an EGL device: falling back would render somewhere else than asked.
        Backend::Auto if device != DeviceChoice::Auto => egl(device),
        Backend::Auto => egl(device).or_else(|first| osmesa().map_err(|_| first)),
    }
}

fn devices() -> Result<Vec<(DeviceInfo, Device)>> {
    let devices = Device::query_devices().map_err(|error| {
        Error::gl(
            format!("no EGL device can be listed: {error}"),
            "install EGL and a GL driver (Debian, Ubuntu: apt-get install libegl1 libgl1-mesa-dri), or use --backend osmesa",
        )
    })?;
    Ok(devices
        .enumerate()
        .map(|(index, device)| {
            let software = device.extensions().contains("EGL_MESA_device_software");
            let node = device.drm_device_node_path().map(|path| path.display().to_string());
            let name = match (device.name(), node, software) {
                (Some(name), _, _) => name.to_owned(),
                (None, Some(node), _) => node,
                (None, None, true) => "software".to_owned(),
                (None, None, false) => "unnamed device".to_owned(),
            };
            (DeviceInfo { index, name, software }, device)
        })
        .collect())
}

fn egl(choice: DeviceChoice) -> Result<Created> {
    let devices = devices()?;
    let wanted: Vec<_> = devices
        .iter()
        .filter(|(info, _)| match choice {
            DeviceChoice::Auto => true,
            DeviceChoice::Software => info.software,
            DeviceChoice::Index(index) => info.index == index,
        })
        .collect();
    let mut failures = Vec::new();
    for (info, device) in wanted {
        match egl_on(device) {
            Ok((context, functions, reset)) => {
                return Ok((Platform::Egl { context, device: info.to_string() }, functions, reset));
            }
            Err(failure) => failures.push(format!("device {info}: {failure}")),
        }
    }
    if failures.is_empty() {
        let listed: Vec<_> = devices.iter().map(|(info, _)| info.to_string()).collect();
        let listed = if listed.is_empty() { "none".to_owned() } else { listed.join(", ") };
        if let DeviceChoice::Index(index) = choice {
            let problem = format!("there is no EGL device {index}; there is {listed}");
            return Err(Error::gl(problem, "give --gl-device the number of one that is there, or auto"));
        }
        failures.push(format!("no such device; there is {listed}"));
    }
    Err(Error::gl(
        format!("no OpenGL 3.3 core context through EGL: {}", failures.join("; ")),
        "choose a device that `finalgather info` lists, or install Mesa's software driver (Debian, Ubuntu: apt-get install \
         libgl1-mesa-dri)",
    ))
}

fn egl_on(device: &Device) -> Result<(PossiblyCurrentContext, glow::Context, ResetStatus), String> {
    let text = |error: glutin::error::Error| error.to_string();
    // A surfaceless context needs a config that renders OpenGL and nothing that a window would need.
    let template = ConfigTemplateBuilder::new()
        .with_surface_type(ConfigSurfaceTypes::empty())
        .with_api(Api::OPENGL)
        .with_alpha_size(0)
        .with_depth_size(0)
        .with_stencil_size(0)
        .build();
    let attributes = |robustness| {
        ContextAttributesBuilder::new()
            .with_context_api(ContextApi::OpenGl(Some(Version::new(3, 3))))
            .with_profile(GlProfile::Core)
            .with_robustness(robustness)
            .build(None)
    };
    unsafe {
        let display = Display::with_device(device, None).map_err(text)?;
        let config = display.find_configs(template).map_err(text)?.next().ok_or("no config renders OpenGL")?;
        let create = |robustness| display.create_context(&config, &attributes(robustness));
        // A robust one tells when it is lost; others may be stale for ever, or end the process.
        let context = create(Robustness::RobustLoseContextOnReset).or_else(|_| create(Robustness::NotRobust)).map_err(text)?;
        let context = context.make_current_surfaceless().map_err(text)?;
        let address = |name: &str| CString::new(name).map_or(std::ptr::null(), |name| display.get_proc_address(&name));
        let functions = glow::Context::from_loader_function(address);
        let reset = ResetStatus::new(&functions, address);
        Ok((context, functions, reset))
    }
}

fn osmesa() -> Result<Created> {
    let context = OsMesa::new().map_err(|problem| {
        Error::gl(
            format!("no OpenGL 3.3 core context through OSMesa: {problem}"),
            "install OSMesa (Debian 12, Ubuntu 24.04: apt-get install libosmesa6), or use --backend egl",
        )
    })?;
    let functions = unsafe { glow::Context::from_loader_function(|name| context.function(name)) };
    let reset = ResetStatus::new(&functions, |name| context.function(name));
    Ok((Platform::OsMesa(context), functions, reset))
}
