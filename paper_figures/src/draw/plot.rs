//! Plots in one style for all figures: panels of lines or bars below each other, each with its legend on the right, as SVG.
//!
//! The width of text is not measured, because that needs font libraries. Panels leave enough room for it.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, ValueFormatter};
use plotters::prelude::*;
pub use plotters::style::RGBColor;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::draw::numbers::tick_label;
use crate::figure::Result;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Colours that people with any kind of colour vision can tell apart (Okabe, Ito 2008).
pub const BLUE: RGBColor = RGBColor(0, 114, 178);
pub const ORANGE: RGBColor = RGBColor(213, 94, 0);
pub const GREEN: RGBColor = RGBColor(0, 158, 115);
pub const PURPLE: RGBColor = RGBColor(204, 121, 167);
pub const SKY: RGBColor = RGBColor(86, 180, 233);
pub const GREY: RGBColor = RGBColor(120, 120, 120);

/// How path tracing is called in plots, beside the contestants of a bench.
pub const PATH_TRACING: &str = "path tracing";

/// The colour of a way to gather, the same in all figures.
pub fn color(name: &str) -> RGBColor {
    match name {
        "kill" => BLUE,
        "early-kill" => SKY,
        "fused" => ORANGE,
        "raycast-gl" => PURPLE,
        "raycast" | PATH_TRACING => GREEN,
        _ => GREY,
    }
}

/// In pixels: the width of a plot, of that the legend's, and the height of a bar with the space around it.
const WIDTH: u32 = 900;
const LEGEND: u32 = 230;
const BAR: u32 = 44;

/// A plot or bar chart in a document, with its title above.
pub struct Panel {
    height: u32,
    title: String,
    content: Content,
}

enum Content {
    Lines([Axis; 2], Vec<Curve>),
    Bars(Axis, Vec<(&'static str, RGBColor)>, Vec<Bar>),
}

impl Panel {
    pub fn lines(height: u32, title: impl Into<String>, axes: [Axis; 2], curves: Vec<Curve>) -> Self {
        Self { height, title: title.into(), content: Content::Lines(axes, curves) }
    }

    /// Horizontal bars, a group for each of `bars` with one bar for each of `series`. `height` is without the bars.
    /// The axis ends at `room` times the longest bar, so that the notes beyond bars have space.
    pub fn bars(
        height: u32,
        title: impl Into<String>,
        x: Axis,
        room: f64,
        series: &[(&'static str, RGBColor)],
        bars: Vec<Bar>,
    ) -> Self {
        let x = x.over(bars.iter().flat_map(|bar| &bar.values).map(|(value, _)| room * value));
        let height = height + BAR * bars.len() as u32;
        Self { height, title: title.into(), content: Content::Bars(x, series.to_vec(), bars) }
    }

    fn draw(&self, area: &Area) -> Result<()> {
        area.draw(&Text::new(self.title.clone(), (76, 10), font(20)))?;
        let (_, below) = area.split_vertically(42);
        let (plot, legend) = below.split_horizontally(WIDTH - LEGEND);
        match &self.content {
            Content::Lines(axes, curves) => lines(&plot, &legend, axes, curves),
            Content::Bars(x, series, bars) => self::bars(&plot, &legend, x, series, bars),
        }
    }
}

/// An SVG document with these panels below each other.
pub fn svg(panels: impl IntoIterator<Item = Panel>) -> Result<String> {
    let panels: Vec<_> = panels.into_iter().collect();
    let height = panels.iter().map(|panel| panel.height).sum();
    let mut text = String::new();
    {
        let mut rest = SVGBackend::with_string(&mut text, (WIDTH, height)).into_drawing_area();
        rest.fill(&WHITE)?;
        for panel in panels {
            let (area, below) = rest.split_vertically(panel.height);
            panel.draw(&area)?;
            rest = below;
        }
        rest.present()?;
    }
    Ok(text + "\n")
}

fn font(size: i32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&BLACK)
}

/// A scale of a plot, with its ticks.
#[derive(Clone, Default)]
pub struct Axis {
    name: String,
    unit: Unit,
    log: bool,
    /// What it must reach, beside the values of curves.
    over: Vec<f64>,
    /// Chosen by [`Axis::fitted`], unless they are given.
    ticks: Vec<f64>,
    /// Between ticks in even steps: their labels have as many digits as the step needs.
    step: Option<f64>,
    range: [f64; 2],
}

/// How the ticks of an axis are written.
#[derive(Clone, Copy, Default)]
pub enum Unit {
    #[default]
    Number,
    Percent,
}

impl Axis {
    /// Over 0 and the values, in about five even steps.
    pub fn linear(name: &str, unit: Unit) -> Self {
        Self { name: name.into(), unit, ..Self::default() }
    }

    /// Over the positive values; ticks at 1, 2 and 5 of each decade, or at decades alone where there are many. A range with less than two
    /// of these has even steps.
    pub fn log(name: &str, unit: Unit) -> Self {
        Self { log: true, ..Self::linear(name, unit) }
    }

    /// Logarithmic, over these ticks.
    pub fn log_at<T: Into<f64>>(name: &str, unit: Unit, ticks: impl IntoIterator<Item = T>) -> Self {
        let mut ticks: Vec<f64> = ticks.into_iter().map(Into::into).collect();
        // Small scales make some of them equal.
        ticks.sort_by(f64::total_cmp);
        ticks.dedup();
        Self { ticks, ..Self::log(name, unit) }
    }

    /// Reaches these values too.
    pub fn over(self, values: impl IntoIterator<Item = f64>) -> Self {
        Self { over: values.into_iter().collect(), ..self }
    }

    /// With range and ticks.
    fn fitted(&self, values: impl Iterator<Item = f64>) -> Self {
        let values = values.chain(self.over.iter().copied()).filter(|value| value.is_finite());
        let (range, ticks, step) = if !self.ticks.is_empty() {
            (log_range(self.ticks.iter().copied()), self.ticks.clone(), None)
        } else if self.log {
            log_ticks(log_range(values))
        } else {
            linear_ticks(values)
        };
        Self { range, ticks, step, ..self.clone() }
    }

    fn place(&self, value: f64) -> f64 {
        if self.log { value.log10() } else { value }
    }

    fn label(&self, tick: f64) -> String {
        let most = self.ticks.iter().fold(0.0, |most: f64, tick| most.max(tick.abs()));
        let even = self.step.map(|step| [step, most]);
        match self.unit {
            Unit::Number => tick_label(tick, even),
            Unit::Percent => tick_label(100.0 * tick, even.map(|even| even.map(|value| 100.0 * value))) + " %",
        }
    }
}

/// Range, ticks, and the step between them where it is even.
type Ticks = ([f64; 2], Vec<f64>, Option<f64>);

/// 1, 2 or 5 times a power of ten, at least a fifth of `length`.
fn even_step(length: f64) -> f64 {
    let power = 10_f64.powf((length / 5.0).log10().floor());
    [1.0, 2.0, 5.0].map(|step| step * power).into_iter().find(|step| step * 5.0 >= length).unwrap_or(10.0 * power)
}

fn linear_ticks(values: impl Iterator<Item = f64>) -> Ticks {
    let (least, most) = values.fold((0.0_f64, 0.0_f64), |(least, most), value| (least.min(value), most.max(value)));
    let most = if least == most { 1.0 } else { most };
    let step = even_step(most - least);
    let (first, last) = ((least / step).floor() as i32, (most / step).ceil() as i32);
    let ticks: Vec<_> = (first..=last).map(|i| f64::from(i) * step).collect();
    ([ticks[0], ticks[ticks.len() - 1]], ticks, Some(step))
}

/// One decade where no value is positive.
fn log_range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let positive = values.filter(|&value| value > 0.0);
    let (least, most) = positive.fold((f64::INFINITY, 0.0_f64), |(least, most), value| (least.min(value), most.max(value)));
    if most > 0.0 { [least / 1.2, most * 1.2] } else { [1.0, 10.0] }
}

fn log_ticks(range: [f64; 2]) -> Ticks {
    let [first, last] = range.map(|end| end.log10().floor() as i32);
    let within = if last - first > 3 { &[1.0][..] } else { &[1.0, 2.0, 5.0] };
    let ticks = (first..=last).flat_map(|decade| within.iter().map(move |digit| digit * 10_f64.powi(decade)));
    let ticks: Vec<_> = ticks.filter(|tick| (range[0]..=range[1]).contains(tick)).collect();
    if ticks.len() > 1 {
        return (range, ticks, None);
    }
    let step = even_step(0.6 * (range[1] - range[0]));
    let (first, last) = ((range[0] / step).ceil() as i32, (range[1] / step).floor() as i32);
    (range, (first..=last).map(|i| f64::from(i) * step).collect(), Some(step))
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, pixels: (i32, i32)) -> i32 {
        let [from, to] = self.range.map(|end| self.place(end));
        // Far outside is outside, in numbers that a picture can hold.
        let share = ((self.place(*value) - from) / (to - from)).clamp(-1.0, 2.0);
        pixels.0 + (share * f64::from(pixels.1 - pixels.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> Range<f64> {
        self.range[0]..self.range[1]
    }
}

impl ValueFormatter<f64> for Axis {
    fn format(value: &f64) -> String {
        value.to_string()
    }

    fn format_ext(&self, value: &f64) -> String {
        self.label(*value)
    }
}

/// A line with a mark at each point.
pub struct Curve {
    name: String,
    color: RGBColor,
    faint: bool,
    points: Vec<(f64, f64)>,
}

impl Curve {
    pub fn new<X: Into<f64>, Y: Into<f64>>(
        name: impl Into<String>,
        color: RGBColor,
        points: impl IntoIterator<Item = (X, Y)>,
    ) -> Self {
        let points = points.into_iter().map(|(x, y)| (x.into(), y.into())).collect();
        Self { name: name.into(), color, faint: false, points }
    }

    /// As a thin line with open marks, if `faint`. It is seen around another curve where both coincide.
    pub fn faint(self, faint: bool) -> Self {
        Self { faint, ..self }
    }

    /// The style of its line, and the size and style of its marks.
    fn style(&self) -> (ShapeStyle, u32, ShapeStyle) {
        if self.faint {
            (self.color.stroke_width(1), 5, self.color.stroke_width(1))
        } else {
            (self.color.stroke_width(2), 3, self.color.filled())
        }
    }
}

fn lines(plot: &Area, legend: &Area, [x, y]: &[Axis; 2], curves: &[Curve]) -> Result<()> {
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let (x, y) = (x.fitted(points().map(|point| point.0)), y.fitted(points().map(|point| point.1)));
    let mut chart = ChartBuilder::on(plot)
        .margin_left(8)
        .margin_right(10)
        .margin_bottom(12)
        .x_label_area_size(48)
        .y_label_area_size(76)
        .build_cartesian_2d(x.clone(), y.clone())?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GREY.mix(0.25))
        .x_desc(&x.name)
        .y_desc(&y.name)
        .label_style(font(15))
        .axis_desc_style(font(17))
        .draw()?;
    for (row, curve) in (0..).zip(curves) {
        let has_place = |&&(at, value): &&(f64, f64)| x.place(at).is_finite() && y.place(value).is_finite();
        let points: Vec<_> = curve.points.iter().filter(has_place).copied().collect();
        let (line, radius, mark) = curve.style();
        chart.draw_series(LineSeries::new(points.clone(), line))?;
        chart.draw_series(points.into_iter().map(|point| Circle::new(point, radius, mark)))?;

        let height = named(legend, row, &curve.name)?;
        legend.draw(&PathElement::new(vec![(0, height), (26, height)], line))?;
        legend.draw(&Circle::new((13, height), radius, mark))?;
    }
    Ok(())
}

/// Values beside each other under one name.
pub struct Bar {
    pub name: String,
    /// One of each series, and what is written beyond it.
    pub values: Vec<(f64, String)>,
}

fn bars(plot: &Area, legend: &Area, x: &Axis, series: &[(&str, RGBColor)], bars: &[Bar]) -> Result<()> {
    /// Share of a row's height that its bars fill.
    const FILLED: f64 = 0.8;
    let mut chart = ChartBuilder::on(plot)
        .margin_right(10)
        .margin_bottom(12)
        .x_label_area_size(48)
        .y_label_area_size(170)
        .build_cartesian_2d(x.fitted([].into_iter()), bars.len() as f64..0.0)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GREY.mix(0.25))
        .disable_y_mesh()
        .y_labels(0)
        .x_desc(&x.name)
        .label_style(font(15))
        .axis_desc_style(font(17))
        .draw()?;
    let thickness = FILLED / series.len() as f64;
    let text =
        |text: &str, from: i32, side: HPos| Text::new(text.to_owned(), (from, 0), font(15).pos(Pos::new(side, VPos::Center)));
    for (row, bar) in bars.iter().enumerate() {
        let top = row as f64 + 0.5 * (1.0 - FILLED);
        for ((i, (value, note)), (_, color)) in (0..).zip(&bar.values).zip(series) {
            let from = top + f64::from(i) * thickness;
            chart.draw_series([Rectangle::new([(0.0, from), (*value, from + thickness)], color.filled())])?;
            chart.draw_series([EmptyElement::at((*value, from + 0.5 * thickness)) + text(note, 6, HPos::Left)])?;
        }
        chart.draw_series([EmptyElement::at((0.0, row as f64 + 0.5)) + text(&bar.name, -8, HPos::Right)])?;
    }
    for (row, (name, color)) in (0..).zip(series) {
        let height = named(legend, row, name)?;
        legend.draw(&Rectangle::new([(0, height - 6), (26, height + 6)], color.filled()))?;
    }
    Ok(())
}

/// Writes a name into a row of the legend, and returns the height at which its sign belongs.
fn named(legend: &Area, row: i32, name: &str) -> Result<i32> {
    let height = 12 + 24 * row;
    legend.draw(&Text::new(name.to_owned(), (34, height), font(15).pos(Pos::new(HPos::Left, VPos::Center))))?;
    Ok(height)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, values: &[f64]) -> Vec<String> {
        let fitted = axis.fitted(values.iter().copied());
        fitted.ticks.iter().map(|&tick| fitted.label(tick)).collect()
    }

    #[test]
    fn linear_ticks_have_the_digits_that_their_step_needs() {
        let number = |values: &[f64]| labels(&Axis::linear("", Unit::Number), values);
        assert_eq!(number(&[0.0041]), ["0.000", "0.001", "0.002", "0.003", "0.004", "0.005"]);
        assert_eq!(number(&[0.3, 0.9]), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(number(&[101.0]), ["0", "50", "100", "150"]);
        assert_eq!(number(&[-3.0, 2e6]), ["-0.5M", "0", "0.5M", "1.0M", "1.5M", "2.0M"]);
        assert_eq!(number(&[11e3]), ["0", "5k", "10k", "15k"]);
        assert_eq!(number(&[1.1e-4]), ["0", "5e-5", "1e-4", "1.5e-4"]);
        assert_eq!(number(&[f64::NAN, f64::INFINITY]), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        let percent = labels(&Axis::linear("", Unit::Percent), &[0.0002]);
        assert_eq!(percent, ["0.000 %", "0.005 %", "0.010 %", "0.015 %", "0.020 %"]);
    }

    #[test]
    fn logarithmic_ticks_are_several_in_a_small_range_too() {
        let number = |values: &[f64]| labels(&Axis::log("", Unit::Number), values);
        assert_eq!(number(&[0.001, 0.011]), ["0.001", "0.002", "0.005", "0.01"]);
        assert_eq!(number(&[0.01, 2e6]), ["0.01", "0.1", "1", "10", "100", "1000", "10k", "100k", "1M"]);
        assert_eq!(number(&[0.0123, 0.0131]), ["0.011", "0.012", "0.013", "0.014", "0.015"]);
        assert_eq!(number(&[3e-7]), ["2.6e-7", "2.8e-7", "3e-7", "3.2e-7", "3.4e-7", "3.6e-7"]);
        assert_eq!(number(&[0.0, f64::NAN]), ["1", "2", "5", "10"]);
        assert_eq!(labels(&Axis::log_at("", Unit::Number, [16_384.0, 20_000.0]), &[]), ["16384", "20k"]);
        let ticks = Axis::log_at("", Unit::Percent, [0.0003, 0.001, 0.001, 0.03]);
        assert_eq!(labels(&ticks, &[]), ["0.03 %", "0.1 %", "3 %"]);
    }

    #[test]
    fn no_two_ticks_have_one_label() {
        for exponent in -60..60 {
            let value = 10_f64.powf(f64::from(exponent) / 7.0);
            for axis in [Axis::linear("", Unit::Number), Axis::linear("", Unit::Percent), Axis::log("", Unit::Number)] {
                let mut labels = labels(&axis, &[value, 1.07 * value]);
                assert!(labels.len() > 1, "{value}: {labels:?}");
                let all = labels.len();
                labels.dedup();
                assert_eq!(labels.len(), all, "{value}: {labels:?}");
            }
        }
    }
}
