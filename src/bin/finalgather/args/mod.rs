//! Options that several commands share. A missing option is `None`. The scene file then decides.

mod values;

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use finalgather::blocks::Shard;
use finalgather::error::{Error, Result};
use finalgather::gpu::{Backend, DeviceChoice};
use finalgather::job::{DeviceRequest, Keeping, SceneRequest};
use finalgather::scene::{CameraChange, Sky, Sun};
use finalgather::settings::{
    Background, Estimator, Exposure, LayerSize, PhotonMapKind, Pipeline, PointSource, Sequence, Squares,
};
use glam::DVec3;
use serde::Serialize;
use serde_json::Value;

use crate::streams::{self, STREAM};

use values::{OrAuto, name, number, or_auto, setting, sky, smooth_angle, sun, switch, vector};
pub use values::{auto_or, checked, count, duration, named, percentage, side, size, stops};

/// The source of OpenGL.
#[derive(Clone, Copy, Debug, clap::Args)]
#[command(next_help_heading = "OpenGL")]
pub struct DeviceArgs {
    /// Library that makes the OpenGL context. auto: EGL, else OSMesa
    #[arg(long, hide_short_help = true, default_value = "auto", value_parser = PossibleValuesParser::new(["auto", "egl", "osmesa"]).try_map(|name| name.parse::<Backend>()))]
    backend: Backend,

    /// EGL device: auto, sw (a software renderer), or an index that `finalgather info` lists
    #[arg(long, hide_short_help = true, default_value = "auto", value_name = "auto|sw|INDEX")]
    gl_device: DeviceChoice,
}

/// How a long job keeps its sums, and which part of the job this run does.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Long jobs")]
pub struct JobArgs {
    /// Keep the sums in this file, for --resume [default: the first output's name with .checkpoint, for a job longer than twice --checkpoint-every; removed at the end]
    #[arg(long, hide_short_help = true, value_name = "FILE", conflicts_with = "shard")]
    checkpoint: Option<PathBuf>,

    /// Seconds between two writes of the checkpoint. A write waits for the end of a block of directions, and comes less often if it takes long. 0: after every block
    #[arg(long, hide_short_help = true, value_name = "SECONDS", default_value_t = 30, value_parser = |text: &str| count(text).ok().filter(|&seconds: &u64| seconds <= 86_400).ok_or("not whole seconds, 86400 at most"))]
    checkpoint_every: u64,

    /// Go on from the checkpoint or, with --shard, from its part, if the file exists. Without --checkpoint: if every output records that this job finished (.exr, .npy, .npz and .ply can), leave the outputs as they are
    #[arg(long)]
    resume: bool,

    /// Do part I of N of the directions, counted from 1, and write it to the one -o, a .part file for `finalgather merge`. {shard} in its name stands for I. auto: take I and N from an
    /// array job of Slurm or AWS Batch. auto/N: take I from a system that does not tell N, such as Kubernetes or PBS
    #[arg(long, hide_short_help = true, value_name = "I/N|auto|auto/N")]
    shard: Option<String>,
}

/// Options that replace the settings of the scene file.
#[derive(Clone, Debug, Serialize, clap::Args)]
#[command(next_help_heading = "Settings")]
pub struct Overrides {
    #[arg(long, value_name = "WxH|N", value_parser = size, help = setting("Picture size in pixels; N is N by N", |s| format!("{}x{}", s.film.size[0], s.film.size[1])))]
    size: Option<[u32; 2]>,

    #[arg(long, value_name = "N", value_parser = count::<u32>, help = setting("Number of global directions. All points share them", |s| s.directions.count))]
    directions: Option<u32>,

    #[arg(long, hide_short_help = true, value_name = "auto|N", value_parser = |text: &str| auto_or(text, LayerSize::Texels), help = setting("Side of the depth layers in texels. auto grows with the number of directions: 128 up to eleven thousand, 192 at 16 thousand, 1024 at most", |s| s.gather.layer_size))]
    layer_size: Option<LayerSize>,

    #[arg(long, value_parser = named::<PointSource>(&["auto", "camera", "traced"]), help = setting("How the camera finds its points: by rasterisation, or by rays through mirrors, glass and the lens", |s| name(s.film.points)))]
    points: Option<PointSource>,

    #[arg(long, value_parser = named::<Pipeline>(&["auto", "fused", "kill", "early-kill", "raycast", "raycast-gl"]), help = setting("How to gather. auto: raycast with a software driver; on a GPU fused where its layers resolve what the points see, else raycast-gl. fused: several directions in one pass, both ends of each. kill: the method of 2004. early-kill: the same with early KILL. raycast: exact rays on the CPU. raycast-gl: exact rays on the GL side, both ends of each direction", |s| s.gather.pipeline))]
    pipeline: Option<Pipeline>,

    #[arg(long, value_name = "N", value_parser = count::<u64>, help = setting("Photons that the lights emit, new ones for every 1024 directions. 1e6 and 1_000_000 are numbers too", |s| s.photons.count))]
    photons: Option<u64>,

    #[arg(long, hide_short_help = true, value_name = "N", value_parser = count::<u32>, help = setting("The most surfaces that store one photon", |s| s.photons.depth))]
    photon_depth: Option<u32>,

    #[arg(long, hide_short_help = true, value_parser = named::<Estimator>(&["self-normalised", "plain"]), help = setting("What divides the sum of radiance: the sum of its weights, or the expected sum", |s| name(s.directions.estimator)))]
    estimator: Option<Estimator>,

    #[arg(long, hide_short_help = true, value_parser = named::<Sequence>(&["random", "r2", "sobol"]), help = setting("Sequence of the directions", |s| name(s.directions.sequence)))]
    sequence: Option<Sequence>,

    #[arg(long, hide_short_help = true, value_name = "auto|1|2|4", value_parser = |text: &str| auto_or(text, Squares::Pixels), help = setting("Divide the directions among the pixels of squares of N by N. Neighbours share the light that they find. auto: 1, but where --pipeline auto chooses rays, more directions in squares of 4, or of 2 from 1000 directions on", |s| s.film.interleave))]
    interleave: Option<Squares>,

    #[arg(long, value_name = "N", value_parser = count::<u64>, help = setting("Seed of all random numbers", |s| s.seed))]
    seed: Option<u64>,

    #[arg(long, hide_short_help = true, value_name = "F", value_parser = number::<f32>, help = setting("Stop peeling when fewer than this fraction of the points sample a layer", |s| s.gather.stop_fraction))]
    stop_fraction: Option<f32>,

    #[arg(long, visible_alias = "error", alias = "until", value_name = "ERROR", value_parser = percentage, help = setting("Stop when the relative standard error of the picture is at most this, as 0.01 or 1%. It is estimated a few times. Layers of `auto` size are then as large as this error needs. 0: never stop early", |s| s.directions.target_error))]
    target_error: Option<f64>,

    /// Exposure of .png in stops. auto: as bright as the surfaces can be without losing detail [default: the scene file's, else 0; auto for a bare model
    /// under the soft sky]
    #[arg(long, value_name = "auto|EV", value_parser = str::parse::<Exposure>)]
    exposure: Option<Exposure>,

    /// What a .png shows where there is no surface: environment, transparent, #rrggbb, or linear r,g,b from 0 to 1. auto: the scene file's, else the
    /// environment; transparent for a bare model under the soft sky
    #[arg(long, value_name = "auto|WHAT", allow_hyphen_values = true, value_parser = |text: &str| or_auto(text, str::parse::<Background>), default_value = "auto")]
    background: OrAuto<Background>,

    /// A plane under the model that catches its shadow: a shadow catcher. auto: on for a bare model under the soft sky
    #[arg(long, value_name = "auto|on|off", value_parser = |text: &str| or_auto(text, switch), default_value = "auto")]
    ground: OrAuto<bool>,

    /// Show all surfaces in one light grey, of albedo 0.8, without textures. Lamps stay lamps
    #[arg(long)]
    #[serde(skip)]
    clay: bool,

    /// Environment, a lat-long .hdr or .exr: the light from outside the scene [default: the scene file's, else black]
    #[arg(long, value_name = "FILE")]
    #[serde(skip)]
    env: Option<PathBuf>,

    /// A sun, in place of the scene file's: its azimuth, clockwise from -z as seen from above (90 is +x), and its height over the horizon, in degrees;
    /// and its illuminance in lux [default: the real sun's at this height]
    #[arg(long, value_name = "AZIMUTH,HEIGHT[,LUX]", allow_hyphen_values = true, value_parser = sun)]
    #[serde(skip)]
    sun: Option<Sun>,

    /// The clear sky of the sun, in place of an environment, for air of this turbidity: 2, very clear, to 10, haze [default: 3]
    #[arg(long, value_name = "TURBIDITY", num_args = 0..=1, require_equals = true, default_missing_value = "3", value_parser = sky, conflicts_with = "env")]
    #[serde(skip)]
    sky: Option<Sky>,

    #[command(flatten)]
    #[serde(skip)]
    files: SceneArgs,

    #[command(flatten)]
    #[serde(skip)]
    pub view: CameraArgs,
}

/// Parts of the camera. Each replaces only its own.
#[derive(Clone, Copy, Debug, clap::Args)]
#[command(next_help_heading = "Camera")]
pub struct CameraArgs {
    /// Where the camera is, in the scene's units [default: as the scene says, else where the whole model fills the picture]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = vector)]
    eye: Option<[f64; 3]>,

    /// What it looks at [default: as the scene says, else the middle of the model]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = vector)]
    target: Option<[f64; 3]>,

    /// Its full vertical angle of view [default: as the scene says, else 40]
    #[arg(long, value_name = "DEGREES", value_parser = number::<f32>)]
    fov: Option<f32>,

    /// The direction that points up in the picture. 0,0,1 for a model whose z axis points up [default: as the scene says, else 0,1,0]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = vector)]
    up: Option<[f64; 3]>,
}

impl CameraArgs {
    /// The scene seen so.
    ///
    /// # Errors
    /// [`Error::Usage`] when the angle of view is infinite or NaN, which a stored request cannot be.
    pub fn choose(self, scene: SceneRequest) -> Result<SceneRequest> {
        if let Some(fov) = self.fov.filter(|fov| !fov.is_finite()) {
            return Err(Error::usage(format!("fov is {fov}"), "give an angle between 0 and 180 degrees"));
        }
        let view = CameraChange {
            eye: self.eye.map(DVec3::from),
            target: self.target.map(DVec3::from),
            up: self.up.map(|up| DVec3::from(up).as_vec3()),
            fov_y_degrees: self.fov,
        };
        Ok(SceneRequest { view, ..scene })
    }

    /// Whether any part is given.
    pub fn is_given(&self) -> bool {
        self.eye.is_some() || self.target.is_some() || self.fov.is_some() || self.up.is_some()
    }
}

/// The photon map of a picture. Bakes choose it by --radiance-cache.
#[derive(Clone, Copy, Debug, clap::Args)]
#[command(next_help_heading = "Settings")]
pub struct PhotonMapArg {
    #[arg(long, alias = "rough", value_parser = named::<PhotonMapKind>(&["surface", "grid"]), help = setting("Where photons leave the light that gather rays see. surface: on the surfaces that they meet. grid: in cells of space, as in 2004", |s| name(s.photons.map)))]
    photon_map: Option<PhotonMapKind>,
}

impl PhotonMapArg {
    /// The scene with this map.
    pub fn choose(self, scene: SceneRequest) -> SceneRequest {
        choose_photon_map(scene, self.photon_map)
    }
}

/// The scene with this photon map, or with its own.
pub fn choose_photon_map(mut scene: SceneRequest, kind: Option<PhotonMapKind>) -> SceneRequest {
    scene.settings.extend(kind.map(|kind| ("photon_map".to_owned(), name(kind).into())));
    scene
}

/// How a scene is read.
#[derive(Clone, Debug, clap::Args)]
pub struct SceneArgs {
    /// Let the scene read files outside its folder
    #[arg(long)]
    allow_outside: bool,

    /// Turn all surfaces: fronts become backs, and lamps shine the other way. If the normals of a model (vn) point to the backs of most of its faces, turn only these faces
    #[arg(long)]
    flip: bool,

    /// Smooth shading for surfaces without normals, such as those of an OBJ without vn: faces that meet at no more than this angle share normals
    #[arg(long, value_name = "DEGREES", value_parser = smooth_angle)]
    smooth_angle: Option<f32>,

    /// Refuse files with faults, in place of mending what can be understood
    #[arg(long)]
    strict: bool,

    /// Refuse a scene without light, in place of adding a soft sky
    #[arg(long)]
    no_default_light: bool,

    /// Use the camera of this name in the file. Default: the first
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,

    /// Use the scene of this name or number (from 0) in a glTF file. Default: the one that the file names
    #[arg(long, value_name = "NAME")]
    gltf_scene: Option<String>,
}

impl SceneArgs {
    /// The scene with its own settings. `-` is read from stdin.
    ///
    /// # Errors
    /// [`Error::Input`] when stdin cannot be read or is empty.
    pub fn scene(&self, path: &Path) -> Result<SceneRequest> {
        let Self { allow_outside, flip, smooth_angle, strict, no_default_light, ref camera, ref gltf_scene } = *self;
        let (path, bytes) = match path == Path::new(STREAM) {
            true => streams::scene().map(|(path, bytes)| (path, Some(bytes)))?,
            false => (path.to_owned(), None),
        };
        Ok(SceneRequest {
            path,
            bytes,
            allow_outside,
            flip,
            smooth_angle,
            strict,
            no_default_light,
            camera: camera.clone(),
            scene: gltf_scene.clone(),
            ..SceneRequest::default()
        })
    }
}

impl DeviceArgs {
    pub fn request(self) -> DeviceRequest {
        DeviceRequest { backend: self.backend, device: self.gl_device }
    }
}

impl JobArgs {
    /// Whether a file of sums is asked for.
    pub fn names_sums(&self) -> bool {
        self.checkpoint.is_some() || self.shard.is_some()
    }

    /// What this run keeps, and which part of the job it does. `auto` reads the variables of an array job.
    ///
    /// # Errors
    /// [`Error::Usage`] when the value of --shard is wrong here, or `outputs` is not one part.
    pub fn keeping(&self, outputs: &[PathBuf]) -> Result<Keeping> {
        let shard = self.shard.as_deref().map(|text| Shard::parse(text, |name| std::env::var(name).ok())).transpose()?;
        let file = match shard {
            Some(shard) => Some(part_of(shard, self.shard.as_deref().is_some_and(|text| text.starts_with("auto")), outputs)?),
            None => self.checkpoint.clone(),
        };
        Ok(Keeping { shard, file, every: Duration::from_secs(self.checkpoint_every), resume: self.resume })
    }
}

/// The one output of a shard.
fn part_of(shard: Shard, automatic: bool, outputs: &[PathBuf]) -> Result<PathBuf> {
    let [output] = outputs else {
        return Err(Error::usage("a shard makes one part", "give one -o, a file ending in .part"));
    };
    if output.extension().is_none_or(|ending| ending != "part") {
        let problem = format!("{}: a shard makes a part, no result", output.display());
        return Err(Error::usage(problem, "give -o a file ending in .part; `finalgather merge` makes the result of all parts"));
    }
    let name = output.to_str().ok_or_else(|| Error::usage("the part's name is not UTF-8", "give another"))?;
    if automatic && !name.contains("{shard}") {
        return Err(Error::usage(
            format!("{name}: all tasks would write this file"),
            "put {shard}, which stands for the task's number, in the name",
        ));
    }
    Ok(name.replace("{shard}", &shard.number().to_string()).into())
}

impl Overrides {
    /// # Errors
    /// [`Error::Usage`] when a number is infinite or NaN. Requests are stored as JSON, which has no such numbers.
    pub fn scene(&self, path: &Path) -> Result<SceneRequest> {
        let stop_fraction = self.stop_fraction.map(f64::from);
        for (name, value) in [("stop-fraction", stop_fraction), ("target-error", self.target_error)] {
            if let Some(value) = value.filter(|value| !value.is_finite()) {
                return Err(Error::usage(format!("{name} is {value}"), "give a finite number"));
            }
        }
        let mut settings = match serde_json::to_value(self) {
            Ok(Value::Object(settings)) => settings,
            _ => unreachable!("options are plain values with names"),
        };
        settings.retain(|_, value| !value.is_null());
        let (environment, &Self { sun, sky, clay, .. }) = (self.env.clone(), self);
        self.view.choose(SceneRequest { environment, sun, sky, clay, settings, ..self.files.scene(path)? })
    }
}
