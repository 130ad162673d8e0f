//! `finalgather render`: everything that can be refused early first, then the render, then the files and the report.

use std::io::{self, IsTerminal};
use std::iter::successors;
use std::path::{Path, PathBuf};
use std::time::Instant;

use finalgather::blocks::sha256;
use finalgather::error::{Error, Result};
use finalgather::export;
use finalgather::gpu::Gpu;
use finalgather::image::{Image, WriteOptions, check_writable};
use finalgather::render::{Render, blocks_of, memory_of};
use finalgather::scene::{Loaded, Material, World};
use finalgather::settings::{PointSource, Settings};
use serde_json::{Value, json};

use crate::args::RenderArgs;
use crate::checkpoint::Checkpoint;
use crate::inputs::check_kept;
use crate::interrupt::Interrupt;
use crate::progress::Progress;
use crate::report::{self, Gl, Report, Seconds};

/// The exit code, unless the run failed.
pub fn run(args: &RenderArgs, started: Instant) -> Result<u8> {
    let outputs = args.outputs();
    check_kept(&outputs, [args.scene.as_path()])?;
    let checkpoint = Checkpoint::new(&args.job, &outputs)?;
    if checkpoint.shard().is_none() {
        outputs.iter().try_for_each(|path| check_writable(path))?;
    }

    let progress = Progress::new("loading");
    let outcome = render(args, &outputs, checkpoint, &progress, started);
    progress.clear();
    outcome
}

fn render(
    args: &RenderArgs,
    outputs: &[PathBuf],
    mut checkpoint: Checkpoint,
    progress: &Progress,
    started: Instant,
) -> Result<u8> {
    let interrupt = Interrupt::watch(progress.clone(), checkpoint.lock_path().map(Path::to_owned)).map_err(|error| {
        Error::usage(format!("signals cannot be caught: {error}"), "run where the system allows signal handlers")
    })?;
    let loading = Instant::now();
    let Loaded { world, settings, report } = args.load_world()?;
    check_kept(outputs, report.files.iter().map(PathBuf::as_path).chain(args.env()))?;
    let load = loading.elapsed().as_secs_f64();
    report.warnings.iter().for_each(|warning| progress.say(&format!("warning: {warning}")));
    let settings = args.override_settings(settings);
    settings.validate()?;
    let lens = world.cameras.first().is_some_and(|(_, camera)| camera.lens.is_some());
    if settings.points == PointSource::Camera && (lens || world.surfaces().any(Material::is_specular)) {
        progress.say("warning: mirrors and glass are drawn as diffuse, through a pinhole; --points traced shows what they are");
    }

    let blocks = blocks_of(&settings);
    let mine = checkpoint.shard().map(|shard| shard.range(blocks.count())).transpose()?;
    if mine.is_some() && settings.until > 0.0 {
        return Err(Error::usage("a shard cannot tell the error of the whole picture", "give --until 0"));
    }
    check_memory(args.memory, &world, &settings, mine.as_ref().map(|mine| mine.len() as u32))?;
    let found = checkpoint.found(progress)?;

    progress.stage("starting OpenGL");
    let gpu = Gpu::headless(args.backend, args.gl_device)?;
    progress.stage("tracing photons");
    let mut render = Render::new(&gpu, &world, &settings)?;
    let directions = mine.clone().map_or(settings.directions, |mine| blocks.directions(mine).len() as u32);
    if let Some(mine) = mine {
        render.only(mine);
    }
    if let Some(part) = found {
        render.resume(checkpoint.path(), &part)?;
        let (done, path) = (render.directions_done(), checkpoint.path().display());
        progress.say(&format!("going on from {done} of {directions} directions in {path}"));
    }
    let wanted = || metadata(&gpu.info().renderer, &settings, &render.job(), (directions, true));
    let over = checkpoint.may_be_over() && are_done(outputs.iter(), &wanted());
    if checkpoint.may_be_over() && !over {
        checkpoint.say_beginning(progress);
    }
    progress.begin_directions(directions);
    let mut failure = None;
    while !over && failure.is_none() && !render.is_done() && interrupt.leaves_time(render.is_between_blocks()) {
        failure = render.step().err();
        interrupt.picture_begun();
        progress.directions_done(render.directions_done());
        checkpoint.keep(progress, || render.save());
    }
    // What was gathered before the device failed is worth keeping.
    if let Some(error) = failure.take_if(|_| render.directions_done() == 0) {
        return Err(error);
    }
    let done = render.directions_done();
    let stopped = interrupt.requested().filter(|_| !over && !render.is_done());
    let ended = failure.is_some() || stopped.is_some();
    let kept = if ended { checkpoint.stop(|| render.save()) } else { Ok(false) };
    let writing = Instant::now();
    let (outputs, what) = if checkpoint.shard().is_some() {
        (vec![checkpoint.path().to_owned()], if kept.is_ok() { "kept in" } else { "not kept in" })
    } else if over {
        (outputs.to_vec(), "")
    } else {
        let image = render.picture();
        if done > 0 && is_black(&image)? {
            progress.say("warning: the picture is black: the camera sees no surface that light reaches; turn it or the lights");
        }
        let metadata = metadata(&gpu.info().renderer, &settings, &render.job(), (done, render.is_done()));
        let options = WriteOptions { exposure: settings.exposure, metadata: Some(&metadata) };
        if let Err(error) = write_all(&image, outputs, &options) {
            if !ended && checkpoint.stop(|| render.save())? {
                progress.say(&format!("what was gathered is kept in {}; --resume writes it", checkpoint.path().display()));
            }
            return Err(failure.unwrap_or(error));
        }
        (outputs.to_vec(), "picture so far written to")
    };
    if !ended {
        checkpoint.finish(|| render.save())?;
    }
    let write = writing.elapsed().as_secs_f64();
    progress.clear();

    let outputs: Vec<_> = outputs.iter().map(|path| path.display().to_string()).collect();
    let paths = outputs.join(", ");
    if ended {
        let how = if failure.is_some() { "failed" } else { "stopped" };
        report::say(&format!("{how} after {done} of {directions} directions; {what} {paths}{}", resume_of(&kept)));
    } else if over {
        report::say(&format!("{paths}: finished by an earlier run, and left as it was"));
    } else if io::stderr().is_terminal() {
        report::say(&format!("written to {paths} after {:.1} s", started.elapsed().as_secs_f64()));
    }
    if let Some(error) = failure.or(kept.err()) {
        return Err(error);
    }
    if args.json {
        let statistics = render.statistics();
        let gl = gpu.info();
        report::print_json(&Report {
            gl: Gl { renderer: &gl.renderer, version: &gl.version, backend: &gl.backend },
            scene: &statistics.scene,
            settings: &settings,
            seconds: Seconds { load, stages: &statistics.seconds, write, total: started.elapsed().as_secs_f64() },
            gather: &statistics.gather,
            photons: &statistics.photons,
            error: statistics.error,
            peak_memory_bytes: report::peak_memory_bytes(),
            outputs: &outputs,
            interrupted: stopped.is_some(),
        })?;
    }
    Ok(stopped.unwrap_or(0))
}

/// Whether the render fits into so many MiB.
/// Of a shard of so many blocks, or of all.
fn check_memory(allowed: Option<usize>, world: &World, settings: &Settings, shard: Option<u32>) -> Result<()> {
    let blocks = |settings: &Settings| shard.unwrap_or_else(|| blocks_of(settings).count());
    let of = |settings: &Settings| memory_of(world, settings, blocks(settings), shard.is_some()).div_ceil(1 << 20);
    let (Some(allowed), needed) = (allowed, of(settings)) else { return Ok(()) };
    let fits = |settings: &Settings| of(settings) <= allowed as u64;
    if fits(settings) {
        return Ok(());
    }
    let of_size = |size: [u32; 2]| Settings { size, ..settings.clone() };
    let smaller = successors(Some(settings.size), |size| Some(size.map(|side| side * 15 / 16)));
    let fitting = smaller.take_while(|size| !size.contains(&0)).find(|&size| fits(&of_size(size)));
    let fewer = successors(Some(settings.directions), |directions| Some(directions / 2));
    let fewer =
        fewer.take_while(|&directions| directions > 0).find(|&directions| fits(&Settings { directions, ..settings.clone() }));
    let fitting = fitting.map(|[width, height]| format!("--size {width}x{height}"));
    let cures =
        fitting.into_iter().chain(fewer.filter(|_| shard.is_none()).map(|directions| format!("--directions {directions}")));
    let cure = cures.chain([format!("--memory {needed}")]).collect::<Vec<_>>().join(" or ");
    Err(Error::usage(format!("the render may take {needed} MiB, and --memory allows {allowed}"), format!("give {cure}")))
}

/// What to add where something is kept.
pub fn resume_of(kept: &Result<bool>) -> &'static str {
    if matches!(kept, Ok(true)) { "; --resume goes on" } else { "" }
}

/// Whether nothing is brighter than a millionth of what the brightest light would show.
fn is_black(image: &Image) -> Result<bool> {
    Ok(image.rgb()?.iter().all(|channel| channel.iter().all(|&sample| sample < 1e-6)))
}

/// What made the picture, by which a finished one is known. No times and no paths: the same render gives the same file.
pub fn metadata(renderer: &str, settings: &Settings, job: &Value, (directions_done, complete): (u32, bool)) -> String {
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "renderer": renderer,
        "settings": settings,
        "job_sha256": sha256(job.to_string().as_bytes()),
        "directions_done": directions_done,
        "complete": complete,
    })
    .to_string()
}

/// Whether all of these files are there and say that they are of this job, which may have ended after any number of directions.
pub fn are_done<'a>(mut outputs: impl Iterator<Item = &'a PathBuf>, metadata: &str) -> bool {
    let about = |mut about: Value| {
        about["directions_done"].take();
        about
    };
    let ours = serde_json::from_str(metadata).ok().map(about);
    outputs.all(|path| export::metadata_of(path).filter(Value::is_object).map(about) == ours)
}

/// Writes every file that can be written, and only then fails with the first error: a render may have taken long.
pub fn write_all(image: &Image, outputs: &[PathBuf], options: &WriteOptions) -> Result<()> {
    let write = |path: &PathBuf| image.write(Path::new(path), options).err();
    let mut errors = outputs.iter().filter_map(write);
    match errors.next() {
        None => Ok(()),
        Some(first) => {
            errors.for_each(|error| report::say(&format!("error: {error}")));
            Err(first)
        }
    }
}
