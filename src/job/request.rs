//! What a job is asked for, as plain data: the command line fills it in, and so can any other caller.

use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::{Task, Watch};
use crate::blocks::Blocks;
use crate::environment::Environment;
use crate::error::{Error, Result};
use crate::gpu::{Backend, DeviceChoice, Gpu};
use crate::scene::{Files, LoadOptions, Scene};
use crate::settings::Settings;

/// A job before it begins; [`super::RenderRequest`] and [`super::BakeRequest`].
pub trait Request {
    fn scene(&self) -> &SceneRequest;

    /// Which OpenGL context the job runs on.
    fn device(&self) -> DeviceRequest;

    /// All result files.
    fn outputs(&self) -> Vec<PathBuf>;

    /// Files that are read beside those that the scene names.
    fn inputs(&self) -> Vec<&Path> {
        self.scene().inputs().collect()
    }

    /// # Errors
    /// [`Error::Usage`] when a result file cannot be written.
    fn check_outputs(&self) -> Result<()>;

    /// Whether the job makes sense only in a scene with light.
    fn needs_light(&self) -> bool;

    /// The settings of this job in a scene with these settings.
    ///
    /// # Errors
    /// [`Error::Usage`] when a number is out of range.
    fn settings(&self, of_scene: &Settings) -> Result<Settings>;

    fn blocks(&self, settings: &Settings) -> Blocks;

    /// Refuses what can be refused before the device starts. `shard` is the range of blocks of a shard.
    ///
    /// # Errors
    /// [`Error::Usage`].
    fn check(&self, scene: &Scene, settings: &Settings, shard: Option<&Range<u32>>, watch: &mut dyn Watch) -> Result<()>;

    /// Prepares everything up to the first direction.
    ///
    /// # Errors
    /// [`Error::Usage`] when the request cannot be met, [`Error::Gl`] when the device fails.
    fn begin<'a>(
        &'a self,
        gpu: &Gpu,
        scene: &'a Scene,
        settings: &Settings,
        shard: Option<Range<u32>>,
        watch: &mut dyn Watch,
    ) -> Result<Box<dyn Task + 'a>>;
}

/// A scene file, and what differs from it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneRequest {
    /// `.toml` or `.obj`.
    pub path: PathBuf,
    /// Lat-long picture in place of the scene's environment.
    pub environment: Option<PathBuf>,
    /// The scene may name files outside its folder.
    pub allow_outside: bool,
    /// Settings in place of the scene's, under the names of the fields of [`Settings`].
    pub settings: Map<String, Value>,
}

/// Which OpenGL context a job runs on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceRequest {
    pub backend: Backend,
    pub device: DeviceChoice,
}

impl SceneRequest {
    /// # Errors
    /// [`Error::Input`] when a file cannot be used, or the scene has no light and `needs_light`.
    pub fn load(&self, needs_light: bool) -> Result<Scene> {
        let environment = self.environment.as_deref().map(Environment::load).transpose()?;
        let files = if self.allow_outside { Files::Anywhere } else { Files::Folder };
        Scene::load_with(&self.path, LoadOptions { environment, files, unlit: !needs_light })
    }

    /// `of_scene` with [`Self::settings`] put over it.
    ///
    /// # Errors
    /// [`Error::Usage`] when a name is not known or a value has another type.
    pub fn settings(&self, of_scene: &Settings) -> Result<Settings> {
        let mut all = serde_json::to_value(of_scene).unwrap_or_default();
        self.settings.iter().for_each(|(name, value)| all[name] = value.clone());
        serde_json::from_value(all).map_err(|error| Error::usage(format!("settings: {error}"), "give a setting of this version"))
    }

    pub(super) fn inputs(&self) -> impl Iterator<Item = &Path> {
        [&self.path].into_iter().chain(&self.environment).map(PathBuf::as_path)
    }
}

impl DeviceRequest {
    /// # Errors
    /// [`Error::Gl`] when it gives no OpenGL 3.3.
    pub fn open(self) -> Result<Gpu> {
        Gpu::headless(self.backend, self.device)
    }
}
