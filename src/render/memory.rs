//! What a render takes, told before it begins.

use glam::{Vec3, Vec4};

use crate::environment::Environment;
use crate::film::{Film, FilmSum};
use crate::photon::BINS;
use crate::points::GatherPoint;
use crate::scene::Scene;
use crate::settings::{Pipeline, PointSource, Settings};

/// Bytes that a render by these settings takes at most, on the GL side and here together, as measured on a software driver, where both are one:
/// program and driver, the scene, eight layers of a batch (deeper scenes take more), and what pixels need, of which a film in each node of the
/// pairwise tree over so many `blocks` is the most; then a picture, unless it is a shard's. Without what a resumed one reads, and caustics' photons.
pub fn memory_of(scene: &Scene, settings: &Settings, blocks: u32, shard: bool) -> u64 {
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
    // On the GL side: visible points with their depth, direct and rough light, sums.
    let gl = 4 * TEXEL + 4 + 3 * TEXEL;
    // Visible points, rough light, caustics; at the end of a block sums, the same in order, and direct light.
    let block = 5 * TEXEL + size_of::<Vec3>() + 3 * TEXEL;
    // Of rays on the CPU, which have points of their own.
    let rays = match (settings.pipeline, settings.points) {
        (Pipeline::Raycast, _) | (_, PointSource::Traced) => size_of::<Option<GatherPoint>>() + 2 * TEXEL,
        _ => 0,
    };
    let films = FilmSum::most_nodes(blocks) as usize;
    // A tree that is no power of two, and the two halves or the whole of it; the picture's channels, a copy for the writer and the file.
    let writing = if shard { 0 } else { films.max(2) * Film::BYTES_PER_PIXEL + 3 * 32 * size_of::<f32>() };
    let pixel = gl + rays + (block + films * Film::BYTES_PER_PIXEL).max(writing);
    let [width, height] = settings.size.map(|side| side as usize);
    (DRIVER + scene + photons + shadows + layers + width * height * pixel) as u64
}
