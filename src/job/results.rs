//! The results of a job, in memory and as files.

use std::path::Path;

use serde_json::Value;

use super::receiver::{is_picture, is_png};
use super::{BakeRequest, JobRequest, Per, Receiver, ReceiverValues, Work};
use crate::error::{Error, Result};
use crate::image::{Channel, Image, WriteOptions};
use crate::scene::Scene;
use crate::settings::{Background, DisplaySettings, Exposure};

/// What a job has made.
#[derive(Debug)]
pub(super) enum Made {
    Picture(Image),
    /// Of each receiver.
    Values(Vec<ReceiverValues>),
}

impl Made {
    /// The values of all receivers, from those of all their points in order ([`crate::bake::Bake::columns`]). `in_memory`: pictures of the camera are
    /// wanted without a file of one.
    pub fn of_points(
        request: &JobRequest,
        receivers: &[Receiver],
        (mut columns, mut inside): (Vec<Channel>, Vec<f32>),
        scene: &Scene,
        in_memory: bool,
    ) -> Self {
        let mut all: Vec<_> = receivers
            .iter()
            .zip(&request.outputs)
            .rev()
            .map(|(receiver, paths)| {
                // From the end on, so that the samples of the first are not copied.
                let first = inside.len() - receiver.points().len();
                let of_channel = |all: &mut Channel| Channel { name: all.name.clone(), samples: all.samples.split_off(first) };
                let own: Vec<_> = columns.iter_mut().map(of_channel).collect();
                let picture = in_memory || paths.iter().any(|path| is_picture(path));
                let values = receiver.values(own, &inside.split_off(first), &scene.space, picture);
                let per_source = matches!(request.work, Work::Bake(BakeRequest { per: Per::Source, .. }));
                match receiver {
                    Receiver::Vertices(_) if per_source => values.per_source(scene),
                    _ => values,
                }
            })
            .collect();
        all.reverse();
        Self::Values(all)
    }

    /// The exposure of 8-bit files, in stops.
    pub fn stops(&self, exposure: Exposure) -> f32 {
        if let Self::Picture(image) = self { image.stops(exposure) } else { exposure.given() }
    }

    /// Statistics of the points of each receiver.
    pub fn counts(&self) -> Vec<Value> {
        if let Self::Values(all) = self { all.iter().map(|values| values.counts.clone()).collect() } else { Vec::new() }
    }

    /// Writes all files that can be written. Returns the errors of the others. `scene`: that of the values.
    pub fn write(
        &self,
        request: &JobRequest,
        scene: Option<&Scene>,
        job: &Value,
        display: &DisplaySettings,
        done: (u32, bool),
    ) -> Vec<Error> {
        let mut errors = Vec::new();
        for (index, paths) in request.outputs.iter().enumerate() {
            let metadata = request.metadata(index, job, display, done);
            errors.extend(paths.iter().filter_map(|path| self.write_one(index, path, scene, display, &metadata).err()));
        }
        errors
    }

    fn write_one(
        &self,
        receiver: usize,
        path: &Path,
        scene: Option<&Scene>,
        display: &DisplaySettings,
        metadata: &str,
    ) -> Result<()> {
        let exposure = self.stops(display.exposure);
        match (self, scene) {
            (Self::Values(all), Some(scene)) => {
                let values = &all[receiver];
                // Light maps have no pixels behind the surface.
                let background = if values.is_of_camera() { display.background } else { Background::Environment };
                values.write(path, scene, &WriteOptions { exposure, background, metadata: Some(metadata) })
            }
            (Self::Picture(image), _) => {
                image.write(path, &WriteOptions { exposure, background: display.background, metadata: Some(metadata) })
            }
            (Self::Values(_), None) => unreachable!("values have a scene"),
        }
    }
}

/// The results of a job in memory.
#[derive(Debug)]
pub struct JobResults {
    pub(super) made: Made,
    pub(super) request: JobRequest,
    /// Of values.
    pub(super) scene: Option<Scene>,
    pub(super) job: Value,
    pub(super) display: DisplaySettings,
    /// Directions done, and whether these are all.
    pub(super) done: (u32, bool),
}

impl JobResults {
    /// The picture of a render.
    pub fn picture(&self) -> Option<&Image> {
        if let Made::Picture(image) = &self.made { Some(image) } else { None }
    }

    /// The values of each receiver of a bake.
    pub fn values(&self) -> &[ReceiverValues] {
        if let Made::Values(all) = &self.made { all } else { &[] }
    }

    /// How 8-bit files look, where [`Self::write`] is not told.
    pub fn display(&self) -> DisplaySettings {
        self.display
    }

    /// Writes the picture, or the values of a receiver, as the job itself does.
    ///
    /// # Errors
    /// [`Error::Usage`] when the file's ending is not one for these results; [`Error::Output`] when it cannot be written.
    pub fn write(&self, receiver: usize, path: &Path, display: &DisplaySettings) -> Result<()> {
        if let Work::Bake(bake) = &self.request.work {
            bake.receivers[receiver].check_writable(path, &bake.plan.what)?;
        } else {
            crate::image::check_writable(path)?;
        }
        let metadata = self.request.metadata(receiver, &self.job, display, self.done);
        self.made.write_one(receiver, path, self.scene.as_ref(), display, &metadata)
    }
}

/// Whether a file shows pictures or values to the eye.
pub(super) fn are_shown(request: &JobRequest) -> bool {
    request.outputs.iter().flatten().any(|path| is_png(path))
}
