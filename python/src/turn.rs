//! One job works at a time in a process. Software drivers crash where several threads draw, and a job takes all cores anyway.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use pyo3::prelude::*;

use crate::errors::usage;

/// The thread whose job works.
static WORKING: Mutex<Option<ThreadId>> = Mutex::new(None);
/// Whether the interpreter ends.
static ENDING: AtomicBool = AtomicBool::new(false);
/// Time between two looks at whose turn it is.
const LOOKS: Duration = Duration::from_millis(10);
/// The longest wait for jobs of other threads when the interpreter ends.
const GRACE: Duration = Duration::from_secs(20);

/// The right to run a job, until it is dropped.
pub struct Turn;

impl Turn {
    /// Waits for the jobs of other threads.
    ///
    /// # Errors
    /// A usage error within a job of the same thread, which would wait for itself; what a signal's handler raises.
    pub fn take(py: Python) -> PyResult<Self> {
        let own = thread::current().id();
        loop {
            if is_ending() {
                return Err(usage(py, "the interpreter ends", "wait for jobs before that"));
            }
            {
                let mut working = WORKING.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
                match *working {
                    None => {
                        *working = Some(own);
                        return Ok(Self);
                    }
                    Some(other) if other == own => {
                        return Err(usage(py, "a job within the progress of another", "run it when the other has ended"));
                    }
                    Some(_) => {}
                }
            }
            py.detach(|| thread::sleep(LOOKS));
            py.check_signals()?;
        }
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        *WORKING.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = None;
    }
}

/// Whether the interpreter ends, and jobs of its threads must.
pub fn is_ending() -> bool {
    ENDING.load(Relaxed)
}

/// Ends the jobs of other threads before the interpreter does. Otherwise they would use a driver that is no longer there.
#[pyfunction]
pub fn _end(py: Python) {
    ENDING.store(true, Relaxed);
    py.detach(|| {
        let begun = Instant::now();
        let works = || WORKING.lock().is_ok_and(|working| working.is_some());
        while works() && begun.elapsed() < GRACE {
            thread::sleep(LOOKS);
        }
    });
}
