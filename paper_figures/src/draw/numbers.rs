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

pub fn whole(number: f64) -> String {
    format!("{number:.0}")
}

/// As many digits as a number below 10 needs, down to ten-thousandths.
pub fn short(number: f64) -> String {
    let digits = if number > 0.0 { (-number.log10() - 1e-9).ceil().clamp(0.0, 4.0) as usize } else { 0 };
    let digits = if number.fract() == 0.0 { digits } else { digits.max(1) };
    format!("{number:.digits$}")
}

/// A number in millions, thousands or ones, short enough for a legend.
pub fn count(number: u32) -> String {
    match number {
        n if n >= 1_000_000 => format!("{}M", f64::from(n) / 1e6),
        n if n >= 1000 => format!("{}k", f64::from(n) / 1e3),
        n => n.to_string(),
    }
}

/// With two or three digits.
pub fn seconds(seconds: f64) -> String {
    let digits = [20.0, 2.0].into_iter().filter(|&limit| seconds < limit).count();
    format!("{seconds:.digits$} s")
}

/// Words joined by "and".
pub fn joined(words: impl IntoIterator<Item = String>) -> String {
    words.into_iter().collect::<Vec<_>>().join(" and ")
}
