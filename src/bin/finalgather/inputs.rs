//! Results are not to be written over inputs, nor over each other.

use std::fs;
use std::path::{Path, PathBuf};

use finalgather::error::{Error, Result};
use finalgather::export::written_with;
use finalgather::file::place_of;

/// # Errors
/// [`Error::Usage`] when an output is one of the inputs, or another output.
pub fn check_kept<'a>(outputs: &[PathBuf], inputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    let written: Vec<_> = outputs.iter().flat_map(|output| written_with(output)).collect();
    // One that has no place cannot be written, and is refused for that.
    let places: Vec<_> = written.iter().map(|output| place_of(output).unwrap_or_else(|_| output.clone())).collect();
    let twice = written.iter().enumerate().find(|&(i, _)| places[..i].contains(&places[i]));
    if let Some((_, output)) = twice {
        let cure = "name each file once; .obj also writes .mtl and .png, .npy .json";
        return Err(Error::usage(format!("{}: is to be written twice", output.display()), cure));
    }
    let inputs: Vec<_> = inputs.into_iter().filter_map(|input| fs::canonicalize(input).ok()).collect();
    match written.iter().zip(&places).find(|(_, place)| inputs.contains(place)) {
        None => Ok(()),
        Some((output, _)) => {
            Err(Error::usage(format!("{}: is an input, and would be written over", output.display()), "give another name"))
        }
    }
}
