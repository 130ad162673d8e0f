//! The names of the `finalgather` library that figures use, the device, and the repository's files.

use std::path::PathBuf;

pub use finalgather::bench::{Bench, BenchPlan, CONTESTANTS, Contestant, Deviation, FUSED, Row, Where};
pub use finalgather::points::GatherPoint;
pub use finalgather::scene::Scene;
pub use finalgather::settings::{LayerSize, PhotonSettings, Squares};
use finalgather::{Backend, DeviceChoice};
pub use finalgather::{Estimator, Gpu, Image, Pipeline, Sequence, Settings, WriteOptions};

use crate::figure::{Result, folder};

/// The OpenGL device that figures are measured on.
pub fn gpu() -> Result<Gpu> {
    Ok(Gpu::headless(Backend::Auto, DeviceChoice::Auto)?)
}

pub fn in_repository(path: &str) -> PathBuf {
    folder().join("..").join(path)
}
