//! Pictures to compare: OpenEXR and PNG.
#![no_main]

use finalgather::Image;
use finalgather_fuzz::check;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    for name in ["a.exr", "a.png"] {
        check(Image::decode(name.as_ref(), bytes));
    }
});
