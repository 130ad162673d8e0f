//! The interface: lays out the picture, notices and dialogs, and sends commands to the renderer.

use std::path::{Path, PathBuf};
use std::sync::mpsc::TryRecvError;
use std::time::{Duration, Instant};

use egui::{
    Align2, CentralPanel, Color32, Context, Frame, Image, Key, KeyboardShortcut, Modifiers, Panel, Rect, RichText, Sense,
    TextureHandle, TextureOptions, Ui, Vec2, pos2, vec2,
};
use egui_file_dialog::FileDialog;
use finalgather::error::{Error, Result};
use finalgather::scene::{World, WorldCamera};
use winit::event_loop::EventLoopProxy;

use super::camera::{KEYS, move_camera};
use super::layers::{LayerRequest, LayerView};
use super::panel;
use super::picture::DisplayOptions;
use super::worker::{DisplayPicture, OpenedScene, RenderProgress, ViewState, Worker, WorkerCommand, WorkerOptions, WorkerReport};

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
    picture: Option<DisplayPicture>,
    texture: Option<TextureHandle>,
    pub progress: RenderProgress,
    pub notices: Vec<Notice>,
    /// The error that ended the renderer.
    failure: Option<Error>,
    /// The error that stopped the last scene from opening, or the render or layer view from finishing.
    refused: Option<Error>,
    dialog: FileDialog,
    /// Whether the dialog saves a picture; otherwise it opens a scene.
    saving: bool,
    pub panel: bool,
    pub help: bool,
    pub quit: bool,
    /// Whether the layer view is on.
    pub layers: bool,
    pub layer_view: LayerView,
    /// The folder in which dialogs begin.
    folder: Option<PathBuf>,
}

/// The values that were last sent to the renderer.
#[derive(Default)]
struct Sent {
    view: Option<ViewState>,
    shown: Option<DisplayOptions>,
    layers: Option<Option<LayerRequest>>,
}

pub struct Notice {
    pub text: String,
    pub bad: bool,
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
    pub fn new(options: WorkerOptions, path: PathBuf, layers: bool, proxy: EventLoopProxy<()>) -> Result<Self> {
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
            picture: None,
            texture: None,
            progress: RenderProgress::default(),
            notices: Vec::new(),
            failure: None,
            refused: None,
            dialog: FileDialog::new(),
            saving: false,
            panel: true,
            help: false,
            quit: false,
            layers,
            layer_view: LayerView::default(),
            folder: std::env::current_dir().ok(),
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
        let pictured = self.directions() == 0 || self.picture.as_ref().is_some_and(shown);
        self.failure.is_some() || self.opening == 0 && (self.scene.is_none() || self.done() && layered && pictured)
    }

    pub fn has_picture(&self) -> bool {
        self.picture.is_some()
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
                    self.refused = None;
                    (self.view.camera, self.view.settings, self.view.moving) = (opened.camera, opened.settings, false);
                    self.shown.exposure = opened.settings.display.exposure.given();
                    opened.warnings.iter().for_each(|text| self.say(text.clone(), false));
                    self.progress = RenderProgress::default();
                    (self.picture, self.sent, self.moved) = (None, Sent::default(), None);
                    self.layer_view.set(None);
                    self.scene = Some(*opened);
                }
                WorkerReport::Picture(picture) => {
                    self.texture = None;
                    self.picture = Some(picture);
                }
                WorkerReport::Progress(progress) => self.progress = *progress,
                WorkerReport::Layers(images) => self.layer_view.set(Some(images)),
                WorkerReport::Probe(probe) => self.layer_view.probe = probe,
                WorkerReport::Saved(path) => {
                    let png = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
                    let but = if png && !self.shown.is_radiance() { ": all of the radiance, not what is shown" } else { "" };
                    self.say(format!("Saved {}{but}", path.display()), false);
                }
                WorkerReport::Refused(error) => self.say(error.to_string(), true),
                WorkerReport::NotOpened(error) => {
                    self.opening -= 1;
                    self.say(error.to_string(), true);
                    match &self.scene {
                        Some(scene) if self.opening == 0 => self.path.clone_from(&scene.path),
                        Some(_) => {}
                        None => self.refused = Some(error),
                    }
                }
                WorkerReport::Halted(error) => {
                    self.say(error.to_string(), true);
                    self.refused = Some(error);
                }
                WorkerReport::Failed(error) => {
                    self.opening = 0;
                    self.failure = Some(error);
                }
            }
        }
    }

    pub fn say(&mut self, text: String, bad: bool) {
        self.notices.retain(|notice| notice.text != text);
        self.notices.push(Notice { text, bad });
    }

    /// Drops all textures, because their context is lost.
    pub fn forget_textures(&mut self) {
        self.texture = None;
        self.layer_view.forget_textures();
    }

    /// Waits for the renderer to leave its driver, for 3 s at most. Returns whether it has.
    pub fn end(&mut self) -> bool {
        self.worker.end(Duration::from_secs(3))
    }

    fn restart(&mut self) {
        self.worker.end(Duration::from_secs(1));
        match spawn(&self.options, &self.proxy) {
            Err(error) => self.say(error.to_string(), true),
            Ok(worker) => {
                self.worker = worker;
                self.failure = None;
                let path = self.path.clone();
                self.open(path);
            }
        }
    }

    /// Lays out one frame.
    pub fn show(&mut self, ui: &mut Ui) {
        self.keys(ui.ctx());
        if self.panel {
            Panel::right("panel").exact_size(panel::WIDTH).resizable(false).show(ui, |ui| panel::show(self, ui));
        }
        CentralPanel::no_frame().frame(Frame::NONE.fill(Color32::from_gray(16))).show(ui, |ui| self.center(ui));
        self.overlays(ui);
        self.dialogs(ui);
        self.send(ui.ctx());
    }

    fn keys(&mut self, ctx: &Context) {
        let shortcut = |modifiers, key| ctx.input_mut(|input| input.consume_shortcut(&KeyboardShortcut::new(modifiers, key)));
        if shortcut(Modifiers::CTRL, Key::O) {
            self.ask_open();
        }
        if shortcut(Modifiers::CTRL, Key::S) {
            self.ask_save();
        }
        self.quit |= shortcut(Modifiers::CTRL, Key::Q);
        if ctx.egui_wants_keyboard_input() {
            return;
        }
        self.help ^= shortcut(Modifiers::NONE, Key::F1);
        self.panel ^= shortcut(Modifiers::NONE, Key::P);
        self.layers ^= shortcut(Modifiers::NONE, Key::L);
        for (key, by) in [(Key::Comma, -1), (Key::Period, 1)] {
            if self.layers && shortcut(Modifiers::NONE, key) {
                self.layer_view.step(by, self.view.settings.directions.count);
            }
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

    pub fn ask_open(&mut self) {
        self.saving = false;
        self.dialog = dialog(self.folder.as_deref())
            .title("Open a scene")
            .add_file_filter_extensions("Scenes", ["toml"].into_iter().chain(World::MODELS).collect())
            .default_file_filter("Scenes");
        self.dialog.pick_file();
    }

    pub fn ask_save(&mut self) {
        if self.picture.is_none() {
            return;
        }
        self.saving = true;
        let name = self.path.with_extension("png");
        let name = name.file_name().unwrap_or_default().to_string_lossy().into_owned();
        self.dialog = dialog(self.folder.as_deref())
            .title("Save the picture")
            .default_file_name(&name)
            .add_save_extension("PNG, 8 bit to look at", "png")
            .add_save_extension("EXR, all channels", "exr");
        self.dialog.save_file();
    }

    fn dialogs(&mut self, ui: &Ui) {
        self.dialog.update(ui.ctx());
        match self.dialog.take_picked() {
            Some(path) if self.saving => self.worker.send(WorkerCommand::Save(path)),
            Some(path) => self.open_chosen(path),
            None => {}
        }
        let dropped = ui.ctx().input(|input| input.raw.dropped_files.first().map(|file| file.path().to_owned()));
        if let Some(path) = dropped {
            self.open_chosen(path);
        }
    }

    fn open_chosen(&mut self, path: PathBuf) {
        self.folder = path.parent().map(Path::to_owned);
        self.open(path);
    }

    /// Shows the picture, and the layer view if it is on.
    fn center(&mut self, ui: &mut Ui) {
        let area = ui.available_rect_before_wrap();
        if !self.layers {
            self.picture(ui, area);
            return;
        }
        let (picture, stack, row) = LayerView::split(area);
        let shown = self.picture(ui, picture);
        self.layer_view.point(ui, shown);
        if let Some(scene) = &self.scene {
            self.layer_view.stack(ui, stack, scene.extent.normalize());
        }
        self.layer_view.row(ui, row);
    }

    /// Shows the picture as large as fits in `area`, and returns its place.
    fn picture(&mut self, ui: &mut Ui, area: Rect) -> Rect {
        let response = ui.interact(area, ui.id().with("picture"), Sense::click_and_drag());
        if let Some(scene) = &self.scene
            && move_camera(ui, &response, &mut self.view.camera, scene.extent.length())
        {
            self.moved = Some(Instant::now());
        }
        let [width, height] = self.view.settings.film.size.map(|side| side as f32);
        let shown = fitted(area, vec2(width, height), ui.pixels_per_point());
        let Some(picture) = &self.picture else { return shown };
        let texture =
            self.texture.get_or_insert_with(|| ui.ctx().load_texture("picture", picture.image.clone(), TextureOptions::LINEAR));
        Image::new(&*texture).paint_at(ui, shown);
        shown
    }

    fn overlays(&mut self, ui: &Ui) {
        let area = ui.ctx().content_rect();
        let left = area.left() + 12.0;
        let card = Frame::popup(&ui.ctx().global_style()).inner_margin(12.0);
        if self.opening > 0 {
            egui::Area::new("opening".into())
                .anchor(Align2::LEFT_BOTTOM, vec2(12.0, -12.0))
                .show(ui.ctx(), |ui| card.show(ui, |ui| ui.label(format!("Opening {}", self.path.display()))));
        }
        let width = (area.width() - if self.panel { panel::WIDTH } else { 0.0 } - 24.0).clamp(160.0, 560.0);
        let mut dismissed = None;
        let mut again = false;
        egui::Area::new("notices".into()).fixed_pos(pos2(left, area.top() + 12.0)).show(ui.ctx(), |ui| {
            ui.set_max_width(width);
            if let Some(error) = &self.failure {
                card.stroke((1.0, panel::BAD)).show(ui, |ui| {
                    ui.label(RichText::new("The renderer has stopped").strong().color(panel::BAD));
                    ui.label(error.to_string());
                    ui.add_space(6.0);
                    again = ui.button("Start again").clicked();
                });
            }
            for (index, notice) in self.notices.iter().enumerate() {
                let color = if notice.bad { panel::BAD } else { ui.visuals().weak_text_color() };
                card.stroke((1.0, color)).show(ui, |ui| {
                    // A shader's log has many lines.
                    egui::ScrollArea::vertical().max_height(0.6 * area.height()).id_salt(index).show(ui, |ui| {
                        ui.horizontal_top(|ui| {
                            if ui.small_button("✖").clicked() {
                                dismissed = Some(index);
                            }
                            let text = RichText::new(&notice.text);
                            let long = notice.text.lines().count() > 4;
                            ui.add(egui::Label::new(if long { text.monospace() } else { text }).wrap());
                        });
                    });
                });
                ui.add_space(6.0);
            }
        });
        if let Some(index) = dismissed {
            self.notices.remove(index);
        }
        if again {
            self.restart();
        }
        let mut open = self.help;
        egui::Window::new("Keys and mouse")
            .open(&mut open)
            .anchor(Align2::CENTER_CENTER, Vec2::ZERO)
            .collapsible(false)
            .resizable(false)
            .show(ui.ctx(), |ui| {
                egui::Grid::new("keys").num_columns(2).spacing(vec2(24.0, 6.0)).show(ui, |ui| {
                    for (keys, effect) in KEYS {
                        ui.strong(keys);
                        ui.label(effect);
                        ui.end_row();
                    }
                });
                if let Some(scene) = &self.scene {
                    ui.separator();
                    ui.weak(format!("finalgather {} on {}", env!("CARGO_PKG_VERSION"), scene.renderer));
                }
            });
        self.help = open;
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
        let layers = self.layers.then_some(self.layer_view.request);
        send_changed(&self.worker, &mut self.sent.layers, &layers, WorkerCommand::Layers);
        send_changed(&self.worker, &mut self.sent.shown, &self.shown, WorkerCommand::Display);
        send_changed(&self.worker, &mut self.sent.view, &self.view, WorkerCommand::SetView);
    }
}

/// Sends `value` unless it was sent last.
fn send_changed<T: Clone + PartialEq>(worker: &Worker, sent: &mut Option<T>, value: &T, command: fn(T) -> WorkerCommand) {
    if sent.as_ref() != Some(value) {
        worker.send(command(value.clone()));
        *sent = Some(value.clone());
    }
}

fn dialog(folder: Option<&Path>) -> FileDialog {
    let dialog = FileDialog::new().as_modal(true).default_size([560.0, 360.0]);
    match folder {
        Some(folder) => dialog.initial_directory(folder.to_owned()),
        None => dialog,
    }
}

/// The largest rectangle of these proportions in the centre of `area`, with its corners on pixels.
fn fitted(area: Rect, size: Vec2, pixels_per_point: f32) -> Rect {
    let room = area * pixels_per_point;
    let scale = (room.width() / size.x).min(room.height() / size.y);
    let size = (size * scale).round();
    let min = (room.center() - 0.5 * size).round();
    Rect::from_min_size(min, size) / pixels_per_point
}
