//! What can be asked on the command line. Whatever is not given stays `None`, so that the scene file can decide it.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Parser, Subcommand};
use finalgather::bake::RadianceCache;
use finalgather::bench::CONTESTANTS;
use finalgather::blocks::Shard;
use finalgather::environment::Environment;
use finalgather::error::Result;
use finalgather::gpu::{Backend, DeviceChoice};
use finalgather::harmonics::MAX_ORDER;
use finalgather::points::UvSource;
use finalgather::quantity::Quantity;
use finalgather::scene::{Files, LoadOptions, Scene};
use finalgather::settings::{Estimator, LayerSize, Pipeline, PointSource, Sequence, Settings};
use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::Error as ValueError;

const RENDER_EXAMPLES: &str = "\
Examples:
  finalgather render scenes/cornell.toml
      writes cornell.png in the current folder
  finalgather render scenes/cornell.toml -o out/cornell.png -o out/cornell.exr
      one render, two files: 8 bit to look at, linear floats with all channels
  finalgather render scenes/cornell.toml --size 128 --directions 64 --photons 1e5
      a quick look
  finalgather render scenes/cornell.toml --json | jq .gather.ms_per_direction";

const COMPARE_NOTES: &str = "\
Measures, over linear R, G and B alike:
  bias           (mean of A - mean of B) / mean of B
  MAE, RMSE      mean absolute error, root of the mean squared error
  relative RMSE  RMSE / mean of B
  relative MSE   mean of (A - B)² / (B² + 0.01)
  PSNR           20 log10(1 / RMSE): white of a PNG is the peak; infinite for equal pictures
  FLIP           mean difference, 0 to 1, that a person sees flipping between the PNGs
In JSON, what is infinite is null.

A PNG is made linear again but for its tone curve, which bends what is above 0.8: where
numbers matter, compare EXR with EXR.

Examples:
  finalgather compare box.exr reference.exr
  finalgather compare box.exr reference.exr --mask walls.png --trim 0.001 -o difference.png
      without the pixels that are black in walls.png and the worst 0.1 % of the others
  finalgather compare box.exr reference.exr --json | jq -e '.flip < 0.05'
      an exit code for scripts

Exit codes:
    0  done, however much the pictures differ
    2  the request cannot be met: an option out of range, an output path that cannot be written
   65  a picture is missing or damaged, does not match the other, or has a sample that is no number
   75  the map could not be written";

const BENCH_NOTES: &str = "\
All contestants gather at the same points (what the camera sees) along the same directions, in
turns, so that what else the machine does meets them alike; times are medians of the rounds.
  ends         how many ends of a direction count; own: each point has rays of its own
  ms/dir       milliseconds a direction, for all points
  ms/sample    milliseconds in which every point gets one ray that counts: twice ms/dir with one
               end, for half of the points face away from it
  Msamples/s   millions of rays that count, a second
  xFUSED       how many times as fast fused is, by ms/sample
  peel, gather the device's own time in these stages, ms a direction (timer queries, in a round
               apart); n/a where a driver tells no time, - for a contestant without stages
  wait, idle   shares of the wall-clock time: the CPU in waits for the device; the device in no
               stage. A software driver works while the CPU waits, on the same cores
  diff, bias   mean difference and bias of irradiance against exact rays along the same
               directions and ends: what layers approximate. Own rays have no such oracle
  RMSE         against exact rays along thousands of other directions: what so few rays leave,
               diff included. The one error that own rays share with the others
  offset       bias against these; of own rays, the error of their mean

Examples:
  finalgather bench
  finalgather bench scene.obj --size 1024 --directions 8 --pipelines fused,raycast
  finalgather bench --json | jq '.rows[] | {name, ms_per_sample}'

Exit codes:
    0  done
    2  the request cannot be met: an option out of range, no scene named and none there
   65  the scene cannot be used: a file is missing or says something wrong
   69  no OpenGL 3.3 here, or its driver failed
  130  stopped by SIGINT (Ctrl-C), 143 by SIGTERM, 129 by SIGHUP: nothing is printed";

#[cfg(feature = "window")]
const VIEW_NOTES: &str = "\
Examples:
  finalgather view
  finalgather view scene.toml --pipeline kill --directions 4000
  finalgather view --directions 64 --frames 1 --screenshot window.png
      unattended: the window once 64 directions are done, as a PNG

Exit codes:
    0  closed, or the screenshot is written
    2  the request cannot be met: an option out of range
   65  with --frames: the scene cannot be used
   69  no window system here, or no OpenGL 3.3
   75  the screenshot could not be written";

const BAKE_NOTES: &str = "\
Quantities, at a point with normal n, w = max(n.d, 0):
  irradiance   integral of L w, in all, from lights and environment themselves, and from surfaces
  ao           share of the w-weighted hemisphere that meets no surface within --ao-distance
  bent-normal  mean of the directions that ao counts as open, of unit length
  sky          share that leaves the scene
  sh           integral of L Y over the hemisphere, lights and all; Y: real orthonormal spherical
               harmonics without Condon-Shortley phase, coefficient l(l+1)+m
  prt          integral of (V w + reflected) Y / pi: radiosity over albedo under an environment of
               radiance Y, shadowed, and reflected by way of --bounces surfaces [default: 2]
  prt-unshadowed  the same with nothing around

Formats:
  vertices  .ply .npy .glb; a vertex for each normal where faces meet in an edge
  lightmap  .exr (all channels; R G B is irradiance) .png, and the model with it: .obj .glb
  camera    .exr .png, or its points: .ply .npy
  points    .ply .npy
  .npy has a .json beside it that says what the numbers are.

Points lie on fronts: the sides from which triangles wind counter-clockwise. Glass is left out.
Of the settings, --size is for camera only, and --interleave, --until and --estimator mean nothing here.

Examples:
  finalgather bake scenes/cornell.toml --to vertices --what irradiance,ao -o box.ply
  finalgather bake scenes/cornell.toml --to lightmap --what irradiance -o map.exr -o box.glb
  finalgather bake scene.obj --to vertices --what prt --order 3 --bounces 2 -o prt.npy
  finalgather relight prt.npy --env sky.hdr --scene scene.obj -o relit.png
  finalgather bake scenes/cornell.toml --to vertices --to lightmap --what ao,irradiance \\
      -o vertices:box.ply -o lightmap:map.exr

Exit codes:
    0  done
    2  the request cannot be met: an option out of range, an output path that cannot be written
   65  a scene or a file of points cannot be used: it is missing or says something wrong
   69  no OpenGL 3.3 here, or its driver failed
   75  a file could not be written; trying again, elsewhere or later, may succeed
  130  stopped by SIGINT (Ctrl-C), 143 by SIGTERM, 129 by SIGHUP: values so far were written, if each point had
       one; a second signal exits at once";

const MERGE_NOTES: &str = "\
Examples:
  for i in 1 2 3 4; do finalgather render scene.toml --shard $i/4 -o box-{shard}.part; done
  finalgather merge box-*.part -o box.png -o box.exr

Exit codes:
    0  done
    2  directions are missing, an output path cannot be written
   65  a file is no part, or damaged; it is of another job; it has what an earlier one has
   75  a file could not be written";

const RELIGHT_NOTES: &str = "\
What is written is irradiance, pi times what a white surface sends back; a picture shows the
scene's materials.

Examples:
  finalgather relight prt.npy --env sky.hdr -o light.npy
  finalgather relight prt.npy --env sky.hdr --scene scene.toml -o relit.png -o relit.ply

Exit codes:
    0  done
    2  the request cannot be met: an output path that cannot be written, or no --scene for it
   65  a file cannot be used, or the transfer is not of the scene's vertices
   75  a file could not be written";

const EXIT_CODES: &str = "\
Exit codes:
    0  done
    2  the request cannot be met: an option out of range, an output path that cannot be written
   65  a scene or a picture cannot be used: a file is missing or says something wrong
   69  no OpenGL 3.3 here, or its driver failed
   75  a picture could not be written; trying again, elsewhere or later, may succeed
  130  stopped by SIGINT (Ctrl-C), 143 by SIGTERM, 129 by SIGHUP: the picture so far was written if at least
       one direction was done; a second signal exits at once";

/// Final gathering by rasterised ray bundles: renders global illumination on OpenGL 3.3, headless
#[derive(Debug, Parser)]
#[command(version, after_help = format!("{RENDER_EXAMPLES}\n  finalgather compare box.exr reference.exr\n  finalgather bench\n  finalgather info\n\n{EXIT_CODES}"))]
pub struct Args {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    Render(RenderArgs),
    #[cfg(feature = "window")]
    View(ViewArgs),
    Compare(CompareArgs),
    Bake(BakeArgs),
    Relight(RelightArgs),
    Merge(MergeArgs),
    Bench(BenchArgs),
    Info(InfoArgs),
}

/// Render a scene to picture files
///
/// Settings come from these options, else from the scene file's [settings], else from the defaults shown here.
#[derive(Debug, clap::Args)]
#[command(after_help = format!("{RENDER_EXAMPLES}\n\n{EXIT_CODES}"), args_override_self = true, allow_negative_numbers = true)]
pub struct RenderArgs {
    /// Scene file: .toml, or a bare .obj with its .mtl
    pub scene: PathBuf,

    /// Picture to write, .png or .exr; may be given several times [default: the scene's name with .png, in the current folder]
    #[arg(short, long = "output", value_name = "FILE")]
    outputs: Vec<PathBuf>,

    /// Print one JSON object about the run on stdout
    #[arg(long)]
    pub json: bool,

    /// MiB that the render may take on the GL side and the CPU's together: one that would take more is refused at once. Not counted: layers beyond the first eight, caustics' photons, the checkpoint that --resume reads
    #[arg(long, value_name = "MIB", value_parser = count::<usize>)]
    pub memory: Option<usize>,

    #[command(flatten)]
    overrides: Overrides,

    #[command(flatten)]
    pub job: JobArgs,

    /// Where the OpenGL context comes from
    #[arg(long, default_value = "auto", value_parser = named_backend(), help_heading = "OpenGL")]
    pub backend: Backend,

    /// EGL device: auto, sw (a software renderer) or an index listed by `finalgather info`
    #[arg(long, default_value = "auto", value_name = "auto|sw|INDEX", help_heading = "OpenGL")]
    pub gl_device: DeviceChoice,
}

/// Bake vertices, light maps, pixels or points of a file: irradiance, openness, spherical harmonics, radiance transfer
///
/// One gather serves all receivers and all quantities. Settings come from these options, else from the scene file's [settings], else from the
/// defaults shown here.
#[derive(Debug, clap::Args)]
#[command(after_help = BAKE_NOTES, args_override_self = true, allow_negative_numbers = true)]
pub struct BakeArgs {
    /// Scene file: .toml, or a bare .obj with its .mtl
    pub scene: PathBuf,

    /// Where values are wanted: vertices, lightmap, camera (one point a pixel) or points:FILE (.ply, .npy or .csv, in world space); may be given several times
    #[arg(long, value_name = "RECEIVER", required = true)]
    pub to: Vec<To>,

    /// Quantities, by commas: irradiance, ao, bent-normal, sky, sh, prt, prt-unshadowed
    #[arg(long, value_name = "QUANTITY", required = true, value_delimiter = ',', value_parser = named::<Quantity>(&["irradiance", "ao", "bent-normal", "sky", "sh", "prt", "prt-unshadowed"]), hide_possible_values = true)]
    pub what: Vec<Quantity>,

    /// File to write, of several receivers with the receiver's name before it, as in vertices:box.ply; may be given several times. Formats by receiver are listed below
    #[arg(short, long = "output", value_name = "[RECEIVER:]FILE", required = true)]
    pub outputs: Vec<String>,

    /// Print one JSON object about the run on stdout
    #[arg(long)]
    pub json: bool,

    /// Bands of spherical harmonics, 1 to 5: N bands have N² coefficients
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = bands)]
    pub order: usize,

    /// Surfaces farther away leave a point open to ao and bent-normal, in the scene's units [default: none do]
    #[arg(long, value_name = "LENGTH")]
    pub ao_distance: Option<f32>,

    /// Where the light of surfaces comes from: traced photons, or earlier gathers at the scene's own vertices, --bounces of them
    #[arg(long, default_value = "photons", value_parser = named::<RadianceCache>(&["photons", "gathered"]))]
    pub rough: RadianceCache,

    /// Side of the light map in texels
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = count::<u32>, conflicts_with = "texels_per_unit", help_heading = "Light map")]
    pub resolution: u32,

    /// Texels along a unit of the scene, in place of --resolution
    #[arg(long, value_name = "F", value_parser = density, help_heading = "Light map")]
    pub texels_per_unit: Option<f32>,

    /// Texture coordinates: auto (the mesh's own where they serve, else an atlas), own or atlas
    #[arg(long, default_value = "auto", value_name = "auto|own|atlas", value_parser = uv_source(), hide_possible_values = true, help_heading = "Light map")]
    pub uvs: UvSource,

    /// Texels around each chart that repeat its edge
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = count::<u32>, help_heading = "Light map")]
    pub padding: u32,

    /// Points in a texel, a square number
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = square, help_heading = "Light map")]
    pub samples_per_texel: u32,

    /// MiB that all of it may take, on the GL side and on the CPU; points take turns where it is short, and what takes more in any case is refused.
    /// Without, points take turns by 1024 MiB, beside the scene and what all of them take on the CPU
    #[arg(long, value_name = "MIB", value_parser = count::<usize>)]
    pub memory: Option<usize>,

    #[command(flatten)]
    pub overrides: Overrides,

    #[command(flatten)]
    pub job: JobArgs,

    /// Where the OpenGL context comes from
    #[arg(long, default_value = "auto", value_parser = named_backend(), help_heading = "OpenGL")]
    pub backend: Backend,

    /// EGL device: auto, sw (a software renderer) or an index listed by `finalgather info`
    #[arg(long, default_value = "auto", value_name = "auto|sw|INDEX", help_heading = "OpenGL")]
    pub gl_device: DeviceChoice,
}

/// How a long job is kept, and dealt out.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Long jobs")]
pub struct JobArgs {
    /// Keep what is summed so far in this file, for --resume [default: the first output's name with .checkpoint, after two times --checkpoint-every, a minute; removed at the end]
    #[arg(long, value_name = "FILE", conflicts_with = "shard")]
    pub checkpoint: Option<PathBuf>,

    /// Seconds between two writes of the checkpoint, the next block of directions awaited; more where writing takes long; 0: after every block
    #[arg(long, value_name = "SECONDS", default_value_t = 30, value_parser = seconds)]
    pub checkpoint_every: u64,

    /// Go on from the checkpoint, or with --shard from its part, if there is one. Without --checkpoint, outputs stay as they are if all are finished ones of the same job and can tell (.exr, .npy, .ply)
    #[arg(long)]
    pub resume: bool,

    /// Do share I of N alone, counted from 1, and write it to the one -o, a .part (in whose name {shard} stands for I), for `finalgather merge`; auto: the task's of an
    /// array job of Slurm or AWS Batch; auto/N: of one that does not tell N, as Kubernetes and PBS
    #[arg(long, value_name = "I/N|auto|auto/N")]
    shard: Option<String>,
}

impl JobArgs {
    /// Which share it is, by what this process knows of an engine's.
    pub fn shard(&self) -> Result<Option<Shard>> {
        self.shard.as_deref().map(|text| Shard::parse(text, |name| std::env::var(name).ok())).transpose()
    }

    /// Whether an engine tells which share it is.
    pub fn is_automatic(&self) -> bool {
        self.shard.as_ref().is_some_and(|text| text.starts_with("auto"))
    }
}

/// Put the parts of a job together that ran in shards: the same bits as of one run
///
/// A picture needs nothing but the parts. A bake needs its scene and points again, found as its command named them from the folder that it ran in.
#[derive(Debug, clap::Args)]
#[command(after_help = MERGE_NOTES, args_override_self = true, allow_negative_numbers = true)]
pub struct MergeArgs {
    /// Parts of all shards, in any order; a finished --checkpoint is one too
    #[arg(value_name = "PART", required = true)]
    pub parts: Vec<PathBuf>,

    /// File to write, as the job itself would have; may be given several times
    #[arg(short, long = "output", value_name = "[RECEIVER:]FILE", required = true)]
    pub outputs: Vec<String>,

    /// Exposure of .png in stops [default: the job's]
    #[arg(long, value_name = "EV", value_parser = stops)]
    pub exposure: Option<f32>,
}

/// A receiver, as `--to` names it.
#[derive(Clone, Debug, PartialEq)]
pub enum To {
    Vertices,
    LightMap,
    Camera,
    Points(PathBuf),
}

impl To {
    pub const VERTICES: &'static str = "vertices";
    pub const LIGHT_MAP: &'static str = "lightmap";
    pub const CAMERA: &'static str = "camera";
    pub const POINTS: &'static str = "points";
    pub const NAMES: [&'static str; 4] = [Self::VERTICES, Self::LIGHT_MAP, Self::CAMERA, Self::POINTS];

    pub fn name(&self) -> &'static str {
        match self {
            Self::Vertices => Self::VERTICES,
            Self::LightMap => Self::LIGHT_MAP,
            Self::Camera => Self::CAMERA,
            Self::Points(_) => Self::POINTS,
        }
    }
}

impl FromStr for To {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.split_once(':')) {
            (Self::VERTICES, _) => Ok(Self::Vertices),
            (Self::LIGHT_MAP, _) => Ok(Self::LightMap),
            (Self::CAMERA, _) => Ok(Self::Camera),
            (_, Some((Self::POINTS, path))) if !path.is_empty() => Ok(Self::Points(path.into())),
            _ => Err("give vertices, lightmap, camera or points:FILE".to_owned()),
        }
    }
}

/// Turn baked radiance transfer into light under an environment
#[derive(Debug, clap::Args)]
#[command(after_help = RELIGHT_NOTES, allow_negative_numbers = true)]
pub struct RelightArgs {
    /// Transfer: a .npy of `finalgather bake --what prt`, with its .json beside it
    pub transfer: PathBuf,

    /// Lat-long picture of the environment, .hdr or .exr
    #[arg(long, value_name = "FILE")]
    pub env: PathBuf,

    /// File to write: .npy (irradiance of each point); with --scene also .ply and .glb (its vertices), .png and .exr (a picture); may be given several times
    #[arg(short, long = "output", value_name = "FILE", required = true)]
    pub outputs: Vec<PathBuf>,

    /// Scene whose vertices the transfer was baked at
    #[arg(long, value_name = "SCENE")]
    pub scene: Option<PathBuf>,

    #[command(flatten)]
    pub files: FilesArg,

    /// Picture size in pixels; N is N by N [default: the scene's]
    #[arg(long, value_name = "WxH|N", value_parser = size)]
    pub size: Option<[u32; 2]>,

    /// Exposure of colours and .png in stops
    #[arg(long, value_name = "EV", default_value_t = 0.0, value_parser = stops)]
    pub exposure: f32,
}

/// What the command line says over the scene file's settings.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Settings")]
pub struct Overrides {
    #[arg(long, value_name = "WxH|N", value_parser = size, help = setting("Picture size in pixels; N is N by N", |s| format!("{}x{}", s.size[0], s.size[1])))]
    size: Option<[u32; 2]>,

    #[arg(long, value_name = "N", value_parser = count::<u32>, help = setting("Global directions, each shared by all points", |s| s.directions))]
    directions: Option<u32>,

    #[arg(long, value_name = "auto|N", value_parser = layer_size, help = setting("Side of the depth layers in texels; auto: what so many directions are worth, 128 for up to a thousand, 256 for four thousand, 1024 at most", |s| s.layer_size))]
    layer_size: Option<LayerSize>,

    #[arg(long, value_parser = named::<PointSource>(&["camera", "traced"]), help = setting("Where the points come from: rasterised, or by rays through mirrors, glass and the camera's lens", |s| name(s.points)))]
    points: Option<PointSource>,

    #[arg(long, value_parser = named::<Pipeline>(&["fused", "kill", "early-kill", "raycast", "raycast-gl"]), help = setting("How the gather is computed: in one pass for both ends of several directions, by the method of 2004, the same with early KILL, by exact rays on the CPU, or by exact rays on the GL side, again for both ends", |s| name(s.pipeline)))]
    pipeline: Option<Pipeline>,

    #[arg(long, value_name = "N", value_parser = count::<u64>, help = setting("Photons emitted from the lights, afresh for every 1024 directions; 1e6 and 1_000_000 are numbers too", |s| s.photons))]
    photons: Option<u64>,

    #[arg(long, value_name = "N", value_parser = count::<u32>, help = setting("The most surfaces that one photon is stored at", |s| s.bounces))]
    pub bounces: Option<u32>,

    #[arg(long, value_parser = named::<Estimator>(&["self-normalised", "plain"]), help = setting("How radiance along directions makes an irradiance: over the sum of its weights, or over their expected sum", |s| name(s.estimator)))]
    estimator: Option<Estimator>,

    #[arg(long, value_parser = named::<Sequence>(&["random", "r2", "sobol"]), help = setting("Where directions come from", |s| name(s.sequence)))]
    sequence: Option<Sequence>,

    #[arg(long, value_name = "1|2|4", help = setting("In squares of N by N pixels, each gathers along its own share of the directions, and what they find is shared", |s| s.interleave))]
    interleave: Option<u32>,

    #[arg(long, value_name = "N", value_parser = count::<u64>, help = setting("Seed of everything random", |s| s.seed))]
    seed: Option<u64>,

    #[arg(long, value_name = "F", help = setting("A direction ends with the layer that fewer than this share of the points sample", |s| s.stop_fraction))]
    stop_fraction: Option<f32>,

    #[arg(long, value_name = "ERROR", help = setting("Stop early once the picture's relative standard error, estimated a few times on the way, is at most this, and let layers of `auto` be as large as that asks for; 0 is never", |s| s.until))]
    until: Option<f64>,

    #[arg(long, value_name = "EV", help = setting("Exposure of .png in stops", |s| s.exposure))]
    pub exposure: Option<f32>,

    /// Environment, a lat-long .hdr or .exr: what lies beyond the scene and lights it [default: the scene file's, else black]
    #[arg(long, value_name = "FILE")]
    pub env: Option<PathBuf>,

    #[command(flatten)]
    files: FilesArg,
}

/// What a scene may read.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct FilesArg {
    /// Read what the scene names also outside its folder; without, that is refused
    #[arg(long)]
    allow_outside: bool,
}

/// Open a window on a scene: the picture as it gathers, a camera to move, the layers of a direction to look at
///
/// The same renderer as `render`, with its settings; F1 in the window lists keys.
#[cfg(feature = "window")]
#[derive(Debug, clap::Args)]
#[command(after_help = VIEW_NOTES, args_override_self = true, allow_negative_numbers = true)]
pub struct ViewArgs {
    /// Scene file: .toml, or a bare .obj with its .mtl [default: the Cornell box]
    pub scene: Option<PathBuf>,

    /// Inner size of the window in points; N is N by N [default: room for the panel and a picture of --size, or 512x512 without]
    #[arg(long, value_name = "WxH|N", value_parser = size)]
    pub window: Option<[u32; 2]>,

    /// Pixels of a point, on screens of many small pixels [default: what the system says]
    #[arg(long, value_name = "FACTOR", value_parser = factor)]
    pub scale: Option<f32>,

    /// Begin in the layer view
    #[arg(long)]
    pub layers: bool,

    /// Prefer GLX to EGL, on X11
    #[arg(long)]
    pub glx: bool,

    /// Once all directions are done, draw so many frames, write --screenshot and end
    #[arg(long, value_name = "N", value_parser = count::<u32>)]
    pub frames: Option<u32>,

    /// Where --frames writes the window as PNG
    #[arg(long, value_name = "FILE", requires = "frames")]
    pub screenshot: Option<PathBuf>,

    /// Print one JSON object at the end: how fast the window drew and answered from the first picture on, in milliseconds
    #[arg(long)]
    pub json: bool,

    /// Read shaders from this folder, laid out as glsl/, and again when a file there changes
    #[arg(long, value_name = "FOLDER", hide_short_help = true)]
    pub shaders: Option<PathBuf>,

    #[command(flatten)]
    pub overrides: Overrides,

    /// Where the renderer's OpenGL context comes from
    #[arg(long, default_value = "auto", value_parser = named_backend(), help_heading = "OpenGL")]
    pub backend: Backend,

    /// EGL device of the renderer: auto, sw (a software renderer) or an index listed by `finalgather info`
    #[arg(long, default_value = "auto", value_name = "auto|sw|INDEX", help_heading = "OpenGL")]
    pub gl_device: DeviceChoice,
}

/// Compare a picture with a reference: mean, bias, MAE, RMSE, relative MSE, PSNR, FLIP
#[derive(Debug, clap::Args)]
#[command(after_help = COMPARE_NOTES, args_override_self = true, allow_negative_numbers = true)]
pub struct CompareArgs {
    /// Picture to judge, .png or .exr
    #[arg(value_name = "A")]
    pub picture: PathBuf,

    /// Reference, .png or .exr, of the same size
    #[arg(value_name = "B")]
    pub reference: PathBuf,

    /// Count only the pixels where this picture is white: its R, or without one its first channel, is above 0.5
    #[arg(long, value_name = "M")]
    pub mask: Option<PathBuf>,

    /// Leave out this share of the counted pixels, those with the largest squared error
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = share)]
    pub trim: f32,

    /// Exposure in stops of what FLIP gets to see
    #[arg(long, value_name = "EV", default_value_t = 0.0, value_parser = stops)]
    pub exposure: f32,

    /// Print one JSON object on stdout
    #[arg(long)]
    pub json: bool,

    /// Map of the differences to write, grey or 0 where pixels do not count; may be given several times. A .png shows FLIP, from black over
    /// purple and orange to pale yellow; an .exr holds A - B as R, G and B, and FLIP
    #[arg(short, long = "output", value_name = "FILE")]
    pub outputs: Vec<PathBuf>,
}

/// Measure all pipelines, and rays on the CPU, side by side: time, where it goes, and error
#[derive(Debug, clap::Args)]
#[command(after_help = BENCH_NOTES, args_override_self = true)]
pub struct BenchArgs {
    /// Scene file: .toml, or a bare .obj with its .mtl [default: scenes/cornell.toml, where there is one]
    pub scene: Option<PathBuf>,

    #[command(flatten)]
    pub files: FilesArg,

    /// Picture size in pixels; N is N by N
    #[arg(long, value_name = "WxH|N", default_value = "512", value_parser = size)]
    pub size: [u32; 2],

    /// Directions of a round
    #[arg(long, value_name = "N", default_value = "32", value_parser = count::<u32>)]
    pub directions: u32,

    /// Rounds, in each of which every contestant has its turn
    #[arg(long, value_name = "N", default_value = "5", value_parser = count::<u32>)]
    pub rounds: u32,

    /// Side of the depth layers in texels, or what a render of the scene would have [default: the scene file's, else auto]
    #[arg(long, value_name = "auto|N", value_parser = layer_size)]
    pub layer_size: Option<LayerSize>,

    /// Photons emitted from the lights [default: the scene file's, else 1000000]
    #[arg(long, value_name = "N", value_parser = count::<u64>)]
    pub photons: Option<u64>,

    /// Measure these alone, with commas between
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = contestants())]
    pub pipelines: Vec<String>,

    /// Print one JSON object on stdout
    #[arg(long)]
    pub json: bool,

    /// Where the OpenGL context comes from
    #[arg(long, default_value = "auto", value_parser = named_backend(), help_heading = "OpenGL")]
    pub backend: Backend,

    /// EGL device: auto, sw (a software renderer) or an index listed by `finalgather info`
    #[arg(long, default_value = "auto", value_name = "auto|sw|INDEX", help_heading = "OpenGL")]
    pub gl_device: DeviceChoice,
}

/// Show which OpenGL there is: backends that work, devices, renderer, limits
#[derive(Debug, clap::Args)]
pub struct InfoArgs {
    /// Print one JSON object on stdout
    #[arg(long)]
    pub json: bool,
}

impl RenderArgs {
    /// The files to write, at least one.
    pub fn outputs(&self) -> Vec<PathBuf> {
        match self.scene.file_stem() {
            Some(stem) if self.outputs.is_empty() => {
                // Appended, because the name may have further dots.
                let mut name = stem.to_owned();
                name.push(".png");
                vec![name.into()]
            }
            _ => self.outputs.clone(),
        }
    }

    pub fn load_scene(&self) -> Result<Scene> {
        self.overrides.load_scene(&self.scene)
    }

    /// The environment in place of the scene's.
    pub fn env(&self) -> Option<&Path> {
        self.overrides.env.as_deref()
    }

    pub fn override_settings(&self, settings: Settings) -> Settings {
        self.overrides.put_over(settings)
    }
}

impl BakeArgs {
    /// The files to write, without the names of receivers.
    pub fn paths(&self) -> Vec<PathBuf> {
        let path = |output: &String| {
            let of = |to: &To| output.strip_prefix(to.name())?.strip_prefix(':');
            self.to.iter().find_map(of).unwrap_or(output).into()
        };
        self.outputs.iter().map(path).collect()
    }
}

impl FilesArg {
    pub fn files(self) -> Files {
        if self.allow_outside { Files::Anywhere } else { Files::Folder }
    }
}

impl Overrides {
    /// Under the environment that was asked for here, or its own.
    pub fn load_scene(&self, path: &Path) -> Result<Scene> {
        Scene::load_with(path, self.load_options()?)
    }

    pub fn load_options(&self) -> Result<LoadOptions> {
        let environment = self.env.as_deref().map(Environment::load).transpose()?;
        Ok(LoadOptions { environment, files: self.files.files(), ..LoadOptions::default() })
    }

    /// `settings` with what was asked for here put over it.
    pub fn put_over(&self, mut settings: Settings) -> Settings {
        fn put<T: Copy>(target: &mut T, source: Option<T>) {
            if let Some(value) = source {
                *target = value;
            }
        }
        put(&mut settings.size, self.size);
        put(&mut settings.directions, self.directions);
        put(&mut settings.layer_size, self.layer_size);
        put(&mut settings.points, self.points);
        put(&mut settings.pipeline, self.pipeline);
        put(&mut settings.photons, self.photons);
        put(&mut settings.bounces, self.bounces);
        put(&mut settings.estimator, self.estimator);
        put(&mut settings.sequence, self.sequence);
        put(&mut settings.interleave, self.interleave);
        put(&mut settings.seed, self.seed);
        put(&mut settings.stop_fraction, self.stop_fraction);
        put(&mut settings.until, self.until);
        put(&mut settings.exposure, self.exposure);
        settings
    }
}

/// Help for an option that overrides a setting, with the default that the library gives it.
fn setting<T: Display>(text: &str, default: impl Fn(Settings) -> T) -> String {
    format!("{text} [default: {}]", default(Settings::default()))
}

/// The name that a scene file uses for this value.
fn name(value: impl serde::Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}

/// Bands of spherical harmonics.
fn bands(text: &str) -> Result<usize, String> {
    text.parse()
        .ok()
        .filter(|order| (1..=MAX_ORDER).contains(order))
        .ok_or(format!("not a number of bands from 1 to {MAX_ORDER}"))
}

fn square(text: &str) -> Result<u32, String> {
    let number = text.parse().ok().filter(|&number: &u32| number > 0 && number.isqrt().pow(2) == number);
    number.ok_or("not a square number such as 1, 4 or 9".to_owned())
}

fn uv_source() -> impl TypedValueParser<Value = UvSource> {
    PossibleValuesParser::new(["auto", "own", "atlas"]).map(|name| match name.as_str() {
        "own" => UvSource::Own,
        "atlas" => UvSource::Atlas,
        _ => UvSource::Auto,
    })
}

/// Parses one of these names as a scene file would.
fn named<T>(names: &'static [&'static str]) -> impl TypedValueParser<Value = T>
where
    T: for<'de> Deserialize<'de> + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(names).try_map(|name| -> Result<T, ValueError> { T::deserialize(name.into_deserializer()) })
}

fn contestants() -> PossibleValuesParser {
    PossibleValuesParser::new(CONTESTANTS.iter().map(|contestant| PossibleValue::new(contestant.name).help(contestant.about)))
}

fn named_backend() -> impl TypedValueParser<Value = Backend> {
    PossibleValuesParser::new(["auto", "egl", "osmesa"]).try_map(|name| name.parse::<Backend>())
}

/// A whole number: digits, grouped by `_` or not, or in the notation of floats (`1e6`).
fn count<T: TryFrom<u64>>(text: &str) -> Result<T, String> {
    /// The first float with a neighbour that is not 1 away, 2^53: from there a float may not be the number that was meant.
    const INEXACT: f64 = 9_007_199_254_740_992.0;
    // Between digits.
    let digits = if text.starts_with('_') || text.ends_with('_') { String::new() } else { text.replace('_', "") };
    let number = digits.parse::<u64>().ok().or_else(|| {
        let float = digits.parse::<f64>().ok()?;
        ((0.0..INEXACT).contains(&float) && float.fract() == 0.0).then_some(float as u64)
    });
    let number = number.ok_or_else(|| match digits.parse::<f64>() {
        Ok(float) if float < 0.0 => "negative",
        Ok(float) if float >= INEXACT => "too large",
        _ => "not a whole number such as 1000, 1_000 or 1e3",
    })?;
    T::try_from(number).map_err(|_| "too large".into())
}

fn seconds(text: &str) -> Result<u64, String> {
    count(text).ok().filter(|&seconds| seconds <= 86_400).ok_or("not whole seconds, 86400 at most".into())
}

fn density(text: &str) -> Result<f32, String> {
    text.parse().ok().filter(|texels: &f32| *texels > 0.0 && texels.is_finite()).ok_or("not a number above 0".into())
}

fn layer_size(text: &str) -> Result<LayerSize, String> {
    if text == "auto" {
        Ok(LayerSize::Auto)
    } else {
        count(text).map(LayerSize::Texels).map_err(|error| format!("{error}, nor auto"))
    }
}

/// What can be left out without leaving nothing.
fn share(text: &str) -> Result<f32, String> {
    let share = text.parse().ok().filter(|share| (0.0..1.0).contains(share));
    share.ok_or("not a share from 0 up to, not including, 1".into())
}

/// Of a size, far from where numbers or windows end.
#[cfg(feature = "window")]
fn factor(text: &str) -> Result<f32, String> {
    text.parse().ok().filter(|factor| (0.25..=8.0).contains(factor)).ok_or("not a factor from 0.25 to 8".into())
}

fn stops(text: &str) -> Result<f32, String> {
    text.parse().ok().filter(|stops: &f32| stops.is_finite()).ok_or("not a number of stops such as -1.5".into())
}

/// `WxH`, or `N` for a square.
fn size(text: &str) -> Result<[u32; 2], String> {
    let (width, height) = text.split_once(['x', 'X']).unwrap_or((text, text));
    let side = |side: &str| count(side).map_err(|_| format!("{side:?} is not a number of pixels; give 640x480 or 512"));
    Ok([side(width)?, side(height)?])
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn clap_accepts_the_definition() {
        Args::command().debug_assert();
    }

    #[test]
    fn counts() {
        for (text, number) in [("0", 0), ("1e6", 1_000_000), ("1_000_000", 1_000_000), ("2.5E2", 250)] {
            assert_eq!(count::<u64>(text), Ok(number), "{text}");
        }
        assert_eq!(count::<u64>("18446744073709551615"), Ok(u64::MAX));
        for text in ["", "_", "-1", "1.5", "1e40", "nan", "inf", "ten"] {
            assert!(count::<u64>(text).is_err(), "{text}");
        }
        assert_eq!(count::<u32>("5e9"), Err("too large".into()));
    }

    #[test]
    fn sizes() {
        assert_eq!(size("64"), Ok([64, 64]));
        assert_eq!(size("640x480"), Ok([640, 480]));
        for text in ["", "x", "640x", "640x480x3", "-1x5"] {
            assert!(size(text).is_err(), "{text}");
        }
    }

    fn parse(line: &str) -> RenderArgs {
        match Args::try_parse_from(line.split(' ')).unwrap().command {
            Command::Render(args) => args,
            _ => panic!("not a render"),
        }
    }

    /// Every option overrides its own setting, and only that.
    #[test]
    fn options_override_settings() {
        let scene = Settings { grid_cells: 7, seed: 3, ..Settings::default() };
        assert_eq!(parse("finalgather render a.toml").override_settings(scene.clone()), scene);
        let all = "finalgather render a.toml --size 3x4 --directions 5 --layer-size 6 --points traced --pipeline raycast-gl --photons 1e2 \
                   --bounces 8 --estimator plain --sequence sobol --interleave 4 --seed 9 --stop-fraction 0.5 --until 0.25 --exposure -1.5";
        let expected = Settings {
            size: [3, 4],
            directions: 5,
            layer_size: LayerSize::Texels(6),
            points: PointSource::Traced,
            pipeline: Pipeline::RaycastGl,
            photons: 100,
            bounces: 8,
            estimator: Estimator::Plain,
            sequence: Sequence::Sobol,
            interleave: 4,
            seed: 9,
            stop_fraction: 0.5,
            until: 0.25,
            exposure: -1.5,
            ..scene.clone()
        };
        assert_eq!(parse(all).override_settings(scene), expected);
    }

    #[test]
    fn output_beside_the_caller_by_default() {
        assert_eq!(parse("finalgather render scenes/box.2.toml").outputs(), [PathBuf::from("box.2.png")]);
        let two = parse("finalgather render a.toml -o b.png --output c.exr").outputs();
        assert_eq!(two, [PathBuf::from("b.png"), PathBuf::from("c.exr")]);
    }

    /// As in scripts that pass further arguments on.
    #[test]
    fn the_last_of_an_option_counts() {
        let twice = parse("finalgather render a.toml --seed 1 --seed 2");
        assert_eq!(twice.override_settings(Settings::default()).seed, 2);
    }
}
