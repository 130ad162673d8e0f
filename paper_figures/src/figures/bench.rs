//! All ways to gather side by side, as `finalgather bench` measures them: the time of a sample at every point, and its error.

use serde::{Deserialize, Serialize};

use crate::draw::{Axis, Bar, Panel, Unit, percent, plot};
use crate::figure::{Figure, Result, Task};
use crate::lab::{Bench, BenchPlan, CONTESTANTS, FUSED, Row, Settings, Where, cornell, gpu};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    size: u32,
    directions: u32,
    rounds: u32,
    /// Directions of the oracle that `converged` is held against.
    converged: u32,
}

#[derive(Serialize, Deserialize)]
pub struct SideBySide {
    size: u32,
    points: u32,
    triangles: usize,
    directions: u32,
    layer_size: u32,
    rounds: u32,
    /// Of the oracle that `converged` is held against.
    converged_directions: u32,
    pub rows: Vec<Row>,
    /// For each contestant, how many times as long it takes as fused for a sample at every point.
    fused_against: Vec<(String, f64)>,
}

impl Figure for SideBySide {
    type Parameters = Parameters;

    fn measure(&Parameters { size, directions, rounds, converged }: &Parameters, task: &Task) -> Result<Self> {
        let scale = task.scale;
        let size = scale.of(size, 64);
        let settings = Settings::default().with(|s| s.film.size = [size; 2]);
        let bench = Bench::new(&gpu()?, cornell()?, &settings, Where::Camera)?;
        let plan = BenchPlan { directions: scale.of(directions, 4), rounds, stages: true, converged: scale.of(converged, 256) };
        let rows = bench.measure(&CONTESTANTS.iter().collect::<Vec<_>>(), plan)?;
        for row in &rows {
            eprintln!("  {}: {:.2} ms a sample", row.name, row.ms_per_sample);
        }
        let fused = rows.iter().find(|row| row.name == FUSED).map(|row| row.ms_per_sample).ok_or("fused is not measured")?;
        Ok(Self {
            size,
            points: bench.point_count(),
            triangles: bench.triangle_count(),
            directions: plan.directions,
            layer_size: settings.layers(),
            rounds,
            converged_directions: plan.converged,
            fused_against: rows.iter().map(|row| (row.name.clone(), row.ms_per_sample / fused)).collect(),
            rows,
        })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let bar = |row: &Row| {
            let of_rays = row.same_rays.map(|same| format!("{} off exact rays", percent(same.mean_difference)));
            let error = of_rays.unwrap_or_else(|| "rays of its own".into());
            let rmse = row.converged.map_or(String::new(), |converged| format!(", RMSE {:.0} %", 100.0 * converged.rmse));
            Bar { name: row.name.clone(), values: vec![(row.ms_per_sample, format!("{:.2}: {error}{rmse}", row.ms_per_sample))] }
        };
        let title = format!("Cornell box, {0} x {0}, {1} directions, {2}² layers", self.size, self.directions, self.layer_size);
        let x = Axis::linear("ms for one sample at every point", Unit::Number);
        let bars = self.rows.iter().map(bar).collect();
        plot::svg([Panel::bars(130, title, x, 2.3, &[("ms a sample", plot::BLUE)], bars)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_contestant_has_a_colour_of_its_own() {
        for (i, a) in CONTESTANTS.iter().enumerate() {
            for b in &CONTESTANTS[..i] {
                assert!(plot::color(a.name) != plot::color(b.name), "{} and {}", a.name, b.name);
            }
        }
    }
}
