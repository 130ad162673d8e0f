//! The command-line tool. Data go to stdout, messages to stderr. Each kind of failure has an exit code.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use finalgather::error::{Error, Result};

mod about_scene;
mod args;
mod bake;
mod bench;
mod compare;
mod info;
mod init;
mod merge;
mod relight;
mod render;
mod report;
mod scene_file;
mod terminal;
#[cfg(feature = "window")]
mod view;

/// Final gathering by rasterised ray bundles: renders global illumination on OpenGL 3.3, headless
#[derive(Debug, Parser)]
#[command(version, after_help = include_str!("help/main.txt"))]
struct Args {
    #[command(subcommand)]
    command: ToolCommand,
}

#[derive(Debug, Subcommand)]
enum ToolCommand {
    Render(render::RenderArgs),
    #[cfg(feature = "window")]
    View(view::ViewArgs),
    Compare(compare::CompareArgs),
    Bake(bake::BakeArgs),
    Relight(relight::RelightArgs),
    Merge(merge::MergeArgs),
    Bench(bench::BenchArgs),
    Info(info::InfoArgs),
    Init(init::InitArgs),
}

fn main() -> ExitCode {
    let command = Args::parse().command;
    let threads = match &command {
        // It starts its own threads, at a lower priority than the window's.
        #[cfg(feature = "window")]
        ToolCommand::View(_) => Ok(()),
        _ => start_threads(),
    };
    let outcome = threads.and_then(|()| match command {
        ToolCommand::Render(args) => render::run(&args),
        #[cfg(feature = "window")]
        ToolCommand::View(args) => view::run(&args),
        ToolCommand::Compare(args) => compare::run(&args),
        ToolCommand::Bake(args) => bake::run(args),
        ToolCommand::Relight(args) => relight::run(&args),
        ToolCommand::Merge(args) => merge::run(&args),
        ToolCommand::Bench(args) => bench::run(&args),
        ToolCommand::Info(args) => info::run(&args),
        ToolCommand::Init(args) => init::run(&args),
    });
    match outcome {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            if let Error::Input { warnings, .. } = &error {
                warnings.iter().for_each(|warning| report::say(&format!("warning: {warning}")));
            }
            report::say(&format!("error: {error}"));
            ExitCode::from(exit_code(&error))
        }
    }
}

/// Starts threads for CPU loops. Rayon would start them on demand, but panic on failure.
fn start_threads() -> Result<()> {
    rayon::ThreadPoolBuilder::new().build_global().map_err(|error| {
        Error::usage(
            format!("no threads can be started: {error}"),
            "raise the limits on memory (ulimit -v) or on threads (ulimit -u)",
        )
    })
}

/// From sysexits.h: EX_DATAERR, EX_UNAVAILABLE and EX_TEMPFAIL; 2 is clap's. `help/main.txt` lists them.
fn exit_code(error: &Error) -> u8 {
    match error {
        Error::Usage { .. } => 2,
        Error::Input { .. } => 65,
        Error::Gl { .. } => 69,
        Error::Output { .. } => 75,
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn clap_accepts_the_definition() {
        Args::command().debug_assert();
    }
}
