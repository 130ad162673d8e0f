//! The photon map. Gather rays read the light of surfaces from it.
//!
//! Lights and environment emit photons. The CPU traces them (`trace.rs`), guided to what gather rays see (`guide.rs`), and stores their flux on the
//! surfaces (`atlas/`) or, as in 2004, in a uniform grid (`grid.rs`). Irradiance is flux over area. [`PhotonTexture`] takes either to the shaders.
//! Caustics need a finer resolution and are estimated at the points themselves (`caustics.rs`). Lengths are in unit space.
//!
//! Source: Jensen 1996, "Global illumination using photon maps". The grid follows Hachisuka 2004, "Final gathering on GPU".

mod atlas;
mod caustics;
mod clip;
mod grid;
mod guide;
mod store;
mod texture;
mod trace;

pub use atlas::PhotonAtlas;
pub use caustics::{CausticMap, CausticPhoton};
pub use grid::PhotonGrid;
pub use guide::Guide;
pub use store::PhotonStore;
pub use texture::PhotonTexture;
pub use trace::{PhotonCounts, PhotonTracer};
