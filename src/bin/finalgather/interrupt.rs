//! SIGINT, SIGTERM and SIGHUP, which a closing terminal sends: stop after the block in progress, keep the result so far, and exit with a code for the signal.
//!
//! A second SIGINT or SIGTERM ends the process at once. So does the first one while there is nothing to keep. A thread waits for the signals, so that it
//! may take locks and print.

use std::cell::Cell;
use std::fs;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering::SeqCst};
use std::thread;
use std::time::{Duration, Instant};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator::Signals;
use signal_hook::{flag, low_level};

use crate::progress::ProgressLine;
use crate::report;

/// Job systems leave half a minute or more before they kill a process; a person who presses Ctrl-C waits less gladly.
const GRACE: Duration = Duration::from_secs(10);

pub struct Interrupt {
    state: Arc<State>,
    /// When the job first saw that it is to stop.
    noticed: Cell<Option<Instant>>,
}

#[derive(Default)]
struct State {
    /// Exit code of the signal that asked for a stop, 0 before.
    code: AtomicU8,
    has_result: AtomicBool,
}

impl Interrupt {
    /// Takes the signals over for the rest of the process, which at its end leaves no `lock`.
    pub fn watch(progress: ProgressLine, lock: Option<PathBuf>) -> io::Result<Self> {
        // Its default action would end the process in the middle of a file; caught, the write fails like any other.
        flag::register(SIGXFSZ, Arc::default())?;

        let state = Arc::new(State::default());
        let shared = Arc::clone(&state);
        let caught = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|&signal| signal != SIGHUP || !is_ignored(SIGHUP));
        let mut signals = Signals::new(caught)?;
        thread::spawn(move || {
            for signal in signals.forever() {
                // What a shell reports for a process that the signal has killed.
                let code = u8::try_from(128 + signal).unwrap_or(u8::MAX);
                let before = shared.code.swap(code, SeqCst);
                let has_result = shared.has_result.load(SeqCst);
                // A terminal that closes says so twice, by its shell and by the system.
                if has_result && (before == 0 || signal == SIGHUP) {
                    continue;
                }
                progress.clear();
                if !has_result {
                    report::say("stopped before there was anything to write; nothing written");
                }
                // What cannot be removed does no harm.
                let _ = lock.as_ref().map(fs::remove_file);
                // Not process::exit: its handlers would take the GL driver down under the thread that is using it.
                low_level::exit(code.into());
            }
        });
        Ok(Self { state, noticed: Cell::default() })
    }

    /// From now on a signal leaves the time to write the result.
    pub fn has_result(&self) {
        self.state.has_result.store(true, SeqCst);
    }

    /// Whether to go on: until a signal asks for a stop, and then to the end of the block in progress, if that comes soon.
    pub fn leaves_time(&self, between_blocks: bool) -> bool {
        if self.requested().is_none() {
            return true;
        }
        let noticed = self.noticed.get().unwrap_or_else(Instant::now);
        self.noticed.set(Some(noticed));
        !between_blocks && noticed.elapsed() < GRACE
    }

    /// The exit code of the signal that asked for a stop.
    pub fn requested(&self) -> Option<u8> {
        Some(self.state.code.load(SeqCst)).filter(|&code| code != 0)
    }
}

/// As `nohup` asks for, where the system tells.
fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
