//! The grid photon map: the rough solution that final gathering looks at.
//!
//! Photons leave the lights and the environment in proportion to power, are traced on the CPU (`trace.rs`) and stored in a uniform grid (`grid.rs`);
//! the irradiance of a surface is estimated as the flux that its cell received over the true surface area in that cell.
//! [`PhotonTexture`] takes the grid to the shaders. What mirrors and glass throw on surfaces is for the points themselves, finer than a grid
//! (`caustics.rs`). Lengths are those of unit space.
//!
//! Source: Jensen 1996, "Global illumination using photon maps"; the grid follows Hachisuka 2004, "Final gathering on GPU".

mod caustics;
mod grid;
mod texture;
mod trace;

pub use caustics::{CausticMap, CausticPhoton};
pub use grid::PhotonGrid;
pub use texture::PhotonTexture;
pub use trace::{PhotonCounts, PhotonTracer};
