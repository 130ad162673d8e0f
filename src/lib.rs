//! Final gathering by rasterised ray bundles, on OpenGL 3.3.

pub mod direct;
pub mod direction;
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
pub mod reference;
pub mod render;
pub mod scene;
pub mod settings;
pub mod shaders;
