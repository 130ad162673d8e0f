//! The figures, a file each.

mod convergence;
mod photon_grid;

use crate::figure::Entry;

/// In the order in which they are made.
pub const FIGURES: [Entry; 2] = [Entry::of::<convergence::Convergence>(), Entry::of::<photon_grid::PhotonGridErrors>()];
