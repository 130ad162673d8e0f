//! The report at the end of a job, as plain data.

use std::fs;

use serde::Serialize;
use serde_json::Value;

use super::{Progress, Watch};
use crate::bake::{BakeStatistics, Plan};
use crate::photon::PhotonCounts;
use crate::render::{GatherCounts, SceneCounts};
use crate::scene::WorldCamera;
use crate::settings::{Pipeline, Settings};

/// What the reports of render, bake, merge and relight have in common. `docs/report.schema.json` describes all of them.
#[derive(Clone, Debug, Serialize)]
pub struct ReportHead {
    pub schema: u32,
    pub version: &'static str,
    /// `render`, `bake`, `merge` or `relight`.
    pub command: &'static str,
    /// Paths of all results, or of the part of a shard.
    pub outputs: Vec<String>,
    /// Of pictures, and of bakes at pixels, in world space.
    pub camera: Option<WorldCamera>,
    pub warnings: Vec<String>,
    /// Peak memory of the process so far. `None` if the system does not tell.
    pub peak_memory_bytes: Option<u64>,
    /// Whether it stopped before its end.
    pub interrupted: bool,
}

impl ReportHead {
    /// The number of this form of reports. It grows when a key goes away or changes its meaning; new keys do not change it.
    pub const SCHEMA: u32 = 1;

    pub fn new(command: &'static str, outputs: Vec<String>, camera: Option<WorldCamera>, warnings: Vec<String>) -> Self {
        let (schema, version) = (Self::SCHEMA, env!("CARGO_PKG_VERSION"));
        let peak_memory_bytes = peak_memory_bytes();
        Self { schema, version, command, outputs, camera, warnings, peak_memory_bytes, interrupted: false }
    }
}

/// Keeps the warnings of a job for its report.
pub(super) struct Noting<'a> {
    watch: &'a mut dyn Watch,
    pub warnings: Vec<String>,
}

impl<'a> Noting<'a> {
    pub fn new(watch: &'a mut dyn Watch) -> Self {
        Self { watch, warnings: Vec::new() }
    }
}

impl Watch for Noting<'_> {
    fn stage(&mut self, stage: &'static str) {
        self.watch.stage(stage);
    }

    fn say(&mut self, line: &str) {
        self.warnings.extend(line.strip_prefix("warning: ").map(str::to_owned));
        self.watch.say(line);
    }

    fn detail(&mut self, line: &str) {
        self.watch.detail(line);
    }

    fn progress(&mut self, progress: Progress) {
        self.watch.progress(progress);
    }

    fn has_result(&mut self) {
        self.watch.has_result();
    }

    fn goes_on(&mut self, between_blocks: bool) -> bool {
        self.watch.goes_on(between_blocks)
    }
}

/// What a merge did.
#[derive(Clone, Debug, Serialize)]
pub struct MergeReport {
    #[serde(flatten)]
    pub head: ReportHead,
    /// Number of parts.
    pub parts: usize,
    /// `render` or `bake`: what the parts are of.
    pub of: &'static str,
    pub settings: Settings,
    pub seconds: TotalSeconds,
}

/// Wall-clock seconds.
#[derive(Clone, Debug, Serialize)]
pub struct TotalSeconds {
    pub total: f64,
}

/// What a job did.
#[derive(Clone, Debug, Serialize)]
pub struct JobReport {
    #[serde(flatten)]
    pub head: ReportHead,
    /// Renderer, version and backend of OpenGL.
    pub gl: Value,
    /// As asked.
    pub settings: Settings,
    /// The pipeline of the settings, or the one that its `auto` chose.
    pub pipeline: Pipeline,
    #[serde(flatten)]
    pub task: TaskReport,
    pub seconds: JobSeconds,
}

/// The parts of a report that differ between renders and bakes.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum TaskReport {
    Render {
        scene: SceneCounts,
        gather: GatherCounts,
        photons: PhotonCounts,
        /// Relative standard error of the picture. `None` if there are too few directions to estimate it.
        error: Option<f64>,
        /// Exposure of the 8-bit pictures, in stops. `None` if this run wrote none.
        exposure: Option<f32>,
    },
    Bake {
        plan: Plan,
        bake: BakeStatistics,
        /// The receivers whose files are written.
        receivers: Vec<ReceiverReport>,
        /// Path of the shard's part.
        part: Option<String>,
    },
}

/// A receiver whose values are written.
#[derive(Clone, Debug, Serialize)]
pub struct ReceiverReport {
    /// Name of the receiver.
    pub to: &'static str,
    pub points: usize,
    /// Statistics of the points. `None` if an earlier run wrote the files.
    pub counts: Option<Value>,
    pub outputs: Vec<String>,
}

/// Wall-clock seconds.
#[derive(Clone, Debug, Serialize)]
pub struct JobSeconds {
    pub load: f64,
    /// Starting OpenGL.
    pub device: f64,
    /// Seconds of stages that only a render or only a bake has.
    #[serde(flatten)]
    pub stages: Value,
    /// Results and checkpoints.
    pub write: f64,
    pub total: f64,
}

/// Peak memory of the process so far, if the system tells.
fn peak_memory_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let kib = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB"))?;
    kib.parse::<u64>().ok()?.checked_mul(1024)
}
