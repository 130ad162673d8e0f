//! Runs the renderer on its own thread with its own GL context, so that the interface never waits for it.
//!
//! The thread handles [`WorkerCommand`]s between two steps and sends [`WorkerReport`]s.

use std::any::Any;
use std::io;
use std::mem;
use std::panic::{self, AssertUnwindSafe};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant, SystemTime};

use finalgather::error::{Error, Result};
use finalgather::gpu::StageClock;
use finalgather::image::Image;
use finalgather::image::compare::Comparison;
use finalgather::job::{DeviceRequest, SceneRequest};
use finalgather::render::{Probe, RenderStatistics, SeenSurface};
use finalgather::scene::WorldCamera;
use finalgather::settings::Settings;
use finalgather::shaders;
use glam::{DVec3, Vec2, Vec3};

use super::layers::{LayerImages, LayerRequest};
use super::picture::{Developed, DisplayOptions};
use super::progressive::{SceneRender, open};
use super::reference::ReferencePicture;
use super::watch::{FileWatch, PAUSE};

/// Commands to the renderer.
pub enum WorkerCommand {
    /// Opens a scene. Answered by [`WorkerReport::Opened`] or [`WorkerReport::NotOpened`].
    Open(PathBuf),
    SetView(ViewState),
    Display(DisplayOptions),
    /// Requests layers after every picture, until `None` is sent.
    Layers(Option<LayerRequest>),
    /// Asks for the names of the surface at this place of the picture, as in [`Probe::place`].
    Surface(Vec2),
    /// Opens a picture to compare with, or closes it.
    Reference(Option<PathBuf>),
    /// Writes the picture so far.
    Save(PathBuf),
    /// Writes a scene file with the requested view.
    SaveScene(PathBuf),
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
    /// The files of the scene have changed, and were read again.
    Reloaded(Box<OpenedScene>),
    /// The previous scene stays open.
    NotOpened(Error),
    Picture(Box<DisplayPicture>),
    Progress(Box<RenderProgress>),
    Layers(LayerImages),
    Probe(Option<Probe>),
    /// The surface at a place that was asked for.
    Surface(Vec2, Option<SeenSurface>),
    /// The reference as it is to be displayed; `None`: it is closed.
    Reference(Option<Box<ReferenceView>>),
    /// A reference cannot be used. The previous one, if any, stays open.
    NotCompared(Error, Option<PathBuf>),
    Saved(PathBuf),
    /// A scene file is written. It needs these options to render as here.
    SceneSaved(PathBuf, Vec<String>),
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
    /// To which the positions of pictures are relative.
    pub origin: DVec3,
    pub warnings: Vec<String>,
    pub renderer: String,
}

pub struct DisplayPicture {
    /// Why it cannot be shown, if it cannot.
    pub developed: Result<Developed, String>,
    /// Its channels.
    pub image: Arc<Image>,
    /// Number of directions in the picture.
    pub directions: u32,
    /// Whether the camera was still.
    pub sharp: bool,
    /// Its differences from the reference, if there is one.
    pub comparison: Option<Result<Comparison, String>>,
}

pub struct ReferenceView {
    pub path: PathBuf,
    pub developed: Result<Developed, String>,
    pub image: Arc<Image>,
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

/// The state of the renderer's thread beside the scene.
#[derive(Default)]
pub struct DisplayRequest {
    pub shown: DisplayOptions,
    pub layers: Option<LayerRequest>,
    pub reference: Option<ReferencePicture>,
}

/// Commands that were received, but not handled yet.
#[derive(Default)]
struct WaitingCommands(Vec<WorkerCommand>);

impl WaitingCommands {
    /// The next command. Of those that wait, the ones that a later one replaces are left out: a drag sends some in each frame.
    fn next(&mut self, commands: &Receiver<WorkerCommand>, patience: Duration) -> Result<WorkerCommand, RecvTimeoutError> {
        if self.0.is_empty() {
            self.add(commands.recv_timeout(patience)?);
        }
        commands.try_iter().for_each(|command| self.add(command));
        Ok(self.0.remove(0))
    }

    fn add(&mut self, command: WorkerCommand) {
        use WorkerCommand::{Display, Layers, SetView, Surface};
        // The others are done one by one, with what was sent before them.
        let replaceable = |command: &WorkerCommand| matches!(command, Display(_) | SetView(_) | Surface(_) | Layers(_));
        let first = self.0.iter().rposition(|waiting| !replaceable(waiting)).map_or(0, |last| last + 1);
        let same = |waiting: &WorkerCommand| mem::discriminant(waiting) == mem::discriminant(&command);
        let old = self.0[first..].iter().position(same).map(|old| first + old).filter(|_| replaceable(&command));
        match (old, &command) {
            (None, _) => self.0.push(command),
            // A surface is of the view that was sent before it.
            (Some(old), Surface(_)) => {
                self.0.remove(old);
                self.0.push(command);
            }
            (Some(old), _) => self.0[old] = command,
        }
    }
}

fn work(options: &WorkerOptions, commands: &Receiver<WorkerCommand>, tell: &dyn Fn(WorkerReport)) -> Result<()> {
    let watch_shaders = |folder: &PathBuf| FileWatch::new(vec![folder.clone()], SystemTime::now());
    let mut watched_shaders = options.shaders.as_ref().map(watch_shaders);
    if let Some(folder) = &options.shaders {
        shaders::reload(folder);
    }
    let gpu = options.device.open()?;
    let clock = StageClock::start(&gpu);
    let mut scene: Option<SceneRender> = None;
    // The scene's files, or that of a scene that did not open.
    let mut files: Option<(PathBuf, FileWatch)> = None;
    let mut wanted = DisplayRequest::default();
    let mut waiting = WaitingCommands::default();
    loop {
        let patience = if scene.as_ref().is_some_and(|scene| scene.has_work(&wanted)) { Duration::ZERO } else { PAUSE };
        match (waiting.next(commands, patience), scene.as_mut()) {
            (Err(RecvTimeoutError::Disconnected), _) => return Ok(()),
            (Err(RecvTimeoutError::Timeout), mut opened) => {
                if watched_shaders.as_mut().is_some_and(FileWatch::changed)
                    && let Some(folder) = &options.shaders
                {
                    shaders::reload(folder);
                    if let Some(scene) = &mut opened {
                        scene.reload(tell);
                    }
                }
                if let Some(scene) = opened {
                    scene.advance(&clock, &wanted, tell)?;
                }
                if let Some((path, watch)) = &mut files
                    && watch.changed()
                {
                    let begun = SystemTime::now();
                    match open(&gpu, options, path) {
                        Ok((opened, next)) => {
                            *watch = FileWatch::new(next.files().to_vec(), begun);
                            tell(WorkerReport::Reloaded(Box::new(opened)));
                            scene = Some(next);
                        }
                        Err(error) => tell(WorkerReport::Refused(error)),
                    }
                }
            }
            (Ok(WorkerCommand::Open(path)), _) => {
                let begun = SystemTime::now();
                match open(&gpu, options, &path) {
                    Ok((opened, next)) => {
                        files = Some((path, FileWatch::new(next.files().to_vec(), begun)));
                        tell(WorkerReport::Opened(Box::new(opened)));
                        scene = Some(next);
                    }
                    Err(error) => {
                        if scene.is_none() {
                            files = Some((path.clone(), FileWatch::new(vec![path], begun)));
                        }
                        tell(WorkerReport::NotOpened(error));
                    }
                }
            }
            (Ok(WorkerCommand::Display(other)), scene) => {
                wanted.shown = other;
                scene.into_iter().for_each(|scene| scene.show(&wanted, tell));
            }
            (Ok(WorkerCommand::Reference(path)), scene) => {
                match path.map(|path| ReferencePicture::open(&path)).transpose() {
                    Ok(reference) => {
                        wanted.reference = reference;
                        tell(WorkerReport::Reference(None));
                    }
                    Err(error) => {
                        let before = wanted.reference.as_ref().map(|reference| reference.path.clone());
                        tell(WorkerReport::NotCompared(error, before));
                    }
                }
                scene.into_iter().for_each(|scene| scene.show(&wanted, tell));
            }
            (Ok(WorkerCommand::Layers(other)), scene) => {
                wanted.layers = other;
                if let (Some(request), Some(scene)) = (&wanted.layers, scene) {
                    scene.take_apart(request, tell);
                }
            }
            (Ok(WorkerCommand::Surface(place)), Some(scene)) => tell(WorkerReport::Surface(place, scene.surface_at(place))),
            (Ok(WorkerCommand::SetView(view)), Some(scene)) => scene.set(view),
            (Ok(WorkerCommand::Save(path)), Some(scene)) => {
                tell(scene.save(&path).map_or_else(WorkerReport::Refused, |()| WorkerReport::Saved(path)));
            }
            (Ok(WorkerCommand::SaveScene(path)), Some(scene)) => {
                tell(scene.save_scene(&path).map_or_else(WorkerReport::Refused, |needed| WorkerReport::SceneSaved(path, needed)));
            }
            (Ok(_), None) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_last_command_of_a_drag_is_done() {
        let (sender, receiver) = mpsc::channel();
        let surface = |x| WorkerCommand::Surface(Vec2::splat(x));
        let display = || WorkerCommand::Display(DisplayOptions::default());
        for command in
            [surface(1.0), display(), surface(2.0), display(), WorkerCommand::Save("a.png".into()), display(), surface(3.0)]
        {
            sender.send(command).unwrap();
        }
        drop(sender);
        let mut waiting = WaitingCommands::default();
        let mut next = || match waiting.next(&receiver, Duration::ZERO).ok()? {
            WorkerCommand::Surface(place) => Some(place.x),
            WorkerCommand::Display(_) => Some(-1.0),
            _ => Some(-2.0),
        };
        let done: Vec<f32> = std::iter::from_fn(&mut next).collect();
        assert_eq!(done, [-1.0, 2.0, -2.0, -1.0, 3.0], "a file is saved as it was asked for");
    }
}
