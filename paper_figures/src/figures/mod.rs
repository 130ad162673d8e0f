//! The kinds of figures, a file each.

pub mod banding;
pub mod bench;
pub mod causes;
pub mod comparison;
pub mod convergence;
pub mod figure1;
pub mod path_tracing;
pub mod photon_grid;
pub mod scaling;
pub mod stop_fraction;
pub mod time_to_error;
pub mod times;

use crate::figure::Kind;

pub const KINDS: [Kind; 12] = [
    Kind::of::<figure1::Figure1>(),
    Kind::of::<comparison::PictureComparison>(),
    Kind::of::<times::Times>(),
    Kind::of::<convergence::Convergence>(),
    Kind::of::<photon_grid::PhotonGridErrors>(),
    Kind::of::<stop_fraction::StopFraction>(),
    Kind::of::<banding::Banding>(),
    Kind::of::<causes::Causes>(),
    Kind::of::<bench::SideBySide>(),
    Kind::of::<path_tracing::PathTracing>(),
    Kind::of::<scaling::Scaling>(),
    Kind::of::<time_to_error::TimeToError>(),
];
