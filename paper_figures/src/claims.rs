//! The poster's claims beside what a run found. Each number comes from the run's documents.

use finalgather::Settings;
use finalgather::bench::FUSED;

use crate::figures::bench::SideBySide;
use crate::figures::comparison::PictureComparison;
use crate::figures::photon_grid::PhotonGridErrors;
use crate::figures::scaling::{Scaling, Step};
use crate::figures::stop_fraction::StopFraction;
use crate::figures::times::{OfPicture, Run, Times};
use crate::html::{self, percent, seconds};
use crate::page::Documents;

struct Claim {
    /// What the poster says, or means.
    poster: &'static str,
    /// `None` where the run lacks what it takes.
    found: fn(&Documents) -> Option<(String, Verdict)>,
    /// Tests.
    shown_by: &'static [&'static str],
}

#[derive(Clone, Copy)]
enum Verdict {
    Holds,
    InPart,
    DoesNotHold,
    NotShown,
}

impl Verdict {
    fn of(holds: bool) -> Self {
        if holds { Self::Holds } else { Self::DoesNotHold }
    }

    /// A class of the page's style, and a word.
    fn shown(self) -> (&'static str, &'static str) {
        match self {
            Self::Holds => ("holds", "holds"),
            Self::InPart => ("part", "in part"),
            Self::DoesNotHold => ("not", "does not hold"),
            Self::NotShown => ("unknown", "not shown"),
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
        found: |documents| {
            let off = |name| Some(row(&documents.data("bench")?, name)?.same_rays?.mean_difference);
            let (fused, kill) = (off(FUSED)?, off("kill")?);
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
        found: |documents| {
            let times: Times = documents.data("times")?;
            let layers = some(times.pictures.iter().filter_map(|picture| Some(run(picture, "kill")?.layers_mean)).collect())?;
            let bias = row(&documents.data("bench")?, "kill")?.same_rays?.bias;
            let layers: Vec<_> = layers.into_iter().map(|layers| format!("{layers:.1}")).collect();
            let text = format!(
                "{} layers a direction; the last sample of each point is its nearest hit: the mean is {} off exact rays.",
                layers.join(" and "),
                percent(bias)
            );
            Some((text, Verdict::of(bias.abs() < ALIASING / 4.0)))
        },
        shown_by: &["tests/gl_peel.rs", "tests/gl_closed_forms.rs"],
    },
    Claim {
        poster: "“Depth layer texel behind the intersection point is culled by a KILL operation.”",
        found: |documents| {
            let times: Times = documents.data("times")?;
            let errors = some(times.pictures.iter().filter_map(|picture| Some(run(picture, "kill")?.relative_rmse)).collect())?;
            let text: Vec<_> = errors.iter().map(|&error| percent(error)).collect();
            let text = format!(
                "Pictures by <code>kill</code>, one pass a layer with <code>discard</code>, are {} off path tracing.",
                text.join(" and ")
            );
            Some((text, Verdict::of(errors.iter().all(|&error| error < PICTURE))))
        },
        shown_by: &["tests/gl_kill.rs", "tests/gl_furnace.rs"],
    },
    Claim {
        poster: "“Criteria based on the number of sampled points can be used to stop the iteration without significant error.”",
        found: |documents| {
            let runs = documents.data::<StopFraction>("stop_fraction")?.runs;
            let all = runs.iter().find(|run| run.stop_fraction == 0.0)?;
            // A hundredth of the error more is not significant.
            let stopped = runs.iter().rfind(|run| run.relative_rmse <= 1.01 * all.relative_rmse)?;
            let saved = |run: &crate::figures::stop_fraction::Run| 1.0 - run.layers_mean / all.layers_mean;
            let most = runs.last()?;
            let text = format!(
                "Stopping at {} of the points leaves the error at {} ({} without) and saves {:.0} % of the layers; at {}, the error is {}.",
                percent(stopped.stop_fraction),
                percent(stopped.relative_rmse),
                percent(all.relative_rmse),
                100.0 * saved(stopped),
                percent(most.stop_fraction),
                percent(most.relative_rmse)
            );
            Some((text, Verdict::of(stopped.stop_fraction > 0.0)))
        },
        shown_by: &["paper_figures/figures/stop_fraction.toml"],
    },
    Claim {
        poster: "A grid photon map is rough solution enough: “I use grid photon map as a pre-process”.",
        found: |documents| {
            let figure: PictureComparison = documents.data("figure2")?;
            let grid: PhotonGridErrors = documents.data("photon_grid")?;
            let Settings { grid_cells, photons, .. } = Settings::default();
            let kind = grid.kinds.iter().find(|kind| kind.grid_cells == grid_cells && u64::from(kind.photons) == photons)?;
            let text = format!(
                "Seen directly, the map is {} off path tracing, its gather {}. The noise of a map falls from {} to {} by gathering.",
                percent(figure.error.photon_map),
                percent(figure.error.relative_rmse),
                percent(kind.seen.noise),
                percent(kind.gathered.noise)
            );
            Some((text, Verdict::of(figure.error.holds && kind.gathered.noise < kind.seen.noise)))
        },
        shown_by: &["tests/photons.rs", "tests/gl_photons.rs"],
    },
    Claim {
        poster: "Figure 2: the Cornell box by 1000 directions. (“Rendering time is 62 sec. (Final gathering takes 50 sec.)”)",
        found: |documents| picture(documents, "figure2", "Figure 2"),
        shown_by: &["tests/reference.rs"],
    },
    Claim {
        poster: "Figure 3: “per-pixel inter-reflection from textured floor was rendered.” (“Final gathering takes 101 sec.”)",
        found: |documents| picture(documents, "figure3", "Figure 3"),
        shown_by: &["tests/reference.rs"],
    },
    Claim {
        poster: "Cost is linear in directions: 50 s for 1000, 101 s for 2000.",
        found: |documents| {
            let times: Times = documents.data("times")?;
            let ratio = |run: &Run| {
                let (all, last) = *run.progress.last()?;
                let (_, half) = run.progress.iter().copied().find(|&(directions, _)| 2 * directions >= all)?;
                Some(last / half)
            };
            let runs = &times.pictures.last()?.runs;
            let ratios = some(runs.iter().filter_map(|run| Some((&run.pipeline, ratio(run)?))).collect())?;
            let text: Vec<_> = ratios.iter().map(|(name, ratio)| format!("{ratio:.2} by <code>{name}</code>")).collect();
            let text = format!("Twice the directions take as many times as long: {} (the poster: 2.02).", text.join(", "));
            // One run on a machine that may be shared varies by a tenth.
            Some((text, Verdict::of(ratios.iter().all(|(_, ratio)| (1.8..2.2).contains(ratio)))))
        },
        shown_by: &["paper_figures/figures/times.toml", "paper_figures/figures/scaling.toml"],
    },
    Claim {
        poster: "“Future hardware with an early KILL operation will accelerate the proposed method further.”",
        found: |documents| {
            let times: Times = documents.data("times")?;
            let gain = |picture: &OfPicture| Some(run(picture, "kill")?.gather / run(picture, "early-kill")?.gather);
            let gains = some(times.pictures.iter().filter_map(gain).collect())?;
            let text: Vec<_> = gains.iter().map(|gain| format!("{gain:.2}")).collect();
            let text = format!("Gathering is {} times as fast, with the same hits but for one in 300 000.", text.join(" and "));
            Some((text, Verdict::of(gains.iter().all(|&gain| gain > 1.0))))
        },
        shown_by: &["tests/gl_kill.rs"],
    },
    Claim {
        poster: "“It is very fast compared with final gathering using ray shooting.”",
        found: |documents| {
            let bench: SideBySide = documents.data("bench")?;
            let [kill, fused, rays] = ["kill", FUSED, "raycast-gl"].map(|name| row(&bench, name).map(|row| row.ms_per_sample));
            let (kill, fused, rays) = (kill?, fused?, rays?);
            let scaling: Scaling = documents.data("scaling")?;
            // The last at which neither was left out for its time.
            let most = |of: &str| {
                let series = scaling.series.iter().find(|series| series.of == of)?;
                series.steps.iter().rfind(|step| against_rays(step).is_some())
            };
            let (points, triangles) = (most("points")?, most("triangles")?);
            let text = format!(
                "Against rays through a tree on the same device, for one sample at every point of the Cornell box: <code>fused</code> takes {:.2} \
                 of their time, {:.2} with {:.1} million points; <code>kill</code> {:.1} times as long. With {} triangles, <code>fused</code> \
                 takes {:.1} times as long as rays.",
                fused / rays,
                against_rays(points)?,
                f64::from(points.points) / 1e6,
                kill / rays,
                triangles.triangles,
                against_rays(triangles)?
            );
            let always = kill < rays && fused < rays && against_rays(triangles)? < 1.0;
            let at_times = fused < rays || against_rays(points)? < 1.0;
            Some((
                text,
                if always {
                    Verdict::Holds
                } else if at_times {
                    Verdict::InPart
                } else {
                    Verdict::DoesNotHold
                },
            ))
        },
        shown_by: &["tests/gl_bench.rs"],
    },
    Claim {
        poster: "“It can process any sets of points including ray-traced pixels, vertex data, light map textures.”",
        found: |_| {
            let text = "Camera pixels, ray-traced pixels, vertices, light-map texels and points of files gather by the same code, and in one run.";
            Some((text.into(), Verdict::Holds))
        },
        shown_by: &["tests/gl_bake.rs", "tests/cli_bake.rs", "tests/lightmap.rs", "tests/gl_traced.rs"],
    },
    Claim {
        poster: "It can process any problem of many samples on the hemisphere, “such as pre-computation of radiance transfer”.",
        found: |_| {
            let text = "Openness, bent normals, spherical harmonics and transfer, by way of other surfaces too, are passes over the same hits.";
            Some((text.into(), Verdict::Holds))
        },
        shown_by: &["tests/gl_bake.rs"],
    },
];

/// How long `fused` takes beside rays on the same device.
fn against_rays(step: &Step) -> Option<f64> {
    let time = |name: &str| step.costs.iter().find(|cost| cost.name == name).map(|cost| cost.ms_per_sample);
    Some(time(FUSED)? / time("raycast-gl")?)
}

fn row<'a>(bench: &'a SideBySide, name: &str) -> Option<&'a finalgather::bench::Row> {
    bench.rows.iter().find(|row| row.name == name)
}

fn run<'a>(picture: &'a OfPicture, pipeline: &str) -> Option<&'a Run> {
    picture.runs.iter().find(|run| run.pipeline == pipeline)
}

/// `None` of nothing, for nothing proves everything.
fn some<T>(found: Vec<T>) -> Option<Vec<T>> {
    (!found.is_empty()).then_some(found)
}

/// A picture of the poster: its error, which is judged, and its times, which are of other hardware.
fn picture(documents: &Documents, figure: &str, name: &str) -> Option<(String, Verdict)> {
    let error = documents.data::<PictureComparison>(figure)?.error;
    let times: Times = documents.data("times")?;
    let times = times.pictures.iter().find(|picture| picture.declared.name == name)?;
    let of = |run: &Run| format!("{} (gather {}) by <code>{}</code>", seconds(run.total), seconds(run.gather), run.pipeline);
    let text: Vec<_> = times.runs.iter().map(of).collect();
    let text = format!(
        "{} off path tracing, bias {}; on other hardware, in {}.",
        percent(error.relative_rmse),
        percent(error.bias),
        text.join(", ")
    );
    Some((text, Verdict::of(error.holds)))
}

/// As HTML.
pub fn table(documents: &Documents) -> String {
    let row = |(number, claim): (usize, &Claim)| {
        let (text, (class, word)) = match (claim.found)(documents) {
            Some((text, verdict)) => (text, verdict.shown()),
            None => ("Not all of what it takes is measured.".into(), Verdict::NotShown.shown()),
        };
        let files: Vec<_> = claim.shown_by.iter().map(|file| format!("<code>{file}</code>")).collect();
        vec![
            (number + 1).to_string(),
            claim.poster.to_owned(),
            text,
            format!("<span class=\"verdict {class}\">{word}</span>"),
            files.join("<br>"),
        ]
    };
    let rows = CLAIMS.iter().enumerate().map(row);
    format!("<div class=\"claims\">\n{}</div>\n", html::table(&["", "the poster", "measured", "", "where the test is"], rows))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cornell::in_repository;
    use crate::page::Page;

    /// Of a recorded run: names of series, rows and pictures are those that the figures write.
    #[test]
    fn a_whole_run_answers_every_claim_and_parts_of_it_do_not() {
        let page = Page::load().unwrap();
        let whole = page.documents(&in_repository("paper_figures/runs/2026-11-22-llvmpipe-2-cores")).unwrap();
        for claim in &CLAIMS {
            assert!((claim.found)(&whole).is_some(), "{}", claim.poster);
        }
        let nothing = page.documents(&in_repository("paper_figures/src")).unwrap();
        let answered: Vec<_> =
            CLAIMS.iter().filter(|claim| (claim.found)(&nothing).is_some()).map(|claim| claim.poster).collect();
        assert_eq!(answered.len(), 2, "without a run: {answered:?}");
    }

    #[test]
    fn tests_that_claims_name_exist() {
        for file in CLAIMS.iter().flat_map(|claim| claim.shown_by) {
            assert!(in_repository(file).is_file(), "{file}");
        }
    }
}
