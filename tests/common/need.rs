//! Programs and drivers that a test needs and a machine may lack.

use std::env;
use std::fmt::Display;
use std::io::{Write, stderr};

/// What was found. Where nothing was, the test fails on CI (the environment variable `CI` is set), and elsewhere stderr says which test is left out.
pub fn need<T>(what: &str, found: Result<T, impl Display>) -> Option<T> {
    let problem = match found {
        Ok(found) => return Some(found),
        Err(problem) => problem,
    };
    let message = format!("NOT TESTED: {what}: {problem}; scripts/setup.sh --tests installs what tests need");
    assert!(env::var_os("CI").is_none_or(|ci| ci.is_empty()), "{message}");
    // The test harness hides what `eprintln` writes in a test that passes.
    let _ = writeln!(stderr(), "{message}");
    None
}
