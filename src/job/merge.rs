//! Merges the parts of a job's shards into what the job itself would have written, from their files and without OpenGL.

use std::path::{Path, PathBuf};

use super::render::write_picture;
use super::{BakeRequest, Receiver, Request, Watch, all_written, check_kept, outputs_of};
use crate::bake::Merge;
use crate::blocks::Part;
use crate::error::{Error, Result};
use crate::image::check_writable;
use crate::render::RenderMerge;
use crate::scene::UnitSpace;

/// Writes what `parts` make to `outputs`, named as [`super::outputs_of`] takes them, with this exposure or the job's own. A bake reads its scene and
/// points again, from where its request found them.
///
/// # Errors
/// [`Error::Input`] when a part is damaged, of another job or has what an earlier one has; [`Error::Usage`] when directions are missing;
/// [`Error::Output`] when a file cannot be written.
pub fn merge(parts: &[PathBuf], outputs: &[String], exposure: Option<f32>, watch: &mut dyn Watch) -> Result<()> {
    let path = parts.first().ok_or_else(|| Error::usage("no parts to merge", "name those of all shards"))?;
    let first = Part::read(path)?;
    match first.job["what"].as_str() {
        Some("render") => merge_render(parts, &first, outputs, exposure, watch),
        Some("bake") => merge_bake(parts, &first, outputs, exposure, watch),
        _ => {
            let problem = "a part of no kind of job that this version knows";
            Err(Error::input(path, None, problem, "merge with the version that made it"))
        }
    }
}

fn merge_render(parts: &[PathBuf], first: &Part, outputs: &[String], exposure: Option<f32>, watch: &mut dyn Watch) -> Result<()> {
    let outputs: Vec<_> = outputs.iter().map(PathBuf::from).collect();
    outputs.iter().try_for_each(|path| check_writable(path))?;
    check_kept(&outputs, parts.iter().map(PathBuf::as_path))?;
    let mut merge = RenderMerge::new(&parts[0], first)?;
    each(parts, |path, part| merge.add(path, part))?;
    let image = merge.picture()?;
    let settings = merge.settings();
    let (exposure, done) = (exposure.unwrap_or(settings.exposure), (settings.directions, true));
    all_written(write_picture(&image, &outputs, merge.job(), exposure, done), watch)
}

fn merge_bake(parts: &[PathBuf], first: &Part, outputs: &[String], exposure: Option<f32>, watch: &mut dyn Watch) -> Result<()> {
    let path = &parts[0];
    let (mut request, own) = BakeRequest::of_part(path, &first.state)?;
    let exposure = exposure.unwrap_or(own);
    request.outputs = outputs_of(&request.receivers, outputs)?;
    let outputs = request.outputs();
    check_kept(&outputs, request.inputs().into_iter().chain(parts.iter().map(PathBuf::as_path)))?;
    request.check_outputs()?;

    watch.stage("loading");
    let mut merge = Merge::new(path, first)?;
    let scene = request.scene.load(request.needs_light())?;
    check_kept(&outputs, scene.files.iter().map(PathBuf::as_path))?;
    scene.warnings.iter().for_each(|warning| watch.say(&format!("warning: {warning}")));
    let (unit, space) = UnitSpace::enter(&scene);
    let unit = unit.without_glass().unwrap_or(unit);
    watch.stage("placing points");
    let settings = merge.settings().clone();
    let receivers = request.place((&unit, &space), &settings, &|| Receiver::of_part(path, first, settings.size), watch)?;
    let points: Vec<_> = receivers.iter().flat_map(|receiver| receiver.points().iter().copied()).collect();
    merge.check_scene(path, &unit, &points)?;
    watch.stage("merging");
    each(parts, |path, part| merge.add(path, part))?;
    let values = merge.columns(&points)?;
    let done = (settings.directions, true);
    let (_, errors) = request.write(&receivers, &values, (&scene, &space), merge.job(), exposure, done);
    all_written(errors, watch)
}

/// Reads one part at a time: there may be many.
fn each(parts: &[PathBuf], mut add: impl FnMut(&Path, &Part) -> Result<()>) -> Result<()> {
    parts.iter().try_for_each(|path| add(path, &Part::read(path)?))
}
