//! Scene files.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| finalgather_fuzz::load("s.toml", bytes));
