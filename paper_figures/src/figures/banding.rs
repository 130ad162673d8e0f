//! Bands: the structured error of few shared directions, and interleaved subsets against it.

use finalgather::{Image, Pipeline, Settings};
use serde::{Deserialize, Serialize};

use crate::figure::{Figure, Result, Task};
use crate::picture::Pictures;
use crate::plot::{self, Axis, Curve};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Sides of squares of pixels.
    interleaves: Vec<u32>,
    /// Directions to a pixel.
    few: Vec<u32>,
    /// Directions in all.
    many: Vec<u32>,
    /// Of the profiles: the row, counted from the top, and its pixels, clear of boxes and edges; and one of `few`.
    row: usize,
    columns: [usize; 2],
    shown: u32,
}

#[derive(Serialize, Deserialize)]
pub struct Banding {
    runs: Vec<Run>,
    /// Along one row of the back wall, with [`Parameters::shown`] directions to a pixel.
    profiles: Vec<Profile>,
}

#[derive(Serialize, Deserialize)]
struct Run {
    interleave: u32,
    directions: u32,
    directions_per_pixel: u32,
    bias: f64,
    relative_rmse: f64,
    flip: f64,
    /// Share of the squared error that is left of it after averaging over 8 x 8 pixels: 1/64 of noise, all of wide bands.
    correlated: f64,
    /// Of a machine that may be shared.
    gather_seconds: f64,
}

#[derive(Serialize, Deserialize)]
struct Profile {
    name: String,
    /// Green radiance of the pixels.
    radiance: Vec<f32>,
}

impl Figure for Banding {
    const KIND: &'static str = "banding";
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let scale = task.scale;
        let pictures = Pictures::new()?;
        let (mut runs, mut profiles) = (Vec::new(), Vec::new());
        for &interleave in &parameters.interleaves {
            let squares = interleave * interleave;
            let few = parameters.few.iter().map(|&count| (count, count * squares));
            for (per_pixel, directions) in few.chain(parameters.many.iter().map(|&all| (all / squares, all))) {
                let directions = scale.of(directions, squares);
                // Exact rays, so that no aliasing of layers is in it.
                let settings = Settings { pipeline: Pipeline::Raycast, interleave, ..pictures.settings(directions) };
                let (picture, statistics) = pictures.render(&settings)?;
                let error = pictures.against_path_tracing(&picture)?;
                runs.push(Run {
                    interleave,
                    directions,
                    directions_per_pixel: directions / squares,
                    bias: error.bias,
                    relative_rmse: error.relative_rmse,
                    flip: error.flip,
                    correlated: pictures.correlated(&picture)?,
                    gather_seconds: statistics.seconds.gather,
                });
                if per_pixel == parameters.shown {
                    profiles.push(profile(name(interleave), &picture, parameters)?);
                }
            }
        }
        profiles.push(profile("path traced".into(), pictures.path_traced(), parameters)?);
        Ok(Self { runs, profiles })
    }

    fn draw(&self, parameters: &Parameters) -> Result<String> {
        let colors = [plot::ORANGE, plot::BLUE, plot::GREEN, plot::GREY];
        let curve = |(&interleave, &color): (&u32, &plot::RGBColor)| {
            let mut points: Vec<_> = self.runs.iter().filter(|run| run.interleave == interleave).collect();
            points.sort_by_key(|run| run.directions_per_pixel);
            let points = points.into_iter().map(|run| (run.directions_per_pixel.into(), run.relative_rmse)).collect();
            Curve { name: name(interleave), color, faint: false, points }
        };
        let errors: Vec<Curve> = parameters.interleaves.iter().zip(&colors).map(curve).collect();
        let along: Vec<Curve> = (self.profiles.iter().zip(colors))
            .map(|(profile, color)| Curve {
                name: profile.name.clone(),
                color,
                faint: false,
                points: (parameters.columns[0]..)
                    .zip(&profile.radiance)
                    .map(|(x, &radiance)| (x as f64, radiance.into()))
                    .collect(),
            })
            .collect();
        plot::svg((900, 860), |area| {
            let (above, below) = area.split_vertically(430);
            let [xs, ys] = plot::values(&errors);
            let x = Axis::log("directions to a pixel", xs.into_iter(), plot::whole);
            let y = Axis::log("against path tracing", ys.into_iter(), plot::percent);
            plot::lines(&above, "Relative RMSE of the Cornell box, 256 x 256", [&x, &y], &errors)?;
            let [xs, ys] = plot::values(&along);
            let x = Axis::linear("pixel", xs.into_iter(), plot::whole);
            let y = Axis::linear("radiance, green", ys.into_iter(), |radiance| format!("{radiance:.2}"));
            let title = format!("A row of the back wall, {} directions to a pixel", parameters.shown);
            plot::lines(&below, &title, [&x, &y], &along)
        })
    }
}

fn name(interleave: u32) -> String {
    if interleave == 1 { "shared by all".into() } else { format!("squares of {interleave}") }
}

fn profile(name: String, picture: &Image, parameters: &Parameters) -> Result<Profile> {
    let [_, green, _] = picture.rgb()?;
    let [first, end] = parameters.columns;
    let row = &green[parameters.row * picture.width..][first..end];
    Ok(Profile { name, radiance: row.to_vec() })
}
