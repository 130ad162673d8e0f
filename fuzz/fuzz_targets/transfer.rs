//! Radiance transfer: a fuzzed array with a sound description, and the reverse.
#![no_main]

use finalgather::export::parse_prt;
use finalgather_fuzz::check;

const ARRAY: &[u8] = include_bytes!("../seeds/transfer/prt.npy");
const ABOUT: &[u8] = include_bytes!("../seeds/transfer/prt.json");

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    for (array, about) in [(bytes, ABOUT), (ARRAY, bytes)] {
        check(parse_prt("prt.npy".as_ref(), array, about));
    }
});
