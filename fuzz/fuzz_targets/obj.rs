//! Models.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| finalgather_fuzz::load("m.obj", bytes));
