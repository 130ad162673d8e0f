//! Numbers from numbers: means, fitted lines, and where a curve meets a level.

use finalgather::bench::Deviation;
use glam::DVec3;

/// Mean over points and channels.
pub fn mean(values: &[DVec3]) -> f64 {
    values.iter().map(|value| value.element_sum()).sum::<f64>() / (3 * values.len()) as f64
}

/// Root mean squared difference over points and channels, as a share of the mean of `truth`.
pub fn relative_rmse(values: &[DVec3], truth: &[DVec3]) -> f64 {
    Deviation::between(values, truth).rmse
}

/// Slope and intercept of the line with the least squares of differences in y.
pub fn fit(points: &[(f64, f64)]) -> (f64, f64) {
    let mean = |of: &dyn Fn(f64, f64) -> f64| points.iter().map(|&(x, y)| of(x, y)).sum::<f64>() / points.len() as f64;
    let (x_mean, y_mean) = (mean(&|x, _| x), mean(&|_, y| y));
    let slope = mean(&|x, y| (x - x_mean) * (y - y_mean)) / mean(&|x, _| (x - x_mean).powi(2));
    (slope, y_mean - slope * x_mean)
}

/// Where a curve through `points`, ascending in x, falls or rises through `level`: linear between the logarithms of both. The last
/// place, because a curve may touch the level before it stays beyond.
pub fn crossing(points: &[(f64, f64)], level: f64) -> Option<f64> {
    let through = |pair: &[(f64, f64)]| {
        let [(x0, y0), (x1, y1)] = [pair[0], pair[1]].map(|(x, y)| (x.ln(), (y / level).ln()));
        (y0 * y1 <= 0.0 && y0 != y1).then(|| (x0 + (x1 - x0) * y0 / (y0 - y1)).exp())
    };
    points.windows(2).rev().find_map(through)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_are_on_straight_lines_in_logarithms() {
        // y = 100 / x² is 1 at 10.
        let points: Vec<_> = [1.0, 4.0, 16.0, 64.0].map(|x: f64| (x, 100.0 / (x * x))).into();
        assert!((crossing(&points, 1.0).unwrap() - 10.0).abs() < 1e-9);
        assert_eq!(crossing(&points, 1000.0), None);
        assert_eq!(crossing(&points[..1], 1.0), None);
    }
}
