//! Models that stand alone: PLY and STL.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    for name in ["m.ply", "m.stl"] {
        finalgather_fuzz::load_model(name, bytes);
    }
});
