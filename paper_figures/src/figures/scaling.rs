//! How the time of each way to gather grows with directions, points, the size of layers, triangles and depth complexity. Rays win where
//! points are few and triangles many: a bundle costs a pass over all triangles, however few the points.
//!
//! Each step of a series is a bench. A contestant that takes more than the budget in a round is left out of the larger steps.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::draw::{Axis, Curve, Panel, Unit, plot};
use crate::figure::{Figure, Result, Task};
use crate::lab::{
    Bench, BenchPlan, CONTESTANTS, Contestant, FUSED, Gpu, LayerSize, Row, Scene, Settings, Where, cornell, crossing, gpu, hills,
    plates, points_on,
};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    directions: Vec<u32>,
    /// Sides of pictures.
    sides: Vec<u32>,
    layer_sizes: Vec<u32>,
    triangles: Vec<u32>,
    layers: Vec<u32>,
    /// Sides of pictures between which the crossover is looked for; the series of triangles adds 512.
    crossover_sides: Vec<u32>,
}

#[derive(Serialize, Deserialize)]
pub struct Scaling {
    pub series: Vec<Series>,
    crossover: Vec<Crossover>,
}

#[derive(Serialize, Deserialize)]
pub struct Series {
    /// What grows.
    pub of: String,
    /// The scene.
    fixed: String,
    /// Seconds of the fastest round, beyond which a contestant is left out of larger steps.
    budget: f64,
    pub steps: Vec<Step>,
    /// Why there are no larger steps, where some are missing.
    ended: Option<String>,
}

#[derive(Serialize, Deserialize)]
pub struct Step {
    at: u32,
    pub points: u32,
    pub triangles: usize,
    directions: u32,
    layer_size: u32,
    rounds: u32,
    costs: Vec<Cost>,
    left_out: Vec<String>,
}

#[derive(Serialize, Deserialize)]
struct Cost {
    name: String,
    /// Of a round.
    seconds: f64,
    ms_per_direction: f64,
    /// In which every point gets one sample.
    ms_per_sample: f64,
    layers_max: u32,
    /// Against exact rays along the same directions; null for rays of each point's own.
    mean_difference: Option<f64>,
    bias: Option<f64>,
}

/// Where fused begins to be faster than rays, for one scene.
#[derive(Serialize, Deserialize)]
struct Crossover {
    triangles: usize,
    /// Which rays.
    rays: String,
    /// Number of points, between those measured; null where one of both is faster at all of them.
    points: Option<f64>,
    /// At the fewest points and at the most: the rays' time over that of fused.
    fused_is_faster: [f64; 2],
}

/// Contestants that cast rays one by one.
const RAYS: [&str; 3] = ["raycast-gl", "raycast", "raycast-cosine"];

/// What a step measures.
struct Setup {
    /// In unit space.
    scene: Scene,
    points: Where,
    settings: Settings,
    directions: u32,
    rounds: u32,
}

impl Figure for Scaling {
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let scale = task.scale;
        let (gpu, cornell) = (gpu()?, cornell()?);
        let few = scale.of(16, 8);
        // At the points of a picture.
        let setup = |scene, side: u32, directions| {
            let settings = Settings::default().with(|s| (s.film.size, s.photons.count) = ([side; 2], 100_000));
            Setup { scene, points: Where::Camera, settings, directions, rounds: 3 }
        };
        let in_box = |side, directions| setup(cornell.clone(), side, directions);
        let all: Vec<_> = CONTESTANTS.iter().collect();
        let with_rays = |contestant: &&&Contestant| contestant.name == FUSED || RAYS.contains(&contestant.name);
        let fused_and_rays: Vec<_> = all.iter().filter(with_rays).copied().collect();
        let series = |of, fixed: &str, steps: &[u32], seconds: f64, contestants, step: &dyn Fn(u32) -> Setup| {
            // A quarter of the steps at a quarter of the scale, and always two.
            let steps = &steps[..scale.of(steps.len() as u32, 2) as usize];
            let budget = seconds * f64::from(scale.of(1000, 1)) / 1000.0;
            Series { of, fixed: fixed.into(), budget, steps: Vec::new(), ended: None }.measured(&gpu, steps, contestants, step)
        };

        let Parameters { directions, sides, layer_sizes, triangles, layers, crossover_sides } = parameters;
        let mut found = vec![
            series("directions".into(), "Cornell box", directions, 12.0, &all, &|directions| {
                // Long rounds average by themselves.
                Setup { rounds: if directions < 1000 { 3 } else { 1 }, ..in_box(128, directions) }
            })?,
            series("points".into(), "Cornell box", sides, 4.0, &all, &|side| {
                in_box(side, if side > 1000 { few / 2 } else { few })
            })?,
            series("layer size".into(), "Cornell box", layer_sizes, 4.0, &all, &|size| {
                let mut setup = in_box(256, few);
                setup.settings.gather.layer_size = LayerSize::Texels(size);
                setup
            })?,
            series("triangles".into(), "room with hills", triangles, 4.0, &all, &|triangles| {
                setup(hills(triangles), 512, few / 2)
            })?,
            series("depth complexity".into(), "pile of plates", layers, 4.0, &all, &|layers| {
                let scene = plates(layers);
                let triangles: Vec<_> = (0..scene.mesh.triangles.len()).collect();
                let points = Where::Points(points_on(&scene, 1 << 18, true, &triangles));
                Setup { points, ..setup(scene, 512, few / 2) }
            })?,
        ];
        for &side in crossover_sides {
            found.push(series("triangles".into(), "room with hills", triangles, 8.0, &fused_and_rays, &|triangles| {
                setup(hills(triangles), side, few / 2)
            })?);
        }
        let duels = found.iter().filter(|series| series.of == "triangles").flat_map(Series::duels);
        Ok(Self { crossover: crossovers(duels.collect()), series: found })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        plot::svg(self.series.iter().take(5).map(Series::panel).chain([self.crossover_panel()]))
    }
}

impl Series {
    fn measured(
        mut self,
        gpu: &Gpu,
        steps: &[u32],
        contestants: &[&'static Contestant],
        step: &dyn Fn(u32) -> Setup,
    ) -> Result<Self> {
        let mut left_out = BTreeSet::new();
        for &at in steps {
            let Setup { scene, points, settings, directions, rounds } = step(at);
            let contestants: Vec<_> =
                contestants.iter().copied().filter(|contestant| !left_out.contains(contestant.name)).collect();
            if contestants.is_empty() {
                self.ended = Some("no contestant is left within the budget".into());
                break;
            }
            let plan = BenchPlan { directions, rounds, stages: false, converged: 0 };
            let measured = Bench::new(gpu, scene, &settings, points)
                .and_then(|bench| Ok((bench.measure(&contestants, plan)?, bench.point_count(), bench.triangle_count())));
            let (rows, points, triangles) = match measured {
                Ok(measured) => measured,
                // What a device cannot hold is a result too.
                Err(error) if !self.steps.is_empty() => {
                    self.ended = Some(error.to_string());
                    break;
                }
                Err(error) => return Err(error.into()),
            };
            let times: Vec<_> = rows.iter().map(|row| format!("{} {:.2}", row.name, row.ms_per_sample)).collect();
            eprintln!("  {} {at}, {}: {} ms", self.of, self.fixed, times.join(", "));
            let costs = rows.iter().map(Cost::of).collect();
            let names = left_out.iter().map(|&name: &&str| name.to_owned()).collect();
            let layer_size = settings.layers();
            self.steps.push(Step { at, points, triangles, directions, layer_size, rounds, costs, left_out: names });
            // By the fastest round, because others may use the machine too.
            let slow = contestants.iter().zip(&rows).filter(|(_, row)| row.seconds_range[0] > self.budget);
            left_out.extend(slow.map(|(contestant, _)| contestant.name));
        }
        Ok(self)
    }

    /// Of each step in which both were measured.
    fn duels(&self) -> Vec<Duel> {
        let duel = |step: &Step, rays| {
            let ratio = 1.0 / step.against(rays)?;
            Some(Duel { triangles: step.triangles, points: step.points, rays, ratio })
        };
        self.steps.iter().flat_map(|step| RAYS.into_iter().filter_map(move |rays| duel(step, rays))).collect()
    }

    /// With the points that were measured, unless they are what grows.
    fn scene_and_points(&self) -> String {
        let points = || self.steps.iter().map(|step| step.points);
        match points().min().zip(points().max()) {
            Some((least, most)) if self.of != "points" && least == most => format!("{}, {most} points", self.fixed),
            Some((least, most)) if self.of != "points" => format!("{}, {least} to {most} points", self.fixed),
            _ => self.fixed.clone(),
        }
    }

    fn panel(&self) -> Panel {
        let by_directions = self.of == "directions";
        let mut names: Vec<&str> = Vec::new();
        for cost in self.steps.iter().flat_map(|step| &step.costs) {
            if !names.contains(&cost.name.as_str()) {
                names.push(&cost.name);
            }
        }
        let curve = |name: &str| {
            let points = self.steps.iter().filter_map(|step| {
                let cost = step.cost(name)?;
                let x = if self.of == "points" { step.points } else { step.at };
                Some((x, if by_directions { cost.seconds } else { cost.ms_per_sample }))
            });
            Curve::new(name, plot::color(name), points)
        };
        let name = match self.of.as_str() {
            "layer size" => "texels along a layer's side",
            "depth complexity" => "plates",
            of => of,
        };
        let x = if self.steps.len() > 4 && self.of == "layer size" || self.of == "depth complexity" {
            Axis::log_at(name, Unit::Number, self.steps.iter().map(|step| step.at))
        } else {
            Axis::log(name, Unit::Number)
        };
        let y = Axis::log(if by_directions { "seconds" } else { "ms a sample" }, Unit::Number);
        let what = if by_directions { "Time of all directions" } else { "Time of one sample at every point" };
        Panel::lines(390, format!("{what}: {}", self.scene_and_points()), [x, y], names.into_iter().map(curve).collect())
    }
}

impl Step {
    fn cost(&self, name: &str) -> Option<&Cost> {
        self.costs.iter().find(|cost| cost.name == name)
    }

    /// The time of fused over that of these rays.
    pub fn against(&self, rays: &str) -> Option<f64> {
        Some(self.cost(FUSED)?.ms_per_sample / self.cost(rays)?.ms_per_sample)
    }
}

impl Cost {
    fn of(row: &Row) -> Self {
        let Row { ref name, seconds, ms_per_direction, ms_per_sample, layers_max, same_rays, .. } = *row;
        let (mean_difference, bias) = same_rays.map(|same| (same.mean_difference, same.bias)).unzip();
        Self { name: name.clone(), seconds, ms_per_direction, ms_per_sample, layers_max, mean_difference, bias }
    }
}

/// A scene's triangles, a number of points, and the time of a sample by fused and by one kind of rays.
struct Duel {
    triangles: usize,
    points: u32,
    rays: &'static str,
    /// The rays' time over that of fused.
    ratio: f64,
}

/// For each scene and kind of rays, from duels at several numbers of points.
fn crossovers(duels: Vec<Duel>) -> Vec<Crossover> {
    let scenes: BTreeSet<_> = duels.iter().map(|duel| duel.triangles).collect();
    let crossover = |triangles, rays: &str| {
        let of_both = duels.iter().filter(|duel| duel.triangles == triangles && duel.rays == rays);
        let mut curve: Vec<_> = of_both.map(|duel| (f64::from(duel.points), duel.ratio)).collect();
        curve.sort_by(|a, b| a.0.total_cmp(&b.0));
        let fused_is_faster = [curve.first()?.1, curve.last()?.1];
        Some(Crossover { triangles, rays: rays.to_owned(), points: crossing(&curve, 1.0), fused_is_faster })
    };
    scenes.into_iter().flat_map(|triangles| RAYS.map(|rays| crossover(triangles, rays))).flatten().collect()
}

impl Scaling {
    fn crossover_panel(&self) -> Panel {
        let curve = |rays: &str| {
            let of_rays = self.crossover.iter().filter(|crossover| crossover.rays == rays);
            let points = of_rays.filter_map(|crossover| Some((crossover.triangles as f64, crossover.points?)));
            Curve::new(format!("fused against {rays}"), plot::color(rays), points)
        };
        // The axes reach what was measured, because there may be no crossover at all.
        let grid = || self.series.iter().filter(|series| series.of == "triangles").flat_map(|series| &series.steps);
        let triangles = Axis::log("triangles", Unit::Number).over(grid().map(|step| step.triangles as f64));
        let points = Axis::log("points", Unit::Number).over(grid().map(|step| step.points.into()));
        let title = "Crossover: fused is faster above, rays below";
        Panel::lines(390, title, [triangles, points], RAYS.map(curve).into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn duel(triangles: usize, points: u32, ratio: f64) -> Duel {
        Duel { triangles, points, rays: RAYS[0], ratio }
    }

    #[test]
    fn the_crossover_lies_where_both_take_as_long() {
        // With 10 triangles as long at 200 points; with 1000 the rays are always faster.
        let found = crossovers(vec![duel(10, 400, 2.0), duel(1000, 400, 0.5), duel(10, 100, 0.5), duel(1000, 100, 0.1)]);
        assert_eq!(found.len(), 2);
        assert!((found[0].points.unwrap() - 200.0).abs() < 1e-9);
        assert_eq!(found[0].fused_is_faster, [0.5, 2.0]);
        assert_eq!((found[1].triangles, found[1].points), (1000, None));
    }
}
