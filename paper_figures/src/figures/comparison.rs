//! A picture beside direct light alone, the photon map seen directly, and the path-traced picture.

use serde::{Deserialize, Serialize};

use crate::draw::{panel, percent, seconds, short_percent, table};
use crate::figure::{Figure, Format, Result, Task};
use crate::lab::{Image, Pictures, Pipeline, Stages, WriteOptions, cropped, sum_of};

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
    directions: u32,
    pipeline: Pipeline,
    points: u32,
    triangles: usize,
    /// Side of the pictures that are compared: larger ones are averaged to it.
    compared_size: usize,
    pub error: Error,
    seconds: Stages,
    /// The picture first.
    panels: Vec<Panel>,
    crops: Vec<Enlarged>,
}

/// Against path tracing.
#[derive(Serialize, Deserialize)]
pub struct Error {
    pub bias: f64,
    pub relative_rmse: f64,
    flip: f64,
    /// Of direct light only and of the photon map seen directly.
    direct_only: f64,
    pub photon_map: f64,
    /// Within the limit; null where it is not judged, at less than full scale.
    pub holds: Option<bool>,
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
    const FORMAT: Format = Format::Html;
    type Parameters = Parameters;

    fn measure(parameters: &Parameters, task: &Task) -> Result<Self> {
        let pictures = Pictures::of(&parameters.scene, &parameters.reference)?;
        // A power of two, so that pictures can be averaged to each other's size.
        let size = task.scale.of(parameters.size, 32).next_power_of_two();
        let directions = task.scale.of(parameters.directions, 8);
        let mut settings = pictures.settings(directions);
        (settings.film.size, settings.gather.pipeline) = ([size; 2], parameters.pipeline);
        let exposure = settings.display.exposure.given();
        let (picture, statistics) = pictures.render(&settings)?;

        let direct = sum_of(&picture, &["Direct", "Emission"])?;
        let photon_map = sum_of(&picture, &["PhotonMap", "Emission"])?;
        let indirect = sum_of(&picture, &["Indirect"])?;
        let path_traced = &pictures.path_traced;
        let (found, map) = pictures.map_against_path_tracing(&picture, exposure)?;
        let relative_rmse = |picture: &Image| Ok(pictures.against_path_tracing(picture)?.relative_rmse) as Result<f64>;

        let write = |name: &str, label: &str, picture: &Image, more_exposure: f32| -> Result<Panel> {
            let (file, path) = task.picture_file(name);
            picture.write(&path, &WriteOptions { exposure: exposure + more_exposure, ..WriteOptions::default() })?;
            Ok(Panel { file, label: label.into() })
        };
        let mut panels = vec![
            write("picture", &format!("Final gathering, {directions} directions"), &picture, 0.0)?,
            write("direct", "Direct light only", &direct, 0.0)?,
            write("photon_map", "The photon map, seen directly", &photon_map, 0.0)?,
            write("path_traced", "Path traced (Mitsuba 3)", path_traced, 0.0)?,
        ];
        let (file, path) = task.picture_file("difference");
        map.write(&path)?;
        panels.push(Panel { file, label: format!("Visible differences: FLIP, mean {:.3}", found.flip) });

        let enlarge = |crop: &Crop| -> Result<Enlarged> {
            let parts = [
                ("picture", "Final gathering", &picture),
                ("path_traced", "Path traced", path_traced),
                ("indirect", "Indirect light alone", &indirect),
                ("photon_map", "The photon map", &photon_map),
            ];
            let part = |(name, label, picture): (&str, &str, &Image)| {
                write(&format!("{}-{name}", crop.name), label, &cropped(picture, crop.place)?, crop.exposure)
            };
            Ok(Enlarged { caption: crop.caption.clone(), panels: parts.into_iter().map(part).collect::<Result<_>>()? })
        };
        Ok(Self {
            size,
            directions,
            pipeline: parameters.pipeline,
            points: statistics.gather.points,
            triangles: statistics.scene.triangles,
            compared_size: picture.width.min(path_traced.width),
            error: Error {
                bias: found.bias,
                relative_rmse: found.relative_rmse,
                flip: found.flip,
                direct_only: relative_rmse(&direct)?,
                photon_map: relative_rmse(&photon_map)?,
                holds: task.scale.is_whole().then_some(found.relative_rmse <= parameters.limit),
            },
            seconds: Stages::of(&statistics),
            panels,
            crops: parameters.crops.iter().map(enlarge).collect::<Result<_>>()?,
        })
    }

    fn draw(&self, parameters: &Parameters) -> Result<String> {
        let panels = |panels: &[Panel]| panels.iter().map(|Panel { file, label }| panel(file, label)).collect::<String>();
        let crop = |crop: &Enlarged| format!("<p>{}</p>\n<div class=\"crops\">\n{}</div>\n", crop.caption, panels(&crop.panels));
        let crops: String = self.crops.iter().map(crop).collect();
        let Self { error, seconds: stages, size, compared_size: compared, .. } = self;
        let stages = [stages.photons, stages.visible_points, stages.direct, stages.gather];
        let limit = short_percent(parameters.limit);
        let verdict = match error.holds {
            Some(true) => format!("both agree within {limit}"),
            Some(false) => format!("both do <strong>not</strong> agree within {limit}"),
            None => format!("agreement within {limit} is not judged at this scale"),
        };
        let others = [("Photon map seen directly", error.photon_map), ("Direct light only", error.direct_only)];
        let others = others.map(|(name, rmse)| vec![name.into(), percent(rmse), String::new(), String::new()]);
        let first =
            vec!["Final gathering".into(), percent(error.relative_rmse), percent(error.bias), format!("{:.3}", error.flip)];
        let numbers = table(&["", "relative RMSE", "bias", "FLIP"], [first].into_iter().chain(others));
        let times = table(
            &["photons", "visible points", "direct light", "final gathering", "all"],
            [stages.into_iter().chain([stages.iter().sum()]).map(seconds).collect()],
        );
        Ok(format!(
            "<div class=\"panels compare\">\n{}</div>\n{crops}<p>{size} × {size} pixels, {} triangles, {} visible points, pipeline <code>{}</code>. \
             Against path tracing at {compared} × {compared}, without lamps, two pixels around them and the worst 0.1 % of the others, {verdict}:</p>\n\
             {numbers}{times}",
            panels(&self.panels),
            self.triangles,
            self.points,
            self.pipeline,
        ))
    }
}
