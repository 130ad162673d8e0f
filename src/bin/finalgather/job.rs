//! A job on a terminal: its progress, its end by signals, its report.

use std::io::{self, IsTerminal};
use std::path::Path;

use finalgather::error::{Error, Result};
use finalgather::job::{Ending, Job, Watch};

use crate::interrupt::Interrupt;
use crate::progress::ProgressLine;
use crate::report;

/// A job's progress on stderr, and the signals that stop it.
pub struct Terminal {
    progress: ProgressLine,
    interrupt: Interrupt,
}

impl Terminal {
    /// `lock` is a file that must not stay where a signal ends the process.
    pub fn new(lock: Option<&Path>) -> Result<Self> {
        let progress = ProgressLine::new("loading");
        let interrupt = Interrupt::watch(progress.clone(), lock.map(Path::to_owned)).map_err(|error| {
            Error::usage(format!("signals cannot be caught: {error}"), "run where the system allows signal handlers")
        })?;
        Ok(Self { progress, interrupt })
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.progress.clear();
    }
}

impl Watch for Terminal {
    fn stage(&mut self, stage: &'static str) {
        self.progress.stage(stage);
    }

    fn say(&mut self, line: &str) {
        self.progress.say(line);
    }

    fn progress(&mut self, directions: [u64; 2]) {
        self.progress.progress(directions);
    }

    fn has_result(&mut self) {
        self.interrupt.has_result();
    }

    fn goes_on(&mut self, between_blocks: bool) -> bool {
        self.interrupt.leaves_time(between_blocks)
    }
}

/// The exit code, unless the job failed.
pub fn run(job: Job, json: bool) -> Result<u8> {
    let mut terminal = Terminal::new(job.lock_path())?;
    let outcome = job.run(&mut terminal)?;
    terminal.progress.clear();
    if outcome.ending == Ending::Finished && io::stderr().is_terminal() {
        let paths: Vec<_> = outcome.outputs.iter().map(|path| path.display().to_string()).collect();
        report::say(&format!("written to {} after {:.1} s", paths.join(", "), outcome.report.seconds.total));
    }
    if json {
        report::print_json(&outcome.report)?;
    }
    Ok(terminal.interrupt.requested().filter(|_| outcome.ending == Ending::Stopped).unwrap_or(0))
}
