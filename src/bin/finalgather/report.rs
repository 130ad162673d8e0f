//! What a run says: lines for a person on stderr, JSON for a program on stdout. Neither panics when nobody listens.

use std::fs;
use std::io::{self, ErrorKind, Write};
use std::path::Path;

use finalgather::error::{Error, Result};
use finalgather::photon::PhotonCounts;
use finalgather::render::{GatherCounts, SceneCounts, StageSeconds};
use finalgather::settings::Settings;
use serde::Serialize;

/// `finalgather render --json`.
#[derive(Serialize)]
pub struct Report<'a> {
    pub gl: Gl<'a>,
    pub scene: &'a SceneCounts,
    pub settings: &'a Settings,
    pub seconds: Seconds<'a>,
    pub gather: &'a GatherCounts,
    pub photons: &'a PhotonCounts,
    /// Relative standard error of the picture; null where there are too few directions to tell.
    pub error: Option<f64>,
    /// Null where the system does not tell.
    pub peak_memory_bytes: Option<u64>,
    pub outputs: &'a [String],
    pub interrupted: bool,
}

#[derive(Serialize)]
pub struct Gl<'a> {
    pub renderer: &'a str,
    pub version: &'a str,
    pub backend: &'a str,
}

#[derive(Serialize)]
pub struct Seconds<'a> {
    pub load: f64,
    #[serde(flatten)]
    pub stages: &'a StageSeconds,
    pub write: f64,
    pub total: f64,
}

/// A line on stderr; there is nowhere left to complain to when that fails. Names in files are not to command a terminal.
pub fn say(line: &str) {
    let line = line.replace(|c: char| c.is_control() && c != '\n', "\u{fffd}");
    let _ = writeln!(io::stderr().lock(), "{line}");
}

/// One JSON value on stdout.
pub fn print_json(value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(|error| stdout_error(&error.to_string()))?;
    print(&text)
}

/// Text and a line end on stdout. A reader that has gone away, as `head` does, has had what it wanted.
pub fn print(text: &str) -> Result<()> {
    let mut stdout = io::stdout().lock();
    match writeln!(stdout, "{text}").and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(stdout_error(&error.to_string())),
        _ => Ok(()),
    }
}

fn stdout_error(problem: &str) -> Error {
    Error::output(Path::new("stdout"), problem, "send stdout to where there is space")
}

/// The most memory that the process has occupied so far, where the system tells.
pub fn peak_memory_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let kib = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB"))?;
    kib.parse::<u64>().ok()?.checked_mul(1024)
}
