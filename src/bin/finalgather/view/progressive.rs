//! The open scene and its render, which grows step by step on the renderer's thread.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use finalgather::error::{Error, Result};
use finalgather::file::folder_of;
use finalgather::file::{check_writable, write_file};
use finalgather::gpu::{Gpu, StageClock};
use finalgather::image::{Image, WriteOptions};
use finalgather::job::{Openness, SceneRequest, metadata, of_picture};
use finalgather::render::{End, Layers, Render, SeenSurface};
use finalgather::scene::{Loaded, WorldCamera};
use finalgather::settings::{Exposure, LayerSize, Settings};
use glam::{DVec3, Vec2};

use crate::scene_file::SceneView;

use super::layers::{LayerImages, LayerRequest};
use super::picture::{Developed, DisplayContent, DisplayOptions, develop};
use super::reference::ReferencePicture;
use super::worker::{
    DisplayPicture, DisplayRequest, OpenedScene, ReferenceView, RenderProgress, ViewState, WorkerOptions, WorkerReport,
};

/// Sides of the picture are divided by this while the camera moves, and in the first picture.
const SHRINK: u32 = 2;
/// Most photons of the first picture.
const FIRST_PHOTONS: u64 = 1 << 15;

/// The open scene and its render.
pub struct SceneRender {
    gpu: Gpu,
    request: SceneRequest,
    /// All files that were read.
    files: Vec<PathBuf>,
    render: Render,
    /// The view that was requested last.
    view: ViewState,
    /// Whether no view was requested yet. Until then nothing is shown: after a reload the file's own view may not be the requested one.
    unviewed: bool,
    /// Whether the render must begin again with this view.
    outdated: bool,
    /// Whether no picture was shown yet. The first one is quick: a small one, with few photons.
    unseen: bool,
    pass: RenderPass,
    /// When the last picture was finished.
    taken: Instant,
    /// The time that it took.
    cost: Duration,
    /// When progress was last reported.
    told: Instant,
    stages: Vec<(&'static str, Option<f64>)>,
}

/// State since the render began with its view.
#[derive(Default)]
struct RenderPass {
    /// Whether the picture is only a quick one: of a moving camera, or the first.
    quick: bool,
    /// Whether an error stopped the render.
    halted: bool,
    finished: bool,
    /// Whether an error stopped the layer view.
    blind: bool,
    /// The last picture.
    image: Arc<Image>,
    /// Number of its directions.
    imaged: u32,
    /// Ambient occlusion, if it is shown.
    openness: Option<Openness>,
    /// Whether it has more directions than the last picture.
    opened: bool,
    /// Whether an error stopped it.
    occluded: bool,
    worked: Duration,
    /// The layers that were reported last.
    layers: Option<Arc<Layers>>,
    /// The place that was probed in them.
    place: Option<Vec2>,
}

/// Opens the scene at `path`.
///
/// # Errors
/// If a file cannot be used.
pub fn open(gpu: &Gpu, options: &WorkerOptions, path: &Path) -> Result<(OpenedScene, SceneRender)> {
    let request = SceneRequest { path: path.to_owned(), ..options.scene.clone() };
    let Loaded { world, settings, report, .. } = request.load(true)?;
    let settings = request.settings(&settings)?;
    // What the device refuses of the whole render is refused here. The photons alone take long.
    let render = Render::new(gpu, &world, &settings.with(few_photons))?;
    let [min, max] = world.bounds();
    let camera = about(world.camera(settings.film.size), 0.5 * (min + max));
    let opened = OpenedScene {
        path: path.to_owned(),
        camera,
        settings,
        extent: (max - min).as_vec3(),
        origin: render.gathered().0.scene.space.local_origin(),
        warnings: [report.warnings, render.warnings()].concat(),
        renderer: gpu.info().renderer.clone(),
    };
    let scene = SceneRender {
        gpu: gpu.clone(),
        files: report.files.into_iter().chain(request.environment.clone()).collect(),
        request,
        render,
        view: ViewState { camera, settings, moving: false, pace: 0 },
        unviewed: true,
        outdated: true,
        unseen: true,
        pass: RenderPass::default(),
        taken: Instant::now(),
        cost: Duration::ZERO,
        told: Instant::now(),
        stages: Vec::new(),
    };
    Ok((opened, scene))
}

/// Settings for a smaller picture at once.
fn smaller(mut settings: Settings) -> Settings {
    settings.film.size = settings.film.size.map(|side| side.div_ceil(SHRINK));
    settings.gather.layer_size = LayerSize::Texels(settings.layers().min(128));
    // This gives blocks of eight directions, with a few light samples each.
    settings.directions.count = 256;
    settings.direct.light_samples = 128;
    settings
}

fn few_photons(settings: &mut Settings) {
    settings.photons.count = settings.photons.count.min(FIRST_PHOTONS);
}

/// Moves the target, the centre of orbits, along the view axis to the distance of the scene's centre.
fn about(camera: WorldCamera, center: DVec3) -> WorldCamera {
    let forward = (camera.target - camera.eye).normalize();
    let distance = forward.dot(center - camera.eye);
    if distance > 0.0 { WorldCamera { target: camera.eye + distance * forward, ..camera } } else { camera }
}

impl SceneRender {
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Sets the requested view.
    pub fn set(&mut self, view: ViewState) {
        self.outdated |= !self.view.is_gathered_as(&view);
        self.view = view;
        self.unviewed = false;
    }

    pub fn has_work(&self, wanted: &DisplayRequest) -> bool {
        !self.unviewed && self.has_work_left(wanted)
    }

    fn has_work_left(&self, wanted: &DisplayRequest) -> bool {
        self.outdated || !(self.pass.halted || self.pass.finished) || self.occludes(wanted)
    }

    /// Whether directions of the ambient occlusion are left to gather.
    fn occludes(&self, wanted: &DisplayRequest) -> bool {
        let left = self.pass.openness.as_ref().is_none_or(|openness| !openness.is_done());
        wanted.shown.content == DisplayContent::Openness && left && !self.pass.occluded
    }

    /// The surface at a place of the requested picture.
    pub fn surface_at(&self, place: Vec2) -> Option<SeenSurface> {
        self.render.surface_at(self.view.camera, self.view.settings.film.size, place)
    }

    /// Gathers one step. When a picture is due, reports it with the requested layers.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn advance(&mut self, clock: &StageClock, wanted: &DisplayRequest, tell: &dyn Fn(WorkerReport)) -> Result<()> {
        if !self.has_work(wanted) {
            return Ok(());
        }
        let begun = Instant::now();
        if self.outdated {
            self.restart(tell);
        }
        if !self.pass.halted {
            let stepped = self.render.step();
            self.pass.halted |= self.stops(stepped, tell)?;
        }
        if self.occludes(wanted) {
            let stepped = self.occlude();
            self.pass.occluded |= self.stops(stepped, tell)?;
            if self.pass.occluded {
                // There may be no other picture to say so.
                self.show(wanted, tell);
            }
        }
        self.pass.worked += begun.elapsed();

        let done = self.render.directions_done();
        let new = done - self.pass.imaged;
        let rendered = self.render.is_done() || self.pass.halted;
        let all = rendered && !self.occludes(wanted);
        let due = match self.view.pace {
            // The first directions are shown at once. After that, pictures take a fifth of the time.
            0 => self.pass.imaged == 0 || self.taken.elapsed() > 4 * self.cost,
            pace => new >= pace || rendered && self.taken.elapsed() > 4 * self.cost,
        };
        if (new > 0 || self.pass.opened) && (due || all) {
            let start = Instant::now();
            if new > 0 {
                let per_direction = |seconds: f64| 1e3 * seconds / f64::from(new);
                self.stages = clock.take().stages.into_iter().map(|(name, time)| (name, time.map(per_direction))).collect();
            }
            self.pass.image = Arc::new(self.picture());
            (self.pass.imaged, self.pass.opened) = (done, false);
            self.show(wanted, tell);
            if self.unseen {
                (self.unseen, self.outdated) = (false, true);
                return Ok(());
            }
            if let Some(request) = &wanted.layers {
                self.take_apart(request, tell);
            }
            (self.taken, self.cost) = (Instant::now(), start.elapsed());
        }
        self.pass.finished = rendered;
        if all || self.told.elapsed() > Duration::from_millis(200) {
            self.told = Instant::now();
            tell(WorkerReport::Progress(Box::new(RenderProgress {
                statistics: self.render.statistics().clone(),
                view: Some(self.view.clone()),
                done: all,
                seconds: self.pass.worked.as_secs_f64(),
                stages: self.stages.clone(),
            })));
        }
        Ok(())
    }

    /// Whether this step ends its work by an error. Tells the error.
    ///
    /// # Errors
    /// If the device is lost.
    fn stops(&mut self, step: Result<()>, tell: &dyn Fn(WorkerReport)) -> Result<bool> {
        let Err(error) = step else { return Ok(false) };
        if self.render.is_lost() {
            return Err(error);
        }
        // The whole render says what stops it, if anything does.
        if std::mem::take(&mut self.unseen) {
            self.outdated = true;
            return Ok(true);
        }
        tell(WorkerReport::Halted(error));
        Ok(true)
    }

    /// Gathers a step of the ambient occlusion.
    fn occlude(&mut self) -> Result<()> {
        let openness = match &mut self.pass.openness {
            Some(openness) => openness,
            none => none.insert(Openness::new(&self.gpu, &self.render)?),
        };
        openness.step()?;
        self.pass.opened = true;
        Ok(())
    }

    /// The picture so far, with the channel `AO` if it is shown.
    fn picture(&self) -> Image {
        let mut picture = self.render.picture();
        picture.channels.extend(self.pass.openness.as_ref().and_then(Openness::channel));
        picture
    }

    /// Reports the requested layers and the samples of a point in them, unless they were reported last. After an error the picture continues
    /// without layers. If the device is lost, the next step reports it.
    pub fn take_apart(&mut self, request: &LayerRequest, tell: &dyn Fn(WorkerReport)) {
        if !self.pass.blind
            && let Err(error) = self.try_take_apart(request, tell)
        {
            self.pass.blind = true;
            tell(WorkerReport::Halted(error));
        }
    }

    fn try_take_apart(&mut self, request: &LayerRequest, tell: &dyn Fn(WorkerReport)) -> Result<()> {
        let number = request.number.unwrap_or(self.render.directions_done().saturating_sub(1));
        let end = End { number, opposite: request.opposite };
        let layers = match self.pass.layers.take().filter(|layers| layers.end == end) {
            Some(layers) => layers,
            None => {
                let layers = Arc::new(self.render.layers(end)?);
                tell(WorkerReport::Layers(LayerImages::new(layers.clone())));
                self.pass.place = None;
                layers
            }
        };
        if let Some(place) = request.place.filter(|_| self.pass.place != request.place) {
            self.pass.place = request.place;
            tell(WorkerReport::Probe(self.render.probe(&layers, place)?));
        }
        self.pass.layers = Some(layers);
        Ok(())
    }

    /// Begins again with the requested view.
    fn restart(&mut self, tell: &dyn Fn(WorkerReport)) {
        // Who asks for pictures after certain numbers of directions gets those of the whole render alone.
        self.unseen &= self.view.pace == 0;
        let mut settings = self.view.settings;
        let quick = self.view.moving || self.unseen;
        if quick {
            settings = smaller(settings);
        }
        if self.unseen {
            few_photons(&mut settings);
        }
        self.outdated = false;
        match self.render.restart(self.view.camera, &settings) {
            Ok(()) => self.pass = RenderPass { quick, ..RenderPass::default() },
            // A quick render goes on to no end of its own.
            Err(error) if self.pass.quick && !quick => {
                self.pass.halted = true;
                tell(WorkerReport::Halted(error));
            }
            Err(error) => tell(WorkerReport::Refused(error)),
        }
    }

    /// Reads the shaders again.
    pub fn reload(&mut self, tell: &dyn Fn(WorkerReport)) {
        match self.render.reload() {
            Ok(()) => {
                self.pass = RenderPass { quick: self.pass.quick, ..RenderPass::default() };
                // A refused restart may have kept the render from the requested view.
                self.outdated = true;
            }
            Err(error) => tell(WorkerReport::Refused(error)),
        }
    }

    /// Reports the picture as it is to be shown.
    pub fn show(&self, wanted: &DisplayRequest, tell: &dyn Fn(WorkerReport)) {
        if self.pass.imaged == 0 {
            return;
        }
        let (image, sharp) = (self.pass.image.clone(), !self.pass.quick);
        // A reference has the exposure of the picture.
        let shown = &DisplayOptions { exposure: Exposure::Stops(image.stops(wanted.shown.exposure)), ..wanted.shown };
        let words = |error: Error| match shown.content {
            DisplayContent::Openness if self.pass.occluded => "an error has stopped the ambient occlusion".to_owned(),
            _ => error.to_string(),
        };
        let reference = wanted.reference.as_ref();
        if let Some(reference) = reference.filter(|reference| reference.is_new(shown)) {
            tell(WorkerReport::Reference(Some(Box::new(ReferenceView {
                path: reference.path.clone(),
                developed: reference.develop(shown).map_err(words),
                image: reference.image.clone(),
            }))));
        }
        let comparison = reference.filter(|_| sharp).map(|reference| reference.compare(&image, shown).map_err(words));
        tell(WorkerReport::Picture(Box::new(DisplayPicture {
            developed: developed(&image, shown, reference).map_err(words),
            directions: self.pass.imaged,
            sharp,
            comparison,
            image,
        })));
    }

    /// Writes a scene file of the requested view. Returns the options without which it renders something else.
    ///
    /// # Errors
    /// If the file cannot be written, or the scene can no longer be read.
    pub fn save_scene(&self, path: &Path) -> Result<Vec<String>> {
        check_writable(path)?;
        let Loaded { world, settings: of_file, .. } = self.request.load(true)?;
        let ViewState { camera, settings, .. } = self.view;
        let view = SceneView { source: &self.request.path, world: &world, camera, settings };
        let folder = folder_of(path);
        let is_scene = view.source.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"));
        let text = if is_scene { view.changed(folder, &of_file)? } else { view.text(folder, false, None)? };
        write_file(path, text.as_bytes())?;
        let SceneRequest {
            environment, sun, sky, allow_outside, flip, smooth_angle, strict, no_default_light, scene, clay, ..
        } = &self.request;
        let env = environment.iter().map(|path| format!("--env {}", quoted(&path.to_string_lossy())));
        let smooth = smooth_angle.iter().map(|degrees| format!("--smooth-angle {degrees}"));
        let sun = sun.iter().map(|sun| {
            let [azimuth, height] = sun.place();
            let lux = sun.illuminance.map_or(String::new(), |lux| format!(",{}", lux.x));
            format!("--sun {azimuth},{height}{lux}")
        });
        let sky = sky.iter().map(|sky| format!("--sky={}", sky.turbidity));
        let part = scene.iter().map(|part| format!("--gltf-scene {}", quoted(part)));
        let switches = [
            (*allow_outside, "--allow-outside"),
            (*flip, "--flip"),
            (*clay, "--clay"),
            (*strict, "--strict"),
            (*no_default_light, "--no-default-light"),
        ];
        Ok(env
            .chain(smooth)
            .chain(sun)
            .chain(sky)
            .chain(part)
            .chain(switches.into_iter().filter(|(on, _)| *on).map(|(_, name)| name.to_owned()))
            .collect())
    }

    /// Writes the picture so far.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        // The exposure is the view's. Its other settings may belong to the next render.
        let display = self.view.settings.display;
        let done = (self.render.directions_done(), self.render.is_done());
        let job = self.render.job();
        let metadata = metadata(&job, &display, &of_picture(&job), done);
        let picture = self.render.picture();
        let (exposure, background) = (picture.stops(display.exposure), display.background);
        picture.write(path, &WriteOptions { exposure, background, metadata: Some(&metadata) })
    }
}

/// A word of a command line. Quotes keep others than plain ones together.
fn quoted(word: &str) -> String {
    let plain = |character: char| character.is_alphanumeric() || "/._-+=:,@%".contains(character);
    if !word.is_empty() && word.chars().all(plain) { word.to_owned() } else { format!("'{}'", word.replace('\'', r"'\''")) }
}

/// The pixels to display. With a reference, both have the false colours that show the reference best.
fn developed(image: &Image, shown: &DisplayOptions, reference: Option<&ReferencePicture>) -> Result<Developed> {
    let Some(reference) = reference else { return develop(image, shown) };
    if shown.difference {
        return reference.difference(image, shown);
    }
    let of_reference = || reference.develop(shown).ok()?.scale.map(|scale| scale.range);
    let range =
        shown.range.or_else(|| if shown.false_color || shown.content == DisplayContent::Error { of_reference() } else { None });
    develop(image, &DisplayOptions { range, ..*shown })
}
