//! `finalgather merge`: the parts of a job's shards → what the job itself would have written.

use std::path::PathBuf;
use std::time::Instant;

use clap::Parser;
use finalgather::blocks::Part;
use finalgather::error::{Error, Result};
use finalgather::image::{WriteOptions, check_writable};
use finalgather::render::Merge;
use finalgather::settings::Settings;

use crate::args::{Args, Command, JobArgs, MergeArgs};
use crate::bake;
use crate::inputs::check_kept;
use crate::render::{metadata, write_all};

/// Of the state of a bake's part: the arguments that made it.
pub const COMMAND: &str = "command";

/// The exit code, unless it failed.
pub fn run(args: &MergeArgs, started: Instant) -> Result<u8> {
    let path = &args.parts[0];
    let Part { job, state, .. } = Part::read(path)?;
    match job["what"].as_str() {
        Some("render") => merge_renders(args),
        Some("bake") => {
            let command = state[COMMAND].as_array().into_iter().flatten().filter_map(|argument| argument.as_str());
            let parsed = Args::try_parse_from(["finalgather"].into_iter().chain(command));
            let Ok(Args { command: Command::Bake(mut bake) }) = parsed else {
                return Err(Error::input(path, None, "damaged: it does not say how it was baked", "make it again"));
            };
            bake.outputs.clone_from(&args.outputs);
            bake.overrides.exposure = args.exposure.or(bake.overrides.exposure);
            bake.job = JobArgs::default();
            bake.json = false;
            bake::run(&bake, &args.parts, started)
        }
        _ => Err(Error::input(
            path,
            None,
            "a part of no kind of job that this version knows",
            "merge with the version that made it",
        )),
    }
}

fn merge_renders(args: &MergeArgs) -> Result<u8> {
    let outputs: Vec<_> = args.outputs.iter().map(PathBuf::from).collect();
    outputs.iter().try_for_each(|path| check_writable(path))?;
    check_kept(&outputs, args.parts.iter().map(PathBuf::as_path))?;
    let mut merge = None;
    // One at a time, for there may be many.
    for path in &args.parts {
        let part = Part::read(path)?;
        let merge = match &mut merge {
            Some(merge) => merge,
            none => none.insert(Merge::new(path, &part)?),
        };
        merge.add(path, &part)?;
    }
    let merge = merge.ok_or_else(|| Error::usage("no parts to merge", "name those of all shards"))?;
    let image = merge.picture()?;
    let own = merge.settings();
    let settings = Settings { exposure: args.exposure.unwrap_or(own.exposure), ..own.clone() };
    let metadata = metadata(merge.renderer(), &settings, merge.job(), (settings.directions, true));
    write_all(&image, &outputs, &WriteOptions { exposure: settings.exposure, metadata: Some(&metadata) })?;
    Ok(0)
}
