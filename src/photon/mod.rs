//! The photon map on a grid. Gather rays read the light of surfaces from it.
//!
//! Lights and environment emit photons in proportion to their power. The CPU traces them (`trace.rs`) and stores them in a uniform grid
//! (`grid.rs`). The irradiance of a surface is estimated as the flux in its cell over the surface area in that cell. [`PhotonTexture`] takes
//! the grid to the shaders. Caustics need a finer resolution and are estimated at the points themselves (`caustics.rs`). Lengths are in unit space.
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
