//! glTF, binary and text. The bytes tell which.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| finalgather_fuzz::load_model("m.glb", bytes));
