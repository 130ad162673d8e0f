//! What a job takes before its points count.

use glam::Vec4;

use crate::photon::BINS;
use crate::scene::{Environment, Texture};
use crate::settings::Settings;

/// Bytes of program and driver, scene, photons, shadow maps and the layers of a batch, eight of them (deeper scenes take more), on the GL side and here
/// together, as measured on a software driver, where both are one. So many copies of the scene are kept.
pub fn common(
    triangles: usize,
    textures: &[Texture],
    environment: Option<&Environment>,
    copies: usize,
    settings: &Settings,
) -> usize {
    const DRIVER: usize = 96 << 20;
    const TRIANGLE: usize = 512;
    const TEXEL: usize = size_of::<Vec4>();
    let square = |side: u32| side as usize * side as usize;
    let texels: usize = textures.iter().map(|texture| texture.texels.len()).sum();
    let beyond = environment.map_or(0, Environment::texels);
    // As loaded, in unit space, and on the GL side with mipmaps; lights from beyond have tables.
    let scene = copies * (TRIANGLE * triangles + 10 * texels) + 4 * texels + 28 * beyond;
    let photons = 3 * TEXEL * BINS * (settings.grid_cells as usize + 2).pow(3);
    let shadows = (TEXEL + 4) * 3 * square(settings.shadow_size);
    let batch = (2048 / settings.layers() as usize).clamp(1, 8);
    let layers = batch * square(settings.layers()) * (8 * 12 + 16);
    DRIVER + scene + photons + shadows + layers
}
