//! Lines for the user on stderr, JSON for programs on stdout. A closed stream causes no panic.

use std::io::{self, ErrorKind, Write};
use std::path::Path;

use finalgather::error::{Error, Result};
use serde::Serialize;

/// Writes a line to stderr and ignores failures. It replaces control characters, so that names in files cannot control the terminal.
pub fn say(line: &str) {
    let line = line.replace(|c: char| c.is_control() && c != '\n', "\u{fffd}");
    let _ = writeln!(io::stderr().lock(), "{line}");
}

/// Writes one JSON value to stdout.
pub fn print_json(value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(|error| stdout_error(&error.to_string()))?;
    print(&text)
}

/// Writes text and a line end to stdout. A reader such as `head` may close stdout early. That is no error.
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
