//! Reading glTF: small files that use what the Khronos sample assets use, beside what a reference viewer shows of them.

mod build;
#[path = "../common/mod.rs"]
mod common;
mod files;
mod geometry;
mod materials;
mod nodes;
mod packed;
mod round_trip;
