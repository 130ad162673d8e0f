//! The job that bakes values at points of receivers.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::Vec2;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::outputs::{are_finished, metadata};
use super::receiver::is_picture;
use super::report::{ReceiverReport, TaskReport, TaskSeconds};
use super::{DeviceRequest, Receiver, ReceiverCounts, ReceiverKind, Request, SceneRequest, Task, Watch};
use crate::bake::{Bake, Plan, blocks_of};
use crate::blocks::{Blocks, Part};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::image::{Channel, WriteOptions};
use crate::points::{CameraPoints, GatherPoint, LightMapOptions};
use crate::prepared::Prepared;
use crate::quantity::Quantity;
use crate::scene::{Camera, Scene, UnitSpace};
use crate::settings::Settings;

/// Keys of a part's state.
const REQUEST: &str = "request";
const EXPOSURE: &str = "exposure";

/// Values at points of a scene. Parts hold it, for their merge makes the receivers again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BakeRequest {
    pub scene: SceneRequest,
    /// At most one of each kind.
    pub receivers: Vec<ReceiverKind>,
    pub plan: Plan,
    /// For [`ReceiverKind::LightMap`]; texels per unit are those of world space.
    pub light_map: LightMapOptions,
    /// Result files of each receiver.
    #[serde(skip)]
    pub outputs: Vec<Vec<PathBuf>>,
    /// MiB that the bake may take, on the GL side and on the CPU.
    #[serde(skip)]
    pub memory: Option<usize>,
    #[serde(skip)]
    pub device: DeviceRequest,
}

struct BakeTask<'a> {
    bake: Bake,
    request: &'a BakeRequest,
    scene: &'a Scene,
    receivers: Vec<Receiver>,
    /// What became of the points of each receiver, once that is written.
    counts: Vec<ReceiverCounts>,
    settings: Settings,
    is_shard: bool,
    /// Wall-clock seconds that placing the points took.
    placing: f64,
}

impl Request for BakeRequest {
    fn scene(&self) -> &SceneRequest {
        &self.scene
    }

    fn device(&self) -> DeviceRequest {
        self.device
    }

    fn outputs(&self) -> Vec<PathBuf> {
        self.outputs.concat()
    }

    fn inputs(&self) -> Vec<&Path> {
        let points = self.receivers.iter().filter_map(|kind| match kind {
            ReceiverKind::Points(path) => Some(path.as_path()),
            _ => None,
        });
        self.scene.inputs().chain(points).collect()
    }

    fn check_outputs(&self) -> Result<()> {
        let mut receivers = self.receivers.iter().zip(&self.outputs);
        receivers.try_for_each(|(kind, paths)| paths.iter().try_for_each(|path| kind.check_writable(path, &self.plan.what)))
    }

    fn needs_light(&self) -> bool {
        // Openness and transfer need none.
        self.plan.what.iter().any(|quantity| matches!(quantity, Quantity::Irradiance | Quantity::Sh))
    }

    fn settings(&self, of_scene: &Settings) -> Result<Settings> {
        // It takes all its directions, and layers for as many.
        let settings = Settings { until: 0.0, ..self.scene.settings(of_scene)? };
        settings.validate()?;
        self.plan.validate()?;
        Ok(settings)
    }

    fn blocks(&self, settings: &Settings) -> Blocks {
        blocks_of(settings)
    }

    fn check(&self, _: &Scene, _: &Settings, shard: Option<&Range<u32>>, _: &mut dyn Watch) -> Result<()> {
        match serde_json::to_value(self) {
            Err(_) if shard.is_some() => {
                Err(Error::usage("a path is not UTF-8, and a part is to hold it", "give names in UTF-8"))
            }
            _ => Ok(()),
        }
    }

    fn begin<'a>(
        &'a self,
        gpu: &Gpu,
        scene: &'a Scene,
        settings: &Settings,
        shard: Option<Range<u32>>,
        watch: &mut dyn Watch,
    ) -> Result<Box<dyn Task + 'a>> {
        watch.stage("placing points");
        let placing = Instant::now();
        let prepared = Prepared::without_glass(gpu, scene)?;
        let camera = || see(gpu, &prepared, settings.size);
        let receivers = self.place((&prepared.scene, &prepared.space), settings, &camera, watch)?;
        let points: Vec<GatherPoint> = receivers.iter().flat_map(|receiver| receiver.points().iter().copied()).collect();
        let placing = placing.elapsed().as_secs_f64();
        watch.stage("tracing photons");
        let mut bake = Bake::new(gpu, prepared, points, settings, &self.plan)?;
        let is_shard = shard.is_some();
        if let Some(shard) = shard {
            bake.only(shard);
        }
        if let Some(most) = self.memory {
            bake.fit(most)?;
        }
        let (counts, settings) = (Vec::new(), settings.clone());
        Ok(Box::new(BakeTask { bake, request: self, scene, receivers, counts, settings, is_shard, placing }))
    }
}

impl BakeRequest {
    /// Makes all receivers. The scene is in unit space and without glass; `camera` makes that of the camera.
    ///
    /// # Errors
    /// As [`Receiver::new`].
    pub(super) fn place(
        &self,
        world: (&Scene, &UnitSpace),
        settings: &Settings,
        camera: &dyn Fn() -> Result<Receiver>,
        watch: &mut dyn Watch,
    ) -> Result<Vec<Receiver>> {
        let new = |kind| Receiver::new(kind, self, world, settings, camera);
        let receivers = self.receivers.iter().map(new).collect::<Result<Vec<_>>>()?;
        receivers.iter().flat_map(Receiver::warnings).for_each(|warning| watch.say(&format!("warning: {warning}")));
        Ok(receivers)
    }

    /// Of the state of a part, with the exposure of the job.
    ///
    /// # Errors
    /// [`Error::Input`] when the part, read from `path`, does not hold it.
    pub(super) fn of_part(path: &Path, state: &Value) -> Result<(Self, f32)> {
        let request = serde_json::from_value(state[REQUEST].clone()).ok();
        let exposure = state[EXPOSURE].as_f64().map(|exposure| exposure as f32);
        let damaged = "does not say how it was baked: damaged, or of an earlier version";
        request.zip(exposure).ok_or_else(|| Error::input(path, None, damaged, "make it again"))
    }

    /// What the file of a receiver says of the `job` that made it.
    fn metadata(&self, kind: &ReceiverKind, job: &Value, exposure: f32, done: (u32, bool)) -> String {
        // Of a light map's options, padding alone shapes no point and so is not part of the job.
        let own = json!({ "plan": job["plan"], "receiver": kind.name(), "padding": self.light_map.padding });
        metadata(job, exposure, own, done)
    }

    /// Writes the values of all points, which are those of `receivers` one after the other. Returns what became of the points, and why files cannot be
    /// written.
    pub(super) fn write(
        &self,
        receivers: &[Receiver],
        (columns, inside): &(Vec<Channel>, Vec<f32>),
        (scene, space): (&Scene, &UnitSpace),
        job: &Value,
        exposure: f32,
        done: (u32, bool),
    ) -> (Vec<ReceiverCounts>, Vec<Error>) {
        let (mut end, mut counts, mut errors) = (0, Vec::new(), Vec::new());
        for ((kind, receiver), paths) in self.receivers.iter().zip(receivers).zip(&self.outputs) {
            let range = end..end + receiver.points().len();
            end = range.end;
            let own = |column: &Channel| Channel { name: column.name.clone(), samples: column.samples[range.clone()].to_vec() };
            let picture = paths.iter().any(|path| is_picture(path));
            let own = columns.iter().map(own).collect();
            let values = receiver.values(own, &inside[range.clone()], space, picture);
            let metadata = self.metadata(kind, job, exposure, done);
            let options = WriteOptions { exposure, metadata: Some(&metadata) };
            errors.extend(paths.iter().filter_map(|path| values.write(path, scene, &options).err()));
            counts.push(values.counts);
        }
        (counts, errors)
    }
}

impl Task for BakeTask<'_> {
    fn step(&mut self) -> Result<()> {
        self.bake.step()
    }

    fn is_done(&self) -> bool {
        self.bake.is_done()
    }

    fn is_between_blocks(&self) -> bool {
        self.bake.is_between_blocks()
    }

    fn directions(&self) -> [u64; 2] {
        let statistics = self.bake.statistics();
        [statistics.directions_done, statistics.directions_total]
    }

    fn has_values(&self) -> bool {
        self.bake.has_values()
    }

    fn save(&self) -> Part<'_> {
        let mut part = self.bake.save();
        // Null where a path is not UTF-8: then it is no shard's, and nobody merges it.
        part.state[REQUEST] = serde_json::to_value(self.request).unwrap_or_default();
        part.state[EXPOSURE] = self.settings.exposure.into();
        self.receivers.iter().for_each(|receiver| receiver.save(&mut part));
        part
    }

    fn resume(&mut self, path: &Path, part: &Part) -> Result<()> {
        self.bake.resume(path, part)
    }

    fn is_written(&self) -> bool {
        let (job, mut receivers) = (self.bake.job(), self.request.receivers.iter().zip(&self.request.outputs));
        let metadata = |kind| self.request.metadata(kind, &job, self.settings.exposure, (0, true));
        receivers.all(|(kind, paths)| are_finished(paths, &metadata(kind)))
    }

    fn write(&mut self, _: &mut dyn Watch) -> Vec<Error> {
        let Some(values) = self.bake.columns() else { return Vec::new() };
        let world = (self.scene, &self.bake.prepared().space);
        let done = (self.bake.directions_done(), self.bake.is_done());
        let (counts, errors) =
            self.request.write(&self.receivers, &values, world, &self.bake.job(), self.settings.exposure, done);
        self.counts = counts;
        errors
    }

    fn kind(&self) -> &'static str {
        "values"
    }

    fn report(&self, written: bool, outputs: Vec<String>) -> (TaskReport, TaskSeconds) {
        let files = self.request.receivers.iter().zip(&self.receivers).zip(&self.request.outputs).enumerate();
        let of = |(i, ((kind, receiver), paths)): (usize, ((&ReceiverKind, &Receiver), &Vec<PathBuf>))| ReceiverReport {
            to: kind.name(),
            points: receiver.points().len(),
            counts: self.counts.get(i).cloned(),
            outputs: paths.iter().map(|path| path.display().to_string()).collect(),
        };
        let report = TaskReport::Bake {
            plan: self.bake.plan().clone(),
            bake: self.bake.statistics().clone(),
            receivers: files.filter(|(i, _)| written || *i < self.counts.len()).map(of).collect(),
            part: outputs.into_iter().next().filter(|_| self.is_shard),
        };
        (report, TaskSeconds::Bake { receivers: self.placing })
    }
}

/// What the scene's camera sees, by rasterisation.
fn see(gpu: &Gpu, prepared: &Prepared, size: [u32; 2]) -> Result<Receiver> {
    let Prepared { scene, space, geometry, .. } = prepared;
    let camera = if scene.framed { Camera::framing(scene.mesh.bounds(), size) } else { scene.camera };
    let visible = CameraPoints::new(gpu, size)?.see(geometry, &camera, Vec2::splat(0.5));
    Receiver::of_camera(&visible, size, space)
}
