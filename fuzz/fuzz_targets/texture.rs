//! Textures: PNG, JPEG, BMP and TGA.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| finalgather_fuzz::load("t.tga", bytes));
