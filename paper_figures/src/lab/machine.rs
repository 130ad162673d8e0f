//! The machine and the date of a measurement.

use std::fs;
use std::thread::available_parallelism;
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use crate::figure::Result;
use crate::lab::library::gpu;

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Machine {
    /// As OpenGL names it.
    renderer: String,
    cores: usize,
    /// As the system names it, where it does.
    #[serde(default)]
    processor: Option<String>,
}

impl Machine {
    pub fn here() -> Result<Self> {
        let information = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let name = information.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
        Ok(Self {
            renderer: gpu()?.info().renderer.clone(),
            cores: available_parallelism()?.get(),
            processor: name.map(|(_, name)| name.trim().to_owned()),
        })
    }

    /// In words.
    pub fn described(&self) -> String {
        let Self { renderer, processor, .. } = self;
        let cores = self.count(" ");
        processor.as_ref().map_or(format!("{renderer}, {cores}"), |name| format!("{renderer}, {cores} of {name}"))
    }

    /// `<date>-<machine>`, as in `2026-11-22-llvmpipe-2-cores`.
    pub fn run_name(&self, date: &str) -> String {
        // Details follow the name in parentheses or behind a slash.
        let name = self.renderer.split(['(', '/']).next().unwrap_or_default().to_lowercase();
        let words: Vec<_> = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty()).collect();
        format!("{date}-{}-{}", words.join("-"), self.count("-"))
    }

    fn count(&self, between: &str) -> String {
        format!("{}{between}core{}", self.cores, if self.cores == 1 { "" } else { "s" })
    }
}

/// The date in UTC, ISO 8601.
pub fn today() -> String {
    let days = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs() / 86_400);
    date(days)
}

/// Of a number of days since 1970-01-01 (Howard Hinnant, "chrono-compatible low-level date algorithms").
fn date(days: u64) -> String {
    // Years begin in March, so that a leap day is the last; an era is 400 of them.
    let days = days + 719_468;
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_of_days() {
        for (days, expected) in [(0, "1970-01-01"), (11_016, "2000-02-29"), (11_017, "2000-03-01"), (20_779, "2026-11-22")] {
            assert_eq!(date(days), expected);
        }
    }

    #[test]
    fn names_of_runs() {
        for (renderer, cores, expected) in [
            ("llvmpipe (LLVM 15.0.6, 256 bits)", 2, "2026-11-22-llvmpipe-2-cores"),
            ("NVIDIA H200/PCIe/SSE2", 1, "2026-11-22-nvidia-h200-1-core"),
        ] {
            assert_eq!(Machine { renderer: renderer.into(), cores, processor: None }.run_name("2026-11-22"), expected);
        }
    }
}
