//! Final gathering by rasterised ray bundles, on OpenGL 3.3.
pub mod error;
pub mod image;
pub mod math;
pub mod scene;
pub mod settings;
