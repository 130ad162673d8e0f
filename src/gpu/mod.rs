//! Stand-in for the GL context, so that the command-line tool compiles and its tests run without one.

use std::str::FromStr;

use serde::Serialize;

use crate::error::{Error, Result};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    #[default]
    Auto,
    Egl,
    OsMesa,
}

impl FromStr for Backend {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "egl" => Ok(Self::Egl),
            "osmesa" => Ok(Self::OsMesa),
            _ => Err("auto, egl or osmesa".into()),
        }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    #[default]
    Auto,
    Software,
    Index(usize),
}

impl FromStr for DeviceChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "sw" => Ok(Self::Software),
            _ => text.parse().map(Self::Index).map_err(|_| "auto, sw or the index of a device".into()),
        }
    }
}

pub struct Gpu(GpuInfo);

impl Gpu {
    pub fn headless(backend: Backend, device: DeviceChoice) -> Result<Self> {
        if let DeviceChoice::Index(index) = device {
            return Err(Error::gl(format!("no EGL device {index}"), "see finalgather info"));
        }
        Ok(Self(GpuInfo {
            renderer: "stand-in".into(),
            vendor: "none".into(),
            version: "3.3".into(),
            glsl: "3.30".into(),
            backend: format!("{backend:?}").to_lowercase(),
            device: format!("{device:?}"),
            limits: Limits {
                max_texture_size: 1,
                max_3d_texture_size: 1,
                max_renderbuffer_size: 1,
                max_draw_buffers: 1,
                max_texture_units: 1,
            },
        }))
    }

    pub fn info(&self) -> &GpuInfo {
        &self.0
    }
}

#[derive(Serialize, Clone, Debug)]
pub struct GpuInfo {
    pub renderer: String,
    pub vendor: String,
    pub version: String,
    pub glsl: String,
    pub backend: String,
    pub device: String,
    pub limits: Limits,
}

#[derive(Serialize, Clone, Debug)]
pub struct Limits {
    pub max_texture_size: u32,
    pub max_3d_texture_size: u32,
    pub max_renderbuffer_size: u32,
    pub max_draw_buffers: u32,
    pub max_texture_units: u32,
}

pub struct DeviceInfo {
    pub index: usize,
    pub name: String,
    pub software: bool,
}

pub fn list_devices() -> Result<Vec<DeviceInfo>> {
    Ok(vec![DeviceInfo { index: 0, name: "stand-in".into(), software: true }])
}
