//! `finalgather render`: renders a scene to picture files.

use std::path::{Path, PathBuf};

use finalgather::error::Result;
use finalgather::job::{Job, JobRequest, SceneRequest, Work};

use crate::args::{DeviceArgs, JobArgs, Overrides, PhotonMapArg, count, duration};
use crate::streams::{STREAM, ToStdout};
use crate::terminal;

/// Render a scene to picture files
///
/// Settings come from these options, else from [settings] in the scene file, else from the defaults shown here.
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/render.txt"), args_override_self = true, allow_negative_numbers = true)]
#[command(mut_arg("photon_depth", |arg| arg.alias("bounces")))]
pub struct RenderArgs {
    /// Scene file (.toml) or model (.obj with its .mtl, .glb, .gltf, .ply, .stl). - is stdin
    scene: PathBuf,

    /// Picture to write, .png or .exr; can be given several times. - is stdout, as PNG; exr:- as EXR [default: the scene's name with .png, in the current folder]
    #[arg(short, long = "output", value_name = "FILE")]
    outputs: Vec<String>,

    /// Print one JSON object about the run on stdout
    #[arg(long)]
    json: bool,

    /// Refuse a render that may take more than this many MiB, on the GL side and the CPU together. Not counted: layers beyond the first eight, photons of caustics, and the checkpoint that --resume reads
    #[arg(long, value_name = "MIB", value_parser = count::<usize>)]
    memory: Option<usize>,

    /// Take at most about this long, in seconds, or as 90s, 5m or 1h: as many directions as fit, in place of --directions. The report tells how many
    #[arg(long, value_name = "TIME", value_parser = duration, conflicts_with_all = ["directions", "resume"])]
    time: Option<f64>,

    #[command(flatten)]
    overrides: Overrides,

    #[command(flatten)]
    photon_map: PhotonMapArg,

    #[command(flatten)]
    job: JobArgs,

    #[command(flatten)]
    device: DeviceArgs,
}

impl RenderArgs {
    /// The files to write, at least one.
    pub fn outputs(&self) -> Vec<String> {
        match self.scene.file_stem() {
            _ if self.outputs.is_empty() && self.scene == Path::new(STREAM) => vec![STREAM.to_owned()],
            Some(stem) if self.outputs.is_empty() => {
                // Appended, because the name may contain more dots.
                vec![format!("{}.png", stem.to_string_lossy())]
            }
            _ => self.outputs.clone(),
        }
    }

    pub fn scene(&self) -> Result<SceneRequest> {
        Ok(self.photon_map.choose(self.overrides.scene(&self.scene)?))
    }
}

/// Returns the exit code.
pub fn run(args: &RenderArgs) -> Result<u8> {
    // Before there is anything to leave behind, because stdin may never end.
    let (scene, device) = (args.scene()?, args.device.request());
    let mut outputs = args.outputs();
    let stdout = ToStdout::of(&mut outputs, Some("png"), args.json)?;
    let outputs: Vec<_> = outputs.iter().map(PathBuf::from).collect();
    let mut keeping = args.job.keeping(&outputs)?;
    if stdout.is_some() {
        ToStdout::keep(&mut keeping)?;
    }
    let request = JobRequest { scene, work: Work::Render, outputs: vec![outputs], memory: args.memory, time: args.time, device };
    terminal::run(Job::new(request, &keeping)?, args.json, stdout)
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use finalgather::settings::{
        Background, DirectionSettings, DisplaySettings, Estimator, Exposure, FilmSettings, GatherSettings, LayerSize,
        PhotonMapKind, PhotonSettings, Pipeline, PointSource, Sequence, Settings, Squares,
    };

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: RenderArgs,
    }

    fn parse(line: &str) -> RenderArgs {
        Line::parse_from(line.split(' ')).args
    }

    fn settings(line: &str, of_scene: &Settings) -> Settings {
        parse(line).scene().unwrap().settings(of_scene).unwrap()
    }

    /// Every option overrides only its own setting, also under its old name.
    #[test]
    fn options_override_settings() {
        let scene = Settings::default().with(|s| (s.photons.grid_cells, s.seed) = (7, 3));
        assert_eq!(settings("render a.toml", &scene), scene);
        let all = "render a.toml --size 3x4 --directions 5 --layer-size 6 --points traced --pipeline raycast-gl --photons 1e2 \
                   --photon-depth 8 --estimator plain --sequence sobol --interleave 4 --seed 9 --stop-fraction 0.5 --target-error 0.25 \
                   --exposure -1.5 --photon-map grid --background #ff0000 --ground on";
        let expected = Settings {
            seed: 9,
            film: FilmSettings { size: [3, 4], points: PointSource::Traced, interleave: Squares::Pixels(4), ground: true },
            directions: DirectionSettings {
                count: 5,
                sequence: Sequence::Sobol,
                estimator: Estimator::Plain,
                target_error: 0.25,
            },
            gather: GatherSettings { pipeline: Pipeline::RaycastGl, layer_size: LayerSize::Texels(6), stop_fraction: 0.5 },
            photons: PhotonSettings { count: 100, depth: 8, map: PhotonMapKind::Grid, ..scene.photons },
            display: DisplaySettings { exposure: Exposure::Stops(-1.5), background: Background::Color([1.0, 0.0, 0.0]) },
            ..scene
        };
        assert_eq!(settings(all, &scene), expected);
        let old = all.replace("photon-depth", "bounces").replace("target-error", "until").replace("photon-map", "rough");
        assert_eq!(settings(&old, &scene), expected);
    }

    #[test]
    fn output_beside_the_caller_by_default() {
        assert_eq!(parse("render scenes/box.2.toml").outputs(), ["box.2.png"]);
        let two = parse("render a.toml -o b.png --output c.exr").outputs();
        assert_eq!(two, ["b.png", "c.exr"]);
    }

    /// Scripts can append options that override earlier ones.
    #[test]
    fn the_last_of_an_option_counts() {
        assert_eq!(settings("render a.toml --seed 1 --seed 2", &Settings::default()).seed, 2);
    }
}
