//! Result files. None replaces an input. Each names the job that made it.

use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::blocks::sha256;
use crate::error::{Error, Result};
use crate::export::{metadata_of, written_with};
use crate::file::place_of;
use crate::scene::UnitSpace;
use crate::settings::DisplaySettings;

/// # Errors
/// [`Error::Usage`] when an output is also an input or another output.
pub fn check_kept<'a>(outputs: &[PathBuf], inputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    let written: Vec<_> = outputs.iter().flat_map(|output| written_with(output)).collect();
    // A path without a place cannot be written. A later check refuses it.
    let places: Vec<_> = written.iter().map(|output| place_of(output).unwrap_or_else(|_| output.clone())).collect();
    let twice = written.iter().enumerate().find(|&(i, _)| places[..i].contains(&places[i]));
    if let Some((_, output)) = twice {
        let cure = "name each file once; .obj also writes .mtl and .png, .npy .json and .sources.npy";
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

/// See [`UnitSpace::local_origin`]; zero if the job does not say its space.
pub(super) fn local_origin(job: &Value) -> DVec3 {
    UnitSpace::deserialize(&job["space"]).map_or(DVec3::ZERO, UnitSpace::local_origin)
}

/// Facts of a picture for [`metadata`]: how its pixels shared the directions, and where the channels P of an EXR begin, if far from the origin.
pub fn of_picture(job: &Value) -> Value {
    let mut own = json!({ "interleave": job["interleave"] });
    if local_origin(job) != DVec3::ZERO {
        own["position_origin"] = json!(local_origin(job).to_array());
    }
    own
}

/// JSON metadata: `job` ([`crate::Render::job`], [`crate::bake::Bake::job`]), `own` facts, progress. No times or paths, so equal jobs give equal files.
pub fn metadata(job: &Value, display: &DisplaySettings, own: &Value, (directions_done, complete): (u32, bool)) -> String {
    let mut about = json!({ "version": job["version"], "renderer": job["gl"]["renderer"], "settings": job["settings"] });
    for (key, value) in json!(display).as_object().into_iter().flatten() {
        about["settings"][key] = value.clone();
    }
    own.as_object().into_iter().flatten().for_each(|(key, value)| about[key] = value.clone());
    about["job_sha256"] = sha256(job.to_string().as_bytes()).into();
    about["directions_done"] = directions_done.into();
    about["complete"] = complete.into();
    about.to_string()
}

/// Whether all files exist with this metadata, after any number of directions.
pub(super) fn are_finished(outputs: &[PathBuf], metadata: &str) -> bool {
    let about = |mut about: Value| {
        about["directions_done"].take();
        about
    };
    let ours = serde_json::from_str(metadata).ok().map(about);
    outputs.iter().all(|path| metadata_of(path).filter(Value::is_object).map(about) == ours)
}
