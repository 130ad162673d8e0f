//! `finalgather bake`: receivers → points → integrals → files. Everything that can be refused early is, before the gather.

mod receiver;

use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::time::Instant;

use finalgather::bake::{Bake, Merge, Plan, Statistics, blocks_of};
use finalgather::blocks::{Part, sha256};
use finalgather::error::{Error, Result};
use finalgather::gpu::Gpu;
use finalgather::image::{Channel, WriteOptions};
use finalgather::points::GatherPoint;
use finalgather::prepared::Prepared;
use finalgather::quantity::Quantity;
use finalgather::scene::{LoadOptions, Scene};
use finalgather::settings::Settings;
use serde::Serialize;
use serde_json::Value;

use self::receiver::{Counts, Receiver};
use crate::args::{BakeArgs, To};
use crate::checkpoint::Checkpoint;
use crate::inputs::check_kept;
use crate::interrupt::Interrupt;
use crate::merge::COMMAND;
use crate::progress::Progress;
use crate::render::{are_done, resume_of};
use crate::report::{self, Gl};

/// Bounces of gathered light, unless said otherwise.
const BOUNCES: u32 = 2;

/// MiB for the points at a time, unless all is to make do with so many.
const MEMORY: usize = 1024;

/// `finalgather bake --json`.
#[derive(Serialize)]
struct Report<'a> {
    gl: Gl<'a>,
    settings: &'a Settings,
    plan: &'a Plan,
    bake: &'a Statistics,
    receivers: &'a [Baked],
    seconds: Seconds,
    peak_memory_bytes: Option<u64>,
    /// What a shard has made.
    part: Option<String>,
    interrupted: bool,
}

#[derive(Serialize)]
struct Seconds {
    load: f64,
    receivers: f64,
    write: f64,
    total: f64,
}

/// A receiver that is done.
#[derive(Serialize)]
struct Baked {
    to: &'static str,
    points: usize,
    /// None where an earlier run has done it.
    counts: Option<Counts>,
    outputs: Vec<String>,
}

/// The exit code, unless the run failed. With `parts`, those of all shards, nothing is gathered but put together.
pub fn run(args: &BakeArgs, parts: &[PathBuf], started: Instant) -> Result<u8> {
    let checkpoint = if parts.is_empty() { Checkpoint::new(&args.job, &args.paths())? } else { Checkpoint::none() };
    if checkpoint.shard().is_some() && command().is_none() {
        return Err(Error::usage("an argument is not UTF-8, and a part is to hold them", "give names in UTF-8"));
    }
    let outputs = if checkpoint.shard().is_some() { Vec::new() } else { outputs_of(args)? };
    let files = args.to.iter().filter_map(|to| if let To::Points(path) = to { Some(path.as_path()) } else { None });
    let inputs = [args.scene.as_path()].into_iter().chain(args.overrides.env.as_deref()).chain(files);
    check_kept(&args.paths(), inputs.chain(parts.iter().map(PathBuf::as_path)))?;
    for (to, outputs) in args.to.iter().zip(&outputs) {
        outputs.iter().try_for_each(|path| receiver::check_writable(to, path, &args.what))?;
    }
    let progress = Progress::new("loading");
    let outcome = bake(args, &outputs, checkpoint, parts, &progress, started);
    progress.clear();
    outcome
}

fn bake(
    args: &BakeArgs,
    outputs: &[Vec<PathBuf>],
    mut checkpoint: Checkpoint,
    parts: &[PathBuf],
    progress: &Progress,
    started: Instant,
) -> Result<u8> {
    let interrupt = Interrupt::watch(progress.clone(), checkpoint.lock_path().map(Path::to_owned)).map_err(|error| {
        Error::usage(format!("signals cannot be caught: {error}"), "run where the system allows signal handlers")
    })?;
    let scene = load(args)?;
    check_kept(&args.paths(), scene.files.iter().map(PathBuf::as_path))?;
    scene.warnings.iter().for_each(|warning| progress.say(&format!("warning: {warning}")));
    let mut settings = args.overrides.put_over(scene.settings.clone());
    // Transfer may do without bounces; photons may not.
    settings.bounces = settings.bounces.max(1);
    // It takes all its directions, and layers for as many.
    settings.until = 0.0;
    // Asked for twice is asked for.
    let mut what = Vec::new();
    for &quantity in &args.what {
        if !what.contains(&quantity) {
            what.push(quantity);
        }
    }
    let plan = Plan {
        what,
        order: args.order,
        gather_bounces: args.overrides.bounces.unwrap_or(BOUNCES),
        ao_distance: args.ao_distance,
        radiance_cache: args.rough,
        memory: MEMORY,
    };
    // Before the device and the receivers, which take their time.
    settings.validate()?;
    plan.validate()?;
    let mine = checkpoint.shard().map(|shard| shard.range(blocks_of(&settings).count())).transpose()?;
    let found = checkpoint.found(progress)?;
    let load = started.elapsed().as_secs_f64();

    progress.stage("starting OpenGL");
    let gpu = Gpu::headless(args.backend, args.gl_device)?;
    progress.stage("placing points");
    let placing = Instant::now();
    let prepared = Prepared::without_glass(&gpu, &scene)?;
    let receivers = args.to.iter().map(|to| Receiver::new(to, args, &gpu, &prepared, &settings)).collect::<Result<Vec<_>>>()?;
    receivers.iter().flat_map(Receiver::warnings).for_each(|warning| progress.say(&format!("warning: {warning}")));
    let points: Vec<GatherPoint> = receivers.iter().flat_map(|receiver| receiver.points().iter().copied()).collect();
    let placed = placing.elapsed().as_secs_f64();
    if !parts.is_empty() {
        let merge = merge(parts, &prepared, &points)?;
        let about = |receiver: &Receiver| {
            metadata(
                args,
                (merge.renderer(), &merge.job()["plan"], merge.job()),
                &settings,
                receiver,
                (settings.directions, true),
            )
        };
        let (_, failures) = write(&receivers, outputs, &merge.columns(&points)?, about, &settings, &scene, &prepared);
        progress.clear();
        return failures.into_iter().next().map_or(Ok(0), Err);
    }
    progress.stage("tracing photons");
    let mut bake = Bake::new(&gpu, prepared, points, &settings, &plan)?;
    if let Some(mine) = mine {
        bake.only(mine);
    }
    if let Some(most) = args.memory {
        bake.fit(most)?;
    }
    if let Some(part) = found {
        bake.resume(checkpoint.path(), &part)?;
        let (Statistics { directions_done, directions_total, .. }, path) = (bake.statistics(), checkpoint.path().display());
        progress.say(&format!("going on from {directions_done} of {directions_total} directions in {path}"));
    }
    let about = |bake: &Bake, receiver: &Receiver, complete: bool| {
        let job = (bake.renderer(), &serde_json::json!(bake.plan()), &bake.job());
        metadata(args, job, &settings, receiver, (bake.directions_done(), complete))
    };
    let over = checkpoint.may_be_over()
        && receivers.iter().zip(outputs).all(|(receiver, paths)| are_done(paths.iter(), &about(&bake, receiver, true)));
    if checkpoint.may_be_over() && !over {
        checkpoint.say_beginning(progress);
    }
    progress.begin_directions(bake.statistics().directions_total);
    let mut failure = None;
    while !over && failure.is_none() && !bake.is_done() && interrupt.leaves_time(bake.is_between_blocks()) {
        failure = bake.step().err();
        // Before there is a value for each point there may be a checkpoint.
        if bake.has_values() || checkpoint.is_kept() {
            interrupt.picture_begun();
        }
        progress.directions_done(bake.statistics().directions_done);
        checkpoint.keep(progress, || save(&bake));
    }
    if let Some(error) = failure.take_if(|_| bake.statistics().directions_done == 0) {
        return Err(error);
    }
    let stopped = interrupt.requested().filter(|_| !over && !bake.is_done());
    let ended = failure.is_some() || stopped.is_some();
    let kept = if ended { checkpoint.stop(|| save(&bake)) } else { Ok(false) };
    let resume = resume_of(&kept);
    progress.clear();
    let Statistics { directions_done, directions_total, .. } = bake.statistics();
    let how = if failure.is_some() { "failed" } else { "stopped" };
    let so_far = format!("{how} after {directions_done} of {directions_total} directions");
    let writing = Instant::now();
    // A shard has a part to make, and a bake that ends early may not have a value for each point.
    let columns = bake.columns().filter(|_| !over && checkpoint.shard().is_none());
    let (mut baked, mut failures) = (Vec::new(), Vec::new());
    if let Some(columns) = &columns {
        let about = |receiver: &Receiver| about(&bake, receiver, bake.is_done());
        (baked, failures) = write(&receivers, outputs, columns, about, &settings, &scene, bake.prepared());
    } else if over {
        let done = |(receiver, paths): (&Receiver, &Vec<PathBuf>)| Baked::new(receiver, paths, None);
        baked = receivers.iter().zip(outputs).map(done).collect();
    }
    let paths: Vec<_> = baked.iter().flat_map(|baked| baked.outputs.iter().map(String::as_str)).collect();
    if ended {
        let what = match &columns {
            Some(_) => format!("values so far written to {}", paths.join(", ")),
            None if resume.is_empty() => "nothing kept".to_owned(),
            None => format!("kept in {}", checkpoint.path().display()),
        };
        report::say(&format!("{so_far}; {what}{resume}"));
    } else if failures.is_empty() {
        checkpoint.finish(|| save(&bake))?;
        if over {
            report::say(&format!("{}: finished by an earlier run, and left as it was", paths.join(", ")));
        } else if columns.is_some() && io::stderr().is_terminal() {
            report::say(&format!("written to {} after {:.1} s", paths.join(", "), started.elapsed().as_secs_f64()));
        }
    }
    // All that can be written is, before one that cannot ends the run.
    if !ended && !failures.is_empty() && checkpoint.stop(|| save(&bake))? {
        report::say(&format!("what was gathered is kept in {}; --resume writes it", checkpoint.path().display()));
    }
    let mut failures = failures.into_iter().chain(failure).chain(kept.err());
    if let Some(error) = failures.next() {
        failures.for_each(|error| report::say(&format!("error: {error}")));
        return Err(error);
    }
    if args.json {
        let gl = gpu.info();
        report::print_json(&Report {
            gl: Gl { renderer: &gl.renderer, version: &gl.version, backend: &gl.backend },
            settings: &settings,
            plan: &plan,
            bake: &bake.statistics(),
            receivers: &baked,
            seconds: Seconds {
                load,
                receivers: placed,
                write: writing.elapsed().as_secs_f64(),
                total: started.elapsed().as_secs_f64(),
            },
            peak_memory_bytes: report::peak_memory_bytes(),
            part: checkpoint.shard().map(|_| checkpoint.path().display().to_string()),
            interrupted: stopped.is_some(),
        })?;
    }
    Ok(stopped.unwrap_or(0))
}

impl Baked {
    fn new(receiver: &Receiver, paths: &[PathBuf], counts: Option<Counts>) -> Self {
        let outputs = paths.iter().map(|path| path.display().to_string()).collect();
        Self { to: receiver.name(), points: receiver.points().len(), counts, outputs }
    }
}

/// The parts of all shards of a bake of these points.
fn merge(parts: &[PathBuf], prepared: &Prepared, points: &[GatherPoint]) -> Result<Merge> {
    let mut merge: Option<Merge> = None;
    for path in parts {
        let part = Part::read(path)?;
        let merge = match &mut merge {
            Some(merge) => merge,
            none => none.insert(Merge::new(path, &part)?),
        };
        merge.check_scene(path, &prepared.scene, points)?;
        merge.add(path, &part)?;
    }
    merge.ok_or_else(|| Error::usage("no parts to merge", "name those of all shards"))
}

/// Writes the values of each receiver, with what `about` says of them. Returns what became of them, and what failed.
fn write(
    receivers: &[Receiver],
    outputs: &[Vec<PathBuf>],
    (columns, inside): &(Vec<Channel>, Vec<f32>),
    about: impl Fn(&Receiver) -> String,
    settings: &Settings,
    scene: &Scene,
    prepared: &Prepared,
) -> (Vec<Baked>, Vec<Error>) {
    let (mut first, mut baked, mut failures) = (0, Vec::new(), Vec::new());
    for (receiver, paths) in receivers.iter().zip(outputs) {
        let range = first..first + receiver.points().len();
        first = range.end;
        let part = |column: &Channel| Channel { name: column.name.clone(), samples: column.samples[range.clone()].to_vec() };
        let own = columns.iter().map(part).collect();
        let about = about(receiver);
        let options = WriteOptions { exposure: settings.exposure, metadata: Some(&about) };
        let (counts, errors) = receiver.write(own, &inside[range.clone()], paths, scene, prepared, &options);
        failures.extend(errors);
        baked.push(Baked::new(receiver, paths, Some(counts)));
    }
    (baked, failures)
}

/// With the arguments of this run, by which `finalgather merge` finds scene and points again.
fn save(bake: &Bake) -> Part<'_> {
    let mut part = bake.save();
    part.state[COMMAND] = command().into();
    part
}

fn command() -> Option<Vec<String>> {
    std::env::args_os().skip(1).map(|argument| argument.into_string().ok()).collect()
}

/// Openness and transfer need no light.
fn load(args: &BakeArgs) -> Result<Scene> {
    let needs_light = args.what.iter().any(|quantity| matches!(quantity, Quantity::Irradiance | Quantity::Sh));
    Scene::load_with(&args.scene, LoadOptions { unlit: !needs_light, ..args.overrides.load_options()? })
}

/// The paths of each receiver.
fn outputs_of(args: &BakeArgs) -> Result<Vec<Vec<PathBuf>>> {
    let mut outputs = vec![Vec::new(); args.to.len()];
    for output in &args.outputs {
        let of = |name: &str| output.strip_prefix(name).and_then(|rest| rest.strip_prefix(':'));
        let named = args.to.iter().enumerate().find_map(|(i, to)| of(to.name()).map(|path| (i, path)));
        match named {
            Some((_, "")) => return Err(Error::usage(format!("-o {output} names no file"), "put one after the colon")),
            Some((i, path)) => outputs[i].push(PathBuf::from(path)),
            None if let Some(name) = To::NAMES.into_iter().find(|name| of(name).is_some()) => {
                let cure = format!("add --to {name}, or give a file of what is baked");
                return Err(Error::usage(format!("-o {output}: {name} was not asked for"), cure));
            }
            None if let Some((name, _)) = output.split_once(':').filter(|(name, _)| is_word(name)) => {
                let cure = format!("put {} before the colon, or ./ before a file of this name", To::NAMES.join(", "));
                return Err(Error::usage(format!("-o {output}: there is no receiver {name:?}"), cure));
            }
            None if args.to.len() == 1 => outputs[0].push(PathBuf::from(output)),
            None => {
                let names: Vec<_> = args.to.iter().map(|to| format!("{}:{output}", to.name())).collect();
                let cure = format!("put its name before the file: {}", names.join(" or "));
                return Err(Error::usage(format!("-o {output}: of which receiver?"), cure));
            }
        }
    }
    match args.to.iter().zip(&outputs).find(|(_, outputs)| outputs.is_empty()) {
        None => Ok(outputs),
        Some((to, _)) => {
            Err(Error::usage(format!("no file is named for {}", to.name()), "name one with -o, or leave the receiver out"))
        }
    }
}

/// Drives have names of one letter.
fn is_word(name: &str) -> bool {
    name.len() != 1 && name.chars().all(|letter| letter.is_ascii_alphabetic() || letter == '-')
}

/// What made the values. No times and no paths: the same bake gives the same files.
fn metadata(
    args: &BakeArgs,
    (renderer, plan, job): (&str, &Value, &Value),
    settings: &Settings,
    receiver: &Receiver,
    (directions_done, complete): (u32, bool),
) -> String {
    serde_json::json!({
        "version": env!("CARGO_PKG_VERSION"),
        "renderer": renderer,
        "settings": settings,
        "plan": plan,
        "receiver": receiver.name(),
        // Of a light map's options the only one that shapes no point.
        "padding": args.padding,
        "job_sha256": sha256(job.to_string().as_bytes()),
        "directions_done": directions_done,
        "complete": complete,
    })
    .to_string()
}
