//! Environments: Radiance and OpenEXR.
#![no_main]

use finalgather::Environment;
use finalgather_fuzz::check;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    for name in ["e.hdr", "e.exr"] {
        check(Environment::decode(name.as_ref(), bytes));
    }
});
