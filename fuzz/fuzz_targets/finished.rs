//! Metadata in outputs about the job that made them.
#![no_main]

use std::env::temp_dir;
use std::fs;
use std::process::id;

use finalgather::export::metadata_of;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    // The metadata of a .npy are in a .json beside it.
    for (name, content) in [("x.ply", "x.ply"), ("x.exr", "x.exr"), ("x.npy", "x.json")] {
        let path = |name: &str| temp_dir().join(format!("finalgather-fuzz-{}-{name}", id()));
        for name in [name, content] {
            fs::write(path(name), bytes).expect("a temporary file can be written");
        }
        let _ = metadata_of(&path(name));
    }
});
