//! Stand-in for the loader: settings only.

use std::path::Path;

use glam::Vec3;
use serde::Deserialize;

use super::{Camera, Mesh, Scene};
use crate::error::{Error, Result};
use crate::settings::Settings;

#[derive(Deserialize)]
struct File {
    #[serde(default)]
    settings: Settings,
}

impl Scene {
    pub fn load(path: &Path) -> Result<Self> {
        let bad = |problem: String| Error::input(path, None, problem, "give a scene");
        let text = std::fs::read_to_string(path).map_err(|error| bad(error.to_string()))?;
        let file: File = toml::from_str(&text).map_err(|error| bad(error.to_string()))?;
        Ok(Self {
            mesh: Mesh::default(),
            materials: Vec::new(),
            textures: Vec::new(),
            camera: Camera { eye: Vec3::ZERO, target: Vec3::Z, up: Vec3::Y, fov_y_degrees: 40.0 },
            settings: file.settings,
            warnings: Vec::new(),
        })
    }
}
