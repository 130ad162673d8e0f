//! What a render takes, told before it begins.

use glam::{Vec3, Vec4};

use crate::film::{Film, FilmSum};
use crate::memory::common;
use crate::points::GatherPoint;
use crate::scene::{Material, World};
use crate::settings::{Pipeline, PointSource, Settings};

/// Bytes that a render by these settings takes at most, on the GL side and here together: what any job takes, and what pixels need, of which a film in
/// each node of the pairwise tree over so many `blocks` is the most; then a picture, unless it is a shard's. Without what a resumed one reads, and
/// caustics' photons.
pub fn memory_of(world: &World, settings: &Settings, blocks: u32, shard: bool) -> u64 {
    const TEXEL: usize = size_of::<Vec4>();
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
    // Gather rays have a scene of their own where there is glass.
    let copies = if world.surfaces().any(Material::is_glass) { 2 } else { 1 };
    let common = common(world.surfaces().count(), &world.textures, world.environment.as_ref(), copies, settings);
    (common + width * height * pixel) as u64
}
