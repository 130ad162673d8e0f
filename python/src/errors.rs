//! The library's errors as Python's exceptions.

use std::process;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use finalgather::Error;
use pyo3::prelude::*;

/// The process that has begun to work. A fork of it has copies of its locks and none of its threads.
static WORKS_IN: AtomicU32 = AtomicU32::new(0);

/// The exception for an error, with the names of Python's arguments in place of the tool's options.
pub fn raised(py: Python, error: &Error) -> PyErr {
    let kind = match error {
        Error::Input { .. } => "InputError",
        Error::Usage { .. } => "UsageError",
        Error::Gl { .. } => "DeviceError",
        Error::Output { .. } => "OutputError",
    };
    let text = error.to_string();
    let (problem, cure) = text.split_once("\n  cure: ").unwrap_or((&text, ""));
    exception(py, kind, problem, cure)
}

/// An impossible request.
pub fn usage(py: Python, problem: impl AsRef<str>, cure: &str) -> PyErr {
    exception(py, "UsageError", problem.as_ref(), cure)
}

fn exception(py: Python, kind: &str, problem: &str, cure: &str) -> PyErr {
    let made = || py.import("finalgather.errors")?.call_method1(kind, (in_python(problem), in_python(cure)));
    made().map_or_else(|error| error, PyErr::from_value)
}

/// Replaces the tool's options, as in `--ao-distance`, by arguments, as in `ao_distance`. Names of files stay as they are.
pub fn in_python(text: &str) -> String {
    const OPTIONS: [&str; 28] = [
        "env",
        "sun",
        "sky",
        "flip",
        "clay",
        "strict",
        "camera",
        "smooth-angle",
        "size",
        "directions",
        "target-error",
        "time",
        "memory",
        "resume",
        "checkpoint",
        "ao-distance",
        "order",
        "what",
        "per",
        "padding",
        "samples-per-texel",
        "gather-bounces",
        "texels-per-unit",
        "points",
        "interleave",
        "photons",
        "exposure",
        "ground",
    ];
    let mut parts = text.split("--");
    let mut told = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let end = part.find(|c: char| !c.is_ascii_lowercase() && c != '-').unwrap_or(part.len());
        let (name, rest) = part.split_at(end);
        if !OPTIONS.contains(&name) || !(told.is_empty() || told.ends_with([' ', '('])) {
            told.extend(["--", part]);
            continue;
        }
        told.push_str(&name.replace('-', "_"));
        // A value: `--env FILE`, `--target-error 0`.
        match rest.strip_prefix(' ').filter(|value| value.starts_with(|c: char| c.is_ascii_uppercase() || c.is_ascii_digit())) {
            Some(value) => told.extend(["=", value]),
            None => told.push_str(rest),
        }
    }
    told
}

/// Notes that this process has threads from now on.
///
/// # Errors
/// A usage error in a fork of a process that had.
pub fn begin_work(py: Python) -> PyResult<()> {
    let own = process::id();
    match WORKS_IN.compare_exchange(0, own, Relaxed, Relaxed) {
        Err(other) if other != own => Err(usage(
            py,
            "this process is a fork of one that has worked before, whose threads it does not have",
            "start processes by spawn or forkserver: multiprocessing.get_context(\"spawn\")",
        )),
        _ => Ok(()),
    }
}
