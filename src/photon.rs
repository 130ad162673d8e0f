//! Stand-in for the photon map: its counts.

use serde::Serialize;

#[derive(Clone, Debug, Default, Serialize)]
pub struct PhotonCounts {
    pub emitted: u64,
    pub stored: u64,
}
