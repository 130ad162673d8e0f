//! The gather of a job in progress, and its results.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::Vec2;
use serde_json::{Value, json};

use super::inside_out::inside_out;
use super::outputs::are_finished;
use super::report::{ReceiverReport, TaskReport};
use super::results::{JobResults, Made, are_shown};
use super::time::choose_directions;
use super::{BakeRequest, JobRequest, Receiver, ReceiverKind, SceneRequest, Watch, Work, check_kept, per_source};
use crate::bake::{Bake, BakePoints};
use crate::blocks::Part;
use crate::error::{Error, Result};
use crate::export::ExportSource;
use crate::gather::chosen_for_bake;
use crate::geometry::Geometry;
use crate::gpu::Gpu;
use crate::image::Image;
use crate::points::CameraPoints;
use crate::prepared::Prepared;
use crate::render::Render;
use crate::scene::{Scene, World, WorldCamera};
use crate::settings::{DisplaySettings, Pipeline, Settings};

/// Keys in the state of a part.
const REQUEST: &str = "request";
const DISPLAY: &str = "display";
const CAMERA: &str = "camera";

pub(super) struct Task<'a> {
    request: &'a JobRequest,
    settings: Settings,
    gather: Gather,
    /// Of a picture, or of pixels.
    camera: Option<WorldCamera>,
    /// Number of directions of a render or of its shard.
    directions: u32,
    is_shard: bool,
    /// Statistics of the points of each receiver, after its files are written.
    counts: Vec<Value>,
    /// Exposure of the 8-bit files, in stops, once they are written.
    stops: Option<f32>,
    /// Wall-clock seconds for placing the points.
    placing: f64,
}

enum Gather {
    Render(Box<Render>),
    Bake(Box<Bake>, Vec<Receiver>),
}

/// Evaluates the same expression for a render or a bake.
macro_rules! either {
    ($task:expr, $gather:ident => $value:expr) => {
        match $task {
            Gather::Render($gather) => $value,
            Gather::Bake($gather, _) => $value,
        }
    };
}

impl<'a> Task<'a> {
    /// Prepares everything before the first direction. `shard` limits the work to its blocks.
    pub fn begin(
        request: &'a JobRequest,
        gpu: &Gpu,
        world: &World,
        settings: &Settings,
        shard: Option<Range<u32>>,
        watch: &mut dyn Watch,
    ) -> Result<Self> {
        let start = Instant::now();
        let (blocks, is_shard) = (request.blocks(settings), shard.is_some());
        let directions = blocks.directions(shard.clone().unwrap_or(0..blocks.count())).len() as u32;
        let mut placing = 0.0;
        let mut gather = match &request.work {
            Work::Render => {
                watch.stage("tracing photons");
                let render = Render::new(gpu, world, settings)?;
                render.warnings().iter().for_each(|warning| watch.say(&format!("warning: {warning}")));
                Gather::Render(Box::new(render))
            }
            Work::Bake(bake) => {
                watch.stage("placing points");
                let prepared = Prepared::without_glass(world)?;
                check_files(bake, &request.outputs, &prepared.scene)?;
                let geometry = Geometry::upload(gpu, &prepared.scene)?;
                let camera = || see(gpu, &prepared.scene, &geometry, settings.film.size);
                let (mut receivers, mut points) = place(bake, &prepared.scene, settings, &camera, watch)?;
                let mut settings = *settings;
                if settings.gather.pipeline == Pipeline::Auto && !points.points.is_empty() {
                    settings.gather.pipeline =
                        chosen_for_bake(gpu.is_software(), &settings, &prepared.scene.mesh, &prepared.bvh, &points.points);
                    // Vertices keep another distance from edges in layers.
                    for vertices in receivers.iter_mut().filter(|receiver| matches!(receiver, Receiver::Vertices(_))) {
                        *vertices = Receiver::new(&ReceiverKind::Vertices, &bake.light_map, &prepared.scene, &settings, camera)?;
                    }
                    points = points_of(bake, &receivers, &settings);
                }
                let inside_out = receivers.iter().zip(&bake.receivers).filter_map(|(receiver, kind)| {
                    let plan = &bake.plan;
                    inside_out(kind.name(), receiver.points(), &prepared.scene, &prepared.bvh, plan)
                });
                let warnings = prepared.warnings().into_iter().chain(inside_out);
                warnings.for_each(|warning| watch.say(&format!("warning: {warning}")));
                placing = start.elapsed().as_secs_f64();
                watch.stage(if request.needs_light() { "tracing photons" } else { "preparing" });
                Gather::Bake(Box::new(Bake::new(gpu, prepared, geometry, points, &settings, &bake.plan)?), receivers)
            }
        };
        if let Some(shard) = shard {
            either!(&mut gather, gather => gather.only(shard));
        }
        if let (Gather::Bake(bake, _), Some(most)) = (&mut gather, request.memory) {
            bake.fit(most)?;
        }
        let camera = request.has_camera().then(|| world.camera(settings.film.size));
        Ok(Self { request, settings: *settings, gather, camera, directions, is_shard, counts: Vec::new(), stops: None, placing })
    }

    pub fn camera(&self) -> Option<WorldCamera> {
        self.camera
    }

    /// The pipeline of the gather, never `auto`.
    pub fn pipeline(&self) -> Pipeline {
        either!(&self.gather, gather => gather.settings().gather.pipeline)
    }

    /// The settings of the job, with the number of directions that was chosen for `--time`.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Chooses as many directions as a picture can gather along in `seconds`, and begins anew with them. A bake has no choice.
    ///
    /// # Errors
    /// When the device fails.
    pub fn choose_directions(&mut self, seconds: f64, watch: &mut dyn Watch) -> Result<()> {
        if let Gather::Render(render) = &mut self.gather {
            self.directions = choose_directions(render, seconds, watch)?;
            self.settings.directions.count = self.directions;
            watch.say(&format!("as many directions as fit: {}", self.directions));
        }
        Ok(())
    }

    /// What is gathered, and how.
    pub fn about(&self) -> String {
        let settings = either!(&self.gather, gather => gather.settings());
        let layers = match settings.gather.pipeline.has_layers() {
            true => format!(", layers of {0} x {0}", settings.layers()),
            false => String::new(),
        };
        let points = match &self.gather {
            Gather::Render(_) => String::new(),
            Gather::Bake(bake, _) => format!(", {} points", bake.statistics().points),
        };
        format!("pipeline {}{layers}{points}", settings.gather.pipeline)
    }

    pub fn step(&mut self) -> Result<()> {
        either!(&mut self.gather, gather => gather.step())
    }

    pub fn is_done(&self) -> bool {
        either!(&self.gather, gather => gather.is_done())
    }

    pub fn is_between_blocks(&self) -> bool {
        either!(&self.gather, gather => gather.is_between_blocks())
    }

    /// Number of directions done and in total.
    pub fn directions(&self) -> [u64; 2] {
        match &self.gather {
            Gather::Render(render) => [render.directions_done(), self.directions].map(u64::from),
            Gather::Bake(bake, _) => {
                let statistics = bake.statistics();
                [statistics.directions_done, statistics.directions_total]
            }
        }
    }

    /// Whether there are results to write.
    pub fn has_values(&self) -> bool {
        match &self.gather {
            Gather::Render(render) => render.directions_done() > 0,
            Gather::Bake(bake, _) => bake.has_values(),
        }
    }

    pub fn save(&self) -> Part<'_> {
        let mut part = either!(&self.gather, gather => gather.save());
        part.state[CAMERA] = json!(self.camera);
        if let Gather::Bake(_, receivers) = &self.gather {
            // Null if a path is not UTF-8, or the scene was in memory. Then it is not a shard, and a merge never reads it.
            let is_of_file = self.request.scene.loaded.is_none();
            part.state[REQUEST] = serde_json::to_value(self.request).ok().filter(|_| is_of_file).into();
            part.state[DISPLAY] = json!(self.settings.display);
            receivers.iter().for_each(|receiver| receiver.save(&mut part));
        }
        part
    }

    pub fn resume(&mut self, path: &Path, part: &Part) -> Result<()> {
        either!(&mut self.gather, gather => gather.resume(path, part))
    }

    /// Whether an earlier run of the same job finished all files.
    pub fn is_written(&self) -> bool {
        let job = either!(&self.gather, gather => gather.job());
        let metadata = |receiver| self.request.metadata(receiver, &job, &self.settings.display, (0, true));
        self.request.outputs.iter().enumerate().all(|(receiver, paths)| are_finished(paths, &metadata(receiver)))
    }

    /// The results so far, if there are any. `in_memory`: see [`Made::of_points`].
    pub fn made(&self, in_memory: bool) -> Option<Made> {
        match &self.gather {
            _ if !self.has_values() => None,
            Gather::Render(render) => Some(Made::Picture(render.picture())),
            Gather::Bake(bake, receivers) => {
                let columns = bake.columns()?;
                Some(Made::of_points(self.request, receivers, columns, &bake.prepared().scene, in_memory))
            }
        }
    }

    /// Writes results to all files that can be written. Returns the errors of the others.
    pub fn write(&mut self, made: &Made, watch: &mut dyn Watch) -> Vec<Error> {
        if let Made::Picture(image) = made
            && is_black(image)
        {
            watch.say("warning: the picture is black: the camera sees no surface that light reaches; turn it or the lights");
        }
        let (job, done) = self.about_results();
        self.request.warning_of_origin(&job).iter().for_each(|warning| watch.say(warning));
        self.stops = are_shown(self.request).then(|| made.stops(self.settings.display.exposure));
        self.counts = made.counts();
        let scene = if let Gather::Bake(bake, _) = &self.gather { Some(&bake.prepared().scene) } else { None };
        made.write(self.request, scene, &job, &self.settings.display, done)
    }

    /// The job of the results, the directions done, and whether these are all.
    fn about_results(&self) -> (Value, (u32, bool)) {
        either!(&self.gather, gather => (gather.job(), (gather.directions_done(), gather.is_done())))
    }

    /// The end of the work, with results that stay in memory.
    pub fn into_results(self, made: Made) -> JobResults {
        let ((job, done), display) = (self.about_results(), self.settings.display);
        let scene = if let Gather::Bake(bake, _) = self.gather { Some(bake.into_scene()) } else { None };
        // Results keep no scene but their own.
        let request = JobRequest { scene: SceneRequest::default(), ..self.request.clone() };
        JobResults { made, request, scene, job, display, done }
    }

    /// The results in one word.
    pub fn kind(&self) -> &'static str {
        if let Gather::Render(_) = &self.gather { "picture" } else { "values" }
    }

    /// The report, and the seconds of stages. `finished`: an earlier run finished the job. `outputs`: all files, or the part of a shard.
    pub fn report(&self, finished: bool, outputs: &[String]) -> (TaskReport, Value) {
        let (bake, receivers) = match &self.gather {
            Gather::Render(render) => {
                let statistics = render.statistics().clone();
                let (seconds, scene, error) = (json!(statistics.seconds), statistics.scene, statistics.error);
                let (gather, photons, exposure) = (statistics.gather, statistics.photons, self.stops);
                let report = TaskReport::Render { scene, gather, photons, error, exposure };
                return (report, seconds);
            }
            Gather::Bake(bake, receivers) => (bake, receivers),
        };
        let Work::Bake(request) = &self.request.work else { unreachable!("a bake was asked for") };
        let files = request.receivers.iter().zip(receivers).zip(&self.request.outputs).enumerate();
        let written = files.filter(|(index, _)| finished || *index < self.counts.len());
        let receivers = written.map(|(index, ((kind, receiver), paths))| ReceiverReport {
            to: kind.name(),
            points: receiver.points().len(),
            counts: self.counts.get(index).cloned(),
            outputs: paths.iter().map(|path| path.display().to_string()).collect(),
        });
        let report = TaskReport::Bake {
            plan: bake.plan().clone(),
            bake: bake.statistics(),
            receivers: receivers.collect(),
            part: outputs.first().filter(|_| self.is_shard).cloned(),
        };
        (report, json!({ "receivers": self.placing }))
    }
}

/// The camera of the picture or the pixels that a part is of.
pub(super) fn camera_of(part: &Part) -> Option<WorldCamera> {
    serde_json::from_value(part.state[CAMERA].clone()).ok().flatten()
}

/// The request of a bake and the display of its files, from a part at `path`.
///
/// # Errors
/// [`Error::Input`] when the part does not contain them.
pub(super) fn request_of(path: &Path, part: &Part) -> Result<(JobRequest, DisplaySettings)> {
    let request = serde_json::from_value(part.state[REQUEST].clone()).ok();
    let display = serde_json::from_value(part.state[DISPLAY].clone()).ok();
    let problem = "damaged, or of an earlier version: it does not say how it was baked";
    request.zip(display).ok_or_else(|| Error::input(path, None, problem, "make it again"))
}

/// Checks that results can be added to the scene's glTF file, if a receiver wants that. Otherwise the error would come after the work.
fn check_files(request: &BakeRequest, outputs: &[Vec<PathBuf>], scene: &Scene) -> Result<()> {
    let Some(source) = ExportSource::of(scene) else { return Ok(()) };
    let has_surface = |kind: &ReceiverKind| matches!(kind, ReceiverKind::Vertices | ReceiverKind::LightMap);
    let receivers = request.receivers.iter().zip(outputs).filter(|(kind, _)| has_surface(kind));
    let is_glb = |path: &&PathBuf| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("glb"));
    let Some(path) = receivers.flat_map(|(_, paths)| paths).find(is_glb) else { return Ok(()) };
    let files = source.check(path)?;
    // The loader has not read pictures that it does not show.
    check_kept(&outputs.concat(), files.iter().map(PathBuf::as_path))
}

/// All receivers in a scene without glass, and their points in order. `camera` makes the camera's receiver.
///
/// # Errors
/// As [`Receiver::new`].
pub(super) fn place(
    request: &BakeRequest,
    scene: &Scene,
    settings: &Settings,
    camera: &dyn Fn() -> Result<Receiver>,
    watch: &mut dyn Watch,
) -> Result<(Vec<Receiver>, BakePoints)> {
    per_source::check(request, scene)?;
    let new = |kind| Receiver::new(kind, &request.light_map, scene, settings, camera);
    let receivers = request.receivers.iter().map(new).collect::<Result<Vec<_>>>()?;
    receivers.iter().flat_map(Receiver::warnings).for_each(|warning| watch.say(&format!("warning: {warning}")));
    let points = points_of(request, &receivers, settings);
    Ok((receivers, points))
}

fn points_of(request: &BakeRequest, receivers: &[Receiver], settings: &Settings) -> BakePoints {
    let turns = request.receivers.iter().map(|kind| kind.turns(&request.light_map, settings));
    receivers.iter().zip(turns).map(|(receiver, turns)| receiver.with_turns(turns)).collect()
}

/// The receiver of the scene's camera, by rasterisation.
fn see(gpu: &Gpu, scene: &Scene, geometry: &Geometry, size: [u32; 2]) -> Result<Receiver> {
    let visible = CameraPoints::new(gpu, size)?.see(geometry, &scene.camera(size), Vec2::splat(0.5), 0);
    Receiver::of_camera(&visible, size, &scene.space)
}

/// Whether every sample of the picture is below a millionth.
fn is_black(image: &Image) -> bool {
    image.rgb().is_ok_and(|channels| channels.iter().all(|channel| channel.iter().all(|&sample| sample < 1e-6)))
}
