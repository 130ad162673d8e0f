//! The report at the end of a job, as plain data.

use std::fs;

use serde::Serialize;
use serde_json::Value;

use crate::bake::{BakeStatistics, Plan};
use crate::photon::PhotonCounts;
use crate::render::{GatherCounts, SceneCounts};
use crate::settings::{Pipeline, Settings};

/// What a job did.
#[derive(Clone, Debug, Serialize)]
pub struct JobReport {
    /// Renderer, version and backend of OpenGL.
    pub gl: Value,
    /// As asked.
    pub settings: Settings,
    /// The pipeline of the settings, or the one that its `auto` chose.
    pub pipeline: Pipeline,
    #[serde(flatten)]
    pub task: TaskReport,
    pub seconds: JobSeconds,
    /// Peak memory of the process so far. `None` if the system does not tell.
    pub peak_memory_bytes: Option<u64>,
    /// Whether the job stopped before its end.
    pub interrupted: bool,
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
        /// Paths of the pictures, or of the shard's part.
        outputs: Vec<String>,
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
pub(super) fn peak_memory_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let kib = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB"))?;
    kib.parse::<u64>().ok()?.checked_mul(1024)
}
