//! A picture beside what it is made of and what it should be: direct light only, the photon map seen directly, path tracing.

use finalgather::{Image, Pipeline, WriteOptions};
use serde::{Deserialize, Serialize};

use crate::figure::{Figure, Format, Result, Task};
use crate::html::{panel, percent, seconds, table};
use crate::picture::{Pictures, cropped, sum_of};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    scene: String,
    /// Path of the path-traced picture, without its ending.
    reference: String,
    size: u32,
    directions: u32,
    pipeline: Pipeline,
    /// Relative RMSE against path tracing, up to which both agree.
    limit: f64,
    /// Parts that are shown enlarged.
    #[serde(default)]
    crops: Vec<Crop>,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Crop {
    name: String,
    /// Left, top and side, as shares of the picture's.
    place: [f32; 3],
    /// In stops, more than the picture's.
    exposure: f32,
    caption: String,
}

#[derive(Serialize, Deserialize)]
pub struct PictureComparison {
    size: u32,
    pub directions: u32,
    pipeline: Pipeline,
    points: u32,
    triangles: usize,
    /// Of the picture that is held against path tracing: larger ones are averaged to it.
    compared_size: usize,
    pub error: Error,
    pub seconds: Seconds,
    /// The picture first.
    panels: Vec<Panel>,
    crops: Vec<Enlarged>,
}

/// Against path tracing.
#[derive(Serialize, Deserialize)]
pub struct Error {
    pub bias: f64,
    pub relative_rmse: f64,
    pub flip: f64,
    /// Of direct light only and of the photon map seen directly.
    direct_only: f64,
    pub photon_map: f64,
    /// Within the limit.
    pub holds: bool,
}

#[derive(Serialize, Deserialize)]
pub struct Seconds {
    photons: f64,
    visible_points: f64,
    direct: f64,
    gather: f64,
}

#[derive(Serialize, Deserialize)]
struct Panel {
    file: String,
    label: String,
}

#[derive(Serialize, Deserialize)]
struct Enlarged {
    caption: String,
    panels: Vec<Panel>,
}

impl Figure for PictureComparison {
    const KIND: &'static str = "comparison";
    const FORMAT: Format = Format::Html;
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let pictures = Pictures::of(&parameters.scene, &parameters.reference)?;
        // A power of two, so that pictures can be averaged to each other's size.
        let size = task.scale.of(parameters.size, 32).next_power_of_two();
        let directions = task.scale.of(parameters.directions, 8);
        let exposure = pictures.loaded().settings.exposure;
        let mut settings = pictures.settings(directions);
        (settings.size, settings.pipeline) = ([size; 2], parameters.pipeline);
        let (picture, statistics) = pictures.render(&settings)?;

        let direct = sum_of(&picture, &["Direct", "Emission"])?;
        let photon_map = sum_of(&picture, &["PhotonMap", "Emission"])?;
        let indirect = sum_of(&picture, &["Indirect"])?;
        let (found, map) = pictures.map_against_path_tracing(&picture, exposure)?;
        let relative_rmse = |picture: &Image| Ok(pictures.against_path_tracing(picture)?.relative_rmse) as Result<f64>;
        let error = Error {
            bias: found.bias,
            relative_rmse: found.relative_rmse,
            flip: found.flip,
            direct_only: relative_rmse(&direct)?,
            photon_map: relative_rmse(&photon_map)?,
            holds: found.relative_rmse <= parameters.limit,
        };

        let write_at = |name: &str, label: &str, picture: &Image, exposure: f32| -> Result<Panel> {
            let (file, path) = task.picture_file(name);
            picture.write(&path, &WriteOptions { exposure, ..WriteOptions::default() })?;
            Ok(Panel { file, label: label.into() })
        };
        let write = |name: &str, label: &str, picture: &Image| write_at(name, label, picture, exposure);
        let gathered = format!("Final gathering, {directions} directions");
        let path_traced = pictures.path_traced();
        let mut panels = vec![
            write("picture", &gathered, &picture)?,
            write("direct", "Direct light only", &direct)?,
            write("photon_map", "The photon map, seen directly", &photon_map)?,
            write("path_traced", "Path traced (Mitsuba 3)", path_traced)?,
        ];
        let (file, path) = task.picture_file("difference");
        map.write(&path)?;
        panels.push(Panel { file, label: format!("What the eye tells apart: FLIP, mean {:.3}", found.flip) });

        let enlarge = |crop: &Crop| -> Result<Enlarged> {
            let parts = [
                ("picture", "Final gathering", &picture),
                ("path_traced", "Path traced", path_traced),
                ("indirect", "Indirect light alone", &indirect),
                ("photon_map", "The photon map", &photon_map),
            ];
            let part = |&(name, label, picture): &(&str, &str, &Image)| {
                write_at(&format!("{}-{name}", crop.name), label, &cropped(picture, crop.place)?, exposure + crop.exposure)
            };
            Ok(Enlarged { caption: crop.caption.clone(), panels: parts.iter().map(part).collect::<Result<_>>()? })
        };
        let stages = statistics.seconds;
        Ok(Self {
            size,
            directions,
            pipeline: parameters.pipeline,
            points: statistics.gather.points,
            triangles: statistics.scene.triangles,
            compared_size: picture.width.min(path_traced.width),
            error,
            seconds: Seconds {
                photons: stages.photons,
                visible_points: stages.visible_points,
                direct: stages.direct,
                gather: stages.gather,
            },
            panels,
            crops: parameters.crops.iter().map(enlarge).collect::<Result<_>>()?,
        })
    }

    fn draw(&self, parameters: &Parameters) -> Result<String> {
        let panels = |panels: &[Panel]| panels.iter().map(|Panel { file, label }| panel(file, label)).collect::<String>();
        let crop = |crop: &Enlarged| format!("<p>{}</p>\n<div class=\"crops\">\n{}</div>\n", crop.caption, panels(&crop.panels));
        let crops: String = self.crops.iter().map(crop).collect();
        let Self { error, seconds: stages, size, compared_size: compared, .. } = self;
        let total = stages.photons + stages.visible_points + stages.direct + stages.gather;
        let agrees = if error.holds { "agree" } else { "do <strong>not</strong> agree" };
        let numbers = table(
            &["", "relative RMSE", "bias", "FLIP"],
            [
                vec!["Final gathering".into(), percent(error.relative_rmse), percent(error.bias), format!("{:.3}", error.flip)],
                vec!["Photon map seen directly".into(), percent(error.photon_map), String::new(), String::new()],
                vec!["Direct light only".into(), percent(error.direct_only), String::new(), String::new()],
            ],
        );
        let times = table(
            &["photons", "visible points", "direct light", "final gathering", "all"],
            [[stages.photons, stages.visible_points, stages.direct, stages.gather, total].map(seconds).to_vec()],
        );
        Ok(format!(
            "<div class=\"panels\">\n{}</div>\n{crops}<p>{size} × {size} pixels, {} triangles, {} visible points, pipeline <code>{}</code>. \
             Against path tracing at {compared} × {compared}, without lamps, two pixels around them and the worst 0.1 % of the others, both {agrees} within {}:</p>\n\
             {numbers}{times}",
            panels(&self.panels),
            self.triangles,
            self.points,
            self.pipeline.name(),
            crate::plot::percent(parameters.limit),
        ))
    }
}
