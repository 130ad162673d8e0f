//! Whole pictures of buildings at default settings, compared with path tracing (`reference/path_trace.py`). `reference/buildings.py` says what goes wrong
//! easily in each scene. References are means of squares of pixels, whose noise is at most 0.4 %.

mod common;

use std::path::{Path, PathBuf};

use finalgather::image::Image;
use finalgather::image::compare::{Selection, compare, mask_of};
use finalgather::render::Render;
use finalgather::scene::{Loaded, World};
use finalgather::settings::{PhotonMapKind, Settings};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/buildings").join(name)
}

/// A view with the settings of its file.
fn picture(view: &str, change: impl FnOnce(&mut Settings)) -> Image {
    let Loaded { world, settings, .. } = World::load(&file(&format!("{view}.toml"))).unwrap();
    let settings = settings.with(change);
    let mut render = Render::new(&common::gpu(), &world, &settings).unwrap();
    while !render.is_done() {
        render.step().unwrap();
    }
    render.picture()
}

/// Red, green and blue, averaged over squares of pixels to the size of `like`.
fn averaged(picture: &Image, like: &Image) -> Image {
    let side = picture.width / like.width;
    assert_eq!([picture.width, picture.height], [side * like.width, side * like.height]);
    let mut means = like.clone();
    means.channels.retain(|channel| ["R", "G", "B"].contains(&channel.name.as_str()));
    for channel in &mut means.channels {
        let samples = picture.channel(&channel.name).unwrap();
        for (i, mean) in channel.samples.iter_mut().enumerate() {
            let (x, y) = (i % like.width * side, i / like.width * side);
            let square = (0..side * side).map(|k| samples[(y + k / side) * picture.width + x + k % side]);
            *mean = square.sum::<f32>() / (side * side) as f32;
        }
    }
    means
}

/// Bias and RMSE of the means against path tracing, as shares of its mean.
fn error_of(view: &str, picture: &Image) -> [f64; 2] {
    let reference = Image::read(&file(&format!("{view}.exr"))).unwrap();
    let mask = mask_of(&Image::read(&file(&format!("{view}_mask.png"))).unwrap());
    let result = compare(&averaged(picture, &reference), &reference, Selection { mask: Some(&mask), trim: 0.0 }).unwrap();
    println!("{view}: bias {:+.2} %, RMSE {:.2} %", 100.0 * result.bias, 100.0 * result.relative_rmse);
    [result.bias, result.relative_rmse]
}

/// With half as many pixels on a side as the file asks for.
fn half(settings: &mut Settings) {
    settings.film.size = settings.film.size.map(|side| side / 2);
}

fn agrees(view: &str, most: [f64; 2]) {
    let [bias, rmse] = error_of(view, &picture(view, |_| ()));
    assert!(bias.abs() < most[0], "{view}: bias {bias}, at most {}", most[0]);
    assert!(rmse < most[1], "{view}: RMSE {rmse}, at most {}", most[1]);
}

/// Lamps are let into a hollow slab. With the grid, the light inside shows on the ceiling.
#[test]
fn an_office_with_a_hollow_slab() {
    agrees("office_a", [0.01, 0.03]);
    let [bias, _] = error_of("office_a", &picture("office_a", |s| (half(s), s.photons.map = PhotonMapKind::Grid).0));
    assert!(bias > 0.1, "the grid mixes what lies near each other: {bias}");
}

/// The floor runs on under all walls.
#[test]
fn a_maze_of_rooms() {
    agrees("maze_a", [0.01, 0.03]);
}

/// Few directions leave by the window.
#[test]
fn a_room_lit_through_a_window() {
    agrees("window_a", [0.01, 0.02]);
}

/// The dark room has light by way of the door alone.
#[test]
fn a_dark_room_beside_a_bright_one() {
    agrees("doors_b", [0.01, 0.03]);
}

/// Few directions meet the sun.
#[test]
fn a_court_in_the_sun() {
    agrees("sun_a", [0.01, 0.02]);
}

/// Nothing gets through walls, neither of a house under an even sky nor of sheets of two centimetres.
#[test]
fn sealed_rooms_are_black() {
    for view in ["house_b", "thin_b"] {
        let picture = picture(view, half);
        let most = picture.rgb().unwrap().into_iter().flatten().copied().fold(0.0, f32::max);
        let seen = picture.channel("A").unwrap().iter().copied().fold(1.0, f32::min);
        println!("{view}: at most {most}");
        assert_eq!(seen, 1.0, "{view}: the camera sees walls everywhere");
        // The sky has radiance 3.
        assert!(most < 0.003, "{view}: {most}");
    }
}
