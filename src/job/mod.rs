//! A whole job: load the scene, gather, save the sums, write the results, report.
//!
//! [`Job::new`] checks a request. [`Job::run`] works and reports to a [`Watch`]. [`merge`] merges shards. Requests and results are in world space.

mod checkpoint;
mod estimate;
mod inside_out;
mod merge;
mod openness;
mod outputs;
mod per_source;
mod receiver;
mod remaining;
mod report;
mod request;
mod results;
mod task;
mod time;

use std::mem::take;
use std::path::{Path, PathBuf};
use std::time::Instant;

use self::checkpoint::Checkpoint;
use self::remaining::Remaining;
use self::report::Noting;
use self::task::Task;
use crate::error::{Error, Result};
use crate::scene::{Loaded, World};

pub use checkpoint::Keeping;
pub use estimate::{Estimate, estimate};
pub use merge::merge;
pub use openness::Openness;
pub use outputs::{check_kept, metadata, of_picture};
pub use per_source::Per;
pub use receiver::{Receiver, ReceiverKind, ReceiverValues, outputs_of};
pub use report::{JobReport, JobSeconds, MergeReport, ReceiverReport, ReportHead, TaskReport, TotalSeconds};
pub use request::{BakeRequest, DeviceRequest, JobRequest, SceneRequest, SharedScene, Work};
pub use results::JobResults;

/// Callbacks of a running job. `()` runs the job to its end in silence.
pub trait Watch {
    /// A new stage begins.
    fn stage(&mut self, _stage: &'static str) {}

    /// A sentence for the user: a warning, or where the results are.
    fn say(&mut self, _line: &str) {}

    /// A fact about the run, for those who ask for more.
    fn detail(&mut self, _line: &str) {}

    /// The gather goes on.
    fn progress(&mut self, _progress: Progress) {}

    /// From now on a stopped job leaves a file.
    fn has_result(&mut self) {}

    /// Whether to continue. A stop loses the block in progress, so the best time to stop is between two blocks.
    fn goes_on(&mut self, _between_blocks: bool) -> bool {
        true
    }
}

impl Watch for () {}

/// How far a gather is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Directions done.
    pub done: u64,
    /// Directions in total. A target error may be reached before.
    pub total: u64,
    /// Predicted seconds to the end of the gather, once enough is known.
    pub seconds_left: Option<f64>,
}

/// A checked job, ready to run.
pub struct Job {
    request: JobRequest,
    outputs: Vec<PathBuf>,
    checkpoint: Checkpoint,
    in_memory: bool,
    started: Instant,
}

/// How a job ended without an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    Finished,
    /// An earlier run had finished it. This run did nothing.
    AlreadyFinished,
    /// [`Watch::goes_on`] returned false.
    Stopped,
}

/// What a job has done.
#[derive(Debug)]
pub struct Outcome {
    pub ending: Ending,
    /// Result files, or the part of a shard.
    pub outputs: Vec<PathBuf>,
    /// Of [`Job::in_memory`]: the results, if there are any so far.
    pub results: Option<JobResults>,
    pub report: JobReport,
}

impl Job {
    /// # Errors
    /// [`Error::Input`] when the scene is of no kind that can be read; [`Error::Usage`] when an output cannot be written or would replace an input or earlier sums; [`Error::Output`] while another run writes it.
    pub fn new(request: JobRequest, keeping: &Keeping) -> Result<Self> {
        Self::checked(request, keeping, false)
    }

    /// A job whose results also stay in memory. It needs no files, and is no shard.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn in_memory(request: JobRequest, keeping: &Keeping) -> Result<Self> {
        Self::checked(request, &Keeping { shard: None, ..keeping.clone() }, true)
    }

    fn checked(request: JobRequest, keeping: &Keeping, in_memory: bool) -> Result<Self> {
        let started = Instant::now();
        if request.time.is_some() && keeping.resume {
            let cure = "give --directions and their number in place of --time, to go on from earlier sums";
            return Err(Error::usage("--time chooses directions anew, and nothing can be resumed", cure));
        }
        if request.scene.bytes.is_none() && request.scene.loaded.is_none() && request.scene.path.exists() {
            World::check_path(&request.scene.path)?;
        }
        let outputs = if keeping.shard.is_some() { Vec::from_iter(keeping.file.clone()) } else { request.outputs.concat() };
        check_kept(&outputs, request.inputs())?;
        let checkpoint = Checkpoint::new(keeping, &outputs)?;
        if keeping.shard.is_none() {
            request.check_outputs(in_memory)?;
        }
        Ok(Self { request, outputs, checkpoint, in_memory, started })
    }

    /// A lock file. Remove it if the process ends during a run.
    pub fn lock_path(&self) -> Option<&Path> {
        self.checkpoint.lock_path()
    }

    /// Runs until all results are written, or `watch` stops it. On a stop or a device failure, it writes the results so far and keeps the sums.
    ///
    /// # Errors
    /// [`Error::Input`] when a file cannot be used; [`Error::Usage`] when the request is impossible; [`Error::Gl`] when the device fails;
    /// [`Error::Output`] when a file cannot be written. All other files are written before it returns.
    pub fn run(self, watch: &mut dyn Watch) -> Result<Outcome> {
        let Self { request, outputs, mut checkpoint, in_memory, started } = self;
        let mut noting = Noting::new(watch);
        let watch = &mut noting;
        let is_shard = checkpoint.shard().is_some();
        watch.stage("loading");
        let loading = Instant::now();
        let loaded = request.scene.share(request.needs_light())?;
        let Loaded { world, settings, report, .. } = &*loaded;
        check_kept(&outputs, report.files.iter().map(PathBuf::as_path))?;
        // Whoever loaded the scene has told its warnings.
        let told = request.scene.loaded.as_ref().map_or(0, |SharedScene(scene)| scene.report.warnings.len());
        watch.warnings.extend_from_slice(&report.warnings[..told]);
        report.warnings[told..].iter().for_each(|warning| watch.say(&format!("warning: {warning}")));
        let files: Vec<_> = report.files.iter().map(|path| path.display().to_string()).collect();
        watch.detail(&format!("read {}", files.join(", ")));
        let settings = request.settings(settings)?;
        let load = loading.elapsed().as_secs_f64();
        let blocks = request.blocks(&settings);
        let shard = checkpoint.shard().map(|shard| shard.range(blocks.count())).transpose()?;
        let mine = shard.clone().unwrap_or(0..blocks.count());
        let mut remaining = Remaining::new(blocks.directions(mine.clone()).len() as f64 / mine.len().max(1) as f64);
        request.check(world, &settings, shard.as_ref(), watch)?;
        let found = checkpoint.find(watch)?;

        watch.stage("starting OpenGL");
        let starting = Instant::now();
        let gpu = request.device.open()?;
        let device = starting.elapsed().as_secs_f64();
        watch.detail(&format!("OpenGL: {}", gpu.info().renderer));
        let mut task = Task::begin(&request, &gpu, world, &settings, shard, watch)?;
        if let Some(part) = found {
            task.resume(checkpoint.path(), &part)?;
            let [done, total] = task.directions();
            watch.say(&format!("going on from {done} of {total} directions in {}", checkpoint.path().display()));
        }
        if let Some(seconds) = request.time {
            watch.stage("choosing directions");
            task.choose_directions(seconds - started.elapsed().as_secs_f64(), watch)?;
            let blocks = request.blocks(task.settings());
            remaining = Remaining::new(blocks.directions(0..blocks.count()).len() as f64 / f64::from(blocks.count()));
        }
        let already = !in_memory && checkpoint.may_be_finished() && task.is_written();
        if checkpoint.may_be_finished() && !already {
            checkpoint.say_beginning(watch);
        }

        let (mut failure, mut write) = (None, 0.0);
        watch.stage("gathering");
        watch.detail(&task.about());
        let progress = |task: &Task, remaining: &Remaining| {
            let [done, total] = task.directions();
            Progress { done, total, seconds_left: remaining.seconds(total - done) }
        };
        watch.progress(progress(&task, &remaining));
        while !already && failure.is_none() && !task.is_done() && watch.goes_on(task.is_between_blocks()) {
            let (before, begins, start) = (task.directions()[0], task.is_between_blocks(), Instant::now());
            failure = task.step().err();
            remaining.add(begins, task.directions()[0].saturating_sub(before), start.elapsed());
            // A checkpoint may exist before each point has a value.
            if task.has_values() || checkpoint.is_kept() {
                watch.has_result();
            }
            watch.progress(progress(&task, &remaining));
            let writing = Instant::now();
            checkpoint.keep(watch, || task.save());
            write += writing.elapsed().as_secs_f64();
        }
        let [done, total] = task.directions();
        // Sums from before the device failed are worth keeping.
        if let Some(error) = failure.take_if(|_| done == 0) {
            return Err(error);
        }

        let ended = failure.is_some() || !already && !task.is_done();
        let ending = match (ended, already) {
            (true, _) => Ending::Stopped,
            (_, true) => Ending::AlreadyFinished,
            _ => Ending::Finished,
        };
        watch.stage("writing");
        let writing = Instant::now();
        let mut kept = if ended { checkpoint.stop(|| task.save()) } else { Ok(false) };
        let made = if already || is_shard { None } else { task.made(in_memory) };
        let unwritten = made.as_ref().map_or(Vec::new(), |made| task.write(made, watch));
        let names: Vec<_> = outputs.iter().map(|path| path.display().to_string()).collect();
        let (paths, path) = (names.join(", "), checkpoint.path().display().to_string());
        if ended {
            let how = if failure.is_some() { "failed" } else { "stopped" };
            let what = match kept {
                _ if made.is_some() && unwritten.is_empty() && !outputs.is_empty() => {
                    format!("{} so far written to {paths}", task.kind())
                }
                Ok(true) => format!("kept in {path}"),
                _ => "nothing kept".to_owned(),
            };
            let resume = match kept {
                Ok(true) if request.time.is_some() => "; --resume goes on, with --directions and that number in place of --time",
                Ok(true) => "; --resume goes on",
                Ok(false) => "; no checkpoint is kept (--checkpoint FILE keeps one)",
                Err(_) => "",
            };
            watch.say(&format!("{how} after {done} of {total} directions; {what}{resume}"));
        } else if unwritten.is_empty() {
            checkpoint.finish(|| task.save())?;
            if already {
                watch.say(&format!("{paths}: finished by an earlier run, and left as it was"));
            }
        } else {
            kept = checkpoint.stop(|| task.save());
            if matches!(kept, Ok(true)) {
                watch.say(&format!("what was gathered is kept in {path}; --resume writes it"));
            }
        }
        all_written(failure.into_iter().chain(unwritten).chain(kept.err()), watch)?;

        write += writing.elapsed().as_secs_f64();
        let (report, stages) = task.report(already, &names);
        let command = if request.work == Work::Render { "render" } else { "bake" };
        let head = ReportHead::new(command, names, task.camera(), take(&mut watch.warnings));
        let report = JobReport {
            head: ReportHead { interrupted: ended, ..head },
            gl: gpu.identity(),
            settings: *task.settings(),
            pipeline: task.pipeline(),
            task: report,
            seconds: JobSeconds { load, device, stages, write, total: started.elapsed().as_secs_f64() },
        };
        let results = made.filter(|_| in_memory).map(|made| task.into_results(made));
        Ok(Outcome { ending, outputs, results, report })
    }
}

/// Returns the first of the errors, and says the others.
fn all_written(errors: impl IntoIterator<Item = Error>, watch: &mut dyn Watch) -> Result<()> {
    let mut errors = errors.into_iter();
    errors.next().map_or(Ok(()), |first| {
        errors.for_each(|error| watch.say(&format!("error: {error}")));
        Err(first)
    })
}
