//! How the time of each way to gather grows with directions, points, layers' size, triangles and depth complexity; and where rays
//! win: with few points and many triangles, for a bundle costs a pass over all triangles however few points ask.
//!
//! Each step of a series is a bench of its own. Who took more than the budget in a round is left out of the larger steps.

use std::collections::BTreeSet;

use finalgather::bench::{Bench, Contestant, FUSED, Plan, Row, Where};
use finalgather::scene::Scene;
use finalgather::settings::LayerSize;
use finalgather::{Gpu, Settings};
use serde::{Deserialize, Serialize};

use crate::contestants::{all, color, crossing};
use crate::cornell;
use crate::figure::{Figure, Result, Task};
use crate::machine::gpu;
use crate::plot::{self, Area, Axis, Curve};
use crate::procedural::{hills, plates, points_on};

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
    pub crossover: Vec<Crossover>,
}

#[derive(Serialize, Deserialize)]
pub struct Series {
    /// What grows.
    pub of: String,
    /// What stays, in words.
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
    pub costs: Vec<Cost>,
    left_out: Vec<String>,
}

#[derive(Serialize, Deserialize)]
pub struct Cost {
    pub name: String,
    /// Of a round.
    seconds: f64,
    ms_per_direction: f64,
    /// In which every point gets one sample.
    pub ms_per_sample: f64,
    layers_max: u32,
    /// Against exact rays along the same directions; null for rays of each point's own.
    mean_difference: Option<f64>,
    bias: Option<f64>,
}

/// Where fused begins to be faster than rays, for one scene.
#[derive(Serialize, Deserialize)]
pub struct Crossover {
    triangles: usize,
    /// Which rays.
    rays: String,
    /// Number of points, between those measured; null where one of both is faster at all of them.
    points: Option<f64>,
    /// At the fewest points and at the most: the rays' time over that of fused.
    fused_is_faster: [f64; 2],
}

/// How a series is measured.
struct Recipe<'a> {
    of: &'static str,
    fixed: String,
    steps: &'a [u32],
    budget: f64,
    contestants: Vec<&'static Contestant>,
    /// The scene in unit space, the points, settings and plan of a step.
    step: &'a dyn Fn(u32) -> Result<(Scene, Where, Settings, Plan)>,
}

/// What casts rays one by one.
const RAYS: [&str; 3] = ["raycast-gl", "raycast", "raycast-cosine"];

impl Figure for Scaling {
    const KIND: &'static str = "scaling";
    type Parameters = Parameters;

    fn measure<'a>(parameters: &'a Parameters, task: &Task) -> Result<Self> {
        let scale = task.scale;
        let gpu = gpu()?;
        let cornell = cornell::load()?.world.flatten();
        let settings = |side: u32| Settings { size: [side; 2], photons: 100_000, ..Settings::default() };
        let plan = |directions| Plan { directions, rounds: 3, stages: false, converged: 0 };
        // A quarter of the steps at a quarter of the scale, and always two.
        let steps = |all: &'a [u32]| &all[..scale.of(all.len() as u32, 2) as usize];
        let budget = |seconds: f64| seconds * f64::from(scale.of(1000, 1)) / 1000.0;
        let few = scale.of(16, 8);

        let mut series = Vec::new();
        let mut add = |recipe: Recipe| -> Result<()> {
            series.push(recipe.measure(&gpu)?);
            Ok(())
        };
        add(Recipe {
            of: "directions",
            fixed: "Cornell box, 2^14 points".into(),
            steps: steps(&parameters.directions),
            budget: budget(12.0),
            contestants: all(),
            step: &|directions| {
                // Long rounds average by themselves.
                let plan = Plan { rounds: if directions < 1000 { 3 } else { 1 }, ..plan(directions) };
                Ok((cornell.clone(), Where::Camera, settings(128), plan))
            },
        })?;
        add(Recipe {
            of: "points",
            fixed: "Cornell box".into(),
            steps: steps(&parameters.sides),
            budget: budget(4.0),
            contestants: all(),
            step: &|side| {
                let directions = if side > 1000 { few / 2 } else { few };
                Ok((cornell.clone(), Where::Camera, settings(side), plan(directions)))
            },
        })?;
        add(Recipe {
            of: "layer size",
            fixed: "Cornell box, 2^16 points".into(),
            steps: steps(&parameters.layer_sizes),
            budget: budget(4.0),
            contestants: all(),
            step: &|layer_size| {
                Ok((
                    cornell.clone(),
                    Where::Camera,
                    Settings { layer_size: LayerSize::Texels(layer_size), ..settings(256) },
                    plan(few),
                ))
            },
        })?;
        add(Recipe {
            of: "triangles",
            fixed: "room with hills, 2^18 points".into(),
            steps: steps(&parameters.triangles),
            budget: budget(4.0),
            contestants: all(),
            step: &|triangles| Ok((hills(triangles), Where::Camera, settings(512), plan(few / 2))),
        })?;
        add(Recipe {
            of: "depth complexity",
            fixed: "pile of plates, 2^18 points on them".into(),
            steps: steps(&parameters.layers),
            budget: budget(4.0),
            contestants: all(),
            step: &|layers| {
                let scene = plates(layers);
                let points = points_on(&scene, 1 << 18);
                Ok((scene, Where::Points(points), settings(512), plan(few / 2)))
            },
        })?;

        let mut grids = vec![series.iter().find(|series| series.of == "triangles").ok_or("no triangles")?.times()];
        for &side in &parameters.crossover_sides {
            let contestants = all().into_iter().filter(|contestant| contestant.name == FUSED || RAYS.contains(&contestant.name));
            let recipe = Recipe {
                of: "triangles",
                fixed: format!("room with hills, {side} x {side} points"),
                steps: steps(&parameters.triangles),
                budget: budget(8.0),
                contestants: contestants.collect(),
                step: &|triangles| Ok((hills(triangles), Where::Camera, settings(side), plan(few / 2))),
            };
            let measured = recipe.measure(&gpu)?;
            grids.push(measured.times());
            series.push(measured);
        }
        Ok(Self { crossover: crossovers(grids.into_iter().flatten().collect()), series })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let panels: Vec<_> = self.series.iter().take(5).collect();
        plot::svg((900, 390 * (panels.len() as u32 + 1)), |area| {
            let areas = area.split_evenly((panels.len() + 1, 1));
            for (area, series) in areas.iter().zip(&panels) {
                series.draw(area)?;
            }
            self.draw_crossover(&areas[panels.len()])
        })
    }
}

impl Recipe<'_> {
    fn measure(&self, gpu: &Gpu) -> Result<Series> {
        let mut left_out = BTreeSet::new();
        let mut series =
            Series { of: self.of.into(), fixed: self.fixed.clone(), budget: self.budget, steps: Vec::new(), ended: None };
        for &at in self.steps {
            let (scene, points, settings, plan) = (self.step)(at)?;
            let contestants: Vec<_> =
                self.contestants.iter().copied().filter(|contestant| !left_out.contains(contestant.name)).collect();
            if contestants.is_empty() {
                series.ended = Some("nobody is left within the budget".into());
                break;
            }
            let measured = Bench::new(gpu, scene, &settings, points)
                .and_then(|bench| Ok((bench.measure(&contestants, plan)?, bench.point_count(), bench.triangle_count())));
            let (rows, points, triangles) = match measured {
                Ok(measured) => measured,
                // What a device cannot hold is a result too.
                Err(error) if !series.steps.is_empty() => {
                    series.ended = Some(error.to_string());
                    break;
                }
                Err(error) => return Err(error.into()),
            };
            eprintln!("  {} {at}, {}: {}", self.of, self.fixed, times(&rows));
            series.steps.push(Step {
                at,
                points,
                triangles,
                directions: plan.directions,
                layer_size: settings.layers(),
                rounds: plan.rounds,
                left_out: left_out.iter().map(|name: &&str| (*name).to_owned()).collect(),
                costs: rows.iter().map(Cost::of).collect(),
            });
            // By the fastest round, for others use the machine too.
            let slow = contestants.iter().zip(&rows).filter(|(_, row)| row.seconds_range[0] > self.budget);
            left_out.extend(slow.map(|(contestant, _)| contestant.name));
        }
        Ok(series)
    }
}

fn times(rows: &[Row]) -> String {
    rows.iter().map(|row| format!("{} {:.2}", row.name, row.ms_per_sample)).collect::<Vec<_>>().join(", ") + " ms"
}

impl Cost {
    fn of(row: &Row) -> Self {
        Self {
            name: row.name.clone(),
            seconds: row.seconds,
            ms_per_direction: row.ms_per_direction,
            ms_per_sample: row.ms_per_sample,
            layers_max: row.layers_max,
            mean_difference: row.same_rays.map(|same| same.mean_difference),
            bias: row.same_rays.map(|same| same.bias),
        }
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

impl Series {
    /// Of each step in which both were measured.
    fn times(&self) -> Vec<Duel> {
        let mut duels = Vec::new();
        for step in &self.steps {
            let time = |name: &str| step.costs.iter().find(|cost| cost.name == name).map(|cost| cost.ms_per_sample);
            for rays in RAYS {
                if let (Some(fused), Some(other)) = (time(FUSED), time(rays)) {
                    duels.push(Duel { triangles: step.triangles, points: step.points, rays, ratio: other / fused });
                }
            }
        }
        duels
    }

    fn draw(&self, area: &Area) -> Result<()> {
        let by_directions = self.of == "directions";
        let mut names: Vec<&str> = Vec::new();
        for cost in self.steps.iter().flat_map(|step| &step.costs) {
            if !names.contains(&cost.name.as_str()) {
                names.push(&cost.name);
            }
        }
        let curve = |name: &&str| {
            let points = self.steps.iter().filter_map(|step| {
                let cost = step.costs.iter().find(|cost| cost.name == *name)?;
                let x = if self.of == "points" { f64::from(step.points) } else { f64::from(step.at) };
                Some((x, if by_directions { cost.seconds } else { cost.ms_per_sample }))
            });
            Curve { name: (*name).to_owned(), color: color(name), faint: false, points: points.collect() }
        };
        let curves: Vec<_> = names.iter().map(curve).collect();
        let [x, y] = plot::values(&curves);
        let name = match self.of.as_str() {
            "directions" => "directions",
            "points" => "points",
            "layer size" => "texels along a layer's side",
            "triangles" => "triangles",
            _ => "plates",
        };
        let x = if self.steps.len() > 4 && self.of == "layer size" || self.of == "depth complexity" {
            Axis::log_at(name, &self.steps.iter().map(|step| f64::from(step.at)).collect::<Vec<_>>(), plot::whole)
        } else {
            Axis::log(name, x.into_iter(), plot::whole)
        };
        let y = Axis::log(if by_directions { "seconds" } else { "ms a sample" }, y.into_iter(), plot::short);
        let what = if by_directions { "Time of all directions" } else { "Time of one sample at every point" };
        plot::lines(area, &format!("{what}: {}", self.fixed), [&x, &y], &curves)
    }
}

/// For each scene and kind of rays, from duels at several numbers of points.
fn crossovers(duels: Vec<Duel>) -> Vec<Crossover> {
    let scenes: BTreeSet<_> = duels.iter().map(|duel| duel.triangles).collect();
    let mut crossovers = Vec::new();
    for triangles in scenes {
        for rays in RAYS {
            let of_both = duels.iter().filter(|duel| duel.triangles == triangles && duel.rays == rays);
            let mut curve: Vec<_> = of_both.map(|duel| (f64::from(duel.points), duel.ratio)).collect();
            curve.sort_by(|a, b| a.0.total_cmp(&b.0));
            if let (Some(first), Some(last)) = (curve.first(), curve.last()) {
                let (points, fused_is_faster) = (crossing(&curve, 1.0), [first.1, last.1]);
                crossovers.push(Crossover { triangles, rays: rays.to_owned(), points, fused_is_faster });
            }
        }
    }
    crossovers
}

impl Scaling {
    fn draw_crossover(&self, area: &Area) -> Result<()> {
        let curve = |rays: &&str| {
            let of_rays = self.crossover.iter().filter(|crossover| crossover.rays == **rays);
            let points = of_rays.filter_map(|crossover| Some((crossover.triangles as f64, crossover.points?)));
            Curve { name: format!("fused against {rays}"), color: color(rays), faint: false, points: points.collect() }
        };
        let curves: Vec<_> = RAYS.iter().map(curve).collect();
        // Axes over what was measured, for there may be no crossover at all.
        let grid = || self.series.iter().filter(|series| series.of == "triangles").flat_map(|series| &series.steps);
        let triangles = Axis::log("triangles", grid().map(|step| step.triangles as f64), plot::whole);
        let points = Axis::log("points", grid().map(|step| f64::from(step.points)), plot::whole);
        plot::lines(area, "Crossover: fused is faster above, rays below", [&triangles, &points], &curves)
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
