//! What figures of time share: who is measured, and how each is drawn.

use finalgather::bench::{CONTESTANTS, Contestant, FUSED};

use crate::figures::path_tracing::PATHS;
use crate::plot::{self, RGBColor};

/// All that can be measured.
pub fn all() -> Vec<&'static Contestant> {
    CONTESTANTS.iter().collect()
}

/// The colour of a contestant, the same in all figures.
pub fn color(name: &str) -> RGBColor {
    match name {
        "kill" => plot::BLUE,
        "early-kill" => plot::SKY,
        FUSED => plot::ORANGE,
        "raycast-gl" => plot::PURPLE,
        "raycast" | PATHS => plot::GREEN,
        _ => plot::GREY,
    }
}

/// How far the layers of a gather are from exact rays, for a note beside its time.
pub fn error_note(mean_difference: Option<f64>) -> String {
    mean_difference.map_or("rays of its own".into(), |share| format!("{:.2} % off exact rays", 100.0 * share))
}

/// Where a curve through `points`, ascending in x, falls or rises through `level`: linear between the logarithms of both. The last
/// place, for a curve may touch the level before it stays beyond.
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

    #[test]
    fn every_contestant_has_a_colour_of_its_own() {
        for (i, a) in CONTESTANTS.iter().enumerate() {
            for b in &CONTESTANTS[..i] {
                assert!(color(a.name) != color(b.name), "{} and {}", a.name, b.name);
            }
        }
    }
}
