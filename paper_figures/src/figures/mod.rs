//! The figures, a file each.

mod banding;
mod causes;
mod convergence;
mod photon_grid;
mod stop_fraction;

use crate::figure::Entry;

/// In the order in which they are made.
pub const FIGURES: [Entry; 5] = [
    Entry::of::<convergence::Convergence>(),
    Entry::of::<photon_grid::PhotonGridErrors>(),
    Entry::of::<stop_fraction::StopFraction>(),
    Entry::of::<banding::Banding>(),
    Entry::of::<causes::Causes>(),
];
