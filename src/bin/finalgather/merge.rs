//! `finalgather merge`: merges the parts of a job's shards into the results of the job.

use std::path::PathBuf;

use finalgather::error::Result;
use finalgather::settings::{Background, DisplaySettings, Exposure};

use crate::report;
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
    #[arg(long, value_name = "auto|EV", value_parser = str::parse::<Exposure>)]
    exposure: Option<Exposure>,

    /// What a .png shows where there is no surface: environment, transparent, #rrggbb, or linear r,g,b from 0 to 1 [default: the job's]
    #[arg(long, value_name = "WHAT", value_parser = str::parse::<Background>)]
    background: Option<Background>,

    /// Print one JSON object about the merge on stdout
    #[arg(long)]
    json: bool,
}

/// Returns the exit code.
pub fn run(args: &MergeArgs) -> Result<u8> {
    let change = |display: &mut DisplaySettings| {
        display.exposure = args.exposure.unwrap_or(display.exposure);
        display.background = args.background.unwrap_or(display.background);
    };
    let mut terminal = Terminal::new(Vec::new())?;
    let merged = finalgather::job::merge(&args.parts, &args.outputs, change, &mut terminal)?;
    terminal.clear();
    report::say(&format!("{}: merged from {} parts", args.outputs.join(", "), args.parts.len()));
    if args.json {
        report::print_json(&merged)?;
    }
    Ok(0)
}
