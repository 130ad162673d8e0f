//! Final gathering by rasterised ray bundles, on OpenGL 3.3.

mod direct;
mod direction;
pub mod error;
mod film;
pub mod gather;
pub mod geometry;
pub mod gpu;
pub mod image;
pub mod math;
pub mod photon;
pub mod points;
pub mod random;
pub mod render;
pub mod scene;
pub mod settings;
pub mod shaders;
