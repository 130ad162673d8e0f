//! The panel beside the picture: progress, what is shown, the view and the settings of the render. Each row has a tooltip.

use std::ops::RangeInclusive;

use egui::{
    Checkbox, CollapsingHeader, Color32, ComboBox, DragValue, Grid, PointerButton, ProgressBar, Response, RichText, ScrollArea,
    Slider, SliderClamping, ThemePreference, Ui, Visuals, vec2,
};
use finalgather::settings::{Exposure, LayerSize, Pipeline};

use super::app::App;
use super::copy;
use super::dialogs::Purpose;
use super::false_color::short;
use super::layers::LayerView;
use super::overlays::NoticeKind;
use super::picture::{Developed, DisplayContent};

/// Width of the panel, in points.
pub const WIDTH: f32 = 264.0;

/// Values that can bound a range of colours. Their differences are finite.
const VALUES: RangeInclusive<f32> = -1e30..=1e30;

const PIPELINES: [(Pipeline, &str); 6] = [
    (Pipeline::Auto, "auto"),
    (Pipeline::Fused, "fused"),
    (Pipeline::Kill, "kill (2004)"),
    (Pipeline::EarlyKill, "early KILL"),
    (Pipeline::RaycastGl, "rays, GL"),
    (Pipeline::Raycast, "rays, CPU"),
];

/// The colour of what went wrong, dark enough to read on a light panel.
pub fn bad(visuals: &Visuals) -> Color32 {
    if visuals.dark_mode { Color32::from_rgb(240, 100, 90) } else { Color32::from_rgb(185, 30, 20) }
}

pub fn show(app: &mut App, ui: &mut Ui) {
    ui.spacing_mut().item_spacing = vec2(8.0, 6.0);
    ui.add_space(8.0);
    ui.horizontal(|ui| {
        if ui.button("Open…").on_hover_text("Open a scene file or a model (Ctrl + O).").clicked() {
            app.ask(Purpose::OpenScene);
        }
        if ui.button("Save…").on_hover_text("Save the picture as PNG or EXR (Ctrl + S).").clicked() {
            app.ask(Purpose::SavePicture);
        }
        let layers = ui.selectable_label(app.layers, "Layers");
        app.layers ^= layers.on_hover_text("Take one direction apart into its layers (L).").clicked();
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            app.help ^= ui.selectable_label(app.help, "F1").on_hover_text("All keys.").clicked();
        });
    });
    ui.add_space(2.0);
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        progress(app, ui);
        if app.layers {
            layers(app, ui);
        }
        let before = (app.shown.content, app.shown.difference);
        shown(app, ui);
        reference(app, ui);
        if (app.shown.content, app.shown.difference) != before {
            // Their numbers are others.
            app.shown.range = None;
        }
        view(app, ui);
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

/// A row with a name and the widget that `add` adds. Both have the tooltip.
fn row(ui: &mut Ui, name: &str, tip: &str, add: impl FnOnce(&mut Ui) -> Response) {
    ui.label(name).on_hover_text(tip);
    add(ui).on_hover_text(tip);
    ui.end_row();
}

/// A slider that a double-click sets back to `normal`. Also returns whether it did.
fn slider(ui: &mut Ui, value: &mut f32, range: RangeInclusive<f32>, normal: f32) -> (Response, bool) {
    let response = ui.add(Slider::new(value, range).clamping(SliderClamping::Never).show_value(false).step_by(0.05));
    let back = response.hovered() && ui.input(|input| input.pointer.button_double_clicked(PointerButton::Primary));
    if back {
        *value = normal;
    }
    (response, back)
}

fn progress(app: &App, ui: &mut Ui) {
    let name = app.path.file_name().unwrap_or_default().to_string_lossy();
    section(ui, &name);
    let (progress, settings) = (&app.progress, &app.view.settings);
    let done = progress.statistics.gather.directions;
    let share = if app.done() { 1.0 } else { done as f32 / settings.directions.count as f32 };
    ui.add(ProgressBar::new(share).desired_height(6.0));
    rows(ui, "progress", |ui| {
        let directions = format!("{done} of {}", settings.directions.count);
        row(ui, "Directions", "Directions of rays that are gathered. More give less error.", |ui| ui.monospace(directions));
        let rate = if progress.seconds > 0.0 { f64::from(done) / progress.seconds } else { 0.0 };
        row(ui, "Speed", "Directions gathered in a second.", |ui| ui.monospace(format!("{rate:.0} a second")));
        let error = progress.statistics.error.map_or("–".into(), |error| format!("{:.2} %", 100.0 * error));
        let tip = "The standard error of the picture, relative to its mean, estimated from two halves of the directions.";
        row(ui, "Estimated error", tip, |ui| ui.monospace(error));
        row(ui, "Time", "Time of work on this view.", |ui| ui.monospace(format!("{:.1} s", progress.seconds)));
    });
}

fn layers(app: &mut App, ui: &mut Ui) {
    section(ui, &format!("{} layers, far to near", app.layer_view.count()));
    let directions = app.view.settings.directions.count;
    let view = &mut app.layer_view;
    rows(ui, "layers", |ui| {
        row(ui, "Direction", "Number of the direction whose layers are shown. Step by , and .", |ui| {
            ui.horizontal(|ui| {
                for (name, by) in [("◀", -1), ("▶", 1)] {
                    if ui.small_button(name).clicked() {
                        view.step(by, directions);
                    }
                }
                ui.monospace(view.number().to_string())
            })
            .inner
        });
        let mut follow = view.request.number.is_none();
        let tip = "Shows the direction that was gathered last. It waits while the pointer is over the picture or the layers.";
        row(ui, "", tip, |ui| {
            let follows = ui.checkbox(&mut follow, "follow the render");
            if follows.changed() {
                view.request.number = if follow { None } else { Some(view.number()) };
            }
            follows
        });
        let tip = "Rays that run the other way along the same line.";
        row(ui, "", tip, |ui| ui.checkbox(&mut view.request.opposite, "reverse the rays"));
        ui.spacing_mut().slider_width = 112.0;
        let tip = "Distance between the layers of the stack. A double-click sets it back.";
        row(ui, "Spread", tip, |ui| slider(ui, &mut view.explode, 0.0..=1.5, LayerView::EXPLODE).0);
    });
}

fn shown(app: &mut App, ui: &mut Ui) {
    section(ui, "Show");
    let shown = &mut app.shown;
    ui.horizontal_wrapped(|ui| {
        for (content, name, tip) in DisplayContent::ALL {
            ui.selectable_value(&mut shown.content, content, name).on_hover_text(tip);
        }
    });
    let radiance = shown.content == DisplayContent::Radiance;
    if shown.content.is_light() {
        ui.horizontal_wrapped(|ui| {
            for (on, name, tip, is_radiance) in [
                (&mut shown.direct, "direct", "Light that comes straight from lamps.", true),
                (&mut shown.indirect, "indirect", "Light that other surfaces reflect: the final gather.", true),
                (&mut shown.caustics, "caustics", "Light by way of mirrors and glass.", true),
                (&mut shown.emission, "emission", "Light of lamps and sky that the camera sees itself.", false),
            ] {
                if radiance || !is_radiance {
                    ui.add(Checkbox::new(on, name)).on_hover_text(tip);
                }
            }
        });
    }
    let of_scene = app.scene.as_ref().map_or_else(Exposure::default, |scene| scene.settings.display.exposure);
    let developed = app.canvas.developed().and_then(|developed| developed.as_ref().ok());
    rows(ui, "exposure", |ui| {
        let tip = "Brightness in stops: one more is twice as bright. A double-click sets it back. Saved PNGs have it too.";
        let now = match (shown.exposure, developed) {
            (Exposure::Auto, Some(developed)) => developed.stops,
            (exposure, _) => exposure.given(),
        };
        let light = shown.content.is_light();
        row(ui, "Exposure", tip, |ui| {
            ui.horizontal(|ui| {
                if !light {
                    ui.disable();
                }
                ui.spacing_mut().slider_width = 64.0;
                let mut stops = now;
                let (slid, back) = slider(ui, &mut stops, -6.0..=6.0, of_scene.given());
                let value = DragValue::new(&mut stops).speed(0.02).max_decimals(2).suffix(" EV").custom_parser(finite);
                let dragged = ui.add(value.range(-Exposure::MOST..=Exposure::MOST));
                if back {
                    shown.exposure = of_scene;
                } else if slid.changed() || dragged.changed() {
                    shown.exposure = Exposure::Stops(stops);
                }
                dragged | slid
            })
            .inner
        });
        row(ui, "", "Chooses the exposure by the light of the surfaces that are seen.", |ui| {
            let mut automatic = shown.exposure == Exposure::Auto;
            let chosen = ui.add_enabled(light, Checkbox::new(&mut automatic, "automatic"));
            if chosen.changed() {
                shown.exposure = if automatic { Exposure::Auto } else { Exposure::Stops(now) };
            }
            chosen
        });
        let tip = "Shows luminance as colours, with a scale below the picture. The error always has them.";
        row(ui, "False colours", tip, |ui| {
            let has_them = !matches!(shown.content, DisplayContent::Normals | DisplayContent::Error);
            ui.add_enabled(has_them, Checkbox::without_text(&mut shown.false_color))
        });
        let scale = developed.and_then(|developed| developed.scale.as_ref());
        if let Some(scale) = scale {
            range(ui, &mut shown.range, scale.range);
        }
    });
    // Saved pictures have the displayed exposure.
    app.view.settings.display.exposure = shown.exposure;
    if let Some(Developed { histogram, .. }) = developed {
        CollapsingHeader::new("Histogram").default_open(true).show(ui, |ui| histogram.draw(ui));
    }
}

/// The range of false colours; `automatic` is the shown one.
fn range(ui: &mut Ui, range: &mut Option<[f32; 2]>, automatic: [f32; 2]) {
    let tip = "Values of the first and the last colour. Automatic: from the 1st to the 99th of a hundred pixels.";
    row(ui, "Colour range", tip, |ui| {
        let mut auto = range.is_none();
        let chosen = ui.checkbox(&mut auto, "automatic");
        if chosen.changed() {
            *range = (!auto).then_some(automatic);
        }
        chosen
    });
    let Some([low, high]) = range else { return };
    row(ui, "", tip, |ui| {
        ui.horizontal(|ui| {
            let text = |value: f64, _| short(value as f32);
            let speed = f64::from((*high - *low).abs().max(1e-4)) * 0.005;
            let first = ui.add(DragValue::new(low).range(VALUES).speed(speed).custom_formatter(text).custom_parser(finite));
            let last = ui.add(DragValue::new(high).range(VALUES).speed(speed).custom_formatter(text).custom_parser(finite));
            *high = high.max(*low + f32::EPSILON * low.abs().max(1e-3));
            first | last
        })
        .inner
    });
}

/// The number of a text, if it is finite.
fn finite(text: &str) -> Option<f64> {
    let text: String = text.chars().filter(|character| !character.is_whitespace()).collect();
    // egui writes a minus sign for a hyphen.
    text.replace('−', "-").parse().ok().filter(|number: &f64| number.is_finite())
}

fn reference(app: &mut App, ui: &mut Ui) {
    section(ui, "Compare");
    let name = app
        .canvas
        .reference
        .as_ref()
        .map(|reference| reference.path.file_name().unwrap_or_default().to_string_lossy().into_owned());
    let Some(name) = name else {
        if ui.button("Open a reference…").on_hover_text("A picture to compare with, EXR or PNG (Ctrl + R).").clicked() {
            app.ask(Purpose::OpenReference);
        }
        return;
    };
    ui.horizontal(|ui| {
        if ui.small_button("✖").on_hover_text("Close the reference.").clicked() {
            app.compare_with(None);
        }
        ui.add(egui::Label::new(name).truncate());
    });
    ui.horizontal_wrapped(|ui| {
        ui.toggle_value(&mut app.canvas.flipped, "Reference")
            .on_hover_text("Shows the reference in place of the picture (hold X).");
        let tip = "Shows the difference of luminance: blue where the picture is darker, red where it is brighter.";
        ui.toggle_value(&mut app.shown.difference, "Difference").on_hover_text(tip);
    });
    match app.canvas.picture.as_ref().and_then(|picture| picture.comparison.as_ref()) {
        None => {
            ui.weak("Compared once the camera is still.");
        }
        Some(Err(problem)) => {
            ui.colored_label(bad(ui.visuals()), problem);
            let size = app.canvas.reference.as_ref().map(|reference| [reference.image.width, reference.image.height]);
            if let Some(size) = size.map(|size| size.map(|side| side as u32)).filter(|size| *size != app.view.settings.film.size)
                && ui.button("Take its size").on_hover_text("Renders the picture in the size of the reference.").clicked()
            {
                app.fill = false;
                app.view.settings.film.size = size;
            }
        }
        Some(Ok(comparison)) => {
            let (bias, rmse, flip) = (comparison.bias, comparison.relative_rmse, comparison.flip);
            rows(ui, "comparison", |ui| {
                let tip = "Difference of the means, by the mean of the reference.";
                row(ui, "Bias", tip, |ui| ui.monospace(format!("{:+.3} %", 100.0 * bias)));
                let tip = "Root of the mean squared difference, by the mean of the reference.";
                row(ui, "RMSE", tip, |ui| ui.monospace(format!("{:.3} %", 100.0 * rmse)));
                let tip = "How different the two look when flipped, from 0 to 1.";
                row(ui, "FLIP", tip, |ui| ui.monospace(format!("{flip:.4}")));
            });
        }
    }
}

fn view(app: &mut App, ui: &mut Ui) {
    section(ui, "View");
    ui.horizontal_wrapped(|ui| {
        let tip = "Copies the camera as options of finalgather render (Ctrl + C).";
        let options = ui.button("Copy options").on_hover_text(tip).clicked().then(|| copy::options(&app.view.camera));
        let tip = "Copies the camera as the [camera] table of a scene file.";
        let toml = ui.button("Copy TOML").on_hover_text(tip).clicked().then(|| copy::toml(&app.view.camera));
        if let Some(text) = options.or(toml) {
            ui.ctx().copy_text(text);
            app.say("Copied the view".into(), NoticeKind::News);
        }
        let tip = "Writes a scene file that renders this view with these settings (Ctrl + Shift + S).";
        if ui.button("Save scene…").on_hover_text(tip).clicked() {
            app.ask(Purpose::SaveScene);
        }
    });
    rows(ui, "view", |ui| {
        let [width, height] = app.view.settings.film.size;
        row(ui, "Picture", "Size of the picture in pixels.", |ui| ui.monospace(format!("{width} x {height}")));
        let tip = "Renders a picture as large as the window has room for, and follows when that changes.";
        let mut fill = app.fill;
        row(ui, "Fill the window", tip, |ui| ui.add(Checkbox::without_text(&mut fill)));
        if fill != app.fill {
            app.fill = fill;
            if let Some(scene) = app.scene.as_ref().filter(|_| !fill) {
                app.view.settings.film.size = scene.settings.film.size;
            }
        }
        row(ui, "Zoom", "Pixels of the screen to one of the picture. Keys 1 and F, or Ctrl + wheel.", |ui| {
            ui.horizontal(|ui| {
                let one = ui.small_button("1:1");
                if one.clicked() {
                    app.canvas.enlarge_to(1.0, None);
                }
                let fit = ui.small_button("fit");
                if fit.clicked() {
                    app.canvas.zoom = super::zoom::Zoom::default();
                }
                one | fit
            })
            .inner
        });
        row(ui, "Theme", "Colours of the window. System: as the desktop.", |ui| {
            let name = |theme| match theme {
                ThemePreference::System => "system",
                ThemePreference::Light => "light",
                ThemePreference::Dark => "dark",
            };
            let chosen = ComboBox::from_id_salt("theme").selected_text(name(app.theme)).show_ui(ui, |ui| {
                for theme in [ThemePreference::System, ThemePreference::Light, ThemePreference::Dark] {
                    ui.selectable_value(&mut app.theme, theme, name(theme));
                }
            });
            chosen.response
        });
    });
}

fn settings(app: &mut App, ui: &mut Ui) {
    section(ui, "Gather");
    let (settings, pace) = (&mut app.view.settings, &mut app.view.pace);
    rows(ui, "gather", |ui| {
        let name = PIPELINES.iter().find(|(pipeline, _)| *pipeline == settings.gather.pipeline).map_or("", |(_, name)| name);
        let tip = "How rays find what they hit. auto: layers (fused) where they resolve the scene, else exact rays.";
        row(ui, "Pipeline", tip, |ui| {
            let chosen = ComboBox::from_id_salt("pipeline").selected_text(name).show_ui(ui, |ui| {
                for (pipeline, name) in PIPELINES {
                    ui.selectable_value(&mut settings.gather.pipeline, pipeline, name);
                }
            });
            chosen.response
        });
        let layered = settings.gather.pipeline.has_layers();
        row(
            ui,
            "Layer size",
            "Side of the layers in texels. Larger ones resolve finer surfaces. auto grows with the directions.",
            |ui| {
                ui.add_enabled_ui(layered, |ui| {
                    ComboBox::from_id_salt("layer size").selected_text(settings.gather.layer_size.to_string()).show_ui(
                        ui,
                        |ui| {
                            let texels = [64, 128, 256, 512, 1024].map(LayerSize::Texels);
                            for size in [LayerSize::Auto].into_iter().chain(texels) {
                                ui.selectable_value(&mut settings.gather.layer_size, size, size.to_string());
                            }
                        },
                    );
                })
                .response
            },
        );
        let stops = matches!(settings.gather.pipeline, Pipeline::Kill | Pipeline::EarlyKill);
        let fraction = DragValue::new(&mut settings.gather.stop_fraction).range(0.0..=0.2).speed(0.0002).max_decimals(4);
        let tip = "Peeling stops when a smaller share of the points samples a layer. Only the pipelines of 2004 stop so.";
        row(ui, "Stop fraction", tip, |ui| {
            ui.add_enabled(stops, fraction.clamp_existing_to_range(false))
                .on_disabled_hover_text("For the pipelines of 2004: the others look at all layers.")
        });
        let directions = DragValue::new(&mut settings.directions.count).range(16..=1_000_000).speed(8.0);
        let tip = "Directions to gather. Four times as many halve the error.";
        row(ui, "Directions", tip, |ui| ui.add(directions.clamp_existing_to_range(false).update_while_editing(false)));
        let text = |pace: f64, _| if pace == 0.0 { "automatically".into() } else { format!("each {pace} directions") };
        let tip = "How often the picture is renewed. Automatically: so that pictures take a fifth of the time. Drag for a number of directions.";
        row(ui, "New pictures", tip, |ui| ui.add(DragValue::new(pace).range(0..=1024).speed(1.0).custom_formatter(text)));
    });
}

fn stages(app: &App, ui: &mut Ui) {
    section(ui, "GPU time a direction");
    rows(ui, "stages", |ui| {
        for (name, time) in &app.progress.stages {
            let tip = "Time that the device takes for this stage of one direction.";
            row(ui, name, tip, |ui| ui.monospace(time.map_or("n/a".into(), |time| format!("{time:.2} ms"))));
        }
        if app.progress.stages.is_empty() {
            ui.weak("no stages");
            ui.end_row();
        }
    });
}
