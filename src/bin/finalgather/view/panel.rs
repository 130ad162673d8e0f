//! The panel beside the picture: progress, display options and settings of the render.

use egui::{Checkbox, Color32, ComboBox, DragValue, Grid, ProgressBar, RichText, ScrollArea, Slider, SliderClamping, Ui, vec2};
use finalgather::settings::{Exposure, LayerSize, Pipeline};

use super::app::App;
use super::picture::DisplayContent;

/// Width of the panel, in points.
pub const WIDTH: f32 = 264.0;
pub const BAD: Color32 = Color32::from_rgb(240, 100, 90);

const PIPELINES: [(Pipeline, &str); 6] = [
    (Pipeline::Auto, "auto"),
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

/// A grid of names and values; `add` adds its rows.
fn rows(ui: &mut Ui, name: &str, add: impl FnOnce(&mut Ui)) {
    Grid::new(name).num_columns(2).min_col_width(96.0).spacing(vec2(12.0, 6.0)).show(ui, add);
}

/// A row with a name and the widgets that `add` adds.
fn row<R>(ui: &mut Ui, name: &str, add: impl FnOnce(&mut Ui) -> R) {
    ui.label(name);
    add(ui);
    ui.end_row();
}

fn progress(app: &App, ui: &mut Ui) {
    let name = app.path.file_name().unwrap_or_default().to_string_lossy();
    section(ui, &name);
    let (progress, settings) = (&app.progress, &app.view.settings);
    let done = progress.statistics.gather.directions;
    let share = if app.done() { 1.0 } else { done as f32 / settings.directions.count as f32 };
    ui.add(ProgressBar::new(share).desired_height(6.0));
    rows(ui, "progress", |ui| {
        row(ui, "Directions", |ui| ui.monospace(format!("{done} of {}", settings.directions.count)));
        let rate = if progress.seconds > 0.0 { f64::from(done) / progress.seconds } else { 0.0 };
        row(ui, "Rate", |ui| ui.monospace(format!("{rate:.0} a second")));
        let error = progress.statistics.error.map_or("–".into(), |error| format!("{:.2} %", 100.0 * error));
        row(ui, "Estimated error", |ui| ui.monospace(error));
        row(ui, "Time", |ui| ui.monospace(format!("{:.1} s", progress.seconds)));
    });
}

fn layers(app: &mut App, ui: &mut Ui) {
    section(ui, &format!("{} layers, far to near", app.layer_view.count()));
    let directions = app.view.settings.directions.count;
    let view = &mut app.layer_view;
    rows(ui, "layers", |ui| {
        row(ui, "Direction", |ui| {
            ui.horizontal(|ui| {
                for (name, by) in [("◀", -1), ("▶", 1)] {
                    if ui.small_button(name).clicked() {
                        view.step(by, directions);
                    }
                }
                ui.monospace(view.number().to_string());
            })
        });
        let mut follow = view.request.number.is_none();
        row(ui, "", |ui| {
            if ui.checkbox(&mut follow, "the one at hand").changed() {
                view.request.number = if follow { None } else { Some(view.number()) };
            }
        });
        row(ui, "", |ui| ui.checkbox(&mut view.request.opposite, "its other end"));
        ui.spacing_mut().slider_width = 112.0;
        row(ui, "Apart", |ui| ui.add(Slider::new(&mut view.explode, 0.0..=1.5).show_value(false)));
    });
}

fn shown(app: &mut App, ui: &mut Ui) {
    section(ui, "Show");
    let shown = &mut app.shown;
    ui.horizontal(|ui| {
        for (content, name) in [
            (DisplayContent::Radiance, "Radiance"),
            (DisplayContent::PhotonMap, "Photon map"),
            (DisplayContent::Normals, "Normals"),
        ] {
            ui.selectable_value(&mut shown.content, content, name);
        }
    });
    ui.horizontal(|ui| {
        let radiance = shown.content == DisplayContent::Radiance;
        ui.add_enabled(radiance, Checkbox::new(&mut shown.direct, "direct"));
        ui.add_enabled(radiance, Checkbox::new(&mut shown.indirect, "indirect"));
        ui.add_enabled(shown.content != DisplayContent::Normals, Checkbox::new(&mut shown.emission, "emission"));
    });
    rows(ui, "exposure", |ui| {
        ui.spacing_mut().slider_width = 76.0;
        let slider = Slider::new(&mut shown.exposure, -6.0..=6.0).clamping(SliderClamping::Never).step_by(0.1).suffix(" EV");
        row(ui, "Exposure", |ui| ui.add(slider));
    });
    // Saved pictures have the displayed exposure.
    app.view.settings.display.exposure = Exposure::Stops(shown.exposure);
}

fn settings(app: &mut App, ui: &mut Ui) {
    section(ui, "Gather");
    let (settings, pace) = (&mut app.view.settings, &mut app.view.pace);
    rows(ui, "gather", |ui| {
        let name = PIPELINES.iter().find(|(pipeline, _)| *pipeline == settings.gather.pipeline).map_or("", |(_, name)| name);
        row(ui, "Pipeline", |ui| {
            ComboBox::from_id_salt("pipeline").selected_text(name).show_ui(ui, |ui| {
                for (pipeline, name) in PIPELINES {
                    ui.selectable_value(&mut settings.gather.pipeline, pipeline, name);
                }
            })
        });
        let layered = settings.gather.pipeline.has_layers();
        row(ui, "Layer size", |ui| {
            ui.add_enabled_ui(layered, |ui| {
                ComboBox::from_id_salt("layer size").selected_text(settings.gather.layer_size.to_string()).show_ui(ui, |ui| {
                    let texels = [64, 128, 256, 512, 1024].map(LayerSize::Texels);
                    for size in [LayerSize::Auto].into_iter().chain(texels) {
                        ui.selectable_value(&mut settings.gather.layer_size, size, size.to_string());
                    }
                });
            })
        });
        let stops = matches!(settings.gather.pipeline, Pipeline::Kill | Pipeline::EarlyKill);
        let fraction = DragValue::new(&mut settings.gather.stop_fraction).range(0.0..=0.2).speed(0.0002).max_decimals(4);
        row(ui, "Stop fraction", |ui| {
            ui.add_enabled(stops, fraction.clamp_existing_to_range(false))
                .on_disabled_hover_text("For the pipelines of 2004: the others look at all layers.")
        });
        let directions = DragValue::new(&mut settings.directions.count).range(16..=1_000_000).speed(8.0);
        row(ui, "Directions", |ui| ui.add(directions.clamp_existing_to_range(false).update_while_editing(false)));
        let text = |pace: f64, _| if pace == 0.0 { "as fits".into() } else { format!("{pace}") };
        row(ui, "Per picture", |ui| {
            ui.add(DragValue::new(pace).range(0..=1024).speed(1.0).custom_formatter(text))
                .on_hover_text("Directions from one picture to the next")
        });
    });
}

fn stages(app: &App, ui: &mut Ui) {
    section(ui, "GPU time a direction");
    rows(ui, "stages", |ui| {
        for (name, time) in &app.progress.stages {
            row(ui, name, |ui| ui.monospace(time.map_or("n/a".into(), |time| format!("{time:.2} ms"))));
        }
        if app.progress.stages.is_empty() {
            ui.weak("no stages");
            ui.end_row();
        }
    });
}
