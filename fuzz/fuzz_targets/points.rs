//! Points: PLY, NumPy and CSV.
#![no_main]

use finalgather::points::file::parse;
use finalgather_fuzz::check;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    for name in ["p.ply", "p.npy", "p.csv"] {
        check(parse(name.as_ref(), bytes));
    }
});
