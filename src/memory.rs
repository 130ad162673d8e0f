//! What a job takes before its points count.

use glam::Vec4;

use crate::environment::Environment;
use crate::photon::BINS;
use crate::scene::Scene;
use crate::settings::Settings;

/// Bytes of program and driver, scene, photons, shadow maps and the layers of a batch, eight of them (deeper scenes take more), on the GL side and here
/// together, as measured on a software driver, where both are one.
pub fn common(scene: &Scene, settings: &Settings) -> usize {
    const DRIVER: usize = 96 << 20;
    const TRIANGLE: usize = 512;
    const TEXEL: usize = size_of::<Vec4>();
    let square = |side: u32| side as usize * side as usize;
    let texels: usize = scene.textures.iter().map(|texture| texture.texels.len()).sum();
    let beyond = scene.environment.as_ref().map_or(0, Environment::texels);
    // Gather rays have a scene of their own where there is glass.
    let scenes = if scene.without_glass().is_some() { 2 } else { 1 };
    // As loaded, in unit space, and on the GL side with mipmaps; lights from beyond have tables.
    let scene = scenes * (TRIANGLE * scene.mesh.triangles.len() + 10 * texels) + 4 * texels + 28 * beyond;
    let photons = 3 * TEXEL * BINS * (settings.grid_cells as usize + 2).pow(3);
    let shadows = (TEXEL + 4) * 3 * square(settings.shadow_size);
    let batch = (2048 / settings.layers() as usize).clamp(1, 8);
    let layers = batch * square(settings.layers()) * (8 * 12 + 16);
    DRIVER + scene + photons + shadows + layers
}
