//! The kinds of figures, a file or folder for each.

mod banding;
pub mod bench;
mod beside_paths;
mod causes;
pub mod comparison;
mod convergence;
mod figure1;
mod four_steps;
mod path_tracing;
pub mod photon_grid;
mod photon_maps;
pub mod scaling;
mod slices;
pub mod stop_fraction;
mod time_to_error;
pub mod times;

use crate::figure::Kind;
use crate::lab::Slice;

pub const KINDS: [Kind; 15] = [
    Kind::of::<Slice>("layers_of_a_slice"),
    Kind::of::<four_steps::FourSteps>("four_steps"),
    Kind::of::<comparison::PictureComparison>("comparison"),
    Kind::of::<beside_paths::BesidePaths>("beside_paths"),
    Kind::of::<times::Times>("times"),
    Kind::of::<convergence::Convergence>("convergence"),
    Kind::of::<photon_grid::PhotonGridErrors>("photon_grid"),
    Kind::of::<photon_maps::PhotonMaps>("photon_maps"),
    Kind::of::<stop_fraction::StopFraction>("stop_fraction"),
    Kind::of::<banding::Banding>("banding"),
    Kind::of::<causes::Causes>("causes"),
    Kind::of::<bench::SideBySide>("bench"),
    Kind::of::<path_tracing::PathTracing>("path_tracing"),
    Kind::of::<scaling::Scaling>("scaling"),
    Kind::of::<time_to_error::TimeToError>("time_to_error"),
];
