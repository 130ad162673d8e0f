//! Plots in the one style of all figures: panels of lines or bars, a legend beside each, as SVG.
//!
//! Text is not measured, for that would take font libraries, so panels leave room enough for it.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, ValueFormatter};
use plotters::prelude::*;
pub use plotters::style::RGBColor;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::figure::Result;

pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Colours that people tell apart with any kind of sight (Okabe, Ito 2008).
pub const BLUE: RGBColor = RGBColor(0, 114, 178);
pub const ORANGE: RGBColor = RGBColor(213, 94, 0);
pub const GREEN: RGBColor = RGBColor(0, 158, 115);
pub const PURPLE: RGBColor = RGBColor(204, 121, 167);
pub const SKY: RGBColor = RGBColor(86, 180, 233);
pub const GREY: RGBColor = RGBColor(120, 120, 120);

/// Width of a panel's legend in pixels.
const LEGEND: u32 = 230;

/// An SVG document of this size.
pub fn svg(size: (u32, u32), draw: impl FnOnce(&Area) -> Result<()>) -> Result<String> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        area.fill(&WHITE)?;
        draw(&area)?;
        area.present()?;
    }
    Ok(text + "\n")
}

fn font(size: i32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&BLACK)
}

/// A scale of a plot, with its ticks.
#[derive(Clone)]
pub struct Axis {
    name: &'static str,
    range: [f64; 2],
    ticks: Vec<f64>,
    log: bool,
    label: fn(f64) -> String,
}

impl Axis {
    /// Over 0 and `values`, in about five even steps.
    pub fn linear(name: &'static str, values: impl Iterator<Item = f64>, label: fn(f64) -> String) -> Self {
        let (least, most) = values.fold((0.0, 1e-12), |(least, most): (f64, f64), value| (least.min(value), most.max(value)));
        let power = 10_f64.powf(((most - least) / 5.0).log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|step| step * power).into_iter().find(|step| step * 5.0 >= most - least);
        let step = step.unwrap_or(power);
        let (first, last) = ((least / step).floor() as i32, (most / step).ceil() as i32);
        let ticks: Vec<_> = (first..=last).map(|i| f64::from(i) * step).collect();
        Self { name, range: [ticks[0], ticks[ticks.len() - 1]], ticks, log: false, label }
    }

    /// Over positive `values`; ticks at 1, 2 and 5 of each decade, or at decades alone where there are many.
    pub fn log(name: &'static str, values: impl Iterator<Item = f64>, label: fn(f64) -> String) -> Self {
        let positive = values.filter(|&value| value > 0.0 && value.is_finite());
        let (least, most) = positive.fold((f64::INFINITY, 0.0_f64), |(least, most), value| (least.min(value), most.max(value)));
        let range = [least / 1.2, most * 1.2];
        let [first, last] = range.map(|end| end.log10().floor() as i32);
        let within = if last - first > 3 { &[1.0][..] } else { &[1.0, 2.0, 5.0] };
        let ticks = (first..=last).flat_map(|decade| within.iter().map(move |digit| digit * 10_f64.powi(decade)));
        Self { name, range, ticks: ticks.filter(|tick| (range[0]..=range[1]).contains(tick)).collect(), log: true, label }
    }

    /// Logarithmic, with ticks at what was measured.
    pub fn log_at(name: &'static str, ticks: &[f64], label: fn(f64) -> String) -> Self {
        Self { ticks: ticks.to_vec(), ..Self::log(name, ticks.iter().copied(), label) }
    }

    fn place(&self, value: f64) -> f64 {
        if self.log { value.log10() } else { value }
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, pixels: (i32, i32)) -> i32 {
        let [from, to] = self.range.map(|end| self.place(end));
        let share = (self.place(*value) - from) / (to - from);
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
        (self.label)(*value)
    }
}

/// A line with a mark at each point.
pub struct Curve {
    pub name: String,
    pub color: RGBColor,
    /// A thin line with open marks, seen around another's where both coincide.
    pub faint: bool,
    pub points: Vec<(f64, f64)>,
}

impl Curve {
    /// How wide its line, how large and how filled its marks are.
    fn style(&self) -> (ShapeStyle, u32, ShapeStyle) {
        if self.faint {
            (self.color.stroke_width(1), 5, self.color.stroke_width(1))
        } else {
            (self.color.stroke_width(2), 3, self.color.filled())
        }
    }
}

/// All x and all y of curves, for their axes.
pub fn values(curves: &[Curve]) -> [Vec<f64>; 2] {
    let points = || curves.iter().flat_map(|curve| &curve.points);
    [points().map(|point| point.0).collect(), points().map(|point| point.1).collect()]
}

/// A panel of curves.
pub fn lines(area: &Area, title: &str, [x, y]: [&Axis; 2], curves: &[Curve]) -> Result<()> {
    let (left, right) = panel(area, title)?;
    let mut chart = ChartBuilder::on(&left)
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
        .x_desc(x.name)
        .y_desc(y.name)
        .label_style(font(15))
        .axis_desc_style(font(17))
        .draw()?;
    for (row, curve) in (0..).zip(curves) {
        let has_place = |&&(at, value): &&(f64, f64)| x.place(at).is_finite() && y.place(value).is_finite();
        let points: Vec<_> = curve.points.iter().filter(has_place).copied().collect();
        let (line, radius, mark) = curve.style();
        chart.draw_series(LineSeries::new(points.clone(), line))?;
        chart.draw_series(points.into_iter().map(|point| Circle::new(point, radius, mark)))?;

        let height = legend(&right, row, &curve.name)?;
        right.draw(&PathElement::new(vec![(0, height), (26, height)], line))?;
        right.draw(&Circle::new((13, height), radius, mark))?;
    }
    Ok(())
}

/// Values beside each other under one name.
pub struct Bar {
    pub name: String,
    /// One of each series, and what is written beyond it.
    pub values: Vec<(f64, String)>,
}

/// A panel of horizontal bars, with the names of bars on the left.
pub fn bars(area: &Area, title: &str, x: &Axis, series: &[(&str, RGBColor)], bars: &[Bar]) -> Result<()> {
    /// Share of a row's height that its bars fill.
    const FILLED: f64 = 0.8;
    let (left, right) = panel(area, title)?;
    let mut chart = ChartBuilder::on(&left)
        .margin_right(10)
        .margin_bottom(12)
        .x_label_area_size(48)
        .y_label_area_size(170)
        .build_cartesian_2d(x.clone(), bars.len() as f64..0.0)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GREY.mix(0.25))
        .disable_y_mesh()
        .y_labels(0)
        .x_desc(x.name)
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
        let height = legend(&right, row, name)?;
        right.draw(&Rectangle::new([(0, height - 6), (26, height + 6)], color.filled()))?;
    }
    Ok(())
}

/// The title above, and the two parts of a panel: plot and legend.
fn panel<'a>(area: &Area<'a>, title: &str) -> Result<(Area<'a>, Area<'a>)> {
    area.draw(&Text::new(title.to_owned(), (76, 10), font(20)))?;
    let (_, below) = area.split_vertically(42);
    Ok(below.split_horizontally(area.dim_in_pixel().0 - LEGEND))
}

/// Writes a name into a row of the legend, and returns the height at which its sign belongs.
fn legend(area: &Area, row: i32, name: &str) -> Result<i32> {
    let height = 12 + 24 * row;
    area.draw(&Text::new(name.to_owned(), (34, height), font(15).pos(Pos::new(HPos::Left, VPos::Center))))?;
    Ok(height)
}

/// A share in percent, with as many digits as it needs.
pub fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    if percent.abs() < 1e-9 {
        return "0".into();
    }
    let digits = (-percent.abs().log10() - 1e-9).ceil().clamp(0.0, 6.0) as usize;
    format!("{percent:.digits$} %")
}

pub fn whole(number: f64) -> String {
    format!("{number:.0}")
}

/// As many digits as a number below 10 needs, down to thousandths.
pub fn short(number: f64) -> String {
    let digits = if number > 0.0 { (-number.log10() - 1e-9).ceil().clamp(0.0, 4.0) as usize } else { 0 };
    let digits = if number.fract() == 0.0 { digits } else { digits.max(1) };
    format!("{number:.digits$}")
}

/// A number in millions, thousands or ones, in words short enough for a legend.
pub fn count(number: u32) -> String {
    match number {
        n if n >= 1_000_000 => format!("{}M", f64::from(n) / 1e6),
        n if n >= 1000 => format!("{}k", f64::from(n) / 1e3),
        n => n.to_string(),
    }
}
