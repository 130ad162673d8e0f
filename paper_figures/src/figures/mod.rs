//! The figures, a file each.

mod banding;
mod bench;
mod causes;
mod convergence;
mod figure1;
mod photon_grid;
mod scaling;
mod stop_fraction;
mod time_to_error;

use crate::figure::Entry;

/// In the order in which they are made.
pub const FIGURES: [Entry; 9] = [
    Entry::of::<figure1::Figure1>(),
    Entry::of::<convergence::Convergence>(),
    Entry::of::<photon_grid::PhotonGridErrors>(),
    Entry::of::<stop_fraction::StopFraction>(),
    Entry::of::<banding::Banding>(),
    Entry::of::<causes::Causes>(),
    Entry::of::<bench::SideBySide>(),
    Entry::of::<scaling::Scaling>(),
    Entry::of::<time_to_error::TimeToError>(),
];
