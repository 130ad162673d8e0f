//! Pictures of buildings by the photon map in a grid and on surfaces, beside each other and against path tracing.

use serde::{Deserialize, Serialize};

use crate::draw::{panel, percent, several, table};
use crate::figure::{Figure, Format, Result, Task};
use crate::lab::{Image, PhotonMapKind, Pictures, Pipeline, WriteOptions, sum_of};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    views: Vec<View>,
    directions: u32,
    pipeline: Pipeline,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct View {
    name: String,
    scene: String,
    /// Path of the path-traced picture, without its ending: means of squares of pixels.
    reference: String,
    /// Of the panels, in stops.
    exposure: f32,
}

#[derive(Serialize, Deserialize)]
pub struct PhotonMaps {
    directions: u32,
    photons: u64,
    /// Side of the squares of pixels whose means are compared.
    square: usize,
    rows: Vec<Row>,
}

/// A view by one photon map.
#[derive(Serialize, Deserialize)]
struct Row {
    view: String,
    map: PhotonMapKind,
    /// Against path tracing, of means of squares of pixels.
    bias: f64,
    relative_rmse: f64,
    picture: String,
    /// The map seen directly.
    photon_map: String,
}

impl Figure for PhotonMaps {
    const FORMAT: Format = Format::Html;
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let directions = task.scale.of(parameters.directions, 8);
        let (mut rows, mut photons, mut square) = (Vec::new(), 0, 0);
        for View { name, scene, reference, exposure } in &parameters.views {
            let pictures = Pictures::of(scene, reference)?;
            let mut settings = pictures.of_scene();
            photons = task.scale.of(settings.photons.count as u32, 10_000).into();
            (settings.directions.count, settings.gather.pipeline, settings.photons.count) =
                (directions, parameters.pipeline, photons);
            for map in [PhotonMapKind::Grid, PhotonMapKind::Surface] {
                let picture = pictures.render(&settings.with(|s| s.photons.map = map))?.0;
                square = picture.width / pictures.path_traced.width;
                let error = pictures.against_path_tracing(&picture)?;
                let write = |part: &str, picture| -> Result<String> {
                    let (file, path) = task.picture_file(&format!("{name}-{}-{part}", label(map)));
                    Image::write(picture, &path, &WriteOptions { exposure: *exposure, ..WriteOptions::default() })?;
                    Ok(file)
                };
                rows.push(Row {
                    view: name.clone(),
                    map,
                    bias: error.bias,
                    relative_rmse: error.relative_rmse,
                    picture: write("picture", &picture)?,
                    photon_map: write("photon_map", &sum_of(&picture, &["PhotonMap", "Emission"])?)?,
                });
            }
        }
        Ok(Self { directions, photons, square, rows })
    }

    fn draw(&self, _: &Parameters) -> Result<String> {
        let panels = |row: &Row| {
            let of = format!("{}, {}", row.view, label(row.map));
            panel(&row.picture, &of) + &panel(&row.photon_map, &format!("{of}: the map, seen directly"))
        };
        let row = |row: &Row| vec![row.view.clone(), label(row.map).into(), percent(row.bias), percent(row.relative_rmse)];
        Ok(format!(
            "<div class=\"panels\">\n{}</div>\n<p>{}, {} photons, exact rays. Means of {4} x {4} pixels against path tracing, without \
             lamps:</p>\n{}",
            self.rows.iter().map(panels).collect::<String>(),
            several(self.directions, "direction"),
            self.photons,
            table(&["view", "photon map", "bias", "relative RMSE"], self.rows.iter().map(row)),
            self.square,
        ))
    }
}

fn label(map: PhotonMapKind) -> &'static str {
    match map {
        PhotonMapKind::Grid => "grid",
        PhotonMapKind::Surface => "surface",
    }
}
