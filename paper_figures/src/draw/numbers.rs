//! Numbers as figures and the page write them.

/// A share in percent, with two digits behind the point.
pub fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}

/// A share in percent, with as many digits as it needs.
pub fn short_percent(share: f64) -> String {
    let percent = 100.0 * share;
    if percent.abs() < 1e-9 {
        return "0".into();
    }
    let digits = (-percent.abs().log10() - 1e-9).ceil().clamp(0.0, 6.0) as usize;
    format!("{percent:.digits$} %")
}

/// A tick of an axis with even steps, or of another. `even` is the step and the largest tick: all ticks have one form, with the digits that the
/// step needs. Others have their own, at most three digits that count. Large round ones are short, so that neighbours do not meet.
pub fn tick_label(tick: f64, even: Option<[f64; 2]>) -> String {
    let digits = |number: f64| (-number.abs().log10() - 1e-9).ceil().max(0.0) as usize;
    let exponential = || format!("{}e{}", trimmed(tick / power(tick), 3), power(tick).log10().round());
    match even {
        Some([step, _]) if step < 1e-4 => {
            if tick == 0.0 {
                "0".into()
            } else {
                exponential()
            }
        }
        Some([step, most]) => {
            let in_tenths = |unit: f64| is_round(step + unit, unit);
            let form = [(1e6, 1e6, "M"), (1e4, 1e3, "k")].into_iter().find(|&(from, unit, _)| most >= from && in_tenths(unit));
            let (unit, mark) = form.map_or((1.0, ""), |(_, unit, mark)| (unit, mark));
            if tick == 0.0 && unit > 1.0 { "0".into() } else { format!("{:.*}{mark}", digits(step / unit), tick / unit) }
        }
        _ if tick != 0.0 && tick.abs() < 1e-4 => exponential(),
        _ if is_round(tick, 1e6) => trimmed(tick / 1e6, 1) + "M",
        _ if tick.abs() >= 1e4 && is_round(tick, 1e3) => trimmed(tick / 1e3, 1) + "k",
        None if tick == 0.0 => "0".into(),
        None => trimmed(tick, digits(tick) + 2),
    }
}

/// Whether at least one `unit`, and in its tenths.
fn is_round(number: f64, unit: f64) -> bool {
    let tenths = 10.0 * number / unit;
    tenths.abs() >= 10.0 && (tenths - tenths.round()).abs() < 1e-6
}

/// The power of ten below.
fn power(number: f64) -> f64 {
    10_f64.powf((number.abs().log10() + 1e-9).floor())
}

/// Without zeros at the end.
fn trimmed(number: f64, digits: usize) -> String {
    let text = format!("{number:.digits$}");
    if digits == 0 { text } else { text.trim_end_matches('0').trim_end_matches('.').into() }
}

/// A number in millions, thousands or ones, short enough for a legend.
pub fn count(number: u32) -> String {
    match number {
        n if n >= 1_000_000 => format!("{}M", f64::from(n) / 1e6),
        n if n >= 1000 => format!("{}k", f64::from(n) / 1e3),
        n => n.to_string(),
    }
}

/// A number of things, such as "1 direction" or "8 directions".
pub fn several(number: u32, thing: &str) -> String {
    format!("{number} {thing}{}", if number == 1 { "" } else { "s" })
}

/// With two or three digits, down to milliseconds.
pub fn seconds(seconds: f64) -> String {
    let digits = [20.0, 2.0, 0.02].into_iter().filter(|&limit| seconds < limit).count();
    format!("{seconds:.digits$} s")
}

/// Words joined by "and".
pub fn joined(words: impl IntoIterator<Item = String>) -> String {
    words.into_iter().collect::<Vec<_>>().join(" and ")
}
