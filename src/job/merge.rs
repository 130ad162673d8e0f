//! Merges the parts of a job's shards into the results of the whole job, from the files and without OpenGL.

use std::mem::take;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::report::Noting;
use super::results::Made;
use super::task::{camera_of, place, request_of};
use super::{
    DeviceRequest, JobRequest, MergeReport, Receiver, ReportHead, SceneRequest, TotalSeconds, Watch, Work, all_written,
    check_kept, outputs_of,
};
use crate::bake::Merge;
use crate::blocks::Part;
use crate::error::{Error, Result};
use crate::prepared::Prepared;
use crate::render::RenderMerge;
use crate::settings::{DisplaySettings, Settings};

/// Writes the results of `parts` to `outputs`, named as for [`super::outputs_of`]. `change` changes the job's display. A bake reads scene and points again.
///
/// # Errors
/// [`Error::Input`] when a part is damaged, of another job or repeated; [`Error::Usage`] when directions are missing; [`Error::Output`] when a file
/// cannot be written.
pub fn merge(
    parts: &[PathBuf],
    outputs: &[String],
    change: impl Fn(&mut DisplaySettings),
    watch: &mut dyn Watch,
) -> Result<MergeReport> {
    let started = Instant::now();
    let mut noting = Noting::new(watch);
    let watch = &mut noting;
    let changed = |settings: &Settings, mut display: DisplaySettings| {
        change(&mut display);
        settings.with(|settings| settings.display = display).validate().map(|()| display)
    };
    changed(&Settings::default(), DisplaySettings::default())?;
    let path = parts.first().ok_or_else(|| Error::usage("no parts to merge", "name those of all shards"))?;
    let first = Part::read(path)?;
    // Reads one part at a time, because there may be many.
    let each = |add: &mut dyn FnMut(&Path, &Part) -> Result<()>| parts.iter().try_for_each(|path| add(path, &Part::read(path)?));
    let inputs = parts.iter().map(PathBuf::as_path);
    let (of, settings, request, errors) = match first.job["what"].as_str() {
        Some("render") => {
            let request = JobRequest {
                time: None,
                scene: SceneRequest::default(),
                work: Work::Render,
                outputs: vec![outputs.iter().map(PathBuf::from).collect()],
                memory: None,
                device: DeviceRequest::default(),
            };
            request.check_outputs(false)?;
            check_kept(&request.outputs.concat(), inputs)?;
            let mut merge = RenderMerge::new(path, &first)?;
            each(&mut |path, part| merge.add(path, part))?;
            request.warning_of_origin(merge.job()).iter().for_each(|warning| watch.say(warning));
            let (settings, picture) = (merge.settings(), Made::Picture(merge.picture()?));
            let (display, done) = (changed(settings, settings.display)?, (settings.directions.count, true));
            let errors = picture.write(&request, None, merge.job(), &display, done);
            ("render", settings.with(|settings| settings.display = display), request, errors)
        }
        Some("bake") => {
            first.check_version(path)?;
            let (mut request, own) = request_of(path, &first)?;
            let Work::Bake(bake) = request.work.clone() else { return Err(unknown(path)) };
            request.outputs = outputs_of(&bake.receivers, outputs)?;
            check_kept(&request.outputs.concat(), request.inputs().chain(inputs))?;
            request.check_outputs(false)?;
            watch.stage("loading");
            let mut merge = Merge::new(path, &first)?;
            let loaded = request.scene.load(request.needs_light())?;
            check_kept(&request.outputs.concat(), loaded.report.files.iter().map(PathBuf::as_path))?;
            loaded.report.warnings.iter().for_each(|warning| watch.say(&format!("warning: {warning}")));
            let prepared = Prepared::without_glass(&loaded.world)?;
            let scene = &prepared.scene;
            watch.stage("placing points");
            let settings = *merge.settings();
            let camera = || Receiver::of_part(path, &first, settings.film.size);
            let (receivers, points) = place(&bake, scene, &settings, &camera, watch)?;
            merge.check_scene(path, scene, &points.points)?;
            watch.stage("merging");
            each(&mut |path, part| merge.add(path, part))?;
            let values = Made::of_points(&request, &receivers, merge.columns(&prepared, &points.points)?, scene, false);
            let (display, done) = (changed(&settings, own)?, (settings.directions.count, true));
            let errors = values.write(&request, Some(scene), merge.job(), &display, done);
            ("bake", settings.with(|settings| settings.display = display), request, errors)
        }
        _ => return Err(unknown(path)),
    };
    all_written(errors, watch)?;
    let outputs = request.outputs.concat().iter().map(|path| path.display().to_string()).collect();
    Ok(MergeReport {
        head: ReportHead::new("merge", outputs, camera_of(&first), take(&mut watch.warnings)),
        parts: parts.len(),
        of,
        settings,
        seconds: TotalSeconds { total: started.elapsed().as_secs_f64() },
    })
}

fn unknown(path: &Path) -> Error {
    Error::input(path, None, "a part of no kind of job that this version knows", "merge with the version that made it")
}
