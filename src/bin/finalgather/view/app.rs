//! The interface: lays out the picture, the panel and dialogs, and sends commands to the renderer.

use std::path::PathBuf;
use std::sync::mpsc::TryRecvError;
use std::time::{Duration, Instant};

use egui::text_selection::LabelSelectionState;
use egui::{CentralPanel, Color32, Context, Frame, Key, KeyboardShortcut, Modifiers, Panel, Rect, Sense, ThemePreference, Ui};
use finalgather::error::{Error, Result};
use finalgather::scene::WorldCamera;
use finalgather::settings::{DisplaySettings, Settings};
use glam::{DVec3, Vec2};
use winit::event_loop::EventLoopProxy;

use super::camera::move_camera;
use super::canvas::Canvas;
use super::copy;
use super::dialogs::{Dialogs, Purpose};
use super::layers::{LayerRequest, LayerView};
use super::overlays::{self, Notice, NoticeKind};
use super::panel;
use super::picture::DisplayOptions;
use super::worker::{DisplayPicture, OpenedScene, RenderProgress, ViewState, Worker, WorkerCommand, WorkerOptions, WorkerReport};
use super::zoom::Zoom;

/// The camera counts as still this long after its last move. Then the picture is gathered in full quality.
const STILL: Duration = Duration::from_millis(150);

pub struct App {
    options: WorkerOptions,
    proxy: EventLoopProxy<()>,
    worker: Worker,
    /// The scene file that is open, or that is being opened.
    pub path: PathBuf,
    /// Number of unanswered requests to open a scene. Until it is 0, the renderer may have another scene than the shown one.
    opening: usize,
    pub scene: Option<OpenedScene>,
    pub view: ViewState,
    pub shown: DisplayOptions,
    sent: Sent,
    /// When the camera last moved, if it is not still yet.
    moved: Option<Instant>,
    pub canvas: Canvas,
    pub progress: RenderProgress,
    pub notices: Vec<Notice>,
    /// The error that ended the renderer.
    failure: Option<Error>,
    /// The reference that is open, or being opened.
    reference: Option<PathBuf>,
    /// The error that stopped the last scene from opening, or the render or layer view from finishing.
    refused: Option<Error>,
    dialogs: Dialogs,
    pub theme: ThemePreference,
    pub panel: bool,
    pub help: bool,
    pub quit: bool,
    /// Whether the layer view is on.
    pub layers: bool,
    pub layer_view: LayerView,
    /// Whether the picture is as large as the window has room for.
    pub fill: bool,
}

/// The values that were last sent to the renderer.
#[derive(Default)]
struct Sent {
    view: Option<ViewState>,
    shown: Option<DisplayOptions>,
    layers: Option<Option<LayerRequest>>,
    surface: Option<(Vec2, WorldCamera)>,
}

fn spawn(options: &WorkerOptions, proxy: &EventLoopProxy<()>) -> Result<Worker> {
    let proxy = proxy.clone();
    Worker::start(options.clone(), move || {
        // This fails only when the process ends.
        let _ = proxy.send_event(());
    })
    .map_err(|error| Error::usage(format!("no thread can be made: {error}"), "allow more threads"))
}

impl App {
    pub fn new(options: WorkerOptions, path: PathBuf, proxy: EventLoopProxy<()>) -> Result<Self> {
        let worker = spawn(&options, &proxy)?;
        let camera =
            WorldCamera { eye: glam::DVec3::Z, target: glam::DVec3::ZERO, up: glam::Vec3::Y, fov_y_degrees: 40.0, lens: None };
        let view = ViewState { camera, settings: options.scene.settings(&Default::default())?, moving: false, pace: 0 };
        let mut app = Self {
            options,
            proxy,
            worker,
            path: PathBuf::new(),
            opening: 0,
            scene: None,
            view,
            shown: DisplayOptions::default(),
            sent: Sent::default(),
            moved: None,
            canvas: Canvas::default(),
            progress: RenderProgress::default(),
            notices: Vec::new(),
            failure: None,
            refused: None,
            reference: None,
            dialogs: Dialogs::new(),
            theme: ThemePreference::System,
            panel: true,
            help: false,
            quit: false,
            layers: false,
            layer_view: LayerView::default(),
            fill: false,
        };
        app.open(path);
        Ok(app)
    }

    pub fn open(&mut self, path: PathBuf) {
        self.notices.clear();
        self.opening += 1;
        self.path.clone_from(&path);
        self.worker.send(WorkerCommand::Open(path));
    }

    pub fn title(&self) -> String {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        let gather = &self.progress.statistics.gather;
        match (&self.scene, self.opening > 0) {
            (_, true) => format!("{name}: opening - finalgather"),
            (None, false) => "finalgather".to_owned(),
            _ if self.done() => format!("{name}: {} directions, done - finalgather", gather.directions),
            _ => format!("{name}: {} directions - finalgather", gather.directions),
        }
    }

    /// Whether all directions of the present view are gathered.
    pub fn done(&self) -> bool {
        let progress = &self.progress;
        progress.done && !self.view.moving && progress.view.as_ref().is_some_and(|view| view.is_gathered_as(&self.view))
    }

    /// Whether the window shows all requested results, or an error that they will not come.
    pub fn finished(&self) -> bool {
        let layered = !self.layers || self.layer_view.count() > 0 || self.refused.is_some();
        let shown = |picture: &DisplayPicture| picture.sharp && picture.directions == self.directions();
        let pictured = self.directions() == 0 || self.canvas.picture.as_deref().is_some_and(shown);
        self.failure.is_some() || self.opening == 0 && (self.scene.is_none() || self.done() && layered && pictured)
    }

    pub fn has_picture(&self) -> bool {
        self.canvas.picture.is_some()
    }

    pub fn directions(&self) -> u32 {
        self.progress.statistics.gather.directions
    }

    /// Takes the error that ended the renderer or kept it from requested results.
    pub fn failure(&mut self) -> Option<Error> {
        self.failure.take().or_else(|| self.refused.take())
    }

    /// Handles all new reports of the renderer.
    pub fn receive(&mut self) {
        loop {
            let report = match self.worker.reports.try_recv() {
                Ok(report) => report,
                Err(TryRecvError::Disconnected) if self.failure.is_none() => {
                    WorkerReport::Failed(Error::gl("the renderer has ended without a word", "start again, and report this"))
                }
                Err(_) => return,
            };
            match report {
                WorkerReport::Opened(opened) => {
                    self.opening -= 1;
                    (self.view.camera, self.view.settings) = (opened.camera, opened.settings);
                    self.canvas.zoom = Zoom::default();
                    self.show_scene(*opened);
                }
                WorkerReport::Reloaded(opened) => {
                    self.keep_view(&opened);
                    self.notices.clear();
                    self.say(format!("Read {} again, because a file has changed", opened.path.display()), NoticeKind::News);
                    self.show_scene(*opened);
                }
                WorkerReport::Picture(picture) => self.canvas.set_picture(Some(picture)),
                WorkerReport::Reference(reference) => self.canvas.set_reference(reference),
                WorkerReport::Surface(place, surface) => {
                    self.canvas.surface = surface.map(|surface| (place, surface));
                }
                WorkerReport::Progress(progress) => self.progress = *progress,
                WorkerReport::Layers(images) => self.layer_view.set(Some(images)),
                WorkerReport::Probe(probe) => self.layer_view.probe = probe,
                WorkerReport::Saved(path) => {
                    let png = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
                    let but = if png && !self.shown.is_radiance() { ": all of the radiance, not what is shown" } else { "" };
                    self.say(format!("Saved {}{but}", path.display()), NoticeKind::News);
                }
                WorkerReport::SceneSaved(path, needed) => {
                    let with = if needed.is_empty() { String::new() } else { format!("; render it with {}", needed.join(" ")) };
                    let kind = if needed.is_empty() { NoticeKind::News } else { NoticeKind::Warning };
                    self.say(format!("Saved {}{with}", path.display()), kind);
                }
                WorkerReport::NotCompared(error, before) => {
                    self.reference = before;
                    self.say(error.to_string(), NoticeKind::Bad);
                }
                WorkerReport::Refused(error) => self.say(error.to_string(), NoticeKind::Bad),
                WorkerReport::NotOpened(error) => {
                    self.opening -= 1;
                    self.say(error.to_string(), NoticeKind::Bad);
                    match &self.scene {
                        Some(scene) if self.opening == 0 => self.path.clone_from(&scene.path),
                        Some(_) => {}
                        None => self.refused = Some(error),
                    }
                }
                WorkerReport::Halted(error) => {
                    self.say(error.to_string(), NoticeKind::Bad);
                    self.refused = Some(error);
                }
                WorkerReport::Failed(error) => {
                    self.opening = 0;
                    self.failure = Some(error);
                }
            }
        }
    }

    /// Takes over a scene that was opened.
    fn show_scene(&mut self, opened: OpenedScene) {
        self.refused = None;
        self.view.moving = false;
        let DisplaySettings { exposure, background } = self.view.settings.display;
        (self.shown.exposure, self.shown.background) = (exposure, background);
        opened.warnings.iter().for_each(|text| self.say(text.clone(), NoticeKind::Warning));
        self.progress = RenderProgress::default();
        (self.sent, self.moved) = (Sent::default(), None);
        self.canvas.set_picture(None);
        self.layer_view.set(None);
        self.scene = Some(opened);
    }

    /// Keeps the camera and the settings that the user has changed. The others become those of the scene's files, now read again.
    fn keep_view(&mut self, opened: &OpenedScene) {
        let Some(before) = &self.scene else {
            // It was broken until now.
            (self.view.camera, self.view.settings) = (opened.camera, opened.settings);
            return;
        };
        if self.view.camera == before.camera {
            self.view.camera = opened.camera;
        }
        self.view.settings = kept(&self.view.settings, &before.settings, &opened.settings);
    }

    pub fn say(&mut self, text: String, kind: NoticeKind) {
        self.notices.retain(|notice| notice.text != text);
        self.notices.push(Notice::new(text, kind));
    }

    pub fn is_opening(&self) -> bool {
        self.opening > 0
    }

    /// The error that ended the renderer.
    pub fn failed(&self) -> Option<&Error> {
        self.failure.as_ref()
    }

    /// Drops all textures, because their context is lost.
    pub fn forget_textures(&mut self) {
        self.canvas.forget_textures();
        self.layer_view.forget_textures();
    }

    /// Waits for the renderer to leave its driver, for 3 s at most. Returns whether it has.
    pub fn end(&mut self) -> bool {
        self.worker.end(Duration::from_secs(3))
    }

    /// Starts another renderer in place of one that failed.
    pub fn restart(&mut self) {
        self.worker.end(Duration::from_secs(1));
        match spawn(&self.options, &self.proxy) {
            Err(error) => self.say(error.to_string(), NoticeKind::Bad),
            Ok(worker) => {
                self.worker = worker;
                self.failure = None;
                let path = self.path.clone();
                self.open(path);
                self.compare_with(self.reference.clone());
            }
        }
    }

    /// Lays out one frame.
    pub fn show(&mut self, ui: &mut Ui) {
        ui.ctx().set_theme(self.theme);
        self.dialogs.escape(ui.ctx());
        self.quit |= ui.ctx().input_mut(|input| input.consume_shortcut(&KeyboardShortcut::new(Modifiers::CTRL, Key::Q)));
        // Keys belong to the dialog while it is open.
        if !self.dialogs.is_open() {
            self.keys(ui.ctx());
        }
        if self.panel {
            Panel::right("panel").exact_size(panel::WIDTH).resizable(false).show(ui, |ui| panel::show(self, ui));
        }
        let around = Color32::from_gray(if ui.visuals().dark_mode { 16 } else { 215 });
        CentralPanel::no_frame().frame(Frame::NONE.fill(around)).show(ui, |ui| self.center(ui));
        overlays::show(self, ui);
        if let Some((purpose, path)) = self.dialogs.show(ui) {
            self.chosen(purpose, path);
        }
        self.send(ui.ctx());
    }

    fn keys(&mut self, ctx: &Context) {
        let shortcut = |modifiers, key| ctx.input_mut(|input| input.consume_shortcut(&KeyboardShortcut::new(modifiers, key)));
        // Shift first: without it the shortcut would match too.
        for (modifiers, key, purpose) in [
            (Modifiers::CTRL | Modifiers::SHIFT, Key::S, Purpose::SaveScene),
            (Modifiers::CTRL, Key::S, Purpose::SavePicture),
            (Modifiers::CTRL, Key::O, Purpose::OpenScene),
            (Modifiers::CTRL, Key::R, Purpose::OpenReference),
        ] {
            if shortcut(modifiers, key) {
                self.ask(purpose);
            }
        }
        self.canvas.held = false;
        if ctx.egui_wants_keyboard_input() {
            return;
        }
        // Selected text goes first.
        let selected = ctx.plugin::<LabelSelectionState>().lock().has_selection();
        if !selected && ctx.input_mut(|input| take(&mut input.events, |event| matches!(event, egui::Event::Copy))) {
            ctx.copy_text(copy::options(&self.view.camera));
            self.say("Copied the view as options".into(), NoticeKind::News);
        }
        self.canvas.held = ctx.input(|input| input.modifiers.is_none() && input.key_down(Key::X));
        self.help ^= shortcut(Modifiers::NONE, Key::F1);
        self.panel ^= shortcut(Modifiers::NONE, Key::P);
        self.layers ^= shortcut(Modifiers::NONE, Key::L);
        for (key, by) in [(Key::Comma, -1), (Key::Period, 1)] {
            if self.layers && shortcut(Modifiers::NONE, key) {
                self.layer_view.step(by, self.view.settings.directions.count);
            }
        }
        if shortcut(Modifiers::NONE, Key::F) {
            self.canvas.zoom = Zoom::default();
        }
        if shortcut(Modifiers::NONE, Key::Num1) {
            self.canvas.enlarge_to(1.0, ctx.pointer_hover_pos());
        }
        if shortcut(Modifiers::NONE, Key::Escape) {
            self.help = false;
            self.notices.clear();
        }
        if shortcut(Modifiers::NONE, Key::R)
            && let Some(scene) = &self.scene
        {
            self.view.camera = scene.camera;
        }
    }

    /// Opens the dialog for this.
    pub fn ask(&mut self, purpose: Purpose) {
        let saves = matches!(purpose, Purpose::SavePicture | Purpose::SaveScene);
        if !saves || self.has_picture() {
            self.dialogs.ask(purpose, &self.path);
        }
    }

    fn chosen(&mut self, purpose: Purpose, path: PathBuf) {
        match purpose {
            Purpose::OpenScene => self.open(path),
            Purpose::OpenReference => self.compare_with(Some(path)),
            Purpose::SavePicture => self.worker.send(WorkerCommand::Save(path)),
            Purpose::SaveScene => self.worker.send(WorkerCommand::SaveScene(path)),
        }
    }

    /// Opens a reference, or closes it.
    pub fn compare_with(&mut self, path: Option<PathBuf>) {
        self.shown.difference &= path.is_some();
        self.reference.clone_from(&path);
        self.worker.send(WorkerCommand::Reference(path));
    }

    /// Shows the picture, and the layer view if it is on.
    fn center(&mut self, ui: &mut Ui) {
        let (area, strip) = Canvas::split(ui.available_rect_before_wrap());
        if self.layers {
            let (picture, stack, row) = LayerView::split(area);
            let shown = self.picture(ui, picture);
            self.layer_view.point(ui, shown, self.canvas.cursor);
            if let Some(scene) = &self.scene {
                self.layer_view.stack(ui, stack, scene.extent.normalize());
            }
            self.layer_view.row(ui, row);
        } else {
            self.picture(ui, area);
        }
        let origin = self.scene.as_ref().map_or(DVec3::ZERO, |scene| scene.origin);
        self.canvas.strip(ui, strip, origin);
    }

    /// Shows the picture in `area`, and returns its place.
    fn picture(&mut self, ui: &mut Ui, area: Rect) -> Rect {
        if self.fill {
            // Lengths in pixels of a window are no more than the device's limits.
            let size: [f32; 2] = (area.size() * ui.pixels_per_point()).into();
            self.view.settings.film.size = size.map(|side| side.round().max(16.0) as u32);
        }
        let response = ui.interact(area, ui.id().with("picture"), Sense::click_and_drag());
        if let Some(scene) = &self.scene
            && !self.dialogs.is_open()
        {
            let pans = self.canvas.navigate(ui, &response);
            if move_camera(ui, &response, &mut self.view.camera, scene.extent.length(), pans) {
                self.moved = Some(Instant::now());
            }
        }
        self.canvas.show(ui, area, self.view.settings.film.size, &response)
    }

    /// Sends changed values to the renderer.
    fn send(&mut self, ctx: &Context) {
        if self.scene.is_none() || self.opening > 0 {
            return;
        }
        if let Some(moved) = self.moved {
            self.view.moving = moved.elapsed() < STILL || ctx.input(|input| input.pointer.any_down());
            if self.view.moving {
                ctx.request_repaint_after(STILL.saturating_sub(moved.elapsed()).max(Duration::from_millis(10)));
            } else {
                self.moved = None;
            }
        }
        let layers = self.layers.then(|| self.layer_view.wanted());
        send_changed(&self.worker, &mut self.sent.layers, &layers, WorkerCommand::Layers);
        send_changed(&self.worker, &mut self.sent.shown, &self.shown, WorkerCommand::Display);
        send_changed(&self.worker, &mut self.sent.view, &self.view, WorkerCommand::SetView);
        if let Some(place) = self.canvas.cursor {
            let asked = (place, self.view.camera);
            if self.sent.surface.is_some_and(|(_, camera)| camera != asked.1) {
                self.canvas.surface = None;
            }
            send_changed(&self.worker, &mut self.sent.surface, &asked, |(place, _)| WorkerCommand::Surface(place));
        }
    }
}

/// Sends `value` unless it was sent last.
fn send_changed<T: Clone + PartialEq>(worker: &Worker, sent: &mut Option<T>, value: &T, command: fn(T) -> WorkerCommand) {
    if sent.as_ref() != Some(value) {
        worker.send(command(value.clone()));
        *sent = Some(value.clone());
    }
}

/// Removes the first such event, and returns whether there was one.
fn take(events: &mut Vec<egui::Event>, is_it: impl Fn(&egui::Event) -> bool) -> bool {
    let place = events.iter().position(is_it);
    place.map(|place| events.remove(place)).is_some()
}

/// The settings `now` with the changes that they have since `before`. Photons and the seed cannot change in a window: they are those of `now`.
fn kept(changed: &Settings, before: &Settings, now: &Settings) -> Settings {
    let [changed, before, mut all] = [changed, before, now].map(|settings| serde_json::to_value(settings).unwrap_or_default());
    for (key, value) in changed.as_object().into_iter().flatten() {
        if *value != before[key] {
            all[key] = value.clone();
        }
    }
    let kept: Settings = serde_json::from_value(all).unwrap_or(*now);
    Settings { photons: now.photons, seed: now.seed, ..kept }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changed_settings_are_kept_one_by_one() {
        let before = Settings::default();
        let with = |change: &dyn Fn(&mut Settings)| before.with(change);
        let changed = with(&|settings| (settings.directions.count, settings.photons.count) = (77, 5));
        let now = with(&|settings| (settings.film.size, settings.directions.count) = ([64, 32], 500));
        let kept = kept(&changed, &before, &now);
        assert_eq!((kept.film.size, kept.directions.count, kept.photons), ([64, 32], 77, before.photons));
    }
}
