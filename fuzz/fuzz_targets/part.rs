//! Checkpoints and parts of shards.
#![no_main]

use std::path::Path;

use finalgather::blocks::Part;
use finalgather::render::RenderMerge;
use finalgather_fuzz::check;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let path = Path::new("x.part");
    check(Part::parse(path, bytes).and_then(|part| RenderMerge::new(path, &part)?.add(path, &part)));
});
