//! Everything that calls the `finalgather` library: scenes, renders, exact gathers, and the names of its types.

mod blocks;
mod cornell;
mod library;
mod machine;
mod numeric;
mod one_direction;
mod path_tracer;
mod pictures;
mod procedural;
mod slice;

pub use blocks::Blocks;
pub use cornell::{Cornell, PhotonGrid, cornell, directions, look_up};
pub use library::*;
pub use machine::{Machine, today};
pub use numeric::{crossing, fit, mean, relative_rmse};
pub use one_direction::{OneDirection, Peeled};
pub use path_tracer::PathTracer;
pub use pictures::{Measured, PhotonMapKind, Pictures, Stages, cropped, sum_of, write_small};
pub use procedural::{hills, plates, points_on};
pub use slice::{Look, Place, Point, Sight, Slice, Stage, Surface, Texel};
