//! `finalgather bake`: computes values at the points of receivers.

use std::path::{Path, PathBuf};

use finalgather::bake::{Plan, RadianceCache};
use finalgather::error::{Error, Result};
use finalgather::harmonics::MAX_ORDER;
use finalgather::job::{BakeRequest, Job, JobRequest, Per, ReceiverKind, Work, outputs_of};
use finalgather::points::{LightMapOptions, Resolution, UvSource};
use finalgather::quantity::Quantity;
use finalgather::settings::PhotonMapKind;
use serde::Deserialize;

use crate::args::{DeviceArgs, JobArgs, Overrides, checked, choose_photon_map, count, named, side};
use crate::streams::{STREAM, ToStdout};
use crate::{report, terminal};

/// Texels along a side of a light map, where nothing else is said.
pub const LIGHT_MAP_SIDE: u32 = 512;

/// Options of pictures that bakes accept, each with the reason why it does nothing.
const OF_PICTURES: [(&str, &str); 7] = [
    ("size", "it is for --to camera; a light map has --resolution"),
    ("background", "it is for the light of --to camera"),
    ("ground", "only a render has it"),
    ("points", "points of --to camera are rasterised"),
    ("interleave", "every point gathers along every direction"),
    ("estimator", "each quantity has its own"),
    ("target_error", "a bake takes all directions"),
];

/// Bake vertices, light maps, pixels or points of a file: irradiance, openness, spherical harmonics, radiance transfer
///
/// One gather serves all receivers and all quantities. Settings come from these options, else from [settings] in the scene file, else from the
/// defaults shown here.
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/bake.txt"), args_override_self = true, allow_negative_numbers = true)]
#[command(mut_args(|arg| if OF_PICTURES.iter().any(|(key, _)| arg.get_id() == *key && !["size", "background"].contains(key)) { arg.hide(true) } else { arg }))]
pub struct BakeArgs {
    /// Scene file (.toml) or model (.obj with its .mtl, .glb, .gltf, .ply, .stl). - is stdin
    scene: PathBuf,

    /// Where to bake: vertices, lightmap, camera (one point in each pixel) or points:FILE (.ply, .npy or .csv, in world space); can be given several times
    #[arg(long, value_name = "RECEIVER", required = true)]
    to: Vec<ReceiverKind>,

    /// Quantities, separated by commas: irradiance, ao, bent-normal, sky, sh, prt, prt-unshadowed
    #[arg(long, value_name = "QUANTITY", default_value = "irradiance", value_delimiter = ',', value_parser = named::<Quantity>(&["irradiance", "ao", "bent-normal", "sky", "sh", "prt", "prt-unshadowed"]), hide_possible_values = true)]
    what: Vec<Quantity>,

    /// File to write; can be given several times. With several receivers, put the receiver's name before it, as in vertices:box.ply. ENDING:-, as in ply:-, is stdout. The formats of each receiver are listed below
    #[arg(short, long = "output", value_name = "[RECEIVER:]FILE", required = true)]
    outputs: Vec<String>,

    /// Rows of --to vertices. row: one for each normal at a vertex, with a map to the vertices of the model's file. source: one for each vertex of the
    /// file, in its order, also for those that no triangle uses: their values are NaN
    #[arg(long, default_value = "row", value_parser = named::<Per>(&["row", "source"]))]
    per: Per,

    /// Print one JSON object about the run on stdout
    #[arg(long)]
    json: bool,

    /// Bands of spherical harmonics, 1 to 5. N bands have N² coefficients
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = bands)]
    order: usize,

    /// ao and bent-normal ignore surfaces farther away than this, in the scene's units [default: they count all surfaces]
    #[arg(long, value_name = "LENGTH")]
    ao_distance: Option<f32>,

    /// Where the light of surfaces comes from. photons: the photon map, on surfaces unless the scene file has photon_map = "grid". surface, grid: that photon map. gathered: earlier gathers at
    /// the vertices of the scene, one for each of --gather-bounces
    #[arg(long, alias = "rough", default_value = "photons", value_parser = named::<RadianceChoice>(&["photons", "surface", "grid", "gathered"]))]
    radiance_cache: RadianceChoice,

    /// How many surfaces may reflect light on its way to a point. For prt and for --radiance-cache gathered; photons have --photon-depth [default: 2]
    #[arg(long, alias = "bounces", value_name = "N", value_parser = count::<u32>)]
    gather_bounces: Option<u32>,

    /// Side of the light map in texels
    #[arg(long, value_name = "N", default_value_t = LIGHT_MAP_SIDE, value_parser = side, conflicts_with = "texels_per_unit", help_heading = "Light map")]
    resolution: u32,

    /// Texels along one unit of the scene, instead of --resolution
    #[arg(long, value_name = "F", value_parser = density, help_heading = "Light map")]
    texels_per_unit: Option<f32>,

    /// Texture coordinates. own: the mesh's. atlas: new ones. auto: the mesh's if they cover it once within 0 to 1, else new ones
    #[arg(long, default_value = "auto", value_name = "auto|own|atlas", value_parser = named::<UvSource>(&["auto", "own", "atlas"]), hide_possible_values = true, help_heading = "Light map")]
    uvs: UvSource,

    /// Texels around each chart that repeat its edge
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = count::<u32>, help_heading = "Light map")]
    padding: u32,

    /// Points in a texel, a square number
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = square, help_heading = "Light map")]
    samples_per_texel: u32,

    /// MiB that the bake may take, on the GL side and on the CPU together. It gathers fewer points at a time to fit. If that is not enough, it is refused.
    /// Without this option, points and their sums take up to 1024 MiB on the GL side at a time
    #[arg(long, value_name = "MIB", value_parser = count::<usize>)]
    memory: Option<usize>,

    #[command(flatten)]
    overrides: Overrides,

    #[command(flatten)]
    job: JobArgs,

    #[command(flatten)]
    device: DeviceArgs,
}

/// The values of --radiance-cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum RadianceChoice {
    Photons,
    Surface,
    Grid,
    Gathered,
}

/// Returns the exit code.
pub fn run(mut args: BakeArgs) -> Result<u8> {
    if args.scene == Path::new(STREAM) && args.job.names_sums() {
        let cure = "give the file of the scene";
        return Err(Error::usage("the sums of a bake name the file of its scene, and stdin has none", cure));
    }
    // Before there is anything to leave behind, because stdin may never end.
    let scene = args.overrides.scene(&args.scene)?;
    let stdout = ToStdout::of(&mut args.outputs, None, args.json)?;
    let BakeArgs { to: receivers, order, gather_bounces, ao_distance, radiance_cache, uvs, padding, samples_per_texel, .. } =
        args;
    // The part of a shard may have the name of a receiver before it, as a result has.
    let path = |output: &String| match output.split_once(':') {
        Some((name, path)) if receivers.iter().any(|receiver| receiver.name() == name) => path.into(),
        _ => PathBuf::from(output),
    };
    let mut keeping = args.job.keeping(&args.outputs.iter().map(path).collect::<Vec<_>>())?;
    if stdout.is_some() {
        ToStdout::keep(&mut keeping)?;
    }
    let is_shard = keeping.shard.is_some();
    let outputs = if is_shard { vec![Vec::new(); receivers.len()] } else { outputs_of(&receivers, &args.outputs)? };
    // Removes repeated quantities.
    let what = args.what.iter().enumerate().filter(|(index, quantity)| !args.what[..*index].contains(quantity));
    let what = what.map(|(_, quantity)| *quantity).collect();
    let (radiance_cache, map) = match radiance_cache {
        RadianceChoice::Photons => (RadianceCache::Photons, None),
        RadianceChoice::Surface => (RadianceCache::Photons, Some(PhotonMapKind::Surface)),
        RadianceChoice::Grid => (RadianceCache::Photons, Some(PhotonMapKind::Grid)),
        RadianceChoice::Gathered => (RadianceCache::Vertices, None),
    };
    if gather_bounces.is_some() && radiance_cache == RadianceCache::Photons && !args.what.contains(&Quantity::Prt) {
        report::say("warning: --gather-bounces has no effect here; the depth of photons is --photon-depth");
    }
    let gather_bounces = gather_bounces.unwrap_or(2);
    if args.per == Per::Source && !receivers.contains(&ReceiverKind::Vertices) {
        report::say("warning: --per has no effect here; it is for --to vertices");
    }
    if args.overrides.view.is_given() && !receivers.contains(&ReceiverKind::Camera) {
        report::say("warning: --eye, --target, --fov and --up have no effect here; they are for --to camera");
    }
    let plan = Plan { what, order, gather_bounces, ao_distance, radiance_cache, memory: Plan::MEMORY };
    let resolution = args.texels_per_unit.map_or(Resolution::Pixels(args.resolution), Resolution::TexelsPerUnit);
    let light_map = LightMapOptions { resolution, uvs, padding, samples_per_texel };
    let (scene, device) = (choose_photon_map(scene, map), args.device.request());
    let has_pixels = receivers.contains(&ReceiverKind::Camera);
    let works = |key: &str| match key {
        "size" => has_pixels,
        "background" => has_pixels && args.what.contains(&Quantity::Irradiance),
        _ => false,
    };
    let without = OF_PICTURES.iter().filter(|(key, _)| scene.settings.contains_key(*key) && !works(key));
    without.for_each(|(key, reason)| {
        report::say(&format!("warning: --{} has no effect here: {reason}", key.replace('_', "-")));
    });
    let work = Work::Bake(BakeRequest { receivers, plan, light_map, per: args.per });
    let request = JobRequest { scene, work, outputs, memory: args.memory, time: None, device };
    terminal::run(Job::new(request, &keeping)?, args.json, stdout)
}

fn bands(text: &str) -> Result<usize, String> {
    checked(text, |order| (1..=MAX_ORDER).contains(order), &format!("not a number of bands from 1 to {MAX_ORDER}"))
}

fn square(text: &str) -> Result<u32, String> {
    checked(text, |&number: &u32| number > 0 && number.isqrt().pow(2) == number, "not a square number such as 1, 4 or 9")
}

fn density(text: &str) -> Result<f32, String> {
    checked(text, |texels: &f32| *texels > 0.0 && texels.is_finite(), "not a number above 0")
}
