//! `finalgather merge`: merges the parts of a job's shards into the results of the job.

use std::path::PathBuf;

use finalgather::error::Result;

use crate::args::stops;
use crate::terminal::Terminal;

/// Merge the parts of a sharded job, to the same bits as one run
///
/// It needs no OpenGL. A picture needs only the parts. A bake also reads its scene and files of points, from the paths that its command gave.
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/merge.txt"), args_override_self = true, allow_negative_numbers = true)]
pub struct MergeArgs {
    /// Parts of all shards, in any order. A finished --checkpoint is a part too
    #[arg(value_name = "PART", required = true)]
    parts: Vec<PathBuf>,

    /// File to write, as for the job itself; can be given several times
    #[arg(short, long = "output", value_name = "[RECEIVER:]FILE", required = true)]
    outputs: Vec<String>,

    /// Exposure of .png in stops [default: the job's]
    #[arg(long, value_name = "EV", value_parser = stops)]
    exposure: Option<f32>,
}

/// Returns the exit code.
pub fn run(args: &MergeArgs) -> Result<u8> {
    finalgather::job::merge(&args.parts, &args.outputs, args.exposure, &mut Terminal::new(Vec::new())?).map(|()| 0)
}
