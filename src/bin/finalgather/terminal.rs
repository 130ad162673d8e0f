//! Runs a job on a terminal: shows progress and handles signals.
//!
//! SIGINT, SIGTERM and SIGHUP (sent by a closing terminal) stop a job after the block in progress. The exit code tells the signal. A second SIGINT or
//! SIGTERM ends the process at once. So does the first one while there is nothing to keep. A thread waits for signals, so it may take locks and print.

use std::cell::Cell;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering::SeqCst};
use std::thread;
use std::time::{Duration, Instant};

use finalgather::error::{Error, Result};
use finalgather::job::{Ending, Job, Progress, Watch};
use indicatif::ProgressBar;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator::Signals;
use signal_hook::{flag, low_level};

use crate::progress::ProgressLine;
use crate::streams::ToStdout;
use crate::{report, summary};

/// Job systems wait half a minute or more before they kill a process. A person who presses Ctrl-C is less patient.
const GRACE: Duration = Duration::from_secs(10);

/// Signals, and progress on stderr.
pub struct Terminal {
    line: ProgressLine,
    signals: Arc<Caught>,
    /// When the job first noticed the signal.
    noticed: Cell<Option<Instant>>,
}

#[derive(Default)]
struct Caught {
    /// Exit code of the signal that requested a stop; 0 before.
    code: AtomicU8,
    has_result: AtomicBool,
}

/// Runs a job, reports it, sends its result to stdout if asked, and returns the exit code.
pub fn run(job: Job, json: bool, stdout: Option<ToStdout>) -> Result<u8> {
    let leftovers = job.lock_path().map(Path::to_owned).into_iter().chain(stdout.as_ref().map(|to| to.folder().to_owned()));
    let mut terminal = Terminal::new(leftovers.collect())?;
    let threads = rayon::current_num_threads();
    terminal.detail(&format!("{threads} CPU thread{}", if threads == 1 { "" } else { "s" }));
    let outcome = job.run(&mut terminal)?;
    terminal.clear();
    stdout.map_or(Ok(()), ToStdout::send)?;
    if outcome.ending == Ending::Finished {
        report::say(&summary::line(&outcome.report));
    }
    if json {
        report::print_json(&outcome.report)?;
    }
    Ok(if outcome.ending == Ending::Stopped { terminal.signals.code.load(SeqCst) } else { 0 })
}

impl Terminal {
    /// Handles signals for the rest of the process. A signal that ends the process removes the files and folders `leftovers`.
    pub fn new(leftovers: Vec<PathBuf>) -> Result<Self> {
        let line = ProgressLine::new();
        let signals = Arc::default();
        watch_signals(&signals, line.bar(), leftovers).map_err(|error| {
            Error::usage(format!("signals cannot be caught: {error}"), "run where the system allows signal handlers")
        })?;
        Ok(Self { line, signals, noticed: Cell::default() })
    }

    /// Removes the line of progress for good.
    pub fn clear(&mut self) {
        self.line.clear();
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.clear();
    }
}

impl Watch for Terminal {
    fn stage(&mut self, stage: &'static str) {
        self.line.stage(stage);
    }

    fn say(&mut self, line: &str) {
        self.line.suspend(|| report::say(line));
    }

    fn detail(&mut self, line: &str) {
        self.line.suspend(|| report::detail(line));
    }

    fn progress(&mut self, progress: Progress) {
        self.line.progress(progress);
    }

    fn has_result(&mut self) {
        self.signals.has_result.store(true, SeqCst);
    }

    fn goes_on(&mut self, between_blocks: bool) -> bool {
        if self.signals.code.load(SeqCst) == 0 {
            return true;
        }
        let noticed = self.noticed.get().unwrap_or_else(Instant::now);
        self.noticed.set(Some(noticed));
        !between_blocks && noticed.elapsed() < GRACE
    }
}

fn watch_signals(caught: &Arc<Caught>, bar: ProgressBar, leftovers: Vec<PathBuf>) -> io::Result<()> {
    // The default action would end the process in the middle of a file. With a handler, the write fails like any other.
    flag::register(SIGXFSZ, Arc::default())?;

    let caught = Arc::clone(caught);
    let stopping = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|&signal| signal != SIGHUP || !is_ignored(SIGHUP));
    let mut signals = Signals::new(stopping)?;
    thread::spawn(move || {
        for signal in signals.forever() {
            // A shell reports this code for a process killed by the signal.
            let code = u8::try_from(128 + signal).unwrap_or(u8::MAX);
            let has_result = caught.has_result.load(SeqCst);
            // Without a result the job is not told, or it would say that it stopped while the process ends.
            if has_result {
                let before = caught.code.swap(code, SeqCst);
                // A closing terminal sends it twice: by the shell and by the system.
                if before == 0 || signal == SIGHUP {
                    continue;
                }
            }
            bar.finish_and_clear();
            if !has_result {
                report::say("stopped before there was a result");
            }
            for leftover in &leftovers {
                // One that stays does no harm.
                let _ = fs::remove_file(leftover).or_else(|_| fs::remove_dir_all(leftover));
            }
            // process::exit would run exit handlers, which destroy the GL driver while another thread uses it.
            low_level::exit(code.into());
        }
    });
    Ok(())
}

/// Whether the signal is ignored, as under `nohup`, if the system tells.
fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
