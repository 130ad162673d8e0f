//! The page of a tiny run shows all declared figures, needs no other file, judges nothing, and marks what fails.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// Figures that take seconds at this scale. The page says of the others that they are missing.
const MEASURED: [&str; 6] = ["figure1", "four_steps", "figure2", "convergence", "photon_grid", "bench"];
/// What lies where this figure wants to write a picture is in its way.
const FAILS: &str = "figure3";
const IN_THE_WAY: &str = "figure3-front-picture.png";

fn figures(out: &Path, options: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_paper_figures")).arg("--out").arg(out).args(options).output().unwrap()
}

fn page(out: &Path) -> String {
    fs::read_to_string(out.join("index.html")).unwrap()
}

/// All texts between `before` and the next quotation mark.
fn quoted<'a>(html: &'a str, before: &str) -> Vec<&'a str> {
    html.split(before).skip(1).filter_map(|rest| rest.split('"').next()).collect()
}

/// The part of the page that shows a figure.
fn part<'a>(html: &'a str, figure: &str) -> &'a str {
    html.split("<h3 id=\"").find(|part| part.starts_with(&format!("{figure}\""))).unwrap()
}

/// A link leads within the page, to a file of the repository, or to the poster.
fn check_link(link: &str, html: &str, out: &Path) {
    match link.strip_prefix('#') {
        Some(place) => assert!(html.contains(&format!("id=\"{place}\"")), "{link} leads nowhere"),
        None if link.starts_with("https://cs.uwaterloo.ca/~thachisu/") => (),
        None => assert!(out.join(link).is_file(), "{link} leads to no file"),
    }
}

#[test]
fn the_page_is_whole_needs_no_other_file_and_marks_what_fails() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path();
    fs::create_dir(out.join(IN_THE_WAY)).unwrap();
    let only = MEASURED.iter().chain([&FAILS]).flat_map(|name| ["--only", name]);
    let run = figures(out, &["--scale", "0.01"].into_iter().chain(only).collect::<Vec<_>>());
    let said = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(1), "{said}");
    assert!(said.lines().last().unwrap().starts_with("error: failed: figure3; "), "{said}");
    let html = page(out);

    let declared = fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("figures")).unwrap();
    let mut names: Vec<String> =
        declared.map(|entry| entry.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned()).collect();
    let mut shown: Vec<&str> = quoted(&html, "<h3 id=\"");
    names.sort();
    shown.sort();
    assert_eq!(shown, names);

    // Each measured figure has a picture or a plot. The page says that the others are missing, and why one failed.
    for name in &names {
        let part = part(&html, name);
        let drawn = part.contains("<svg") || part.contains("src=\"data:image/png;base64,");
        assert_eq!(drawn, MEASURED.contains(&name.as_str()), "{name}");
        assert_eq!(part.contains("<strong>Failed.</strong>"), name == FAILS, "{name}");
        assert_eq!(part.contains("Not measured yet"), !drawn && name != FAILS, "{name}");
    }
    assert!(part(&html, FAILS).contains(IN_THE_WAY) && part(&html, FAILS).contains("(at a scale of 0.01)"));
    assert!(html.contains("These failed: <a href=\"#figure3\">figure3</a>."));

    let pictures = quoted(&html, "src=\"");
    assert!(pictures.len() >= 20, "only {} pictures", pictures.len());
    for picture in pictures {
        let start = &picture[..picture.len().min(40)];
        assert!(picture.starts_with("data:image/png;base64,iVBOR"), "{start} is not in the page");
    }
    quoted(&html, "href=\"").into_iter().for_each(|link| check_link(link, &html, out));
    assert_eq!(html.matches("<script").count(), 1);
    for other in ["<script ", "<link", "url(", "@import"] {
        assert!(!html.contains(other), "{other}");
    }

    // Headings tell what ran. The claims whose figures ran show values, and none is judged.
    assert!(part(&html, "figure2").contains(">Figure 2. The Cornell box, 10 directions<"));
    assert!(!html.contains("directions}"), "a heading has a name without a number");
    let claims = html.split("class=\"claims\"").nth(1).unwrap().split("</table>").next().unwrap();
    let verdicts = |verdict: &str| claims.matches(&format!("<span class=\"verdict unknown\">{verdict}</span>")).count();
    assert_eq!(claims.matches("<tr>").count(), 13);
    assert_eq!([verdicts("not judged at this scale"), verdicts("not judged: not measured"), verdicts("not judged")], [2, 8, 2]);
    assert!(claims.contains(" % off exact rays by <code>fused</code>"));
    assert_eq!(html.matches("is not judged at this scale").count(), 1);

    // Without scripts each step of the story shows one picture.
    let steps: Vec<_> = part(&html, "four_steps").split("<section class=\"step\"").skip(1).collect();
    assert_eq!(steps.len(), 4);
    for step in steps {
        assert_eq!(step.matches("<figure").count() - step.matches("\" class=\"hidden\"><img").count(), 1);
    }
}

#[test]
fn what_was_not_measured_cannot_be_redrawn() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path();
    let run = figures(out, &["--redraw", "--only", "causes"]);
    assert_eq!(run.status.code(), Some(1));
    let cure = "there are no earlier measurements; measure it first, without --redraw";
    assert!(String::from_utf8_lossy(&run.stderr).contains(&format!("causes failed: {cure}")));
    assert!(part(&page(out), "causes").contains(cure));

    // A redraw of all that there is has nothing to draw, and that is no error. What failed stays marked.
    assert!(figures(out, &["--redraw"]).status.success());
    assert!(part(&page(out), "causes").contains(cure));
}
