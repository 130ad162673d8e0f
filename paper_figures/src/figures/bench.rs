//! All ways to gather side by side, as `finalgather bench` measures them: the time of a sample at every point, and its error.

use finalgather::Settings;
use finalgather::bench::{Bench, FUSED, Plan, Row, Where};
use serde::{Deserialize, Serialize};

use crate::contestants::{self, error_note};
use crate::cornell;
use crate::figure::{Figure, Result, Task};
use crate::machine::gpu;
use crate::plot::{self, Axis, Bar};

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
    /// How many times as fast fused is, by the time for a sample at every point.
    fused_against: Vec<(String, f64)>,
}

impl Figure for SideBySide {
    const KIND: &'static str = "bench";
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let scale = task.scale;
        let scene = cornell::load()?.world.flatten();
        let size = scale.of(parameters.size, 64);
        let settings = Settings { size: [size; 2], ..Settings::default() };
        let bench = Bench::new(&gpu()?, scene, &settings, Where::Camera)?;
        let plan = Plan {
            directions: scale.of(parameters.directions, 4),
            rounds: parameters.rounds,
            stages: true,
            converged: scale.of(parameters.converged, 256),
        };
        let rows = bench.measure(&contestants::all(), plan)?;
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
            rounds: plan.rounds,
            converged_directions: plan.converged,
            fused_against: rows.iter().map(|row| (row.name.clone(), row.ms_per_sample / fused)).collect(),
            rows,
        })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let bar = |row: &Row| {
            let error = error_note(row.same_rays.map(|same| same.mean_difference));
            let rmse = row.converged.map_or(String::new(), |converged| format!(", RMSE {:.0} %", 100.0 * converged.rmse));
            Bar { name: row.name.clone(), values: vec![(row.ms_per_sample, format!("{:.2}: {error}{rmse}", row.ms_per_sample))] }
        };
        let bars: Vec<_> = self.rows.iter().map(bar).collect();
        let title = format!("Cornell box, {0} x {0}, {1} directions, {2}² layers", self.size, self.directions, self.layer_size);
        plot::svg((900, 130 + 44 * bars.len() as u32), |area| {
            // Room for what is written beyond the longest.
            let ends = bars.iter().map(|bar| 2.3 * bar.values[0].0);
            let x = Axis::linear("ms for one sample at every point", ends, plot::whole);
            plot::bars(area, &title, &x, &[("ms a sample", plot::BLUE)], &bars)
        })
    }
}
