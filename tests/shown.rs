//! Whole pictures of what files say about lights and surfaces, compared with path tracing (`reference/path_trace.py`). `reference/shown.py` says what each
//! scene holds. References are means of squares of pixels.

mod common;

use common::blocks::Blocks;

const SHOWN: Blocks = Blocks("shown");

const MOST: [f64; 2] = [0.01, 0.025];

#[test]
fn plants_and_a_blind_in_the_sun() {
    SHOWN.agrees("blind", MOST);
}

#[test]
fn a_still_life_of_metal_and_varnish() {
    SHOWN.agrees("still_life", MOST);
}

#[test]
fn a_screen_as_the_only_lamp() {
    SHOWN.agrees("screen", MOST);
}

#[test]
fn a_hall_of_two_hundred_lamps() {
    SHOWN.agrees("hall", MOST);
}
