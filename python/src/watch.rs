//! A running job beside Python: progress, warnings, and signals. The job runs without the interpreter's lock, and takes it for each of these.

use std::time::{Duration, Instant};

use finalgather::job::{Progress, Watch};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::errors::in_python;
use crate::turn::is_ending;

/// Time between two looks at signals. Python's lock may be held by others, so they are not done more often than a person notices.
const LOOKS: Duration = Duration::from_millis(50);
/// Time between two reports of progress.
const REPORTS: Duration = Duration::from_millis(100);
/// The longest wait for the end of a block after Ctrl-C.
const GRACE: Duration = Duration::from_secs(10);

/// What a job tells Python, and what Python tells it.
pub struct PythonWatch {
    /// Called with directions done, their total, and seconds left.
    progress: Option<Py<PyAny>>,
    /// What ended the job: an exception of a callback or of a signal's handler.
    pub ended_by: Option<PyErr>,
    noticed: Option<Instant>,
    looked: Instant,
    reported: Option<Instant>,
}

impl PythonWatch {
    pub fn new(progress: Option<Py<PyAny>>) -> Self {
        Self { progress, ended_by: None, noticed: None, looked: Instant::now(), reported: None }
    }

    /// Whether Ctrl-C ended the job, rather than an exception of a callback.
    pub fn is_interrupted(&self, py: Python) -> bool {
        self.noticed.is_some() && self.ended_by.as_ref().is_some_and(|error| error.is_instance_of::<PyKeyboardInterrupt>(py))
    }

    /// Keeps what Python raised. Its code may also be where a signal is noticed: then the job ends as after a look at signals.
    fn keep(&mut self, outcome: PyResult<()>) {
        let Err(error) = outcome else { return };
        if Python::attach(|py| error.is_instance_of::<PyKeyboardInterrupt>(py)) {
            self.noticed.get_or_insert_with(Instant::now);
        }
        self.ended_by.get_or_insert(error);
    }

    /// Looks whether a signal came. False after the second, which does not wait.
    fn look(&mut self) -> bool {
        self.looked = Instant::now();
        let Err(error) = Python::attach(|py| py.check_signals()) else { return true };
        let is_first = self.noticed.replace(Instant::now()).is_none();
        self.ended_by.get_or_insert(error);
        is_first
    }
}

impl Watch for PythonWatch {
    fn say(&mut self, line: &str) {
        let said = Python::attach(|py| match line.strip_prefix("warning: ") {
            Some(warning) => warn(py, warning),
            None => logger(py)?.call_method1("info", ("%s", in_python(line))).map(drop),
        });
        self.keep(said);
    }

    fn detail(&mut self, line: &str) {
        let said = Python::attach(|py| logger(py)?.call_method1("debug", ("%s", line)).map(drop));
        self.keep(said);
    }

    fn progress(&mut self, Progress { done, total, seconds_left }: Progress) {
        let Some(progress) = &self.progress else { return };
        if done < total && self.reported.is_some_and(|last| last.elapsed() < REPORTS) {
            return;
        }
        self.reported = Some(Instant::now());
        let called = Python::attach(|py| progress.call1(py, (done, total, seconds_left)).map(drop));
        self.keep(called);
    }

    fn goes_on(&mut self, between_blocks: bool) -> bool {
        if is_ending() || self.noticed.is_none() && self.ended_by.is_some() {
            return false;
        }
        if (self.looked.elapsed() >= LOOKS || between_blocks) && !self.look() {
            return false;
        }
        self.noticed.is_none_or(|noticed| !between_blocks && noticed.elapsed() < GRACE)
    }
}

/// Warns by Python's warnings, at the line that called.
pub fn warn(py: Python, text: &str) -> PyResult<()> {
    let kind = py.import("finalgather.errors")?.getattr("Warning")?;
    py.import("warnings")?.call_method1("warn", (in_python(text), kind)).map(drop)
}

fn logger(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    py.import("logging")?.call_method1("getLogger", ("finalgather",))
}
