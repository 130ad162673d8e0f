//! Predicts the memory of a job before it starts. Each type that allocates has a function `bytes`; this module adds them up.
//!
//! A prediction counts the GL side and the CPU together, because a software driver has one memory for both. It leaves out amounts that only a run
//! can tell: layers beyond the first eight, photons of caustics, and the part that a resumed job reads.

use glam::{Vec3, Vec4};

use crate::film::{Film, FilmSum};
use crate::gather::LayerStore;
use crate::geometry::Geometry;
use crate::photon::{PhotonAtlas, PhotonGrid, PhotonTexture};
use crate::points::{
    Accumulator, CameraPoints, GBuffer, GatherPoint, GlossTextures, PointGloss, PointTextures, Sharing, chosen_source,
};
use crate::scene::{Environment, Scene, Triangle};
use crate::settings::{PhotonMapKind, Pipeline, PointSource, Settings, Squares};

/// Bytes of program and driver. Measured with llvmpipe: the peak of a render of 64 pixels, less the bytes of the types, was 94 MiB.
const DRIVER: usize = 96 << 20;
/// Bytes of a triangle on the CPU: its mesh as loaded and in unit space, and its part of the ray tree. Measured in the same way: 280 bytes, in a
/// bake of `ao` at one point among 500 000 triangles. The rest is a margin.
const TRIANGLE: usize = 376;

/// Bytes that every job takes: driver, scene, photons, tables of rays, and the layers of a batch of directions.
pub fn common(scene: &Scene, settings: &Settings, has_photons: bool) -> usize {
    // A scene with glass is held twice: with its glass for eye rays and photons, without it for gather rays.
    let is_glass = |triangle: &Triangle| scene.materials[triangle.material as usize].is_glass();
    let scenes = if scene.mesh.triangles.iter().any(is_glass) { 2 } else { 1 };
    let texels: usize = scene.textures.iter().map(|texture| size_of_val(&texture.texels[..])).sum();
    let surfaces = scenes * (TRIANGLE * scene.mesh.triangles.len() + Geometry::bytes(scene)) + (1 + scenes) * texels;
    let environment = scene.environment.as_ref().map_or(0, Environment::bytes);
    let triangles = scene.mesh.triangles.len();
    let photons = match settings.photons.map {
        _ if !has_photons => 0,
        PhotonMapKind::Surface => PhotonAtlas::bytes(triangles, settings.photons.count),
        PhotonMapKind::Grid => {
            let cells = settings.photons.grid_cells;
            PhotonGrid::bytes(cells) + PhotonTexture::bytes(cells) + PhotonGrid::area_bytes(triangles)
        }
    };
    // `auto` may choose layers.
    let layers = if settings.gather.pipeline.has_layers() { LayerStore::bytes(settings.layers()) } else { 0 };
    DRIVER + surfaces + environment + photons + layers
}

/// Most bytes of a render: `common`, a block's pixels, a film in each node of the pairwise tree over `blocks`; and the picture, unless a shard.
pub fn of_render(scene: &Scene, settings: &Settings, blocks: u32, shard: bool) -> u64 {
    let size = settings.film.size;
    let pixels: usize = size.map(|side| side as usize).iter().product();
    let texels = |count: usize| count * size_of::<Vec4>() * pixels;
    // Three accumulators: gather, direct light, photon map.
    let gl = CameraPoints::bytes(size) + Accumulator::bytes(size, 3);
    // The photon map; at the end of a block the gather's sums as read, and the same in pixel order; direct light and caustics.
    let sharing = if settings.film.interleave == Squares::Pixels(1) { 0 } else { Sharing::bytes(pixels) };
    let block = GBuffer::bytes(pixels) + texels(3) + 2 * size_of::<Vec3>() * pixels + sharing;
    let lens = scene.camera.is_some_and(|camera| camera.lens.is_some());
    let rays = match (settings.gather.pipeline, chosen_source(scene, lens, &settings.film)) {
        _ if settings.film.ground => size_of::<Option<GatherPoint>>() * pixels + PointTextures::bytes(size),
        (Pipeline::Raycast, _) | (_, PointSource::Traced) => {
            size_of::<Option<GatherPoint>>() * pixels + PointTextures::bytes(size)
        }
        _ => 0,
    };
    // The textures of gloss, and the points' reflection; two more sums of the gather and one of direct light, as read and in order.
    let glossy = scene.is_glossy();
    let of_gloss = || {
        let read = texels(4) + (size_of::<PointGloss>() + 2 * size_of::<Vec3>()) * pixels;
        PointTextures::bytes(size) + GlossTextures::bytes(size) + Accumulator::bytes(size, 3) + read
    };
    let gloss = if glossy { of_gloss() } else { 0 };
    let rare = scene.has_caustics() || scene.environment.is_some();
    let film = |nodes: usize| Film::bytes(nodes * pixels, glossy, rare);
    let channels = 32 + if scene.environment.is_some() { 3 } else { 0 } + usize::from(settings.film.ground);
    let films = FilmSum::most_nodes(blocks) as usize;
    // The tree, when its size is no power of two, and its two halves or its whole; the picture's channels, a copy for the writer, and the file.
    let writing = if shard { 0 } else { film(films.max(2)) + 3 * channels * size_of::<f32>() * pixels };
    (common(scene, settings, true) + gl + rays + gloss + (block + film(films)).max(writing)) as u64
}
