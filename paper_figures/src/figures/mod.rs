//! The figures, a file each.

mod convergence;

use crate::figure::Entry;

/// In the order in which they are made.
pub const FIGURES: [Entry; 1] = [Entry::of::<convergence::Convergence>()];
