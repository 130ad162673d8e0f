//! Results are not to be written over inputs, nor over each other.

use std::fs;
use std::path::{Path, PathBuf};

use finalgather::error::{Error, Result};

/// # Errors
/// [`Error::Usage`] when an output is one of the inputs, or another output.
pub fn check_kept<'a>(outputs: &[PathBuf], inputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    let twice = outputs.iter().enumerate().find(|(i, output)| outputs[..*i].contains(output));
    if let Some((_, output)) = twice {
        return Err(Error::usage(format!("{}: is to be written twice", output.display()), "name each file once"));
    }
    let inputs: Vec<_> = inputs.into_iter().filter_map(|input| fs::canonicalize(input).ok()).collect();
    match outputs.iter().find(|output| fs::canonicalize(output).is_ok_and(|output| inputs.contains(&output))) {
        None => Ok(()),
        Some(output) => {
            Err(Error::usage(format!("{}: is an input, and would be written over", output.display()), "give another name"))
        }
    }
}
