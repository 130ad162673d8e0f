//! The deviation of irradiances from an oracle's, and the median of repeated measurements.

use std::f64::consts::PI;

use glam::{DVec3, Vec4};
use serde::{Deserialize, Serialize};

/// Errors over all points and channels, as shares of the oracle's mean.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Deviation {
    /// mean |a - b| / mean b
    pub mean_difference: f64,
    /// mean (a - b) / mean b
    pub bias: f64,
    /// √ mean (a - b)² / mean b
    pub rmse: f64,
}

impl Deviation {
    pub fn between(found: &[DVec3], oracle: &[DVec3]) -> Self {
        let total = |of: &dyn Fn(DVec3) -> DVec3| -> f64 {
            found.iter().zip(oracle).map(|(found, oracle)| of(found - oracle).element_sum()).sum::<f64>()
        };
        let channels = 3.0 * oracle.len() as f64;
        let mean = oracle.iter().map(|oracle| oracle.element_sum()).sum::<f64>() / channels;
        Self {
            mean_difference: total(&|d| d.abs()) / channels / mean,
            bias: total(&|d| d) / channels / mean,
            rmse: (total(&|d| d * d) / channels).sqrt() / mean,
        }
    }
}

/// Irradiance from sums: π Σ L w / Σ w; 0 when no ray has weight.
pub fn irradiance(sum: Vec4) -> DVec3 {
    let sum = sum.as_dvec4();
    if sum.w > 0.0 { PI * sum.truncate() / sum.w } else { DVec3::ZERO }
}

/// The middle value, or the mean of the two middle values.
///
/// # Panics
/// When `values` is empty.
pub fn median(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len().is_multiple_of(2) { 0.5 * (values[middle - 1] + values[middle]) } else { values[middle] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians() {
        assert_eq!(median(&[3.0]), 3.0);
        assert_eq!(median(&[9.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 100.0, 2.0]), 3.0);
    }

    #[test]
    fn deviations_are_shares_of_the_oracles_mean() {
        // One point differs by +1 and one by -3; the mean is 4.
        let oracle = [DVec3::splat(2.0), DVec3::splat(6.0)];
        let found = [DVec3::splat(3.0), DVec3::splat(3.0)];
        let deviation = Deviation::between(&found, &oracle);
        assert_eq!(deviation, Deviation { mean_difference: 0.5, bias: -0.25, rmse: 5.0_f64.sqrt() / 4.0 });
    }
}
