//! Every shader program of the crate, from the sources in `glsl/`. Tests compile all of [`ALL`] and [`WITH_IMAGES`].

use std::fs;
use std::path::Path;

use crate::gpu::{ShaderSource, replace_shader_text};

const INCLUDES: &[(&str, &str)] = &[
    ("surface.glsl", include_str!("../glsl/include/surface.glsl")),
    ("octahedral.glsl", include_str!("../glsl/include/octahedral.glsl")),
    ("points.glsl", include_str!("../glsl/include/points.glsl")),
    ("layer.glsl", include_str!("../glsl/include/layer.glsl")),
    ("packed_surface.glsl", include_str!("../glsl/include/packed_surface.glsl")),
    ("layer_store.glsl", include_str!("../glsl/include/layer_store.glsl")),
    ("photon_grid.glsl", include_str!("../glsl/include/photon_grid.glsl")),
    ("albedo.glsl", include_str!("../glsl/include/albedo.glsl")),
    ("found.glsl", include_str!("../glsl/include/found.glsl")),
    ("carriers.glsl", include_str!("../glsl/include/carriers.glsl")),
    ("harmonics.glsl", include_str!("../glsl/include/harmonics.glsl")),
    ("hits.glsl", include_str!("../glsl/include/hits.glsl")),
    ("radiance.glsl", include_str!("../glsl/include/radiance.glsl")),
    ("bvh.glsl", include_str!("../glsl/include/bvh.glsl")),
];

/// Most directions that a shader takes at once, as its define says.
pub const BATCH: usize = 8;

macro_rules! shader {
    ($vertex:literal, $fragment:literal $(, $define:literal)*) => {
        ShaderSource {
            name: $fragment,
            vertex: include_str!(concat!("../glsl/", $vertex, ".vert")),
            fragment: include_str!(concat!("../glsl/", $fragment, ".frag")),
            defines: &[$($define),*],
            includes: INCLUDES,
        }
    };
}

pub static VISIBLE_POINTS: ShaderSource = shader!("surface", "visible_points");
pub static SHADOW: ShaderSource = shader!("surface", "shadow");
pub static DIRECT: ShaderSource = shader!("fullscreen", "direct");
pub static PHOTON_MAP: ShaderSource = shader!("fullscreen", "photon_map");
pub static PEEL: ShaderSource = shader!("surface", "peel");
pub static KILL: ShaderSource = shader!("fullscreen", "kill");
pub static KILL_FARTHEST: ShaderSource = shader!("fullscreen", "kill", "FARTHEST");
pub static KILL_FARTHEST_EARLY: ShaderSource = shader!("fullscreen", "kill", "FARTHEST", "EARLY");
pub static REJECT: ShaderSource = shader!("fullscreen", "reject");
pub static STORE_PEEL: ShaderSource = shader!("surface", "store_peel", "BATCH 8");
pub static STORE_PEEL_FARTHEST: ShaderSource = shader!("surface", "store_peel", "BATCH 8", "FARTHEST");
pub static STORE_APPEND: ShaderSource = shader!("surface", "store_append", "BATCH 8");
pub static STORE_SORT: ShaderSource = shader!("fullscreen", "store_sort");
pub static FUSED: ShaderSource = shader!("fullscreen", "fused", "BATCH 8");
pub static FUSED_TEXTURED: ShaderSource = shader!("fullscreen", "fused", "BATCH 8", "TEXTURED");
pub static FUSED_FIND: ShaderSource = shader!("fullscreen", "fused", "BATCH 8", "FIND");
pub static ACCUMULATE: ShaderSource = shader!("fullscreen", "accumulate");
pub static ACCUMULATE_TEXTURED: ShaderSource = shader!("fullscreen", "accumulate", "TEXTURED");
pub static RAYS: ShaderSource = shader!("fullscreen", "rays", "BATCH 8");
pub static RAYS_TEXTURED: ShaderSource = shader!("fullscreen", "rays", "BATCH 8", "TEXTURED");
pub static RAYS_FIND: ShaderSource = shader!("fullscreen", "rays", "BATCH 8", "FIND");

pub static HEMISPHERE: ShaderSource = shader!("fullscreen", "hemisphere", "BATCH 8");
pub static HARMONICS: ShaderSource = shader!("fullscreen", "harmonics", "BATCH 8");

/// All of the above that every device can run.
pub static ALL: [&ShaderSource; 21] = [
    &VISIBLE_POINTS,
    &SHADOW,
    &DIRECT,
    &PHOTON_MAP,
    &PEEL,
    &KILL,
    &KILL_FARTHEST,
    &KILL_FARTHEST_EARLY,
    &REJECT,
    &STORE_PEEL,
    &STORE_PEEL_FARTHEST,
    &FUSED,
    &FUSED_TEXTURED,
    &FUSED_FIND,
    &ACCUMULATE,
    &ACCUMULATE_TEXTURED,
    &RAYS,
    &RAYS_TEXTURED,
    &RAYS_FIND,
    &HEMISPHERE,
    &HARMONICS,
];

/// Those for devices on which shaders write to images.
pub static WITH_IMAGES: [&ShaderSource; 2] = [&STORE_APPEND, &STORE_SORT];

/// Reads the files of a folder laid out as `glsl/`, as far as it has them, in place of what is embedded: for work on shaders. Programs made
/// from now on are of these.
pub fn reload(folder: &Path) {
    let vertex = [("surface", VISIBLE_POINTS.vertex), ("fullscreen", DIRECT.vertex)];
    let vertex = vertex.map(|(name, text)| (format!("{name}.vert"), text));
    let fragments = ALL.iter().chain(&WITH_IMAGES).map(|source| (format!("{}.frag", source.name), source.fragment));
    let includes = INCLUDES.iter().map(|&(name, text)| (format!("include/{name}"), text));
    for (path, embedded) in vertex.into_iter().chain(fragments).chain(includes) {
        replace_shader_text(embedded, fs::read_to_string(folder.join(path)).ok());
    }
}
