//! The poster's claims, of `claims.toml`, beside the findings of a run. Each verdict is computed from the run's documents. A claim without
//! measurements of full scale is not judged.

use serde::Deserialize;

use crate::document::Document;
use crate::draw::{joined, percent, seconds, table};
use crate::figure::{Figure, Result, Scale};
use crate::figures::bench::SideBySide;
use crate::figures::comparison::PictureComparison;
use crate::figures::photon_grid::PhotonGridErrors;
use crate::figures::scaling::{Scaling, Step};
use crate::figures::stop_fraction::StopFraction;
use crate::figures::times::{OfPicture, Run, Times};
use crate::lab::{FUSED, PhotonSettings, Row};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Claims {
    claims: Vec<Claim>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Claim {
    /// What the poster says, or means.
    poster: String,
    measure: Option<String>,
    text: String,
    shown_by: Vec<String>,
}

/// The documents that a claim is judged by.
struct Evidence<'a> {
    documents: &'a [Document],
    /// Whether all documents that were asked for are of full scale.
    whole: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Verdict {
    Holds,
    InPart,
    DoesNotHold,
    /// Measured at less than full scale.
    NotAtThisScale,
    /// A measurement is missing.
    NotMeasured,
    /// No figure measures it.
    NotJudged,
}

impl Verdict {
    fn of(holds: bool) -> Self {
        if holds { Self::Holds } else { Self::DoesNotHold }
    }

    /// A class of the page's style, and words.
    fn shown(self) -> (&'static str, &'static str) {
        match self {
            Self::Holds => ("holds", "holds"),
            Self::InPart => ("part", "in part"),
            Self::DoesNotHold => ("not", "does not hold"),
            Self::NotAtThisScale => ("unknown", "not judged at this scale"),
            Self::NotMeasured => ("unknown", "not judged: not measured"),
            Self::NotJudged => ("unknown", "not judged"),
        }
    }
}

/// Largest mean difference of irradiance from exact rays along the same directions that aliasing of layers may make.
const ALIASING: f64 = 0.02;
/// Largest relative RMSE of a picture against path tracing.
const PICTURE: f64 = 0.02;

/// The values for a claim's text, and the verdict; `None` where the run lacks a measurement.
fn find(measure: &str, run: &mut Evidence) -> Option<(Vec<String>, Verdict)> {
    let (values, holds) = match measure {
        "projection" => {
            let off = [run.same_rays(FUSED)?.0, run.same_rays("kill")?.0];
            (off.map(percent).to_vec(), off.into_iter().all(|off| off < ALIASING))
        }
        "nearest layer" => {
            let layers = of_pictures(&run.of("times")?, |picture| Some(pipeline(picture, "kill")?.layers_mean))?;
            let bias = run.same_rays("kill")?.1;
            let layers = joined(layers.iter().map(|layers| format!("{layers:.1}")));
            (vec![layers, percent(bias)], bias.abs() < ALIASING / 4.0)
        }
        "kill" => {
            let errors = of_pictures(&run.of("times")?, |picture| Some(pipeline(picture, "kill")?.relative_rmse))?;
            (vec![joined(errors.iter().copied().map(percent))], errors.iter().all(|&error| error < PICTURE))
        }
        "stop fraction" => {
            let runs = run.of::<StopFraction>("stop_fraction")?.runs;
            let all = runs.iter().find(|run| run.stop_fraction == 0.0)?;
            let error = all.measured.relative_rmse;
            // One hundredth more error is not significant.
            let stopped = runs.iter().rfind(|run| run.measured.relative_rmse <= 1.01 * error)?;
            let saved = format!("{:.0} %", 100.0 * (1.0 - stopped.layers_mean / all.layers_mean));
            let [at, most] =
                [stopped, runs.last()?].map(|run| [run.stop_fraction, run.measured.relative_rmse].map(percent).to_vec());
            ([at, vec![percent(error), saved], most].concat(), stopped.stop_fraction > 0.0)
        }
        "photon map" => {
            let error = run.of::<PictureComparison>("figure2")?.error;
            let grid: PhotonGridErrors = run.of("photon_grid")?;
            let PhotonSettings { grid_cells, count, .. } = PhotonSettings::default();
            let count = run.scale("photon_grid")?.of(count as u32, 1);
            let kind = grid.kinds.iter().find(|kind| (kind.grid_cells, kind.photons) == (grid_cells, count))?;
            let (seen, gathered) = (kind.seen.noise, kind.gathered.noise);
            let values = [error.photon_map, error.relative_rmse, seen, gathered].map(percent);
            (values.to_vec(), error.holds.unwrap_or(false) && gathered < seen)
        }
        // Of a picture of the poster, the error is judged. The times are of other hardware.
        "figure2" | "figure3" => {
            let error = run.of::<PictureComparison>(measure)?.error;
            let times: Times = run.of("times")?;
            let is_it = |picture: &&OfPicture| picture.declared.name.to_lowercase().replace(' ', "") == measure;
            let of = |run: &Run| {
                format!("{} (gather {}) by <code>{}</code>", seconds(run.total), seconds(run.stages.gather), run.pipeline)
            };
            let times: Vec<_> = times.pictures.iter().find(is_it)?.runs.iter().map(of).collect();
            (vec![percent(error.relative_rmse), percent(error.bias), times.join(", ")], error.holds.unwrap_or(false))
        }
        "linear" => {
            let times: Times = run.of("times")?;
            let ratio = |run: &Run| {
                let (all, last) = *run.progress.last()?;
                let (_, half) = run.progress.iter().copied().find(|&(directions, _)| 2 * directions >= all)?;
                Some((run.pipeline.clone(), last / half))
            };
            let ratios = some(times.pictures.last()?.runs.iter().filter_map(ratio).collect())?;
            let text: Vec<_> = ratios.iter().map(|(name, ratio)| format!("{ratio:.2} by <code>{name}</code>")).collect();
            // One run on a machine that may be shared varies by a tenth.
            (vec![text.join(", ")], ratios.iter().all(|(_, ratio)| (1.8..2.2).contains(ratio)))
        }
        "early kill" => {
            let gain = |picture: &OfPicture| {
                Some(pipeline(picture, "kill")?.stages.gather / pipeline(picture, "early-kill")?.stages.gather)
            };
            let gains = of_pictures(&run.of("times")?, gain)?;
            let [early, kill] = [run.same_rays("early-kill")?.0, run.same_rays("kill")?.0].map(percent);
            (vec![joined(gains.iter().map(|gain| format!("{gain:.2}"))), early, kill], gains.iter().all(|&gain| gain > 1.0))
        }
        "ray shooting" => {
            let rays = run.row("raycast-gl")?.ms_per_sample;
            let [fused, kill] = [run.row(FUSED)?, run.row("kill")?].map(|row| row.ms_per_sample / rays);
            let scaling: Scaling = run.of("scaling")?;
            // The largest step that measured both, and the time of fused over that of the rays.
            let most = |of: &str| {
                let steps = &scaling.series.iter().find(|series| series.of == of)?.steps;
                steps.iter().rev().find_map(|step: &Step| Some((step, step.against("raycast-gl")?)))
            };
            let ((points, at_points), (triangles, at_triangles)) = (most("points")?, most("triangles")?);
            let points = match points.points {
                few @ ..1_000_000 => few.to_string(),
                many => format!("{:.1} million", f64::from(many) / 1e6),
            };
            let [fused_text, at_points_text] = [fused, at_points].map(|share| format!("{share:.2}"));
            let [kill_text, at_triangles_text] = [kill, at_triangles].map(|share| format!("{share:.1}"));
            let triangles = triangles.triangles.to_string();
            let values = vec![fused_text, at_points_text, points, kill_text, triangles, at_triangles_text];
            let always = [kill, fused, at_triangles].into_iter().all(|share| share < 1.0);
            if !always && (fused < 1.0 || at_points < 1.0) {
                return Some((values, Verdict::InPart));
            }
            (values, always)
        }
        other => unreachable!("claims.toml names no measurement {other}"),
    };
    Some((values, Verdict::of(holds)))
}

impl Evidence<'_> {
    /// The data of a figure.
    fn of<F: Figure>(&mut self, figure: &str) -> Option<F> {
        let document = self.documents.iter().find(|document| document.figure == figure)?;
        self.whole &= document.scale.is_whole();
        document.data()
    }

    fn scale(&self, figure: &str) -> Option<Scale> {
        self.documents.iter().find(|document| document.figure == figure).map(|document| document.scale)
    }

    /// A contestant's row of the bench.
    fn row(&mut self, name: &str) -> Option<Row> {
        self.of::<SideBySide>("bench")?.rows.into_iter().find(|row| row.name == name)
    }

    /// Its mean difference and bias against exact rays along the same directions.
    fn same_rays(&mut self, name: &str) -> Option<(f64, f64)> {
        self.row(name)?.same_rays.map(|same| (same.mean_difference, same.bias))
    }
}

fn pipeline<'a>(picture: &'a OfPicture, name: &str) -> Option<&'a Run> {
    picture.runs.iter().find(|run| run.pipeline == name)
}

fn of_pictures(times: &Times, of: impl Fn(&OfPicture) -> Option<f64>) -> Option<Vec<f64>> {
    some(times.pictures.iter().filter_map(of).collect())
}

/// `None` if empty, because nothing can be concluded from it.
fn some<T>(found: Vec<T>) -> Option<Vec<T>> {
    (!found.is_empty()).then_some(found)
}

impl Claim {
    fn all() -> Result<Vec<Self>> {
        Ok(toml::from_str::<Claims>(include_str!("../../claims.toml"))?.claims)
    }

    /// The finding and the verdict.
    fn judged(&self, documents: &[Document]) -> (String, Verdict) {
        let Some(measure) = &self.measure else { return (self.text.clone(), Verdict::NotJudged) };
        let mut evidence = Evidence { documents, whole: true };
        let Some((values, verdict)) = find(measure, &mut evidence) else {
            return ("The run lacks a measurement that this needs.".into(), Verdict::NotMeasured);
        };
        let text = values.iter().fold(self.text.clone(), |text, value| text.replacen("{}", value, 1));
        (text, if evidence.whole { verdict } else { Verdict::NotAtThisScale })
    }
}

/// As HTML.
pub fn claims_table(documents: &[Document]) -> Result<String> {
    let claims = Claim::all()?;
    let row = |(number, claim): (usize, &Claim)| {
        let (text, verdict) = claim.judged(documents);
        let (class, word) = verdict.shown();
        let files: Vec<_> = claim.shown_by.iter().map(|file| format!("<code>{file}</code>")).collect();
        let verdict = format!("<span class=\"verdict {class}\">{word}</span>");
        vec![(number + 1).to_string(), claim.poster.clone(), text, verdict, files.join("<br>")]
    };
    let rows = claims.iter().enumerate().map(row);
    Ok(format!("<div class=\"claims\">\n{}</div>\n", table(&["", "the poster", "measured", "", "where the test is"], rows)))
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;
    use crate::lab::in_repository;

    /// Of a recorded run: names of series, rows and pictures are those that the figures write.
    fn recorded() -> Vec<Document> {
        let files = std::fs::read_dir(in_repository("paper_figures/runs/2026-11-22-llvmpipe-2-cores")).unwrap();
        let paths = files.map(|entry| entry.unwrap().path()).filter(|path| path.extension().is_some_and(|end| end == "json"));
        paths.map(|path| Document::read(&path).unwrap()).collect()
    }

    fn verdicts(documents: &[Document]) -> Vec<Verdict> {
        Claim::all().unwrap().iter().map(|claim| claim.judged(documents).1).collect()
    }

    #[test]
    fn a_whole_run_judges_each_claim_that_a_figure_measures() {
        for claim in Claim::all().unwrap() {
            let (text, verdict) = claim.judged(&recorded());
            let judged = [Verdict::Holds, Verdict::InPart, Verdict::DoesNotHold].contains(&verdict);
            assert_eq!(claim.measure.is_some(), judged, "{text}");
            assert!(!text.contains('{'), "{text}");
        }
        let unmeasured = |claim: &Claim| if claim.measure.is_some() { Verdict::NotMeasured } else { Verdict::NotJudged };
        assert_eq!(verdicts(&[]), Claim::all().unwrap().iter().map(unmeasured).collect::<Vec<_>>());
    }

    #[test]
    fn a_run_at_less_than_full_scale_judges_nothing_but_shows_its_values() {
        let mut documents = recorded();
        documents.iter_mut().for_each(|document| document.scale = Scale(0.5));
        for claim in Claim::all().unwrap().iter().filter(|claim| claim.measure.is_some()) {
            let (text, verdict) = claim.judged(&documents);
            // Half the photons are in no recorded map.
            let expected =
                if claim.measure.as_deref() == Some("photon map") { Verdict::NotMeasured } else { Verdict::NotAtThisScale };
            assert_eq!(verdict, expected, "{text}");
            assert!(expected == Verdict::NotMeasured || text.contains(|c: char| c.is_ascii_digit()), "{text}");
        }
    }

    /// Makes all measurements alike, and errors larger and larger.
    fn spoil(key: &str, value: &mut Value, count: &mut u32) {
        match value {
            Value::Object(fields) => fields.iter_mut().for_each(|(key, value)| spoil(key, value, count)),
            Value::Array(values) => values.iter_mut().for_each(|value| spoil(key, value, count)),
            Value::Bool(holds) => *holds = false,
            Value::Number(number) if number.is_f64() && key == "relative_rmse" => {
                *count += 1;
                *value = f64::from(*count).into();
            }
            Value::Number(number) if number.is_f64() && key != "stop_fraction" => *value = 1.0.into(),
            _ => (),
        }
    }

    #[test]
    fn each_verdict_depends_on_measurements() {
        let spoilt = |document: Document| {
            let mut value = serde_json::to_value(&document).unwrap();
            spoil("", &mut value["data"], &mut 0);
            serde_json::from_value(value).unwrap()
        };
        let documents: Vec<_> = recorded().into_iter().map(spoilt).collect();
        for claim in Claim::all().unwrap().iter().filter(|claim| claim.measure.is_some()) {
            let [before, after] = [&recorded(), &documents].map(|documents| claim.judged(documents).1);
            assert!(before != after && after == Verdict::DoesNotHold, "{}: {before:?} and {after:?}", claim.poster);
        }
    }

    #[test]
    fn tests_that_claims_name_exist() {
        for file in Claim::all().unwrap().iter().flat_map(|claim| &claim.shown_by) {
            assert!(in_repository(file).is_file(), "{file}");
        }
    }
}
