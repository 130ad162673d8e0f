//! Requests for jobs, as plain data. The command line makes them, and other callers can too.

use std::iter::successors;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::outputs::{local_origin, metadata, of_picture};
use super::receiver::check_kinds;
use super::{Per, ReceiverKind, Watch};
use crate::bake::{Plan, blocks_of as blocks_of_bake};
use crate::blocks::Blocks;
use crate::error::{Error, Result};
use crate::gpu::{Backend, DeviceChoice, Gpu};
use crate::image::check_writable;
use crate::points::LightMapOptions;
use crate::quantity::Quantity;
use crate::render::{blocks_of, memory_of};
use crate::scene::{CameraChange, Environment, Files, LoadOptions, Loaded, Material, PunctualLight, Sky, Sun, World};
use crate::settings::{DisplaySettings, Exposure, PointSource, Settings, Squares};

/// A job. Parts of a bake contain it, because a merge makes the receivers again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JobRequest {
    pub scene: SceneRequest,
    pub work: Work,
    /// Files of the picture, or of each receiver of a bake.
    #[serde(skip)]
    pub outputs: Vec<Vec<PathBuf>>,
    /// MiB for the whole job, GL side and CPU together.
    #[serde(skip)]
    pub memory: Option<usize>,
    /// Seconds for the whole job, of a picture. The directions are then as many as it can gather along; those of the settings do not matter.
    #[serde(skip)]
    pub time: Option<f64>,
    #[serde(skip)]
    pub device: DeviceRequest,
}

/// The kind of job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Work {
    /// A picture.
    Render,
    Bake(BakeRequest),
}

/// Values at points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BakeRequest {
    /// At most one of each kind.
    pub receivers: Vec<ReceiverKind>,
    pub plan: Plan,
    /// For [`ReceiverKind::LightMap`]. Texels per unit refer to world space.
    pub light_map: LightMapOptions,
    /// For [`ReceiverKind::Vertices`]. It moves no point, so parts and checkpoints of both are the same.
    #[serde(default)]
    pub per: Per,
}

/// A scene file, and changes to it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneRequest {
    /// A scene file (`.toml`) or a model.
    pub path: PathBuf,
    /// The bytes of that file, if it is not to be read.
    #[serde(skip)]
    pub bytes: Option<Vec<u8>>,
    /// The scene itself, if it is loaded already. Of the other fields, the view and the settings still count.
    #[serde(skip)]
    pub loaded: Option<SharedScene>,
    /// A lat-long picture that replaces the scene's environment.
    pub environment: Option<PathBuf>,
    /// See [`LoadOptions`], as the next.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sun: Option<Sun>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sky: Option<Sky>,
    /// The scene may name files outside its folder.
    pub allow_outside: bool,
    /// All surfaces are turned, see [`LoadOptions::flip`].
    pub flip: bool,
    /// See [`LoadOptions::smooth_angle`].
    #[serde(default)]
    pub smooth_angle: Option<f32>,
    /// See [`LoadOptions`], as the next three.
    #[serde(default)]
    pub strict: bool,
    #[serde(default)]
    pub no_default_light: bool,
    #[serde(default)]
    pub camera: Option<String>,
    #[serde(default)]
    pub scene: Option<String>,
    /// See [`LoadOptions::clay`].
    #[serde(default)]
    pub clay: bool,
    /// Replaces parts of the camera.
    #[serde(default)]
    pub view: CameraChange,
    /// Settings that replace the scene's, by their keys in scene files.
    pub settings: Map<String, Value>,
}

/// A loaded scene that several jobs read. Equal to itself alone.
#[derive(Clone, Debug)]
pub struct SharedScene(pub Arc<Loaded>);

impl PartialEq for SharedScene {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// The OpenGL context of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceRequest {
    pub backend: Backend,
    pub device: DeviceChoice,
}

impl SceneRequest {
    /// # Errors
    /// [`Error::Input`] when a file cannot be used, or `needs_light` and nothing emits light; [`Error::Usage`] when the camera or a setting is unusable.
    pub fn load(&self, needs_light: bool) -> Result<Loaded> {
        self.share(needs_light).map(Arc::unwrap_or_clone)
    }

    /// The same without a copy of a scene that is loaded already, unless it has to change.
    pub(super) fn share(&self, needs_light: bool) -> Result<Arc<Loaded>> {
        let mut loaded = match &self.loaded {
            Some(SharedScene(loaded)) => loaded.clone(),
            None => self.read(needs_light).map(Arc::new)?,
        };
        if needs_light && loaded.needs_light() {
            Arc::make_mut(&mut loaded).light()?;
        }
        if self.view != CameraChange::default() {
            let settings = self.settings(&loaded.settings)?;
            settings.validate()?;
            let camera = loaded.world.changed_camera(settings.film.size, &self.view).check();
            let camera = camera.map_err(|(problem, cure)| Error::usage(problem, cure))?;
            Arc::make_mut(&mut loaded).world.cameras.insert(0, ("options".to_owned(), camera));
        }
        Ok(loaded)
    }

    fn read(&self, needs_light: bool) -> Result<Loaded> {
        let environment = self.environment.as_deref().map(Environment::load).transpose()?;
        let files = if self.allow_outside { Files::Anywhere } else { Files::Folder };
        let &Self { strict, no_default_light, flip, smooth_angle, clay, sun, sky, .. } = self;
        let (camera, scene) = (self.camera.clone(), self.scene.clone());
        World::load_with(
            &self.path,
            LoadOptions {
                environment,
                sun,
                sky,
                files,
                unlit: !needs_light,
                no_default_light,
                strict,
                flip,
                smooth_angle,
                clay,
                camera,
                scene,
                bytes: self.bytes.clone(),
            },
        )
    }

    /// Returns `of_scene`, changed by [`Self::settings`].
    ///
    /// # Errors
    /// [`Error::Usage`] when a key is unknown or a value has the wrong type.
    pub fn settings(&self, of_scene: &Settings) -> Result<Settings> {
        let mut all = serde_json::to_value(of_scene).unwrap_or_default();
        self.settings.iter().for_each(|(name, value)| all[Settings::key_of(name)] = value.clone());
        serde_json::from_value(all).map_err(|error| Error::usage(format!("settings: {error}"), "give a setting of this version"))
    }
}

impl DeviceRequest {
    /// # Errors
    /// [`Error::Gl`] when there is no OpenGL 3.3.
    pub fn open(self) -> Result<Gpu> {
        Gpu::headless(self.backend, self.device)
    }
}

impl JobRequest {
    /// Files that are read in addition to those that the scene names.
    pub(super) fn inputs(&self) -> impl Iterator<Item = &Path> {
        let receivers = if let Work::Bake(bake) = &self.work { &bake.receivers[..] } else { &[] };
        let points = receivers.iter().filter_map(|kind| if let ReceiverKind::Points(path) = kind { Some(path) } else { None });
        [&self.scene.path].into_iter().chain(&self.scene.environment).chain(points).map(PathBuf::as_path)
    }

    /// Checks that the picture, or each receiver, has files that can be written. Results in memory need none.
    pub(super) fn check_outputs(&self, in_memory: bool) -> Result<()> {
        let wanted = if let Work::Bake(bake) = &self.work { bake.receivers.len() } else { 1 };
        if self.outputs.len() != wanted || !in_memory && self.outputs.iter().any(Vec::is_empty) {
            let problem = format!("{} lists of files for {wanted} results, or an empty list", self.outputs.len());
            return Err(Error::usage(problem, "give one file or more for the picture, or for each receiver"));
        }
        let Work::Bake(bake) = &self.work else {
            return self.outputs.iter().flatten().try_for_each(|path| check_writable(path));
        };
        check_kinds(&bake.receivers)?;
        let mut files =
            bake.receivers.iter().zip(&self.outputs).flat_map(|(kind, paths)| paths.iter().map(move |path| (kind, path)));
        files.try_for_each(|(kind, path)| kind.check_writable(path, &bake.plan.what))
    }

    /// Whether results are of the camera's pixels.
    pub(super) fn has_camera(&self) -> bool {
        if let Work::Bake(bake) = &self.work { bake.receivers.contains(&ReceiverKind::Camera) } else { true }
    }

    /// Openness and transfer need no light.
    pub(super) fn needs_light(&self) -> bool {
        let needs = |quantity: &Quantity| matches!(quantity, Quantity::Irradiance | Quantity::Sh);
        if let Work::Bake(bake) = &self.work { bake.plan.what.iter().any(needs) } else { true }
    }

    /// The settings of this job, from the settings of the scene.
    pub(super) fn settings(&self, of_scene: &Settings) -> Result<Settings> {
        let mut settings = self.scene.settings(of_scene)?;
        if let Work::Bake(bake) = &self.work {
            // A bake uses all its directions. The layer size must follow from their number.
            settings.directions.target_error = 0.0;
            settings.film.ground = false;
            settings.film.points = PointSource::Camera;
            settings.display.exposure = Exposure::Stops(settings.display.exposure.given());
            settings.film.interleave = Squares::Auto;
            bake.plan.validate()?;
        }
        settings.validate()?;
        Ok(settings)
    }

    pub(super) fn blocks(&self, settings: &Settings) -> Blocks {
        match &self.work {
            Work::Bake(bake) => {
                let turns = bake.receivers.iter().map(|kind| kind.turns(&bake.light_map, settings)).max();
                blocks_of_bake(&settings.directions, turns.unwrap_or(1))
            }
            Work::Render => blocks_of(settings),
        }
    }

    /// Makes all checks that need no device. `shard` has its blocks.
    pub(super) fn check(
        &self,
        world: &World,
        settings: &Settings,
        shard: Option<&Range<u32>>,
        watch: &mut dyn Watch,
    ) -> Result<()> {
        if let Work::Bake(bake) = &self.work {
            let bright = world.environment.as_ref().is_some_and(|environment| environment.bright_power() > 0.0);
            if bright && bake.plan.what.contains(&Quantity::Sh) {
                watch.say(
                    "warning: sh has small bright parts of the environment, as the sun, from few of the shared directions; more \
                     --directions make it less noisy",
                );
            }
            return match serde_json::to_value(self) {
                Err(_) if shard.is_some() => {
                    let cure = "give names in UTF-8, and files of points";
                    Err(Error::usage("a part is to hold the job, and a path is not UTF-8 or points are in memory", cure))
                }
                _ => Ok(()),
            };
        }
        let lens = world.cameras.first().is_some_and(|(_, camera)| camera.lens.is_some());
        if settings.film.points == PointSource::Camera && (lens || world.surfaces().any(Material::is_specular)) {
            watch.say("warning: mirrors and glass are drawn as diffuse, through a pinhole; --points traced shows what they are");
        }
        if settings.film.points == PointSource::Camera && world.surfaces().any(Material::may_be_narrow) {
            watch.say("warning: few of the shared directions meet narrow gloss, so it is noisy; --points traced follows it");
        }
        if settings.film.ground {
            warning_of_ground(world).iter().for_each(|warning| watch.say(warning));
        }
        if self.time.is_some() && shard.is_some() {
            return Err(Error::usage(
                "shards of a job have the same directions, whatever their time",
                "give --directions in place of --time",
            ));
        }
        if shard.is_some() && settings.directions.target_error > 0.0 {
            return Err(Error::usage("a shard cannot tell the error of the whole picture", "give --target-error 0"));
        }
        self.memory.map_or(Ok(()), |allowed| check_memory(allowed as u64, world, settings, shard))
    }

    /// A warning if a picture has positions relative to an origin of their own. `job` made it.
    pub(super) fn warning_of_origin(&self, job: &Value) -> Option<String> {
        let origin = local_origin(job);
        let has_positions = |path: &&PathBuf| {
            self.work == Work::Render && path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr"))
        };
        let path = self.outputs.iter().flatten().find(has_positions).filter(|_| origin != DVec3::ZERO)?;
        Some(format!(
            "warning: {}: 32 bits cannot hold coordinates so far from the origin, so P.X, P.Y and P.Z are relative to {origin}; the metadata \
             says so too, as position_origin",
            path.display()
        ))
    }

    /// Metadata for the files of the picture or of a receiver. `job` made them.
    pub(super) fn metadata(&self, receiver: usize, job: &Value, display: &DisplaySettings, done: (u32, bool)) -> String {
        let own = match &self.work {
            Work::Render => of_picture(job),
            // Padding is the only light map option that moves no point. So the job does not contain it.
            Work::Bake(BakeRequest { receivers, light_map, per, .. }) => {
                let kind = &receivers[receiver];
                let mut own = json!({ "plan": job["plan"], "receiver": kind.name(), "padding": light_map.padding });
                if *kind == ReceiverKind::Vertices && *per == Per::Source {
                    own["per"] = json!(per);
                }
                own
            }
        };
        metadata(job, display, &own, done)
    }
}

/// What is not right with the shadow on the ground, if anything.
fn warning_of_ground(world: &World) -> Option<&'static str> {
    if world.environment.is_none() {
        return Some(
            "warning: --ground has no effect: it catches the shadow of the environment's light, and there is none; give --env",
        );
    }
    (world.has_lamps() || world.lights.iter().any(PunctualLight::shines)).then_some(
        "warning: lamps light the ground too, so its shadow is too light: it is that of the environment alone; --ground off leaves it out",
    )
}

/// Checks that a render, or a shard of these blocks, fits into `allowed` MiB.
fn check_memory(allowed: u64, world: &World, settings: &Settings, shard: Option<&Range<u32>>) -> Result<()> {
    let scene = world.flatten();
    let blocks = |settings: &Settings| shard.map_or(blocks_of(settings).count(), |shard| shard.len() as u32);
    let of = |settings: &Settings| memory_of(&scene, settings, blocks(settings), shard.is_some()).div_ceil(1 << 20);
    let (needed, fits) = (of(settings), |change: &dyn Fn(&mut Settings)| of(&settings.with(change)) <= allowed);
    if needed <= allowed {
        return Ok(());
    }
    let sizes =
        successors(Some(settings.film.size), |size| Some(size.map(|side| side * 15 / 16)).filter(|size| !size.contains(&0)));
    let size = { sizes }.find(|&size| fits(&|settings| settings.film.size = size));
    let counts =
        successors(Some(settings.directions.count), |directions| Some(directions / 2).filter(|&directions| directions > 0));
    let directions = { counts }.find(|&directions| shard.is_none() && fits(&|settings| settings.directions.count = directions));
    let size = size.map(|[width, height]| format!("--size {width}x{height}"));
    let directions = directions.map(|directions| format!("--directions {directions}"));
    let cures = size.into_iter().chain(directions).chain([format!("--memory {needed}")]).collect::<Vec<_>>();
    let problem = format!("the render may take {needed} MiB, and --memory allows {allowed}");
    Err(Error::usage(problem, format!("give {}", cures.join(" or "))))
}
