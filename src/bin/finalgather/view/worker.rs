//! The renderer on a thread and a GL context of its own, so that the interface never waits for it.
//!
//! It heeds [`Command`]s between two steps and tells by [`Report`]s what has come of them.

use std::any::Any;
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender, TryRecvError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant, SystemTime};
use std::{fs, io};

use egui::ColorImage;
use finalgather::error::{Error, Result};
use finalgather::gpu::{Gpu, StageClock};
use finalgather::image::{Image, WriteOptions};
use finalgather::job::{DeviceRequest, SceneRequest, metadata};
use finalgather::math::Aabb;
use finalgather::render::{End, Layers, Probe, Render, RenderStatistics};
use finalgather::scene::{Camera, Loaded};
use finalgather::settings::{LayerSize, Settings};
use finalgather::shaders;
use glam::Vec2;
use serde_json::Value;

use super::layers::{Apart, Wish};
use super::picture::{Shown, developed};

/// How sides of the picture shrink while it moves.
const SHRINK: u32 = 2;

/// What the renderer is to do.
pub enum Command {
    /// Answered by [`Report::Opened`] or [`Report::NotOpened`].
    Open(PathBuf),
    Look(View),
    Show(Shown),
    /// What the layer view is to have, while there is one.
    Layers(Option<Wish>),
    /// Writes the picture so far.
    Save(PathBuf),
}

/// What is to be rendered of the scene.
#[derive(Clone, PartialEq)]
pub struct View {
    /// In world space.
    pub camera: Camera,
    pub settings: Settings,
    /// Rather soon than sharp.
    pub moving: bool,
    /// Directions from one picture to the next; 0 is as many as leave most of the time to them.
    pub pace: u32,
}

impl View {
    /// Whether the renderer has the same to do for both.
    pub fn is_gathered_as(&self, other: &Self) -> bool {
        let settings = Settings { exposure: other.settings.exposure, ..self.settings.clone() };
        View { settings, pace: other.pace, ..*self } == *other
    }
}

/// What the renderer tells.
pub enum Report {
    Opened(Box<Opened>),
    /// The scene before stays.
    NotOpened(Error),
    Picture(Picture),
    Progress(Box<Progress>),
    Layers(Apart),
    Probe(Option<Probe>),
    Saved(PathBuf),
    /// It goes on with what it had.
    Refused(Error),
    /// Something that is asked for will not come: the rest of the directions, or the layers.
    Halted(Error),
    /// It has ended.
    Failed(Error),
}

/// A scene that is there now.
pub struct Opened {
    pub path: PathBuf,
    pub camera: Camera,
    /// The scene file's with those of the command line over them.
    pub settings: Settings,
    /// The scene's box.
    pub bounds: Aabb,
    pub warnings: Vec<String>,
    pub renderer: String,
}

pub struct Picture {
    pub image: Arc<ColorImage>,
    /// What it is the mean of.
    pub directions: u32,
    /// Of the view as it is to stay.
    pub sharp: bool,
}

#[derive(Clone, Default)]
pub struct Progress {
    pub statistics: RenderStatistics,
    /// Of what.
    pub view: Option<View>,
    /// Whether nothing is left to do, and shown.
    pub done: bool,
    /// Seconds of work since the view changed last.
    pub seconds: f64,
    /// Milliseconds a direction on the device; `None` where it tells no time.
    pub stages: Vec<(&'static str, Option<f64>)>,
}

/// The interface's end of the thread; dropped, it ends.
pub struct Worker {
    commands: Option<Sender<Command>>,
    pub reports: Receiver<Report>,
    thread: Option<JoinHandle<()>>,
}

/// What it starts from.
#[derive(Clone)]
pub struct Start {
    pub device: DeviceRequest,
    /// Of any path.
    pub scene: SceneRequest,
    /// Where shaders are read, and read again when they change.
    pub shaders: Option<PathBuf>,
}

impl Worker {
    /// `wake` is called after each report.
    pub fn start(start: Start, wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let (commands, receiver) = mpsc::channel();
        let (sender, reports) = mpsc::channel();
        let thread = thread::Builder::new().name("renderer".into()).spawn(move || {
            let tell = |report| {
                // Nobody listens only when all is about to end.
                let _ = sender.send(report);
                wake();
            };
            // Whatever this thread starts, the driver's threads for one, yields to the interface too. Where the system refuses, all are equal.
            #[cfg(target_os = "linux")]
            let _ = rustix::process::nice(10);
            let ended = panic::catch_unwind(AssertUnwindSafe(|| work(&start, &receiver, &tell)));
            if let Err(error) = ended.unwrap_or_else(|words| Err(panicked(&*words))) {
                tell(Report::Failed(error));
            }
        })?;
        Ok(Self { commands: Some(commands), reports, thread: Some(thread) })
    }

    /// A thread that has failed hears nothing; what it was to do is asked again of the next.
    pub fn send(&self, command: Command) {
        if let Some(commands) = &self.commands {
            let _ = commands.send(command);
        }
    }

    /// Waits some time for it to leave the GL driver. Whether it has.
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

/// The scene that is open.
struct OpenScene {
    render: Render,
    /// As last asked for, and whether the render is of that.
    view: View,
    fresh: bool,
    /// Why it does not go on.
    halted: bool,
    /// The picture so far, as the clock at its time had it.
    image: Image,
    imaged: u32,
    /// When that was, and how long it took.
    taken: Instant,
    cost: Duration,
    told: Instant,
    worked: Duration,
    device: Vec<(&'static str, Option<f64>)>,
    finished: bool,
    /// As shown last, and the place in them.
    layers: Option<Arc<Layers>>,
    place: Option<Vec2>,
    /// Whether layers were asked for in vain.
    blind: bool,
}

fn work(start: &Start, commands: &Receiver<Command>, tell: &dyn Fn(Report)) -> Result<()> {
    if let Some(folder) = &start.shaders {
        shaders::reload(folder);
    }
    let mut changed = start.shaders.as_deref().and_then(newest);
    let gpu = start.device.open()?;
    let clock = StageClock::start(&gpu);
    let mut job: Option<OpenScene> = None;
    let mut shown = Shown::default();
    let mut wish: Option<Wish> = None;
    loop {
        let command = if job.as_ref().is_some_and(OpenScene::has_work) {
            commands.try_recv().map_err(|none| none == TryRecvError::Disconnected)
        } else if start.shaders.is_some() {
            commands.recv_timeout(Duration::from_millis(250)).map_err(|none| none == RecvTimeoutError::Disconnected)
        } else {
            commands.recv().map_err(|_| true)
        };
        match command {
            Err(true) => return Ok(()),
            Ok(Command::Open(path)) => match open(&gpu, start, &path) {
                Ok((opened, next)) => {
                    tell(Report::Opened(Box::new(opened)));
                    job = Some(next);
                }
                Err(error) => tell(Report::NotOpened(error)),
            },
            Ok(Command::Show(other)) => {
                shown = other;
                if let Some(job) = &job {
                    job.show(&shown, tell)?;
                }
            }
            Ok(Command::Look(view)) => {
                if let Some(job) = &mut job {
                    job.fresh &= job.view.is_gathered_as(&view);
                    job.view = view;
                }
            }
            Ok(Command::Layers(other)) => {
                wish = other;
                if let (Some(wish), Some(job)) = (&wish, &mut job) {
                    job.take_apart(wish, tell);
                }
            }
            Ok(Command::Save(path)) => {
                if let Some(job) = &job {
                    tell(job.save(&path).map_or_else(Report::Refused, |()| Report::Saved(path)));
                }
            }
            Err(false) => {
                if let Some(folder) = &start.shaders
                    && changed != newest(folder)
                {
                    changed = newest(folder);
                    shaders::reload(folder);
                    if let Some(job) = &mut job {
                        job.reload(tell);
                    }
                }
                if let Some(job) = &mut job {
                    job.advance(&clock, &shown, wish.as_ref(), tell)?;
                }
            }
        }
    }
}

/// When the folder, of which files may go, or something in it was changed last.
fn newest(path: &Path) -> Option<SystemTime> {
    let own = fs::metadata(path).ok()?.modified().ok();
    let entries = fs::read_dir(path).into_iter().flatten().flatten();
    entries.map(|entry| newest(&entry.path())).chain([own]).max()?
}

fn open(gpu: &Gpu, start: &Start, path: &Path) -> Result<(Opened, OpenScene)> {
    let request = SceneRequest { path: path.to_owned(), ..start.scene.clone() };
    let Loaded { world, settings, report } = request.load(true)?;
    let settings = request.settings(&settings)?;
    let render = Render::new(gpu, &world, &settings)?;
    let bounds = world.bounds();
    let camera = about(world.camera(settings.size), bounds);
    let opened = Opened {
        path: path.to_owned(),
        camera,
        settings: settings.clone(),
        bounds,
        warnings: report.warnings,
        renderer: gpu.info().renderer.clone(),
    };
    Ok((opened, OpenScene::new(camera, render, settings)))
}

/// The camera with its target, about which it turns, as far away as the middle of the scene.
fn about(camera: Camera, bounds: Aabb) -> Camera {
    let forward = (camera.target - camera.eye).normalize();
    let distance = forward.dot(bounds.center() - camera.eye);
    if distance > 0.0 { Camera { target: camera.eye + distance * forward, ..camera } } else { camera }
}

impl OpenScene {
    fn new(camera: Camera, render: Render, settings: Settings) -> Self {
        let view = View { camera, settings, moving: false, pace: 0 };
        Self {
            render,
            view,
            fresh: true,
            halted: false,
            image: Image::default(),
            imaged: 0,
            taken: Instant::now(),
            cost: Duration::ZERO,
            told: Instant::now(),
            worked: Duration::ZERO,
            device: Vec::new(),
            finished: false,
            layers: None,
            place: None,
            blind: false,
        }
    }

    fn has_work(&self) -> bool {
        !self.fresh || !(self.halted || self.finished)
    }

    /// One step, and where it is due a picture, with the layers that are wished for.
    ///
    /// # Errors
    /// When the device has failed for good.
    fn advance(&mut self, clock: &StageClock, shown: &Shown, wish: Option<&Wish>, tell: &dyn Fn(Report)) -> Result<()> {
        if !self.has_work() {
            return Ok(());
        }
        let begun = Instant::now();
        if !self.fresh {
            self.restart(tell);
        }
        if !self.halted
            && let Err(error) = self.render.step()
        {
            if self.render.is_lost() {
                return Err(error);
            }
            tell(Report::Halted(error));
            self.halted = true;
        }
        self.worked += begun.elapsed();

        let done = self.render.directions_done();
        let all = self.render.is_done() || self.halted;
        let due = match self.view.pace {
            // The first few at once; then a picture costs a fifth of the time.
            0 => self.imaged == 0 || self.taken.elapsed() > 4 * self.cost,
            pace => done - self.imaged >= pace,
        };
        if done > self.imaged && (due || all) {
            let start = Instant::now();
            self.image = self.render.picture();
            let stages = clock.take().stages.into_iter();
            let directions = f64::from(done - self.imaged);
            self.device = stages.map(|(name, seconds)| (name, seconds.map(|seconds| 1e3 * seconds / directions))).collect();
            self.imaged = done;
            self.show(shown, tell)?;
            if let Some(wish) = wish {
                self.take_apart(wish, tell);
            }
            (self.taken, self.cost) = (Instant::now(), start.elapsed());
        }
        self.finished = all;
        if all || self.told.elapsed() > Duration::from_millis(200) {
            self.told = Instant::now();
            tell(Report::Progress(Box::new(Progress {
                statistics: self.render.statistics().clone(),
                view: Some(self.view.clone()),
                done: all,
                seconds: self.worked.as_secs_f64(),
                stages: self.device.clone(),
            })));
        }
        Ok(())
    }

    /// The layers that are wished for, and what a point samples of them, as far as they are not on show. What goes wrong here leaves the
    /// picture as it is; where the device is lost, the next step says so.
    fn take_apart(&mut self, wish: &Wish, tell: &dyn Fn(Report)) {
        if !self.blind
            && let Err(error) = self.try_take_apart(wish, tell)
        {
            self.blind = true;
            tell(Report::Halted(error));
        }
    }

    fn try_take_apart(&mut self, wish: &Wish, tell: &dyn Fn(Report)) -> Result<()> {
        let number = wish.number.unwrap_or(self.render.directions_done().saturating_sub(1));
        let end = End { number, opposite: wish.opposite };
        let layers = match self.layers.take().filter(|layers| layers.end == end) {
            Some(layers) => layers,
            None => {
                let layers = Arc::new(self.render.layers(end)?);
                tell(Report::Layers(Apart::new(layers.clone())));
                self.place = None;
                layers
            }
        };
        if let Some(place) = wish.place.filter(|_| self.place != wish.place) {
            self.place = wish.place;
            tell(Report::Probe(self.render.probe(&layers, place)?));
        }
        self.layers = Some(layers);
        Ok(())
    }

    /// Begins with the view as it was last asked for.
    fn restart(&mut self, tell: &dyn Fn(Report)) {
        let mut settings = self.view.settings.clone();
        if self.view.moving {
            settings.size = settings.size.map(|side| side.div_ceil(SHRINK));
            settings.layer_size = LayerSize::Texels(settings.layers().min(128));
            // Blocks of eight directions, with a few samples of the lights each.
            settings.directions = 256;
            settings.light_samples = 128;
        }
        self.fresh = true;
        match self.render.restart(self.view.camera, &settings) {
            Ok(()) => self.forget(),
            Err(error) => tell(Report::Refused(error)),
        }
    }

    /// What the render has forgotten.
    fn forget(&mut self) {
        (self.halted, self.finished, self.blind, self.imaged) = (false, false, false, 0);
        self.layers = None;
        self.worked = Duration::ZERO;
    }

    fn reload(&mut self, tell: &dyn Fn(Report)) {
        match self.render.reload() {
            // Begun again as it was asked for last, which a refusal may have kept it from.
            Ok(()) => {
                self.forget();
                self.fresh = false;
            }
            Err(error) => tell(Report::Refused(error)),
        }
    }

    fn show(&self, shown: &Shown, tell: &dyn Fn(Report)) -> Result<()> {
        if self.imaged > 0 {
            let image = Arc::new(developed(&self.image, shown)?);
            tell(Report::Picture(Picture { image, directions: self.imaged, sharp: !self.view.moving }));
        }
        Ok(())
    }

    fn save(&self, path: &Path) -> Result<()> {
        // The exposure on show; the view's other settings may be of a picture to come.
        let exposure = self.view.settings.exposure;
        let done = (self.render.directions_done(), self.render.is_done());
        let metadata = metadata(&self.render.job(), exposure, Value::Null, done);
        self.render.picture().write(path, &WriteOptions { exposure, metadata: Some(&metadata) })
    }
}
