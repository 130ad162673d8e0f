//! Lines for a person on stderr, JSON for a program on stdout. Neither panics when nobody reads it.

use std::io::{self, ErrorKind, Write};
use std::path::Path;

use finalgather::error::{Error, Result};
use serde::Serialize;

/// A line on stderr. A failure cannot be told anywhere. Control characters go, because names in files must not command a terminal.
pub fn say(line: &str) {
    let line = line.replace(|c: char| c.is_control() && c != '\n', "\u{fffd}");
    let _ = writeln!(io::stderr().lock(), "{line}");
}

/// One JSON value on stdout.
pub fn print_json(value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(|error| stdout_error(&error.to_string()))?;
    print(&text)
}

/// Text and a line end on stdout. A reader such as `head` may close it early, and that is no error.
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
