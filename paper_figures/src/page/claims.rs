//! The poster's claims beside the findings of a run. Each verdict is computed from the run's documents; without measurements of full scale
//! a claim is not judged.

use crate::document::Document;
use crate::draw::html;
use crate::draw::numbers::{joined, percent, seconds};
use crate::figure::Figure;
use crate::figures::bench::SideBySide;
use crate::figures::comparison::PictureComparison;
use crate::figures::photon_grid::PhotonGridErrors;
use crate::figures::scaling::{Scaling, Step};
use crate::figures::stop_fraction::StopFraction;
use crate::figures::times::{OfPicture, Run, Times};
use crate::lab::library::{FUSED, Row, Settings};

struct Claim {
    /// What the poster says, or means.
    poster: &'static str,
    /// `None` where the run lacks a measurement.
    found: fn(&mut Evidence) -> Option<(String, Verdict)>,
    /// Tests.
    shown_by: &'static [&'static str],
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
            Self::NotJudged => ("unknown", "not judged"),
        }
    }
}

/// Largest mean difference of irradiance from exact rays along the same directions that aliasing of layers may make.
const ALIASING: f64 = 0.02;
/// Largest relative RMSE of a picture against path tracing.
const PICTURE: f64 = 0.02;

const CLAIMS: [Claim; 12] = [
    Claim {
        poster: "“Expensive ray intersection can be regarded as a multi-layered parallel projection.”",
        found: |run| {
            let [fused, kill] = [FUSED, "kill"].map(|name| Some(run.row(name)?.same_rays?.mean_difference));
            let (fused, kill) = (fused?, kill?);
            let text = format!(
                "Along the same directions, irradiance is {} off exact rays by <code>fused</code>, {} by <code>kill</code>.",
                percent(fused),
                percent(kill)
            );
            Some((text, Verdict::of(fused.max(kill) < ALIASING)))
        },
        shown_by: &["tests/gl_hits.rs"],
    },
    Claim {
        poster: "“Each depth layer is projected from far to near and intersection points sample nearest depth layer.”",
        found: |run| {
            let layers = of_pictures(&run.times()?, |picture| Some(pipeline(picture, "kill")?.layers_mean))?;
            let bias = run.row("kill")?.same_rays?.bias;
            let text = format!(
                "{} layers a direction. The last sample of each point is its nearest hit: the mean is {} off exact rays.",
                joined(layers.iter().map(|layers| format!("{layers:.1}"))),
                percent(bias)
            );
            Some((text, Verdict::of(bias.abs() < ALIASING / 4.0)))
        },
        shown_by: &["tests/gl_peel.rs", "tests/gl_closed_forms.rs"],
    },
    Claim {
        poster: "“Depth layer texel behind the intersection point is culled by a KILL operation.”",
        found: |run| {
            let errors = of_pictures(&run.times()?, |picture| Some(pipeline(picture, "kill")?.relative_rmse))?;
            let text = joined(errors.iter().copied().map(percent));
            let text = format!(
                "Pictures by <code>kill</code>, one pass a layer with <code>discard</code>, are {text} off path tracing."
            );
            Some((text, Verdict::of(errors.iter().all(|&error| error < PICTURE))))
        },
        shown_by: &["tests/gl_kill.rs", "tests/gl_furnace.rs"],
    },
    Claim {
        poster: "“Criteria based on the number of sampled points can be used to stop the iteration without significant error.”",
        found: |run| {
            let runs = run.of::<StopFraction>("stop_fraction")?.runs;
            let all = runs.iter().find(|run| run.stop_fraction == 0.0)?;
            // One hundredth more error is not significant.
            let limit = 1.01 * all.measured.relative_rmse;
            let stopped = runs.iter().rfind(|run| run.measured.relative_rmse <= limit)?;
            let most = runs.last()?;
            let text = format!(
                "Stopping at {} of the points leaves the error at {} ({} without) and saves {:.0} % of the layers; at {}, the error is {}.",
                percent(stopped.stop_fraction),
                percent(stopped.measured.relative_rmse),
                percent(all.measured.relative_rmse),
                100.0 * (1.0 - stopped.layers_mean / all.layers_mean),
                percent(most.stop_fraction),
                percent(most.measured.relative_rmse)
            );
            Some((text, Verdict::of(stopped.stop_fraction > 0.0)))
        },
        shown_by: &["paper_figures/figures/stop_fraction.toml"],
    },
    Claim {
        poster: "A grid photon map is rough solution enough: “I use grid photon map as a pre-process”.",
        found: |run| {
            let error = run.of::<PictureComparison>("figure2")?.error;
            let grid: PhotonGridErrors = run.of("photon_grid")?;
            let Settings { grid_cells, photons, .. } = Settings::default();
            let kind = grid.kinds.iter().find(|kind| kind.grid_cells == grid_cells && u64::from(kind.photons) == photons)?;
            let text = format!(
                "Seen directly, the map is {} off path tracing, its gather {}. The noise of a map falls from {} to {} by gathering.",
                percent(error.photon_map),
                percent(error.relative_rmse),
                percent(kind.seen.noise),
                percent(kind.gathered.noise)
            );
            Some((text, Verdict::of(error.holds? && kind.gathered.noise < kind.seen.noise)))
        },
        shown_by: &["tests/photons.rs", "tests/gl_photons.rs"],
    },
    Claim {
        poster: "Figure 2: the Cornell box by 1000 directions. (“Rendering time is 62 sec. (Final gathering takes 50 sec.)”)",
        found: |run| picture(run, "figure2", "Figure 2"),
        shown_by: &["tests/reference.rs"],
    },
    Claim {
        poster: "Figure 3: “per-pixel inter-reflection from textured floor was rendered.” (“Final gathering takes 101 sec.”)",
        found: |run| picture(run, "figure3", "Figure 3"),
        shown_by: &["tests/reference.rs"],
    },
    Claim {
        poster: "Cost is linear in directions: 50 s for 1000, 101 s for 2000.",
        found: |run| {
            let times = run.times()?;
            let ratio = |run: &Run| {
                let (all, last) = *run.progress.last()?;
                let (_, half) = run.progress.iter().copied().find(|&(directions, _)| 2 * directions >= all)?;
                Some((run.pipeline.clone(), last / half))
            };
            let ratios = some(times.pictures.last()?.runs.iter().filter_map(ratio).collect())?;
            let text: Vec<_> = ratios.iter().map(|(name, ratio)| format!("{ratio:.2} by <code>{name}</code>")).collect();
            let text = format!("Twice the directions take as many times as long: {} (the poster: 2.02).", text.join(", "));
            // One run on a machine that may be shared varies by a tenth.
            Some((text, Verdict::of(ratios.iter().all(|(_, ratio)| (1.8..2.2).contains(ratio)))))
        },
        shown_by: &["paper_figures/figures/times.toml", "paper_figures/figures/scaling.toml"],
    },
    Claim {
        poster: "“Future hardware with an early KILL operation will accelerate the proposed method further.”",
        found: |run| {
            let gain = |picture: &OfPicture| Some(pipeline(picture, "kill")?.gather / pipeline(picture, "early-kill")?.gather);
            let gains = of_pictures(&run.times()?, gain)?;
            let [kill, early] = ["kill", "early-kill"].map(|name| Some(run.row(name)?.same_rays?.mean_difference));
            let text = format!(
                "Gathering is {} times as fast. Irradiance is as far off exact rays: {} with early KILL, {} without.",
                joined(gains.iter().map(|gain| format!("{gain:.2}"))),
                percent(early?),
                percent(kill?)
            );
            Some((text, Verdict::of(gains.iter().all(|&gain| gain > 1.0))))
        },
        shown_by: &["tests/gl_kill.rs"],
    },
    Claim {
        poster: "“It is very fast compared with final gathering using ray shooting.”",
        found: |run| {
            let [kill, fused, rays] = ["kill", FUSED, "raycast-gl"].map(|name| run.row(name).map(|row| row.ms_per_sample));
            let (kill, fused) = (kill? / rays?, fused? / rays?);
            let scaling: Scaling = run.of("scaling")?;
            // Of the largest step that measured both: its place, and the time of fused over that of the rays.
            let most = |of: &str| {
                let steps = &scaling.series.iter().find(|series| series.of == of)?.steps;
                steps.iter().rev().find_map(|step: &Step| Some((step, step.against("raycast-gl")?)))
            };
            let ((points, at_points), (triangles, at_triangles)) = (most("points")?, most("triangles")?);
            let text = format!(
                "Against rays through a tree on the same device, for one sample at every point of the Cornell box: <code>fused</code> takes {fused:.2} \
                 of their time, {at_points:.2} with {:.1} million points; <code>kill</code> {kill:.1} times as long. With {} triangles, <code>fused</code> \
                 takes {at_triangles:.1} times as long as rays.",
                f64::from(points.points) / 1e6,
                triangles.triangles,
            );
            let faster = [kill, fused, at_triangles].map(|share| share < 1.0);
            let verdict = match faster {
                [true, true, true] => Verdict::Holds,
                [_, true, _] => Verdict::InPart,
                _ if at_points < 1.0 => Verdict::InPart,
                _ => Verdict::DoesNotHold,
            };
            Some((text, verdict))
        },
        shown_by: &["tests/gl_bench.rs"],
    },
    Claim {
        poster: "“It can process any sets of points including ray-traced pixels, vertex data, light map textures.”",
        found: |_| {
            not_measured(
                "Camera pixels, ray-traced pixels, vertices, light-map texels and points of files gather by the same code, and in one run.",
            )
        },
        shown_by: &["tests/gl_bake.rs", "tests/cli_bake.rs", "tests/lightmap.rs", "tests/gl_traced.rs"],
    },
    Claim {
        poster: "It can process any problem of many samples on the hemisphere, “such as pre-computation of radiance transfer”.",
        found: |_| {
            not_measured(
                "Openness, bent normals, spherical harmonics and transfer, by way of other surfaces too, are passes over the same hits.",
            )
        },
        shown_by: &["tests/gl_bake.rs"],
    },
];

impl Evidence<'_> {
    /// The data of a figure.
    fn of<F: Figure>(&mut self, figure: &str) -> Option<F> {
        let document = self.documents.iter().find(|document| document.figure == figure)?;
        self.whole &= document.scale.is_whole();
        document.data()
    }

    fn times(&mut self) -> Option<Times> {
        self.of("times")
    }

    /// A contestant's row of the bench.
    fn row(&mut self, name: &str) -> Option<Row> {
        self.of::<SideBySide>("bench")?.rows.into_iter().find(|row| row.name == name)
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

/// A fact that tests show and no figure measures.
fn not_measured(fact: &str) -> Option<(String, Verdict)> {
    Some((format!("No figure measures this; tests do. {fact}"), Verdict::NotJudged))
}

/// A picture of the poster: its error, which is judged, and its times, which are of other hardware.
fn picture(run: &mut Evidence, figure: &str, name: &str) -> Option<(String, Verdict)> {
    let error = run.of::<PictureComparison>(figure)?.error;
    let times = run.times()?;
    let times = times.pictures.iter().find(|picture| picture.declared.name == name)?;
    let of = |run: &Run| format!("{} (gather {}) by <code>{}</code>", seconds(run.total), seconds(run.gather), run.pipeline);
    let text: Vec<_> = times.runs.iter().map(of).collect();
    let text = format!(
        "{} off path tracing, bias {}; on other hardware, in {}.",
        percent(error.relative_rmse),
        percent(error.bias),
        text.join(", ")
    );
    Some((text, Verdict::of(error.holds?)))
}

/// The finding and the verdict for a claim.
fn judged(claim: &Claim, documents: &[Document]) -> (String, Verdict) {
    let mut evidence = Evidence { documents, whole: true };
    match (claim.found)(&mut evidence) {
        None => ("The run lacks a measurement of full scale that this needs.".into(), Verdict::NotJudged),
        Some((text, _)) if !evidence.whole => (format!("{text} (At less than full scale.)"), Verdict::NotJudged),
        Some(judged) => judged,
    }
}

/// As HTML.
pub fn table(documents: &[Document]) -> String {
    let row = |(number, claim): (usize, &Claim)| {
        let (text, verdict) = judged(claim, documents);
        let (class, word) = verdict.shown();
        let files: Vec<_> = claim.shown_by.iter().map(|file| format!("<code>{file}</code>")).collect();
        let verdict = format!("<span class=\"verdict {class}\">{word}</span>");
        vec![(number + 1).to_string(), claim.poster.to_owned(), text, verdict, files.join("<br>")]
    };
    let rows = CLAIMS.iter().enumerate().map(row);
    format!("<div class=\"claims\">\n{}</div>\n", html::table(&["", "the poster", "measured", "", "where the test is"], rows))
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;
    use crate::figure::Scale;
    use crate::lab::library::in_repository;

    /// Of a recorded run: names of series, rows and pictures are those that the figures write.
    fn recorded() -> Vec<Document> {
        let files = std::fs::read_dir(in_repository("paper_figures/runs/2026-11-22-llvmpipe-2-cores")).unwrap();
        let paths = files.map(|entry| entry.unwrap().path()).filter(|path| path.extension().is_some_and(|end| end == "json"));
        paths.map(|path| Document::read(&path).unwrap()).collect()
    }

    fn verdicts(documents: &[Document]) -> Vec<Verdict> {
        CLAIMS.iter().map(|claim| judged(claim, documents).1).collect()
    }

    #[test]
    fn a_whole_run_judges_each_claim_that_a_figure_measures() {
        let (measured, others) = (verdicts(&recorded()), verdicts(&[]));
        assert!(measured[..10].iter().all(|&verdict| verdict != Verdict::NotJudged), "{measured:?}");
        assert_eq!(measured[10..], [Verdict::NotJudged; 2]);
        assert_eq!(others, [Verdict::NotJudged; 12], "without a run");
    }

    #[test]
    fn a_run_at_less_than_full_scale_judges_nothing() {
        let mut documents = recorded();
        documents.iter_mut().for_each(|document| document.scale = Scale(0.5));
        assert_eq!(verdicts(&documents), [Verdict::NotJudged; 12]);
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
        let (before, after) = (verdicts(&recorded()), verdicts(&recorded().into_iter().map(spoilt).collect::<Vec<_>>()));
        for (claim, (before, after)) in CLAIMS.iter().zip(before.into_iter().zip(after)).take(10) {
            assert!(before != after && after == Verdict::DoesNotHold, "{}: {before:?} and {after:?}", claim.poster);
        }
    }

    #[test]
    fn tests_that_claims_name_exist() {
        for file in CLAIMS.iter().flat_map(|claim| claim.shown_by) {
            assert!(in_repository(file).is_file(), "{file}");
        }
    }
}
