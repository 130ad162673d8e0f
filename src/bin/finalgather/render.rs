//! `finalgather render`: everything that can be refused early first, then the render, then the files and the report.

use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::time::Instant;

use finalgather::error::{Error, Result};
use finalgather::gpu::{Gpu, GpuInfo};
use finalgather::image::{Image, WriteOptions, check_writable};
use finalgather::render::Render;
use finalgather::settings::{PointSource, Settings};
use serde_json::json;

use crate::args::RenderArgs;
use crate::interrupt::Interrupt;
use crate::progress::Progress;
use crate::report::{self, Gl, Report, Seconds};

/// The exit code, unless the run failed.
pub fn run(args: &RenderArgs, started: Instant) -> Result<u8> {
    let outputs = args.outputs();
    outputs.iter().try_for_each(|path| check_writable(path))?;

    let progress = Progress::new("loading");
    let outcome = render(args, &outputs, &progress, started);
    progress.clear();
    outcome
}

fn render(args: &RenderArgs, outputs: &[PathBuf], progress: &Progress, started: Instant) -> Result<u8> {
    let interrupt = Interrupt::watch(progress.clone()).map_err(|error| {
        Error::usage(format!("signals cannot be caught: {error}"), "run where the system allows signal handlers")
    })?;
    let loading = Instant::now();
    let scene = args.load_scene()?;
    let load = loading.elapsed().as_secs_f64();
    scene.warnings.iter().for_each(|warning| progress.say(&format!("warning: {warning}")));
    let settings = args.override_settings(scene.settings.clone());
    settings.validate()?;
    if settings.points == PointSource::Camera && (scene.is_specular() || scene.camera.lens.is_some()) {
        progress.say("warning: mirrors and glass are drawn as diffuse, through a pinhole; --points traced shows what they are");
    }

    progress.stage("starting OpenGL");
    let gpu = Gpu::headless(args.backend, args.gl_device)?;
    progress.stage("tracing photons");
    let mut render = Render::new(&gpu, &scene, &settings)?;
    progress.begin_directions(settings.directions);
    let mut failure = None;
    while failure.is_none() && !render.is_done() && interrupt.requested().is_none() {
        failure = render.step().err();
        interrupt.picture_begun();
        progress.directions_done(render.directions_done());
    }
    // What was gathered before the device failed is worth keeping.
    if let Some(error) = failure.take_if(|_| render.directions_done() == 0) {
        return Err(error);
    }
    let stopped = interrupt.requested().filter(|_| !render.is_done());
    let image = render.picture();
    if render.directions_done() > 0 && is_black(&image)? {
        progress.say("warning: the picture is black: the camera sees no surface that light reaches; turn it or the lights");
    }
    progress.clear();

    let writing = Instant::now();
    let metadata = metadata(gpu.info(), &settings, render.directions_done());
    write_all(&image, outputs, &WriteOptions { exposure: settings.exposure, metadata: Some(&metadata) })?;
    let write = writing.elapsed().as_secs_f64();

    let outputs: Vec<_> = outputs.iter().map(|path| path.display().to_string()).collect();
    let paths = outputs.join(", ");
    if let Some(error) = failure {
        let (done, all) = (render.directions_done(), settings.directions);
        report::say(&format!("failed after {done} of {all} directions; picture so far written to {paths}"));
        return Err(error);
    }
    if stopped.is_some() {
        let (done, all) = (render.directions_done(), settings.directions);
        report::say(&format!("stopped after {done} of {all} directions; picture so far written to {paths}"));
    } else if io::stderr().is_terminal() {
        report::say(&format!("written to {paths} after {:.1} s", started.elapsed().as_secs_f64()));
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

/// Whether nothing is brighter than a millionth of what the brightest light would show.
fn is_black(image: &Image) -> Result<bool> {
    Ok(image.rgb()?.iter().all(|channel| channel.iter().all(|&sample| sample < 1e-6)))
}

/// What made the picture. No times and no paths: the same render gives the same file.
pub fn metadata(gl: &GpuInfo, settings: &Settings, directions_done: u32) -> String {
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "renderer": gl.renderer,
        "settings": settings,
        "directions_done": directions_done,
    })
    .to_string()
}

/// Writes every file that can be written, and only then fails with the first error: a render may have taken long.
fn write_all(image: &Image, outputs: &[PathBuf], options: &WriteOptions) -> Result<()> {
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
