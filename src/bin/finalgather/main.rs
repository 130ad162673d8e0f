//! The command-line tool. Data go to stdout, messages to stderr. Each kind of failure has an exit code.

use std::env;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{Arg, Command, CommandFactory, FromArgMatches, Parser, Subcommand};
use finalgather::error::{Error, Result};

mod about_scene;
mod args;
mod bake;
mod bench;
mod compare;
mod info;
mod init;
mod merge;
mod progress;
mod relight;
mod render;
mod report;
mod scene_file;
mod shell;
mod streams;
mod summary;
mod terminal;
#[cfg(feature = "window")]
mod view;

/// Final gathering by rasterised ray bundles: renders global illumination on OpenGL 3.3, headless
#[derive(Debug, Parser)]
#[command(version, after_long_help = include_str!("help/main.txt"))]
struct Args {
    #[command(subcommand)]
    command: ToolCommand,

    #[command(flatten)]
    messages: report::MessageArgs,

    /// CPU threads, also of a software driver [default: all cores]
    #[arg(long, global = true, value_name = "N", value_parser = threads, help_heading = "Messages and threads")]
    threads: Option<usize>,
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
    Completions(shell::CompletionsArgs),
    Man(shell::ManArgs),
}

fn main() -> ExitCode {
    let matches = brief(Args::command()).color(report::color_of(env::args_os())).try_get_matches().unwrap_or_else(|error| {
        if let Some(scene) = scene_without_command(&error) {
            report::say(&format!("error: {}: which command?\n  cure: finalgather render {0}", scene.display()));
            std::process::exit(2);
        }
        error.exit()
    });
    let Args { command, messages, threads } = Args::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    report::set(messages);
    let limited = threads.map_or(Ok(()), limit_threads);
    let started = match &command {
        // It starts its own threads, at a lower priority than the window's.
        #[cfg(feature = "window")]
        ToolCommand::View(_) => Ok(()),
        _ => start_threads(),
    };
    let outcome = limited.and(started).and_then(|()| match command {
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
        ToolCommand::Completions(args) => shell::complete(&args, Args::command()),
        ToolCommand::Man(args) => shell::man(&args, Args::command()),
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

/// Shortens the help of `-h` to the first sentence of each option. `--help` has all.
fn brief(tool: Command) -> Command {
    let of_argument = |argument: Arg| {
        let Some(whole) = argument.get_help().filter(|_| argument.get_long_help().is_none()).map(ToString::to_string) else {
            return argument;
        };
        let Some((first, rest)) = whole.split_once(". ") else { return argument };
        let default = rest.rfind("[default:").map_or(String::new(), |start| format!(" {}", &rest[start..]));
        argument.help(format!("{first}{default}")).long_help(whole)
    };
    tool.mut_subcommands(|command| command.mut_args(of_argument))
}

/// The file that stands in the place of a command.
fn scene_without_command(error: &clap::Error) -> Option<PathBuf> {
    let first = (error.kind() == ErrorKind::InvalidSubcommand).then(|| env::args_os().nth(1))??;
    Some(PathBuf::from(first)).filter(|path| path.is_file())
}

/// Lets Rayon and Mesa's software driver use this many threads. Both read their number from the environment, which a process cannot change safely once
/// it has threads. So the program begins again in this process, once.
fn limit_threads(count: usize) -> Result<()> {
    // With 0 the driver draws on the caller's thread.
    let of_driver = if count == 1 { 0 } else { count };
    let wanted = [("RAYON_NUM_THREADS", count.to_string()), ("LP_NUM_THREADS", of_driver.to_string())];
    if wanted.iter().all(|(name, value)| env::var(name).is_ok_and(|set| set == *value)) {
        return Ok(());
    }
    let error = match env::current_exe() {
        Ok(program) => std::process::Command::new(program).args(env::args_os().skip(1)).envs(wanted).exec(),
        Err(error) => error,
    };
    Err(Error::usage(format!("--threads: the program cannot begin again: {error}"), "set RAYON_NUM_THREADS and LP_NUM_THREADS"))
}

fn threads(text: &str) -> Result<usize, String> {
    args::checked(text, |count| (1..=1024).contains(count), "not a number of threads from 1 to 1024")
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
