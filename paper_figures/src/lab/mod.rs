//! Everything that calls the `finalgather` library: scenes, renders, exact gathers, and the names of its types.

pub mod cornell;
pub mod library;
pub mod machine;
pub mod numeric;
pub mod path_tracer;
pub mod pictures;
pub mod procedural;
pub mod slice;
