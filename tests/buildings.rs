//! Whole pictures of buildings at default settings, compared with path tracing (`reference/path_trace.py`). `reference/buildings.py` says what goes wrong
//! easily in each scene. References are means of squares of pixels, whose noise is at most 0.4 %.

mod common;

use common::blocks::Blocks;
use finalgather::settings::{PhotonMapKind, Settings};

const BUILDINGS: Blocks = Blocks("buildings");

/// With half as many pixels on a side as the file asks for.
fn half(settings: &mut Settings) {
    settings.film.size = settings.film.size.map(|side| side / 2);
}

/// Lamps are let into a hollow slab. With the grid, the light inside shows on the ceiling.
#[test]
fn an_office_with_a_hollow_slab() {
    BUILDINGS.agrees("office_a", [0.01, 0.03]);
    let [bias, _] =
        BUILDINGS.error_of("office_a", &BUILDINGS.picture("office_a", |s| (half(s), s.photons.map = PhotonMapKind::Grid).0));
    assert!(bias > 0.1, "the grid mixes what lies near each other: {bias}");
}

/// The floor runs on under all walls.
#[test]
fn a_maze_of_rooms() {
    BUILDINGS.agrees("maze_a", [0.01, 0.03]);
}

/// Few directions leave by the window.
#[test]
fn a_room_lit_through_a_window() {
    BUILDINGS.agrees("window_a", [0.01, 0.02]);
}

/// The dark room has light by way of the door alone.
#[test]
fn a_dark_room_beside_a_bright_one() {
    BUILDINGS.agrees("doors_b", [0.01, 0.03]);
}

/// Few directions meet the sun.
#[test]
fn a_court_in_the_sun() {
    BUILDINGS.agrees("sun_a", [0.01, 0.02]);
}

/// Nothing gets through walls, neither of a house under an even sky nor of sheets of two centimetres.
#[test]
fn sealed_rooms_are_black() {
    for view in ["house_b", "thin_b"] {
        let picture = BUILDINGS.picture(view, half);
        let most = picture.rgb().unwrap().into_iter().flatten().copied().fold(0.0, f32::max);
        let seen = picture.channel("A").unwrap().iter().copied().fold(1.0, f32::min);
        println!("{view}: at most {most}");
        assert_eq!(seen, 1.0, "{view}: the camera sees walls everywhere");
        // The sky has radiance 3.
        assert!(most < 0.003, "{view}: {most}");
    }
}
