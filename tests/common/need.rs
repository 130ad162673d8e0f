//! Programs and drivers that a test needs but a machine may not have.

use std::env;
use std::fmt::Display;
use std::io::{Write, stderr};

/// Returns what was found. Otherwise the test fails on CI (environment variable `CI` is set); elsewhere stderr names the skipped test.
pub fn need<T>(what: &str, found: Result<T, impl Display>) -> Option<T> {
    let problem = match found {
        Ok(found) => return Some(found),
        Err(problem) => problem,
    };
    let message = format!("NOT TESTED: {what}: {problem}; scripts/setup.sh --tests installs what tests need");
    assert!(env::var_os("CI").is_none_or(|ci| ci.is_empty()), "{message}");
    // The test harness hides `eprintln` output of passing tests.
    let _ = writeln!(stderr(), "{message}");
    None
}
