//! Final gathering by rasterised ray bundles, on OpenGL 3.3.
pub mod error;
pub mod gpu;
pub mod image;
pub mod photon;
pub mod render;
pub mod scene;
pub mod settings;
