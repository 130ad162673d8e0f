//! Bands: the structured error of few shared directions, and interleaved subsets, which break it.

use serde::{Deserialize, Serialize};

use crate::draw::{Axis, Curve, Panel, Unit, plot, several};
use crate::figure::{Figure, Result, Task};
use crate::lab::{Image, Measured, Pictures, Pipeline, Squares};

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
    /// Along one row of the back wall.
    profiles: Vec<Profile>,
    /// To a pixel, of the profiles; fewer than [`Parameters::shown`] at a small scale.
    #[serde(default)]
    shown: Option<u32>,
}

#[derive(Serialize, Deserialize)]
struct Run {
    interleave: u32,
    directions: u32,
    directions_per_pixel: u32,
    #[serde(flatten)]
    measured: Measured,
    flip: f64,
    /// Share of the squared error that is left of it after averaging over 8 x 8 pixels: 1/64 of noise, all of wide bands.
    correlated: f64,
}

#[derive(Serialize, Deserialize)]
struct Profile {
    name: String,
    /// Green radiance of the pixels.
    radiance: Vec<f32>,
}

impl Figure for Banding {
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let pictures = Pictures::new()?;
        let (mut runs, mut profiles) = (Vec::new(), Vec::new());
        let mut shown = None;
        for &interleave in &parameters.interleaves {
            let squares = interleave * interleave;
            let few = parameters.few.iter().map(|&count| (count, count * squares));
            for (per_pixel, directions) in few.chain(parameters.many.iter().map(|&all| (all / squares, all))) {
                let directions = task.scale.of(directions, squares);
                // Exact rays, to exclude the aliasing of layers.
                let mut settings = pictures.settings(directions);
                (settings.gather.pipeline, settings.film.interleave) = (Pipeline::Raycast, Squares::Pixels(interleave));
                let found = pictures.measure(&settings)?;
                runs.push(Run {
                    interleave,
                    directions,
                    directions_per_pixel: directions / squares,
                    measured: found.measured(),
                    flip: found.error.flip,
                    correlated: pictures.correlated(&found.picture)?,
                });
                if per_pixel == parameters.shown {
                    shown = Some(directions / squares);
                    profiles.push(profile(name(interleave), &found.picture, parameters)?);
                }
            }
        }
        profiles.push(profile("path traced".into(), &pictures.path_traced, parameters)?);
        Ok(Self { runs, profiles, shown })
    }

    fn draw(&self, parameters: &Parameters) -> Result<String> {
        let colors = [plot::ORANGE, plot::BLUE, plot::GREEN, plot::GREY];
        let curve = |(&interleave, color): (&u32, plot::RGBColor)| {
            let mut runs: Vec<_> = self.runs.iter().filter(|run| run.interleave == interleave).collect();
            runs.sort_by_key(|run| run.directions_per_pixel);
            let points = runs.into_iter().map(|run| (run.directions_per_pixel, run.measured.relative_rmse));
            Curve::new(name(interleave), color, points)
        };
        let errors = parameters.interleaves.iter().zip(colors).map(curve).collect();
        let profile = |(profile, color): (&Profile, plot::RGBColor)| {
            Curve::new(&profile.name, color, (parameters.columns[0] as u32..).zip(profile.radiance.iter().copied()))
        };
        let profiles = self.profiles.iter().zip(colors).map(profile).collect();
        let along = [Axis::linear("pixel", Unit::Number), Axis::linear("radiance, green", Unit::Number)];
        let axes = [Axis::log("directions to a pixel", Unit::Number), Axis::log("against path tracing", Unit::Percent)];
        let title =
            format!("A row of the back wall, {} to a pixel", several(self.shown.unwrap_or(parameters.shown), "direction"));
        plot::svg([
            Panel::lines(430, "Relative RMSE of the Cornell box, 256 x 256", axes, errors),
            Panel::lines(430, title, along, profiles),
        ])
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
