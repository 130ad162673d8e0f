//! `finalgather relight`: computes light from transfer and environment, as numbers, on the model or as a picture.

use std::f32::consts::{FRAC_1_PI, PI};
use std::path::{Path, PathBuf};

use finalgather::error::{Error, Result};
use finalgather::export::{self, ExportMesh, ExportSource, PointValues, Positions, read_prt};
use finalgather::harmonics::project;
use finalgather::image::{self, Channel, Image, WriteOptions};
use finalgather::job::{SceneRequest, check_kept};
use finalgather::points::Vertices;
use finalgather::scene::{Bvh, Chance, Environment, Loaded, Mesh, Rays, Scene};
use finalgather::settings::{Exposure, Settings};
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use crate::args::{SceneArgs, size, stops};
use crate::report;

const CURE: &str = "give the scene that it was baked of, with --to vertices and --per row";
/// Rings of sample directions for the projection of the environment.
const RINGS: usize = 512;
/// Rays along each side of a pixel.
const SUBPIXELS: usize = 4;

/// Turn baked radiance transfer into light under an environment
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/relight.txt"), allow_negative_numbers = true)]
pub struct RelightArgs {
    /// Transfer: a .npy of `finalgather bake --what prt`, with its .json beside it
    transfer: PathBuf,

    /// Lat-long picture of the environment, .hdr or .exr
    #[arg(long, value_name = "FILE")]
    env: PathBuf,

    /// File to write: .npy (irradiance of each point) or, with --scene, .ply and .glb (its vertices), .png and .exr (a picture); can be given several times
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
}

/// The model, in unit space except `positions`.
struct Model {
    loaded: Loaded,
    /// Has the vertices of a bake. Its triangles are those of the tree.
    mesh: Mesh,
    /// Of the vertices, in world space.
    positions: Vec<DVec3>,
    bvh: Bvh,
    unit: Scene,
}

/// Returns the exit code.
pub fn run(args: &RelightArgs) -> Result<u8> {
    for path in &args.outputs {
        match ending(path) {
            "png" | "exr" => image::check_writable(path)?,
            _ => export::check_writable(path, &["npy", "ply", "glb", "png", "exr"])?,
        }
        if ending(path) != "npy" && args.scene.is_none() {
            return Err(Error::usage(
                format!("{}: what the points lie on is not known", path.display()),
                "name the scene that was baked, --scene, or write .npy",
            ));
        }
    }
    check_kept(&args.outputs, [&args.transfer, &args.env].into_iter().chain(&args.scene).map(PathBuf::as_path))?;
    let transfer = read_prt(&args.transfer)?;
    let environment = Environment::load(&args.env)?;
    let model = args.scene.as_deref().map(|path| Model::load(&args.files.scene(path)?)).transpose()?;
    if let Some(Model { loaded, .. }) = &model {
        check_kept(&args.outputs, loaded.report.files.iter().map(PathBuf::as_path))?;
    }
    let irradiance = relit(&transfer, &environment);
    let columns = columns_of(&irradiance);
    if let Some(model) = &model
        && model.mesh.positions.len() != irradiance.len()
    {
        let problem =
            format!("transfer of {} points, and the scene has {} vertices", irradiance.len(), model.mesh.positions.len());
        return Err(Error::input(&args.transfer, None, problem, CURE));
    }
    if model.as_ref().is_some_and(|model| export::is_of(&args.transfer, model.world()) == Some(false)) {
        return Err(Error::input(&args.transfer, None, "transfer of other points than the scene's vertices", CURE));
    }
    let options = WriteOptions { exposure: args.exposure, ..WriteOptions::default() };
    for path in &args.outputs {
        match (&model, ending(path)) {
            (Some(model), "png" | "exr") => {
                let size = args.size.unwrap_or(model.loaded.settings.film.size);
                let exposure = Exposure::Stops(args.exposure);
                let settings = Settings::default().with(|s| (s.film.size, s.display.exposure) = (size, exposure));
                settings.validate()?;
                model.picture(&irradiance, &environment, size).write(path, &options)?;
            }
            (Some(model), _) => {
                let surface = model.surface();
                let (positions, normals) = (surface.positions, &model.mesh.normals);
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
    Ok(0)
}

fn ending(path: &Path) -> &str {
    path.extension().and_then(|ending| ending.to_str()).unwrap_or_default()
}

/// Irradiance of each point: π Σ T c.
fn relit(transfer: &[Channel], environment: &Environment) -> Vec<Vec3> {
    let coefficients = project(RINGS, |direction| environment.radiance(direction));
    let point = |i: usize| {
        let term = |(k, column): (usize, &Channel)| column.samples[i] * coefficients[k / 3][k % 3];
        let color = |c: usize| transfer.iter().enumerate().skip(c).step_by(3).map(term).sum::<f32>();
        // A truncated series can give negative values. They become 0.
        (PI * Vec3::new(color(0), color(1), color(2))).max(Vec3::ZERO)
    };
    (0..transfer[0].samples.len()).into_par_iter().map(point).collect()
}

fn columns_of(irradiance: &[Vec3]) -> Vec<Channel> {
    let column = |c: usize| Channel {
        name: format!("Irradiance.{}", ["R", "G", "B"][c]),
        samples: irradiance.iter().map(|value| value[c]).collect(),
    };
    (0..3).map(column).collect()
}

impl Model {
    fn load(request: &SceneRequest) -> Result<Self> {
        let loaded = request.load(false)?;
        let unit = loaded.world.flatten();
        // Bakes leave glass out too.
        let unit = unit.without_glass().unwrap_or(unit);
        // The number of vertices does not depend on the inset.
        let vertices = Vertices::new(&unit.mesh, 0.0);
        let mesh = vertices.mesh().clone();
        let positions = mesh.positions.iter().map(|&position| unit.space.to_world(position)).collect();
        Ok(Self { bvh: Bvh::new(&unit.mesh), loaded, mesh, positions, unit })
    }

    fn world(&self) -> Positions<'_> {
        Positions { world: &self.positions, origin: self.unit.space.local_origin() }
    }

    fn surface(&self) -> ExportMesh<'_> {
        let (materials, textures) = (&self.unit.materials[..], &self.unit.textures[..]);
        ExportMesh { mesh: &self.mesh, positions: self.world(), materials, textures, source: ExportSource::of(&self.unit) }
    }

    /// The view of the scene's camera. Front sides show albedo × irradiance / π, interpolated between vertices. Misses show the environment.
    fn picture(&self, irradiance: &[Vec3], environment: &Environment, size: [u32; 2]) -> Image {
        let [width, height] = size.map(|side| side as usize);
        let camera = self.unit.space.enter_camera(self.loaded.world.camera(size));
        let rays = Rays::new(&self.unit, &self.bvh);
        let radiance = |direction: Vec3, chance: Chance| {
            let Some(hit) = rays.nearest(camera.eye, direction, None, chance) else { return environment.radiance(direction) };
            if !self.unit.mesh.meets_front(hit.triangle, direction) {
                return Vec3::ZERO;
            }
            let weights = self.unit.mesh.barycentric(hit.triangle, camera.eye + hit.distance * direction);
            let vertices = self.mesh.triangles[hit.triangle].vertices;
            let light: Vec3 = (0..3).map(|k| weights[k] * irradiance[vertices[k] as usize]).sum();
            self.unit.albedo(hit.triangle, weights) * light * FRAC_1_PI
        };
        let pixel = |i: usize| {
            let at = |step: usize| (step as f32 + 0.5) / SUBPIXELS as f32;
            let places = (0..SUBPIXELS * SUBPIXELS).map(|k| (k, Vec2::new(at(k % SUBPIXELS), at(k / SUBPIXELS))));
            let corner = Vec2::new((i % width) as f32, (i / width) as f32);
            let size = Vec2::new(width as f32, height as f32);
            let seen = places.map(|(k, place)| {
                let ray = camera.ray((corner + place) / size, size.x / size.y);
                radiance(ray, Chance::of_pixel(i as u32, k as u32, 0))
            });
            seen.sum::<Vec3>() / (SUBPIXELS * SUBPIXELS) as f32
        };
        let pixels: Vec<Vec3> = (0..width * height).into_par_iter().map(pixel).collect();
        let channel =
            |(c, name): (usize, &str)| Channel { name: name.into(), samples: pixels.iter().map(|pixel| pixel[c]).collect() };
        Image { width, height, channels: ["R", "G", "B"].into_iter().enumerate().map(channel).collect() }
    }
}
