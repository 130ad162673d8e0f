//! The whole picture against someone else's: `reference/cornell_256.exr`, path-traced with Mitsuba 3 by `reference/path_trace.py`
//! (32768 paths a pixel; its own noise is about 0.7 % of the mean).

use std::path::Path;

use finalgather::gpu::{Backend, DeviceChoice, Gpu};
use finalgather::image::Image;
use finalgather::image::compare::{Selection, compare};
use finalgather::render::Render;
use finalgather::scene::Scene;

/// The Cornell box, 256x256, 1000 directions, everything else by default.
#[test]
fn cornell_box_agrees_with_path_tracing() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let reference = Image::read(&root.join("tests/reference/cornell_256.exr")).unwrap();
    let scene = Scene::load(&root.join("scenes/cornell.toml")).unwrap();
    let mut settings = scene.settings.clone();
    settings.size = [256, 256];
    assert_eq!(settings.directions, 1000, "the scene file's own count");
    let gpu = Gpu::headless(Backend::Auto, DeviceChoice::Auto).unwrap();
    let mut render = Render::new(&gpu, &scene, &settings).unwrap();
    while !render.is_done() {
        render.step().unwrap();
    }

    // The light is a hundred times brighter than the rest, so that its anti-aliased outline alone would decide the result: it is left
    // out with two pixels around it. So is the worst 0.1 %, single pixels on outlines of the blocks.
    let mask = Image::read(&root.join("tests/reference/cornell_256_mask.png")).unwrap();
    let mask: Vec<bool> = mask.channel("R").unwrap().iter().map(|&counted| counted > 0.5).collect();
    let left_out = mask.iter().filter(|&&counted| !counted).count();
    assert!((400..1000).contains(&left_out), "the mask covers the light and little else, not {left_out} pixels");
    let result = compare(&render.picture(), &reference, Selection { mask: Some(&mask), trim: 0.001 }).unwrap();
    println!("bias {:+.3} %, relative RMSE {:.3} %", 100.0 * result.bias, 100.0 * result.relative_rmse);
    // Measured: -0.12 % and 1.6 %. Of the latter, the structured error of 1000 directions is 1.3 %, the rest mostly the
    // reference's noise.
    assert!(result.bias.abs() < 0.005, "{result:?}");
    assert!(result.relative_rmse < 0.02, "{result:?}");
}
