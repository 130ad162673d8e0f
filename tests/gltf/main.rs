//! Reading glTF: small files that use what the Khronos sample assets use, beside what a reference viewer shows of them.

mod build;
mod files;
mod geometry;
mod materials;
mod nodes;
mod packed;
