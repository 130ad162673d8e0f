//! The histogram of what is shown.

use egui::epaint::PathShape;
use egui::{Align2, Color32, FontId, Rect, Sense, Shape, Stroke, Ui, pos2, vec2};

use super::false_color::short;

const BINS: usize = 96;
/// Stops below and above white that a histogram of light shows.
const STOPS: [f32; 2] = [-10.0, 4.0];
/// Pixels that are counted; of larger pictures, every n-th.
const COUNTED: usize = 1 << 16;

/// What the horizontal axis is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Axis {
    /// Stops from white, after this exposure in stops.
    Stops(f32),
    /// Values from the one to the other.
    Values([f32; 2]),
}

/// Counts of values, of red, green and blue.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    axis: Axis,
    counts: [[u32; BINS]; 3],
    /// Shares of values left of the axis and right of it.
    beyond: [f32; 2],
}

impl Histogram {
    pub fn new(channels: [&[f32]; 3], axis: Axis) -> Self {
        let mut counts = [[0; BINS]; 3];
        let (mut beyond, mut total) = ([0_u32; 2], 0_u32);
        // An odd step does not keep to some columns of a picture with an even width.
        let step = channels[0].len().div_ceil(COUNTED) | 1;
        for (counts, channel) in counts.iter_mut().zip(channels) {
            for &value in channel.iter().step_by(step) {
                let at = axis.place(value);
                // NaN counts as too dark, as a PNG shows it.
                let end = if at > 1.0 { Some(1) } else { (at.is_nan() || at < 0.0).then_some(0) };
                total += 1;
                match end {
                    Some(end) => beyond[end] += 1,
                    None => counts[((at * BINS as f32) as usize).min(BINS - 1)] += 1,
                }
            }
        }
        Self { axis, counts, beyond: beyond.map(|count| count as f32 / total.max(1) as f32) }
    }

    /// Draws it over the width of `ui`.
    pub fn draw(&self, ui: &mut Ui) {
        let (response, painter) = ui.allocate_painter(vec2(ui.available_width(), 78.0), Sense::hover());
        let (area, visuals) = (response.rect, ui.visuals());
        let plot = Rect::from_min_max(area.min, area.max - vec2(0.0, 16.0));
        painter.rect_filled(plot, 2.0, visuals.extreme_bg_color);
        // The root lets the few be seen beside the many.
        let most = self.counts.iter().flatten().copied().max().unwrap_or(0).max(1) as f32;
        let colors = if visuals.dark_mode {
            [(255, 90, 90), (90, 220, 90), (110, 140, 255)]
        } else {
            [(200, 0, 0), (0, 140, 0), (0, 0, 220)]
        };
        let [red, green, blue] = &self.counts;
        let is_grey = red == green && green == blue;
        for (counts, (r, g, b)) in self.counts.iter().zip(colors).take(if is_grey { 1 } else { 3 }) {
            let point = |(bin, &count): (usize, &u32)| {
                let x = egui::lerp(plot.x_range(), (bin as f32 + 0.5) / BINS as f32);
                pos2(x, plot.bottom() - 1.0 - (plot.height() - 4.0) * (count as f32 / most).sqrt())
            };
            let points = counts.iter().enumerate().map(point).collect();
            painter.add(Shape::Path(PathShape::line(
                points,
                Stroke::new(1.2, if is_grey { visuals.text_color() } else { Color32::from_rgb(r, g, b) }),
            )));
        }
        let (font, weak) = (FontId::proportional(11.0), visuals.weak_text_color());
        for (at, words) in self.axis.marks() {
            let x = egui::lerp(plot.x_range(), at);
            painter.line_segment([pos2(x, plot.top()), pos2(x, plot.bottom())], Stroke::new(1.0, weak.gamma_multiply(0.5)));
            let align = if at < 0.05 {
                Align2::LEFT_TOP
            } else if at > 0.95 {
                Align2::RIGHT_TOP
            } else {
                Align2::CENTER_TOP
            };
            painter.text(pos2(x, plot.bottom() + 1.0), align, words, font.clone(), weak);
        }
        let [below, above] = self.beyond.map(|share| 100.0 * share);
        response.on_hover_text(format!(
            "Red, green and blue of the shown values. {}. {below:.1} % lie left of the axis, {above:.1} % right of it.",
            self.axis.about()
        ));
    }
}

impl Axis {
    /// From 0 to 1; beyond are values that it does not show.
    fn place(self, value: f32) -> f32 {
        match self {
            Self::Stops(exposure) => (value.log2() + exposure - STOPS[0]) / (STOPS[1] - STOPS[0]),
            Self::Values([low, high]) => (value - low) / (high - low),
        }
    }

    fn marks(self) -> Vec<(f32, String)> {
        match self {
            Self::Stops(_) => {
                let mark = |stop: f32| {
                    (
                        (stop - STOPS[0]) / (STOPS[1] - STOPS[0]),
                        if stop == 0.0 { "white".to_owned() } else { format!("{stop:+}") },
                    )
                };
                [-8.0, -4.0, 0.0, 3.0].map(mark).to_vec()
            }
            Self::Values([low, high]) => [0.0, 0.5, 1.0].map(|at| (at, short(egui::lerp(low..=high, at)))).to_vec(),
        }
    }

    fn about(self) -> &'static str {
        match self {
            Self::Stops(_) => "The axis is in stops from white, after the exposure",
            Self::Values(_) => "The axis is the value",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_every_value_once() {
        let values = [0.0, 0.1, 0.1, 0.9, 2.0, f32::NAN];
        let histogram = Histogram::new([&values, &[], &[]], Axis::Values([0.0, 1.0]));
        let total: u32 = histogram.counts[0].iter().sum();
        assert_eq!(total, 4);
        assert_eq!(histogram.counts[0][(0.1 * BINS as f32) as usize], 2);
        assert_eq!(histogram.beyond, [1.0 / 6.0, 1.0 / 6.0], "NaN counts as dark, and 2 lies above");
    }

    #[test]
    fn exposure_moves_light_by_stops() {
        let at = |exposure| Axis::Stops(exposure).place(0.25);
        let stop = 1.0 / (STOPS[1] - STOPS[0]);
        assert!((at(2.0) - at(0.0) - 2.0 * stop).abs() < 1e-6);
        assert!((at(2.0) - Axis::Stops(0.0).place(1.0)).abs() < 1e-6, "0.25 two stops brighter is white");
        assert!(Axis::Stops(0.0).place(0.0) < 0.0, "black lies below");
    }
}
