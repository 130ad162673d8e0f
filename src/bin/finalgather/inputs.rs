//! Inputs are not to be written over by results.

use std::fs;
use std::path::{Path, PathBuf};

use finalgather::error::{Error, Result};

/// # Errors
/// [`Error::Usage`] when an output is one of the inputs.
pub fn check_kept<'a>(outputs: &[PathBuf], inputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    let inputs: Vec<_> = inputs.into_iter().filter_map(|input| fs::canonicalize(input).ok()).collect();
    match outputs.iter().find(|output| fs::canonicalize(output).is_ok_and(|output| inputs.contains(&output))) {
        None => Ok(()),
        Some(output) => {
            Err(Error::usage(format!("{}: is an input, and would be written over", output.display()), "give another name"))
        }
    }
}
