//! Lines for the user on stderr, JSON for programs on stdout. A closed stream causes no panic.

use std::ffi::OsString;
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use anstream::{AutoStream, ColorChoice};
use clap::ValueEnum;
use clap::builder::Styles;
use clap::builder::styling::Style;
use finalgather::error::{Error, Result};
use serde::Serialize;

/// How much is said on stderr, and in what colours. All commands have these options.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
#[command(next_help_heading = "Messages and threads")]
pub struct MessageArgs {
    /// No progress and no notes. Twice: no warnings either
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    quiet: u8,

    /// Tell more: files, device, pipeline, the time of each stage
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    verbose: bool,

    /// Colours of messages. auto: on a terminal, unless NO_COLOR is set
    #[arg(long, global = true, value_name = "WHEN", default_value = "auto", hide_short_help = true)]
    color: ColorWhen,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum ColorWhen {
    #[default]
    Auto,
    Always,
    Never,
}

static MESSAGES: OnceLock<MessageArgs> = OnceLock::new();
static WARNINGS: AtomicUsize = AtomicUsize::new(0);
/// A path that messages show under another name.
static SHOWN_AS: OnceLock<(String, &str)> = OnceLock::new();

/// Sets how much is said from now on. Before, it is as without options.
pub fn set(args: MessageArgs) {
    // It is set once.
    let _ = MESSAGES.set(args);
}

fn messages() -> MessageArgs {
    MESSAGES.get().copied().unwrap_or_default()
}

/// Shows a path as `name` from now on. It is set once.
pub fn show_as(path: &Path, name: &'static str) {
    let _ = SHOWN_AS.set((path.display().to_string(), name));
}

/// The number of warnings so far.
pub fn warnings() -> usize {
    WARNINGS.load(Ordering::Relaxed)
}

/// Whether progress and notes are wanted.
pub fn is_talkative() -> bool {
    messages().quiet == 0
}

/// The colours of clap's own messages, which it needs to know before it parses.
pub fn color_of(mut arguments: impl Iterator<Item = OsString>) -> clap::ColorChoice {
    let mut choice = clap::ColorChoice::Auto;
    while let Some(argument) = arguments.next() {
        let value = match argument.to_str() {
            Some("--color") => arguments.next().and_then(|value| value.into_string().ok()),
            Some("--") => break,
            Some(other) => other.strip_prefix("--color=").map(str::to_owned),
            None => None,
        };
        choice = value.and_then(|value| clap::ColorChoice::from_str(&value, false).ok()).unwrap_or(choice);
    }
    choice
}

/// Writes a line to stderr and ignores failures: errors always, warnings unless twice quiet, all else unless quiet. It replaces control characters, so
/// that names in files cannot control the terminal.
pub fn say(line: &str) {
    let line = line.replace(|c: char| c.is_control() && c != '\n', "\u{fffd}");
    let line = SHOWN_AS.get().map_or(line.clone(), |(path, name)| line.replace(path, name));
    let styles = Styles::styled();
    let warning = Style::new().fg_color(Some(clap::builder::styling::AnsiColor::Yellow.into())).bold();
    let (most, style) = match line.split_once(": ").map(|(kind, _)| kind) {
        Some("error") => (u8::MAX, *styles.get_error()),
        Some("warning") => (1, warning),
        _ => (0, Style::new()),
    };
    if most == 1 {
        WARNINGS.fetch_add(1, Ordering::Relaxed);
    }
    let MessageArgs { quiet, color, .. } = messages();
    if quiet > most {
        return;
    }
    let (kind, rest) = if style.is_plain() { ("", line.as_str()) } else { line.split_at(line.find(':').unwrap_or(0) + 1) };
    let cure = styles.get_valid();
    let rest = rest.replace("\n  cure:", &format!("\n  {cure}cure:{cure:#}"));
    let choice = match color {
        ColorWhen::Auto => AutoStream::choice(&io::stderr()),
        ColorWhen::Always => ColorChoice::AlwaysAnsi,
        ColorWhen::Never => ColorChoice::Never,
    };
    let _ = writeln!(AutoStream::new(io::stderr().lock(), choice), "{style}{kind}{style:#}{rest}");
}

/// As [`say`], if more is to be told.
pub fn detail(line: &str) {
    if messages().verbose {
        say(line);
    }
}

/// Writes one JSON value to stdout.
pub fn print_json(value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(|error| stdout_error(&error.to_string()))?;
    print(&text)
}

/// Writes text and a line end to stdout. A reader such as `head` may close stdout early. That is no error.
pub fn print(text: &str) -> Result<()> {
    print_bytes(format!("{text}\n").as_bytes())
}

/// Writes bytes to stdout, as [`print`].
pub fn print_bytes(bytes: &[u8]) -> Result<()> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(stdout_error(&error.to_string())),
        _ => Ok(()),
    }
}

fn stdout_error(problem: &str) -> Error {
    Error::output(Path::new("stdout"), problem, "send stdout to where there is space")
}
