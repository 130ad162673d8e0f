//! Runs the renderer on its own thread with its own GL context, so that the interface never waits for it.
//!
//! The thread handles [`WorkerCommand`]s between two steps and sends [`WorkerReport`]s.

use std::any::Any;
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant, SystemTime};
use std::{fs, io};

use egui::ColorImage;
use finalgather::error::{Error, Result};
use finalgather::gpu::{Gpu, StageClock};
use finalgather::image::{Image, WriteOptions};
use finalgather::job::{DeviceRequest, SceneRequest, metadata, of_picture};
use finalgather::render::{End, Layers, Probe, Render, RenderStatistics};
use finalgather::scene::{Loaded, WorldCamera};
use finalgather::settings::{LayerSize, Settings};
use finalgather::shaders;
use glam::{DVec3, Vec2, Vec3};

use super::layers::{LayerImages, LayerRequest};
use super::picture::{DisplayOptions, develop};

/// Sides of the picture are divided by this while the camera moves.
const SHRINK: u32 = 2;

/// Commands to the renderer.
pub enum WorkerCommand {
    /// Opens a scene. Answered by [`WorkerReport::Opened`] or [`WorkerReport::NotOpened`].
    Open(PathBuf),
    SetView(ViewState),
    Display(DisplayOptions),
    /// Requests layers after every picture, until `None` is sent.
    Layers(Option<LayerRequest>),
    /// Writes the picture so far.
    Save(PathBuf),
}

/// The requested camera and settings of the render.
#[derive(Clone, PartialEq)]
pub struct ViewState {
    /// In world space.
    pub camera: WorldCamera,
    pub settings: Settings,
    /// While the camera moves, pictures are smaller and come sooner.
    pub moving: bool,
    /// Directions from one picture to the next; 0 lets pictures take a fifth of the time.
    pub pace: u32,
}

impl ViewState {
    /// Whether both need the same gathering.
    pub fn is_gathered_as(&self, other: &Self) -> bool {
        let settings = Settings { display: other.settings.display, ..self.settings };
        Self { settings, pace: other.pace, ..*self } == *other
    }
}

/// Reports from the renderer.
pub enum WorkerReport {
    Opened(Box<OpenedScene>),
    /// The previous scene stays open.
    NotOpened(Error),
    Picture(DisplayPicture),
    Progress(Box<RenderProgress>),
    Layers(LayerImages),
    Probe(Option<Probe>),
    Saved(PathBuf),
    /// A command failed. The renderer continues as before.
    Refused(Error),
    /// The render or the layer view stopped: the rest of the directions, or the layers, will not come.
    Halted(Error),
    /// The thread has ended.
    Failed(Error),
}

/// The scene that was opened.
pub struct OpenedScene {
    pub path: PathBuf,
    pub camera: WorldCamera,
    /// Settings of the scene file, overridden by the command line.
    pub settings: Settings,
    /// Lengths of the sides of its bounding box.
    pub extent: Vec3,
    pub warnings: Vec<String>,
    pub renderer: String,
}

pub struct DisplayPicture {
    pub image: Arc<ColorImage>,
    /// Number of directions in the picture.
    pub directions: u32,
    /// Whether the camera was still.
    pub sharp: bool,
}

#[derive(Clone, Default)]
pub struct RenderProgress {
    pub statistics: RenderStatistics,
    /// The view of the render.
    pub view: Option<ViewState>,
    /// Whether all directions are gathered and displayed.
    pub done: bool,
    /// Seconds of work since the view last changed.
    pub seconds: f64,
    /// Milliseconds of device time a direction; `None` if the driver measures no time.
    pub stages: Vec<(&'static str, Option<f64>)>,
}

/// The interface's handle of the thread. Dropping it ends the thread.
pub struct Worker {
    commands: Option<Sender<WorkerCommand>>,
    pub reports: Receiver<WorkerReport>,
    thread: Option<JoinHandle<()>>,
}

/// Options of the renderer.
#[derive(Clone)]
pub struct WorkerOptions {
    pub device: DeviceRequest,
    /// What differs from the scene file; its path is that of the file to open.
    pub scene: SceneRequest,
    /// The folder of shaders that are reloaded when they change.
    pub shaders: Option<PathBuf>,
}

impl Worker {
    /// `wake` is called after each report.
    pub fn start(options: WorkerOptions, wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let (commands, receiver) = mpsc::channel();
        let (sender, reports) = mpsc::channel();
        let thread = thread::Builder::new().name("renderer".into()).spawn(move || {
            let tell = |report| {
                // This fails only when the program is about to end.
                let _ = sender.send(report);
                wake();
            };
            // Threads of the driver inherit the low priority, so that the interface goes first. A failure does no harm.
            #[cfg(target_os = "linux")]
            let _ = rustix::process::nice(10);
            let ended = panic::catch_unwind(AssertUnwindSafe(|| work(&options, &receiver, &tell)));
            if let Err(error) = ended.unwrap_or_else(|words| Err(panicked(&*words))) {
                tell(WorkerReport::Failed(error));
            }
        })?;
        Ok(Self { commands: Some(commands), reports, thread: Some(thread) })
    }

    /// A thread that has failed ignores commands. The application repeats them for the next thread.
    pub fn send(&self, command: WorkerCommand) {
        if let Some(commands) = &self.commands {
            let _ = commands.send(command);
        }
    }

    /// Ends the thread and waits up to `patience` for it to leave the GL driver. Returns whether it has.
    pub fn end(&mut self, patience: Duration) -> bool {
        self.commands = None;
        let until = Instant::now() + patience;
        while self.thread.as_ref().is_some_and(|thread| !thread.is_finished()) && Instant::now() < until {
            thread::sleep(Duration::from_millis(5));
        }
        self.thread.take_if(|thread| thread.is_finished()).map(JoinHandle::join).is_some()
    }
}

fn panicked(words: &(dyn Any + Send)) -> Error {
    let words = words.downcast_ref::<String>().map(String::as_str).or(words.downcast_ref::<&str>().copied());
    Error::gl(format!("the renderer panicked: {}", words.unwrap_or("it does not say why")), "start again, and report this")
}

/// The open scene and its render.
struct SceneRender {
    render: Render,
    /// The view that was requested last.
    view: ViewState,
    /// Whether the render must begin again with this view.
    outdated: bool,
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
    /// Whether an error stopped the render.
    halted: bool,
    finished: bool,
    /// Whether an error stopped the layer view.
    blind: bool,
    /// The last picture.
    image: Image,
    /// Number of its directions.
    imaged: u32,
    worked: Duration,
    /// The layers that were reported last.
    layers: Option<Arc<Layers>>,
    /// The place that was probed in them.
    place: Option<Vec2>,
}

fn work(options: &WorkerOptions, commands: &Receiver<WorkerCommand>, tell: &dyn Fn(WorkerReport)) -> Result<()> {
    if let Some(folder) = &options.shaders {
        shaders::reload(folder);
    }
    let mut changed = options.shaders.as_deref().and_then(newest);
    let gpu = options.device.open()?;
    let clock = StageClock::start(&gpu);
    let mut scene: Option<SceneRender> = None;
    let mut shown = DisplayOptions::default();
    let mut layers: Option<LayerRequest> = None;
    loop {
        let patience = match &options.shaders {
            _ if scene.as_ref().is_some_and(SceneRender::has_work) => Duration::ZERO,
            Some(_) => Duration::from_millis(250),
            None => Duration::MAX,
        };
        match (commands.recv_timeout(patience), scene.as_mut()) {
            (Err(RecvTimeoutError::Disconnected), _) => return Ok(()),
            (Err(RecvTimeoutError::Timeout), mut scene) => {
                if let Some(folder) = &options.shaders
                    && changed != newest(folder)
                {
                    changed = newest(folder);
                    shaders::reload(folder);
                    if let Some(scene) = &mut scene {
                        scene.reload(tell);
                    }
                }
                if let Some(scene) = scene {
                    scene.advance(&clock, &shown, layers.as_ref(), tell)?;
                }
            }
            (Ok(WorkerCommand::Open(path)), _) => match open(&gpu, options, &path) {
                Ok((opened, next)) => {
                    tell(WorkerReport::Opened(Box::new(opened)));
                    scene = Some(next);
                }
                Err(error) => tell(WorkerReport::NotOpened(error)),
            },
            (Ok(WorkerCommand::Display(other)), scene) => {
                shown = other;
                scene.map_or(Ok(()), |scene| scene.show(&shown, tell))?;
            }
            (Ok(WorkerCommand::Layers(other)), scene) => {
                layers = other;
                if let (Some(request), Some(scene)) = (&layers, scene) {
                    scene.take_apart(request, tell);
                }
            }
            (Ok(WorkerCommand::SetView(view)), Some(scene)) => {
                scene.outdated |= !scene.view.is_gathered_as(&view);
                scene.view = view;
            }
            (Ok(WorkerCommand::Save(path)), Some(scene)) => {
                tell(scene.save(&path).map_or_else(WorkerReport::Refused, |()| WorkerReport::Saved(path)));
            }
            (Ok(WorkerCommand::SetView(_) | WorkerCommand::Save(_)), None) => {}
        }
    }
}

/// The time of the last change of a folder or its contents. Files may vanish meanwhile.
fn newest(path: &Path) -> Option<SystemTime> {
    let own = fs::metadata(path).ok()?.modified().ok();
    let entries = fs::read_dir(path).into_iter().flatten().flatten();
    entries.map(|entry| newest(&entry.path())).chain([own]).max()?
}

fn open(gpu: &Gpu, options: &WorkerOptions, path: &Path) -> Result<(OpenedScene, SceneRender)> {
    let request = SceneRequest { path: path.to_owned(), ..options.scene.clone() };
    let Loaded { world, settings, report } = request.load(true)?;
    let settings = request.settings(&settings)?;
    let render = Render::new(gpu, &world, &settings)?;
    let [min, max] = world.bounds();
    let camera = about(world.camera(settings.film.size), 0.5 * (min + max));
    let opened = OpenedScene {
        path: path.to_owned(),
        camera,
        settings,
        extent: (max - min).as_vec3(),
        warnings: [report.warnings, render.warnings()].concat(),
        renderer: gpu.info().renderer.clone(),
    };
    let scene = SceneRender {
        render,
        view: ViewState { camera, settings, moving: false, pace: 0 },
        outdated: false,
        pass: RenderPass::default(),
        taken: Instant::now(),
        cost: Duration::ZERO,
        told: Instant::now(),
        stages: Vec::new(),
    };
    Ok((opened, scene))
}

/// Moves the target, the centre of orbits, along the view axis to the distance of the scene's centre.
fn about(camera: WorldCamera, center: DVec3) -> WorldCamera {
    let forward = (camera.target - camera.eye).normalize();
    let distance = forward.dot(center - camera.eye);
    if distance > 0.0 { WorldCamera { target: camera.eye + distance * forward, ..camera } } else { camera }
}

impl SceneRender {
    fn has_work(&self) -> bool {
        self.outdated || !(self.pass.halted || self.pass.finished)
    }

    /// Gathers one step. When a picture is due, reports it with the requested layers.
    ///
    /// # Errors
    /// If the device is lost.
    fn advance(
        &mut self,
        clock: &StageClock,
        shown: &DisplayOptions,
        layers: Option<&LayerRequest>,
        tell: &dyn Fn(WorkerReport),
    ) -> Result<()> {
        if !self.has_work() {
            return Ok(());
        }
        let begun = Instant::now();
        if self.outdated {
            self.restart(tell);
        }
        if !self.pass.halted
            && let Err(error) = self.render.step()
        {
            if self.render.is_lost() {
                return Err(error);
            }
            tell(WorkerReport::Halted(error));
            self.pass.halted = true;
        }
        self.pass.worked += begun.elapsed();

        let done = self.render.directions_done();
        let new = done - self.pass.imaged;
        let all = self.render.is_done() || self.pass.halted;
        let due = match self.view.pace {
            // The first directions are shown at once. After that, pictures take a fifth of the time.
            0 => self.pass.imaged == 0 || self.taken.elapsed() > 4 * self.cost,
            pace => new >= pace,
        };
        if new > 0 && (due || all) {
            let start = Instant::now();
            self.pass.image = self.render.picture();
            let per_direction = |seconds: f64| 1e3 * seconds / f64::from(new);
            self.stages = clock.take().stages.into_iter().map(|(name, time)| (name, time.map(per_direction))).collect();
            self.pass.imaged = done;
            self.show(shown, tell)?;
            if let Some(request) = layers {
                self.take_apart(request, tell);
            }
            (self.taken, self.cost) = (Instant::now(), start.elapsed());
        }
        self.pass.finished = all;
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

    /// Reports the requested layers and the samples of a point in them, unless they were reported last. After an error the picture continues
    /// without layers. If the device is lost, the next step reports it.
    fn take_apart(&mut self, request: &LayerRequest, tell: &dyn Fn(WorkerReport)) {
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
        let mut settings = self.view.settings;
        if self.view.moving {
            settings.film.size = settings.film.size.map(|side| side.div_ceil(SHRINK));
            settings.gather.layer_size = LayerSize::Texels(settings.layers().min(128));
            // This gives blocks of eight directions, with a few light samples each.
            settings.directions.count = 256;
            settings.direct.light_samples = 128;
        }
        self.outdated = false;
        match self.render.restart(self.view.camera, &settings) {
            Ok(()) => self.pass = RenderPass::default(),
            Err(error) => tell(WorkerReport::Refused(error)),
        }
    }

    fn reload(&mut self, tell: &dyn Fn(WorkerReport)) {
        match self.render.reload() {
            Ok(()) => {
                self.pass = RenderPass::default();
                // A refused restart may have kept the render from the requested view.
                self.outdated = true;
            }
            Err(error) => tell(WorkerReport::Refused(error)),
        }
    }

    fn show(&self, shown: &DisplayOptions, tell: &dyn Fn(WorkerReport)) -> Result<()> {
        if self.pass.imaged > 0 {
            let image = Arc::new(develop(&self.pass.image, shown)?);
            tell(WorkerReport::Picture(DisplayPicture { image, directions: self.pass.imaged, sharp: !self.view.moving }));
        }
        Ok(())
    }

    fn save(&self, path: &Path) -> Result<()> {
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
