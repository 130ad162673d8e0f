//! `finalgather render`: a scene to picture files.

use std::path::PathBuf;

use finalgather::error::Result;
use finalgather::job::{Job, RenderRequest, SceneRequest};

use crate::args::{DeviceArgs, JobArgs, Overrides, count};
use crate::job;

/// Render a scene to picture files
///
/// Settings come from these options, else from [settings] in the scene file, else from the defaults shown here.
#[derive(Debug, clap::Args)]
#[command(after_help = concat!(include_str!("help/render.txt"), "\n\n", include_str!("help/exit_codes.txt")))]
#[command(args_override_self = true, allow_negative_numbers = true, mut_arg("photon_depth", |arg| arg.alias("bounces")))]
pub struct RenderArgs {
    /// Scene file: .toml, or a bare .obj with its .mtl
    scene: PathBuf,

    /// Picture to write, .png or .exr; can be given several times [default: the scene's name with .png, in the current folder]
    #[arg(short, long = "output", value_name = "FILE")]
    outputs: Vec<PathBuf>,

    /// Print one JSON object about the run on stdout
    #[arg(long)]
    json: bool,

    /// Refuse a render that may take more than this many MiB, on the GL side and the CPU together. Not counted: layers beyond the first eight, photons of caustics, and the checkpoint that --resume reads
    #[arg(long, value_name = "MIB", value_parser = count::<usize>)]
    memory: Option<usize>,

    #[command(flatten)]
    overrides: Overrides,

    #[command(flatten)]
    job: JobArgs,

    #[command(flatten)]
    device: DeviceArgs,
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

    pub fn scene(&self) -> SceneRequest {
        self.overrides.scene(&self.scene)
    }
}

/// The exit code, unless the run failed.
pub fn run(args: &RenderArgs) -> Result<u8> {
    let outputs = args.outputs();
    let keeping = args.job.keeping(&outputs)?;
    let request = RenderRequest { scene: args.scene(), outputs, memory: args.memory, device: args.device.request() };
    job::run(Job::new(request, &keeping)?, args.json)
}
