//! The panel beside the picture: how far the render is, what is shown of it, and how it is made.

use egui::{Checkbox, Color32, ComboBox, DragValue, Grid, ProgressBar, RichText, ScrollArea, Slider, SliderClamping, Ui, vec2};
use finalgather::settings::{LayerSize, Pipeline};

use super::app::App;
use super::picture::What;

/// In points.
pub const WIDTH: f32 = 264.0;
pub const BAD: Color32 = Color32::from_rgb(240, 100, 90);

const PIPELINES: [(Pipeline, &str); 5] = [
    (Pipeline::Fused, "fused"),
    (Pipeline::Kill, "kill (2004)"),
    (Pipeline::EarlyKill, "early KILL"),
    (Pipeline::RaycastGl, "rays, GL"),
    (Pipeline::Raycast, "rays, CPU"),
];

pub fn show(app: &mut App, ui: &mut Ui) {
    ui.spacing_mut().item_spacing = vec2(8.0, 6.0);
    ui.add_space(8.0);
    ui.horizontal(|ui| {
        if ui.button("Open…").clicked() {
            app.ask_open();
        }
        if ui.button("Save…").clicked() {
            app.ask_save();
        }
        app.layers ^= ui.selectable_label(app.layers, "Layers").clicked();
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            app.help ^= ui.selectable_label(app.help, "F1").clicked();
        });
    });
    ui.add_space(2.0);
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        progress(app, ui);
        if app.layers {
            layers(app, ui);
        }
        shown(app, ui);
        settings(app, ui);
        stages(app, ui);
    });
}

fn section(ui: &mut Ui, title: &str) {
    ui.add_space(6.0);
    ui.label(RichText::new(title).strong());
    ui.separator();
}

/// Rows of a name and something on its right.
fn rows(ui: &mut Ui, name: &str, add: impl FnOnce(&mut Ui)) {
    Grid::new(name).num_columns(2).min_col_width(96.0).spacing(vec2(12.0, 6.0)).show(ui, add);
}

fn row(ui: &mut Ui, name: &str, value: String) {
    ui.label(name);
    ui.monospace(value);
    ui.end_row();
}

fn progress(app: &App, ui: &mut Ui) {
    let name = app.path.file_name().unwrap_or_default().to_string_lossy();
    section(ui, &name);
    let (progress, settings) = (&app.progress, &app.view.settings);
    let done = progress.statistics.gather.directions;
    let share = if app.done() { 1.0 } else { done as f32 / settings.directions as f32 };
    ui.add(ProgressBar::new(share).desired_height(6.0));
    rows(ui, "progress", |ui| {
        row(ui, "Directions", format!("{done} of {}", settings.directions));
        let rate = if progress.seconds > 0.0 { f64::from(done) / progress.seconds } else { 0.0 };
        row(ui, "Rate", format!("{rate:.0} a second"));
        let error = progress.statistics.error.map_or("–".into(), |error| format!("{:.2} %", 100.0 * error));
        row(ui, "Estimated error", error);
        row(ui, "Time", format!("{:.1} s", progress.seconds));
    });
}

fn layers(app: &mut App, ui: &mut Ui) {
    section(ui, &format!("{} layers, far to near", app.layer_view.count()));
    let directions = app.view.settings.directions;
    let view = &mut app.layer_view;
    rows(ui, "layers", |ui| {
        ui.label("Direction");
        ui.horizontal(|ui| {
            for (name, by) in [("◀", -1), ("▶", 1)] {
                if ui.small_button(name).clicked() {
                    view.step(by, directions);
                }
            }
            ui.monospace(view.number().to_string());
        });
        ui.end_row();

        ui.label("");
        let mut follow = view.wish.number.is_none();
        if ui.checkbox(&mut follow, "the one at hand").changed() {
            view.wish.number = if follow { None } else { Some(view.number()) };
        }
        ui.end_row();

        ui.label("");
        ui.checkbox(&mut view.wish.opposite, "its other end");
        ui.end_row();

        ui.label("Apart");
        ui.spacing_mut().slider_width = 112.0;
        ui.add(Slider::new(&mut view.explode, 0.0..=1.5).show_value(false));
        ui.end_row();
    });
}

fn shown(app: &mut App, ui: &mut Ui) {
    section(ui, "Show");
    let shown = &mut app.shown;
    ui.horizontal(|ui| {
        for (what, name) in [(What::Radiance, "Radiance"), (What::PhotonMap, "Photon map"), (What::Normals, "Normals")] {
            ui.selectable_value(&mut shown.what, what, name);
        }
    });
    ui.horizontal(|ui| {
        let radiance = shown.what == What::Radiance;
        ui.add_enabled(radiance, Checkbox::new(&mut shown.direct, "direct"));
        ui.add_enabled(radiance, Checkbox::new(&mut shown.indirect, "indirect"));
        ui.add_enabled(shown.what != What::Normals, Checkbox::new(&mut shown.emission, "emission"));
    });
    rows(ui, "exposure", |ui| {
        ui.label("Exposure");
        ui.spacing_mut().slider_width = 76.0;
        ui.add(Slider::new(&mut shown.exposure, -6.0..=6.0).clamping(SliderClamping::Never).step_by(0.1).suffix(" EV"));
        ui.end_row();
    });
    // What is saved is exposed as what is seen.
    app.view.settings.exposure = shown.exposure;
}

fn settings(app: &mut App, ui: &mut Ui) {
    section(ui, "Gather");
    let (settings, pace) = (&mut app.view.settings, &mut app.view.pace);
    rows(ui, "gather", |ui| {
        ui.label("Pipeline");
        let name = PIPELINES.iter().find(|(pipeline, _)| *pipeline == settings.pipeline).map_or("", |(_, name)| name);
        ComboBox::from_id_salt("pipeline").selected_text(name).show_ui(ui, |ui| {
            for (pipeline, name) in PIPELINES {
                ui.selectable_value(&mut settings.pipeline, pipeline, name);
            }
        });
        ui.end_row();

        let layered = matches!(settings.pipeline, Pipeline::Fused | Pipeline::Kill | Pipeline::EarlyKill);
        ui.label("Layer size");
        ui.add_enabled_ui(layered, |ui| {
            ComboBox::from_id_salt("layer size").selected_text(settings.layer_size.to_string()).show_ui(ui, |ui| {
                let texels = [64, 128, 256, 512, 1024].map(LayerSize::Texels);
                for size in [LayerSize::Auto].into_iter().chain(texels) {
                    ui.selectable_value(&mut settings.layer_size, size, size.to_string());
                }
            });
        });
        ui.end_row();

        ui.label("Stop fraction");
        let stops = matches!(settings.pipeline, Pipeline::Kill | Pipeline::EarlyKill);
        ui.add_enabled(
            stops,
            DragValue::new(&mut settings.stop_fraction)
                .range(0.0..=0.2)
                .clamp_existing_to_range(false)
                .speed(0.0002)
                .max_decimals(4),
        )
        .on_disabled_hover_text("For the pipelines of 2004: the others look at all layers.");
        ui.end_row();

        ui.label("Directions");
        ui.add(
            DragValue::new(&mut settings.directions)
                .range(16..=1_000_000)
                .clamp_existing_to_range(false)
                .speed(8.0)
                .update_while_editing(false),
        );
        ui.end_row();

        ui.label("Per picture");
        let text = |pace: f64, _| if pace == 0.0 { "as fits".into() } else { format!("{pace}") };
        ui.add(DragValue::new(pace).range(0..=1024).speed(1.0).custom_formatter(text))
            .on_hover_text("Directions from one picture to the next");
        ui.end_row();
    });
}

fn stages(app: &App, ui: &mut Ui) {
    section(ui, "GPU time a direction");
    rows(ui, "stages", |ui| {
        for (name, time) in &app.progress.stages {
            row(ui, name, time.map_or("n/a".into(), |time| format!("{time:.2} ms")));
        }
        if app.progress.stages.is_empty() {
            ui.weak("no stages");
            ui.end_row();
        }
    });
}
