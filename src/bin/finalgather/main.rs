//! The command-line tool: data on stdout, everything said to a person on stderr, an exit code for each kind of failure.

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use finalgather::error::{Error, Result};

mod args;
mod bake;
mod bench;
mod checkpoint;
mod compare;
mod info;
mod inputs;
mod interrupt;
mod merge;
mod progress;
mod relight;
mod render;
mod report;
#[cfg(feature = "window")]
mod view;

use args::{Args, Command};

fn main() -> ExitCode {
    let started = Instant::now();
    let command = Args::parse().command;
    let threads = match &command {
        // Its renderer's are to leave the window the first turn.
        #[cfg(feature = "window")]
        Command::View(_) => Ok(()),
        _ => start_threads(),
    };
    let outcome = threads.and_then(|()| match command {
        Command::Render(args) => render::run(&args, started),
        #[cfg(feature = "window")]
        Command::View(args) => view::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Bake(args) => bake::run(&args, &[], started),
        Command::Relight(args) => relight::run(&args),
        Command::Merge(args) => merge::run(&args, started),
        Command::Bench(args) => bench::run(&args),
        Command::Info(args) => info::run(&args),
    });
    match outcome {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            report::say(&format!("error: {error}"));
            ExitCode::from(exit_code(&error))
        }
    }
}

/// Those of loops on the CPU, which would start them by themselves, but panic where that fails.
fn start_threads() -> Result<()> {
    rayon::ThreadPoolBuilder::new().build_global().map_err(|error| {
        Error::usage(
            format!("no threads can be started: {error}"),
            "raise the limits on memory (ulimit -v) or on threads (ulimit -u)",
        )
    })
}

/// After sysexits.h: EX_DATAERR, EX_UNAVAILABLE and EX_TEMPFAIL; 2 is what clap uses. [`args`] lists them for --help.
fn exit_code(error: &Error) -> u8 {
    match error {
        Error::Usage { .. } => 2,
        Error::Input { .. } => 65,
        Error::Gl { .. } => 69,
        Error::Output { .. } => 75,
    }
}
