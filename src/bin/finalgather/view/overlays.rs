//! What lies over the picture: notices, errors and the list of keys.

use std::time::{Duration, Instant};

use egui::{Align2, Frame, RichText, Ui, Vec2, pos2, vec2};

use super::app::App;
use super::camera::KEYS;
use super::panel;

/// How long news is shown.
const NEWS: Duration = Duration::from_secs(5);

/// Whether a line marks a place in the line above it.
fn is_mark(line: &str) -> bool {
    line.contains('^') && line.chars().all(|character| "|^ ".contains(character))
}

/// A sentence for the user.
pub struct Notice {
    pub text: String,
    pub kind: NoticeKind,
    said: Instant,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoticeKind {
    /// Vanishes by itself.
    News,
    Warning,
    Bad,
}

impl Notice {
    pub fn new(text: String, kind: NoticeKind) -> Self {
        Self { text, kind, said: Instant::now() }
    }

    /// The time until it vanishes.
    fn left(&self) -> Option<Duration> {
        (self.kind == NoticeKind::News).then(|| NEWS.saturating_sub(self.said.elapsed()))
    }
}

pub fn show(app: &mut App, ui: &Ui) {
    let area = ui.ctx().content_rect();
    let card = Frame::popup(&ui.ctx().global_style()).inner_margin(12.0);
    app.notices.retain(|notice| notice.left() != Some(Duration::ZERO));
    if let Some(left) = app.notices.iter().filter_map(Notice::left).min() {
        ui.ctx().request_repaint_after(left);
    }
    if app.is_opening() {
        egui::Area::new("opening".into())
            .anchor(Align2::LEFT_BOTTOM, vec2(12.0, -12.0))
            .show(ui.ctx(), |ui| card.show(ui, |ui| ui.label(format!("Opening {}", app.path.display()))));
    }
    notices(app, ui, card);
    let mut open = app.help;
    egui::Window::new("Keys and mouse")
        .open(&mut open)
        .anchor(Align2::CENTER_CENTER, Vec2::ZERO)
        .collapsible(false)
        .resizable(false)
        .show(ui.ctx(), |ui| {
            let height = area.height() - 100.0;
            egui::ScrollArea::vertical().max_height(height).min_scrolled_height(height).show(ui, |ui| {
                egui::Grid::new("keys").num_columns(2).spacing(vec2(24.0, 4.0)).show(ui, |ui| {
                    for (keys, effect) in KEYS {
                        ui.strong(keys);
                        ui.label(effect);
                        ui.end_row();
                    }
                });
                if let Some(scene) = &app.scene {
                    ui.separator();
                    ui.weak(format!("finalgather {} on {}", env!("CARGO_PKG_VERSION"), scene.renderer));
                }
            });
        });
    app.help = open;
}

fn notices(app: &mut App, ui: &Ui, card: Frame) {
    let area = ui.ctx().content_rect();
    let width = (area.width() - if app.panel { panel::WIDTH } else { 0.0 } - 24.0).clamp(160.0, 560.0);
    let bad = panel::bad(ui.visuals());
    let mut dismissed = None;
    let mut again = false;
    egui::Area::new("notices".into()).fixed_pos(pos2(area.left() + 12.0, area.top() + 12.0)).show(ui.ctx(), |ui| {
        ui.set_max_width(width);
        if let Some(error) = app.failed() {
            card.stroke((1.0, bad)).show(ui, |ui| {
                ui.label(RichText::new("The renderer has stopped").strong().color(bad));
                ui.label(error.to_string());
                ui.add_space(6.0);
                again = ui.button("Start again").clicked();
            });
        }
        for (index, notice) in app.notices.iter().enumerate() {
            let color = if notice.kind == NoticeKind::Bad { bad } else { ui.visuals().weak_text_color() };
            card.stroke((1.0, color)).show(ui, |ui| {
                // A shader's log has many lines.
                egui::ScrollArea::vertical().max_height(0.6 * area.height()).id_salt(index).show(ui, |ui| {
                    ui.horizontal_top(|ui| {
                        if ui.small_button("✖").on_hover_text("Close. Escape closes all.").clicked() {
                            dismissed = Some(index);
                        }
                        let text = RichText::new(&notice.text);
                        // So does an error that marks its place by carets below the line.
                        let long = notice.text.lines().count() > 4 || notice.text.lines().any(is_mark);
                        ui.add(egui::Label::new(if long { text.monospace() } else { text }).wrap());
                    });
                });
            });
            ui.add_space(6.0);
        }
    });
    if let Some(index) = dismissed {
        app.notices.remove(index);
    }
    if again {
        app.restart();
    }
}
