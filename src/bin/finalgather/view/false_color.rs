//! False colours: numbers as colours, with a scale to read them by.

use egui::{Align2, Color32, FontId, Mesh, Painter, Rect, pos2, vec2};

/// Steps of a scale's bar.
const STEPS: usize = 64;
/// Width of a number below a scale's bar, in points.
const NUMBER: f32 = 70.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorMap {
    /// Of even steps to the eye, from dark violet to yellow.
    Viridis,
    /// Blue below the middle, red above it.
    BlueToRed,
}

/// Colours and the values that they stand for.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorScale {
    pub map: ColorMap,
    /// The values of the first and of the last colour.
    pub range: [f32; 2],
    /// What the numbers are, for the reader.
    pub what: &'static str,
    /// Numbers are shown in per cent.
    pub percent: bool,
}

impl ColorMap {
    /// The colour at `at`, from 0 to 1. Values beyond have the colour of the end. NaN has magenta, which no scale has.
    pub fn color(self, at: f32) -> [u8; 3] {
        if at.is_nan() {
            return [255, 0, 255];
        }
        let at = at.clamp(0.0, 1.0);
        let color = match self {
            Self::Viridis => viridis(at),
            Self::BlueToRed => blue_to_red(at),
        };
        color.map(|part| (255.0 * part.clamp(0.0, 1.0)).round() as u8)
    }
}

/// The map viridis of matplotlib, by the polynomial that Matt Zucker fitted to it (shadertoy.com/view/WlfXRN, public domain).
fn viridis(t: f32) -> [f32; 3] {
    const RED: [f32; 7] = [0.277_727_33, 0.105_093_04, -0.330_861_83, -4.634_230_5, 6.228_27, 4.776_385, -5.435_456];
    const GREEN: [f32; 7] = [0.005_407_344_5, 1.404_613_5, 0.214_847_56, -5.799_101, 14.179_933, -13.745_145, 4.645_853];
    const BLUE: [f32; 7] = [0.334_099_8, 1.384_590_1, 0.095_095_16, -19.332_44, 56.690_55, -65.353_03, 26.312_435];
    [RED, GREEN, BLUE].map(|factors| factors.iter().rev().fold(0.0, |sum, factor| sum * t + factor))
}

/// White in the middle. The ends are those of RdBu, ColorBrewer.
fn blue_to_red(t: f32) -> [f32; 3] {
    const BLUE: [f32; 3] = [0.129, 0.4, 0.675];
    const RED: [f32; 3] = [0.698, 0.094, 0.169];
    let (end, share) = if t < 0.5 { (BLUE, 1.0 - 2.0 * t) } else { (RED, 2.0 * t - 1.0) };
    end.map(|part| 1.0 + share * (part - 1.0))
}

/// The range from the 1st to the 99th of a hundred values, so that few bright pixels do not darken the rest. It is never empty.
pub fn automatic_range(values: &[f32]) -> [f32; 2] {
    let mut finite: Vec<f32> = values.iter().copied().filter(|value| value.is_finite()).collect();
    if finite.is_empty() {
        return [0.0, 1.0];
    }
    let last = finite.len() - 1;
    let mut at = |share: f32| *finite.select_nth_unstable_by((share * last as f32).round() as usize, f32::total_cmp).1;
    let (low, high) = (at(0.01), at(0.99));
    if high > low { [low, high] } else { [low, low + 1e-6_f32.max(1e-3 * low.abs())] }
}

impl ColorScale {
    /// Colours of the values, three bytes each.
    pub fn colors(&self, values: &[f32]) -> Vec<u8> {
        let [low, high] = self.range;
        values.iter().flat_map(|value| self.map.color((value - low) / (high - low))).collect()
    }

    /// Draws the bar and its numbers into `area`.
    pub fn draw(&self, painter: &Painter, area: Rect, text: Color32) {
        let font = FontId::proportional(12.0);
        let bar = Rect::from_min_max(pos2(area.left() + 12.0, area.top() + 18.0), pos2(area.right() - 12.0, area.top() + 28.0));
        painter.text(area.left_top() + vec2(12.0, 2.0), Align2::LEFT_TOP, self.what, font.clone(), text);
        let mut mesh = Mesh::default();
        for step in 0..=STEPS {
            let at = step as f32 / STEPS as f32;
            let [r, g, b] = self.map.color(at);
            let x = egui::lerp(bar.x_range(), at);
            mesh.colored_vertex(pos2(x, bar.top()), Color32::from_rgb(r, g, b));
            mesh.colored_vertex(pos2(x, bar.bottom()), Color32::from_rgb(r, g, b));
        }
        for step in 0..STEPS as u32 {
            mesh.add_triangle(2 * step, 2 * step + 1, 2 * step + 2);
            mesh.add_triangle(2 * step + 1, 2 * step + 2, 2 * step + 3);
        }
        painter.add(mesh);
        let numbers = ((bar.width() / NUMBER) as usize).clamp(2, 5);
        for number in 0..numbers {
            let at = number as f32 / (numbers - 1) as f32;
            let value = egui::lerp(self.range[0]..=self.range[1], at);
            let words = if self.percent { format!("{} %", short(100.0 * value)) } else { short(value) };
            let align = match number {
                0 => Align2::LEFT_TOP,
                _ if number == numbers - 1 => Align2::RIGHT_TOP,
                _ => Align2::CENTER_TOP,
            };
            painter.text(pos2(egui::lerp(bar.x_range(), at), bar.bottom() + 2.0), align, words, font.clone(), text);
        }
    }
}

/// Three digits that tell.
pub fn short(value: f32) -> String {
    match value.abs() {
        size if size == 0.0 || (100.0..1e5).contains(&size) => format!("{value:.0}"),
        size if !(1e-3..1e5).contains(&size) => format!("{value:.1e}"),
        size if size >= 10.0 => format!("{value:.1}"),
        size if size >= 1.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The ends are those of matplotlib's table, up to the polynomial's error.
    #[test]
    fn viridis_begins_violet_and_ends_yellow() {
        for (at, expected) in [(0.0, [68, 1, 84]), (0.5, [33, 145, 140]), (1.0, [253, 231, 37])] {
            let color = ColorMap::Viridis.color(at);
            let off = color.iter().zip(expected).map(|(&a, b): (&u8, u8)| a.abs_diff(b)).max();
            assert!(off <= Some(6), "{at}: {color:?}");
        }
        assert_eq!(ColorMap::Viridis.color(-1.0), ColorMap::Viridis.color(0.0));
        assert_eq!(ColorMap::Viridis.color(f32::INFINITY), ColorMap::Viridis.color(1.0));
        assert_eq!(ColorMap::Viridis.color(f32::NAN), [255, 0, 255]);
    }

    #[test]
    fn no_difference_is_white() {
        assert_eq!(ColorMap::BlueToRed.color(0.5), [255; 3]);
        let [[r, _, b], [more_r, _, less_b]] = [ColorMap::BlueToRed.color(0.0), ColorMap::BlueToRed.color(1.0)];
        assert!(b > r && more_r > less_b);
    }

    #[test]
    fn a_few_bright_pixels_do_not_set_the_range() {
        let mut values: Vec<f32> = (0..1000).map(|value| value as f32).collect();
        values[7] = 1e6;
        values[8] = f32::NAN;
        let [low, high] = automatic_range(&values);
        assert!((5.0..=15.0).contains(&low) && (980.0..=999.0).contains(&high), "{low} {high}");
        let [low, high] = automatic_range(&[2.0; 10]);
        assert!(low == 2.0 && high > low);
        assert_eq!(automatic_range(&[]), [0.0, 1.0]);
    }

    #[test]
    fn numbers_are_short() {
        let cases = [(0.0, "0"), (0.1234, "0.123"), (12.34, "12.3"), (1234.4, "1234"), (1e-5, "1.0e-5"), (-2.5, "-2.50")];
        for (value, expected) in cases {
            assert_eq!(short(value), expected);
        }
    }
}
