//! Contexts without a window: on an EGL device, through glutin, or through OSMesa.

use std::ffi::CString;
use std::fmt;
use std::str::FromStr;

use glutin::api::egl::{context::PossiblyCurrentContext, device::Device, display::Display};
use glutin::config::{Api, ConfigSurfaceTypes, ConfigTemplateBuilder};
use glutin::context::{
    ContextApi, ContextAttributes, ContextAttributesBuilder, GlProfile, PossiblyCurrentGlContext, Robustness, Version,
};
use glutin::display::GlDisplay;
use serde::Serialize;

use super::osmesa::OsMesa;
use super::reset::ResetStatus;
use crate::error::{Error, Result};

/// The library that makes the context.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// EGL, or OSMesa if EGL fails.
    #[default]
    Auto,
    Egl,
    OsMesa,
}

/// The EGL device that renders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// The first device that makes a context. EGL lists hardware first.
    #[default]
    Auto,
    /// The software device.
    Software,
    /// The index in [`list_devices`], from 0.
    Index(usize),
}

/// One EGL device.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceInfo {
    pub index: usize,
    pub name: String,
    pub software: bool,
}

/// A context, its functions and its reset status.
pub(super) type Created = (Platform, glow::Context, ResetStatus);

/// Owns a context of the library that made it.
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
    /// The names of backend and device.
    pub fn names(&self) -> [&str; 2] {
        match self {
            Self::Egl { device, .. } => ["egl", device],
            Self::OsMesa(_) => ["osmesa", "software"],
        }
    }

    /// Returns whether it succeeded. After a failure no context is current, so that no other context receives the next calls.
    pub fn make_current(&self) -> bool {
        let made = match self {
            Self::Egl { context, .. } => context.make_current_surfaceless().is_ok(),
            Self::OsMesa(context) => context.make_current().is_ok(),
        };
        if let (false, Self::Egl { context, .. }) = (made, self) {
            // If this fails too, the context is not current either.
            let _ = context.make_not_current_in_place();
        }
        made
    }
}

/// Lists the EGL devices of this machine, in EGL's order.
///
/// # Errors
/// [`Error::Gl`] if libEGL is missing or too old to list devices.
pub fn list_devices() -> Result<Vec<DeviceInfo>> {
    Ok(devices()?.into_iter().map(|(info, _)| info).collect())
}

/// Makes a context and leaves it current.
pub(super) fn create(backend: Backend, device: DeviceChoice) -> Result<Created> {
    match backend {
        Backend::Egl => egl(device),
        Backend::OsMesa => osmesa(),
        // A named device is an EGL device. OSMesa would render on another.
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
    let is_wanted = |info: &DeviceInfo| match choice {
        DeviceChoice::Auto => true,
        DeviceChoice::Software => info.software,
        DeviceChoice::Index(index) => info.index == index,
    };
    let mut failures = Vec::new();
    for (info, device) in devices.iter().filter(|(info, _)| is_wanted(info)) {
        match egl_on(info, device) {
            Ok(created) => return Ok(created),
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

fn egl_on(info: &DeviceInfo, device: &Device) -> Result<Created, String> {
    let text = |error: glutin::error::Error| error.to_string();
    // A surfaceless context needs a config that renders OpenGL, and none of the buffers of a window.
    let template = ConfigTemplateBuilder::new()
        .with_surface_type(ConfigSurfaceTypes::empty())
        .with_api(Api::OPENGL)
        .with_alpha_size(0)
        .with_depth_size(0)
        .with_stencil_size(0)
        .build();
    let display = unsafe { Display::with_device(device, None) }.map_err(text)?;
    let config = unsafe { display.find_configs(template) }.map_err(text)?.next().ok_or("no config renders OpenGL")?;
    let context = create_context(&display, &config, |attributes| attributes.build(None))
        .map_err(text)?
        .make_current_surfaceless()
        .map_err(text)?;
    let (functions, reset) = load_functions(&display);
    Ok((Platform::Egl { context, device: info.to_string() }, functions, reset))
}

/// Makes an OpenGL 3.3 core context, robust if the driver can: a robust context reports its loss. Others may stay stale for ever, or end
/// the process. `build` adds the window, if there is one.
pub(super) fn create_context<D: GlDisplay>(
    display: &D,
    config: &D::Config,
    build: impl Fn(ContextAttributesBuilder) -> ContextAttributes,
) -> glutin::error::Result<D::NotCurrentContext> {
    let create = |robustness| {
        let attributes = ContextAttributesBuilder::new()
            .with_context_api(ContextApi::OpenGl(Some(Version::new(3, 3))))
            .with_profile(GlProfile::Core)
            .with_robustness(robustness);
        unsafe { display.create_context(config, &build(attributes)) }
    };
    create(Robustness::RobustLoseContextOnReset).or_else(|_| create(Robustness::NotRobust))
}

/// The GL functions of the current context.
pub(super) fn load_functions(display: &impl GlDisplay) -> (glow::Context, ResetStatus) {
    let address = |name: &str| CString::new(name).map_or(std::ptr::null(), |name| display.get_proc_address(&name));
    let functions = unsafe { glow::Context::from_loader_function(address) };
    let reset = ResetStatus::new(&functions, address);
    (functions, reset)
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
