//! A picture beside path tracing of about the same time, and beside the path-traced picture that errors are measured against.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::draw::{panel, percent, seconds, table};
use crate::figure::{Figure, Format, Result, Task};
use crate::lab::{Blocks, WriteOptions, in_repository};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    views: Vec<View>,
}

/// A view and its pictures by Mitsuba.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct View {
    name: String,
    scene: String,
    /// Means over squares of pixels, a path without its ending.
    blocks: String,
    directions: u32,
    /// Shown: the picture of the same time, with so many paths a pixel and so many seconds, and the one with many paths.
    short: String,
    short_paths: u32,
    short_seconds: f64,
    /// Relative RMSE of its means.
    short_rmse: f64,
    long: String,
}

#[derive(Serialize, Deserialize)]
pub struct BesidePaths {
    views: Vec<Found>,
}

#[derive(Serialize, Deserialize)]
struct Found {
    name: String,
    size: [usize; 2],
    directions: u32,
    /// From the file to the picture, on a machine that may be shared.
    seconds: f64,
    bias: f64,
    relative_rmse: f64,
    /// Ours, the short and the long one of path tracing.
    files: [String; 3],
}

impl Figure for BesidePaths {
    const FORMAT: Format = Format::Html;
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let find = |view: &View| -> Result<Found> {
            let directions = task.scale.of(view.directions, 8);
            let start = Instant::now();
            let blocks = Blocks::read(&view.scene, &view.blocks)?;
            let picture = blocks.render(directions)?;
            let seconds = start.elapsed().as_secs_f64();
            let error = blocks.against_path_tracing(&picture)?;
            let (file, path) = task.picture_file(&format!("{}-picture", view.name));
            picture.write(&path, &WriteOptions::default())?;
            let copied = |from: &str, name: &str| -> Result<String> {
                let (file, path) = task.picture_file(&format!("{}-{name}", view.name));
                std::fs::copy(in_repository(from), path)?;
                Ok(file)
            };
            Ok(Found {
                name: view.name.clone(),
                size: [picture.width, picture.height],
                directions,
                seconds,
                bias: error.bias,
                relative_rmse: error.relative_rmse,
                files: [file, copied(&view.short, "short")?, copied(&view.long, "long")?],
            })
        };
        Ok(Self { views: parameters.views.iter().map(find).collect::<Result<_>>()? })
    }

    fn draw(&self, parameters: &Parameters) -> Result<String> {
        let panels = |(found, view): (&Found, &View)| {
            let labels = [
                format!("Final gathering, {} directions, {}", found.directions, seconds(found.seconds)),
                format!("Path traced (Mitsuba 3), {} paths a pixel, {}", view.short_paths, seconds(view.short_seconds)),
                "Path traced, many paths".to_owned(),
            ];
            let panels: String = found.files.iter().zip(labels).map(|(file, label)| panel(file, &label)).collect();
            format!("<div class=\"panels compare\">\n{panels}</div>\n")
        };
        let rows = |(found, view): (&Found, &View)| {
            let [width, height] = found.size;
            let name = format!("{}, {width} × {height}", found.name.replace('_', " "));
            vec![name, percent(found.bias), percent(found.relative_rmse), percent(view.short_rmse)]
        };
        let views = || self.views.iter().zip(&parameters.views);
        let numbers = table(&["", "bias", "relative RMSE", "of path tracing of the same time"], views().map(rows));
        Ok(views().map(panels).collect::<String>() + &numbers)
    }
}
