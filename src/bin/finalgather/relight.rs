//! `finalgather relight`: computes light from transfer and environment, as numbers, on the model or as a picture.

use std::path::{Path, PathBuf};
use std::time::Instant;

use finalgather::error::{Error, Result};
use finalgather::export::{self, ExportMesh, ExportSource, PointValues, Positions, read_prt};
use finalgather::image::{self, Channel, WriteOptions};
use finalgather::job::{ReportHead, SceneRequest, TotalSeconds, check_kept};
use finalgather::relight::{RelitModel, irradiance};
use finalgather::scene::{Environment, Loaded};
use finalgather::settings::{Exposure, Settings};
use glam::{DVec3, Vec3};
use serde::Serialize;

use crate::args::{SceneArgs, size, stops};
use crate::report;

const CURE: &str = "give the scene that it was baked of, with --to vertices and --per row";

/// Turn baked radiance transfer into light under an environment
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/relight.txt"), allow_negative_numbers = true)]
pub struct RelightArgs {
    /// Transfer: a .npy of `finalgather bake --what prt`, with its .json beside it, or a .npz
    transfer: PathBuf,

    /// Lat-long picture of the environment, .hdr or .exr
    #[arg(long, value_name = "FILE")]
    env: PathBuf,

    /// File to write: .npy or .npz (irradiance of each point) or, with --scene, .ply and .glb (its vertices), .png and .exr (a picture); can be given several times
    #[arg(short, long = "output", value_name = "FILE", required = true)]
    outputs: Vec<PathBuf>,

    /// Scene whose vertices the transfer was baked at
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,

    #[command(flatten)]
    files: SceneArgs,

    /// Picture size in pixels; N is N by N [default: the scene's]
    #[arg(long, value_name = "WxH|N", value_parser = size)]
    size: Option<[u32; 2]>,

    /// Exposure of colours and .png in stops
    #[arg(long, value_name = "EV", default_value_t = 0.0, value_parser = stops)]
    exposure: f32,

    /// Print one JSON object about the run on stdout
    #[arg(long)]
    json: bool,
}

/// The scene that was baked.
struct Baked {
    loaded: Loaded,
    model: RelitModel,
}

/// What a relighting did.
#[derive(Serialize)]
struct RelightReport {
    #[serde(flatten)]
    head: ReportHead,
    points: usize,
    seconds: TotalSeconds,
}

/// Returns the exit code.
pub fn run(args: &RelightArgs) -> Result<u8> {
    let started = Instant::now();
    for path in &args.outputs {
        match ending(path) {
            "png" | "exr" => image::check_writable(path)?,
            _ => export::check_writable(path, &["npy", "npz", "ply", "glb", "png", "exr"])?,
        }
        if !["npy", "npz"].contains(&ending(path)) && args.scene.is_none() {
            return Err(Error::usage(
                format!("{}: what the points lie on is not known", path.display()),
                "name the scene that was baked, --scene, or write .npy",
            ));
        }
    }
    check_kept(&args.outputs, [&args.transfer, &args.env].into_iter().chain(&args.scene).map(PathBuf::as_path))?;
    let transfer = read_prt(&args.transfer)?;
    let environment = Environment::load(&args.env)?;
    let baked = args.scene.as_deref().map(|path| Baked::load(&args.files.scene(path)?)).transpose()?;
    if let Some(Baked { loaded, .. }) = &baked {
        check_kept(&args.outputs, loaded.report.files.iter().map(PathBuf::as_path))?;
        loaded.report.warnings.iter().for_each(|warning| report::say(&format!("warning: {warning}")));
    }
    let irradiance = irradiance(&transfer, &environment);
    let columns = columns_of(&irradiance);
    if let Some(Baked { model, .. }) = &baked
        && model.mesh.positions.len() != irradiance.len()
    {
        let problem =
            format!("transfer of {} points, and the scene has {} vertices", irradiance.len(), model.mesh.positions.len());
        return Err(Error::input(&args.transfer, None, problem, CURE));
    }
    if baked.as_ref().is_some_and(|baked| export::is_of(&args.transfer, baked.world()) == Some(false)) {
        return Err(Error::input(&args.transfer, None, "transfer of other points than the scene's vertices", CURE));
    }
    let options = WriteOptions { exposure: args.exposure, ..WriteOptions::default() };
    let mut camera = None;
    for path in &args.outputs {
        match (&baked, ending(path)) {
            (Some(Baked { loaded, model }), "png" | "exr") => {
                let size = args.size.unwrap_or(loaded.settings.film.size);
                let exposure = Exposure::Stops(args.exposure);
                let settings = Settings::default().with(|s| (s.film.size, s.display.exposure) = (size, exposure));
                settings.validate()?;
                let camera = *camera.insert(loaded.world.camera(size));
                model.picture(&irradiance, &environment, camera, size).write(path, &options)?;
            }
            (Some(baked), _) => {
                let surface = baked.surface();
                let (positions, normals) = (surface.positions, &baked.model.mesh.normals);
                PointValues { positions, normals, columns: &columns, surface: Some(surface), sources: None }
                    .write(path, &options)?;
            }
            // A .npy file contains only the columns.
            (None, _) => {
                let (nowhere, normals) = (vec![DVec3::ZERO; irradiance.len()], &vec![Vec3::ZERO; irradiance.len()]);
                let positions = Positions::near(&nowhere);
                PointValues { positions, normals, columns: &columns, surface: None, sources: None }.write(path, &options)?;
            }
        }
    }
    let paths: Vec<_> = args.outputs.iter().map(|path| path.display().to_string()).collect();
    report::say(&format!("{}: light of {} points", paths.join(", "), irradiance.len()));
    if args.json {
        let warnings = baked.map_or(Vec::new(), |baked| baked.loaded.report.warnings);
        let seconds = TotalSeconds { total: started.elapsed().as_secs_f64() };
        let head = ReportHead::new("relight", paths, camera, warnings);
        report::print_json(&RelightReport { head, points: irradiance.len(), seconds })?;
    }
    Ok(0)
}

fn ending(path: &Path) -> &str {
    path.extension().and_then(|ending| ending.to_str()).unwrap_or_default()
}

fn columns_of(irradiance: &[Vec3]) -> Vec<Channel> {
    let column = |c: usize| Channel {
        name: format!("Irradiance.{}", ["R", "G", "B"][c]),
        samples: irradiance.iter().map(|value| value[c]).collect(),
    };
    (0..3).map(column).collect()
}

impl Baked {
    fn load(request: &SceneRequest) -> Result<Self> {
        let loaded = request.load(false)?;
        Ok(Self { model: RelitModel::new(&loaded.world), loaded })
    }

    fn world(&self) -> Positions<'_> {
        Positions { world: &self.model.positions, origin: self.model.scene.space.local_origin() }
    }

    fn surface(&self) -> ExportMesh<'_> {
        let RelitModel { mesh, scene, .. } = &self.model;
        let (materials, textures) = (&scene.materials[..], &scene.textures[..]);
        ExportMesh { mesh, positions: self.world(), materials, textures, source: ExportSource::of(scene) }
    }
}
