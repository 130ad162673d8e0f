//! The command-line tool: data on stdout, messages for a person on stderr, an exit code for each kind of failure.

use std::process::ExitCode;

use clap::Parser;
use finalgather::error::{Error, Result};

mod args;
mod bake;
mod bench;
mod compare;
mod info;
mod interrupt;
mod job;
mod merge;
mod progress;
mod relight;
mod render;
mod report;
#[cfg(feature = "window")]
mod view;

use args::{Args, Command};

fn main() -> ExitCode {
    let command = Args::parse().command;
    let threads = match &command {
        // It starts its own, at a lower priority than the window's.
        #[cfg(feature = "window")]
        Command::View(_) => Ok(()),
        _ => start_threads(),
    };
    let outcome = threads.and_then(|()| match command {
        Command::Render(args) => render::run(&args),
        #[cfg(feature = "window")]
        Command::View(args) => view::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Bake(args) => bake::run(&args),
        Command::Relight(args) => relight::run(&args),
        Command::Merge(args) => merge::run(&args),
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

/// Threads for loops on the CPU. Rayon would start them by itself, but panic where that fails.
fn start_threads() -> Result<()> {
    rayon::ThreadPoolBuilder::new().build_global().map_err(|error| {
        Error::usage(
            format!("no threads can be started: {error}"),
            "raise the limits on memory (ulimit -v) or on threads (ulimit -u)",
        )
    })
}

/// As in sysexits.h: EX_DATAERR, EX_UNAVAILABLE and EX_TEMPFAIL; 2 is clap's. `help/exit_codes.txt` lists them.
fn exit_code(error: &Error) -> u8 {
    match error {
        Error::Usage { .. } => 2,
        Error::Input { .. } => 65,
        Error::Gl { .. } => 69,
        Error::Output { .. } => 75,
    }
}
