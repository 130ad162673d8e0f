//! Runs a job on a terminal: shows progress and handles signals.
//!
//! SIGINT, SIGTERM and SIGHUP (sent by a closing terminal) stop a job after the block in progress. The exit code tells the signal. A second SIGINT or
//! SIGTERM ends the process at once. So does the first one while there is nothing to keep. A thread waits for signals, so it may take locks and print.

use std::cell::Cell;
use std::fs;
use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering::SeqCst};
use std::thread;
use std::time::{Duration, Instant};

use finalgather::error::{Error, Result};
use finalgather::job::{Ending, Job, Watch};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator::Signals;
use signal_hook::{flag, low_level};

use crate::report;

/// Job systems wait half a minute or more before they kill a process. A person who presses Ctrl-C is less patient.
const GRACE: Duration = Duration::from_secs(10);

/// Signals, and progress on stderr if that is a terminal. Progress is plain text, so NO_COLOR needs no support.
pub struct Terminal {
    bar: ProgressBar,
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

/// Runs a job, reports it and returns the exit code.
pub fn run(job: Job, json: bool) -> Result<u8> {
    let mut terminal = Terminal::new(job.lock_path())?;
    let outcome = job.run(&mut terminal)?;
    terminal.clear();
    if outcome.ending == Ending::Finished && io::stderr().is_terminal() {
        let paths: Vec<_> = outcome.outputs.iter().map(|path| path.display().to_string()).collect();
        report::say(&format!("written to {} after {:.1} s", paths.join(", "), outcome.report.seconds.total));
    }
    if json {
        report::print_json(&outcome.report)?;
    }
    Ok(if outcome.ending == Ending::Stopped { terminal.signals.code.load(SeqCst) } else { 0 })
}

impl Terminal {
    /// Handles signals for the rest of the process. A signal that ends the process removes the file `lock`.
    pub fn new(lock: Option<&Path>) -> Result<Self> {
        // The draw target hides the bar if stderr is not a terminal.
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr()).with_style(style("{spinner} {msg}"));
        bar.set_message("loading");
        if !bar.is_hidden() {
            bar.enable_steady_tick(Duration::from_millis(100));
        }
        let signals = Arc::default();
        watch_signals(&signals, bar.clone(), lock.map(Path::to_owned)).map_err(|error| {
            Error::usage(format!("signals cannot be caught: {error}"), "run where the system allows signal handlers")
        })?;
        Ok(Self { bar, signals, noticed: Cell::default() })
    }

    /// Removes the progress bar for good.
    pub fn clear(&self) {
        self.bar.finish_and_clear();
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.clear();
    }
}

impl Watch for Terminal {
    fn stage(&mut self, stage: &'static str) {
        self.bar.set_message(stage);
    }

    fn say(&mut self, line: &str) {
        self.bar.suspend(|| report::say(line));
    }

    fn progress(&mut self, [done, total]: [u64; 2]) {
        if self.bar.length() != Some(total) {
            self.bar.set_length(total);
            self.bar.set_style(style("{wide_bar} {pos}/{len} directions, {per_sec}, {eta} left"));
            // Earlier stages have another rate.
            self.bar.reset();
        }
        self.bar.set_position(done);
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

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

fn watch_signals(caught: &Arc<Caught>, bar: ProgressBar, lock: Option<PathBuf>) -> io::Result<()> {
    // The default action would end the process in the middle of a file. With a handler, the write fails like any other.
    flag::register(SIGXFSZ, Arc::default())?;

    let caught = Arc::clone(caught);
    let stopping = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|&signal| signal != SIGHUP || !is_ignored(SIGHUP));
    let mut signals = Signals::new(stopping)?;
    thread::spawn(move || {
        for signal in signals.forever() {
            // A shell reports this code for a process killed by the signal.
            let code = u8::try_from(128 + signal).unwrap_or(u8::MAX);
            let before = caught.code.swap(code, SeqCst);
            let has_result = caught.has_result.load(SeqCst);
            // A closing terminal sends it twice: by the shell and by the system.
            if has_result && (before == 0 || signal == SIGHUP) {
                continue;
            }
            bar.finish_and_clear();
            if !has_result {
                report::say("stopped before there was a result");
            }
            // A leftover file does no harm.
            let _ = lock.as_ref().map(fs::remove_file);
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
