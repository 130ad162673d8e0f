//! The page of a tiny run shows all declared figures, needs no other file, and judges nothing.

use std::fs;
use std::path::Path;
use std::process::Command;

/// Figures that take seconds at this scale. The page says of the others that they are missing.
const MEASURED: [&str; 4] = ["figure2", "figure3", "convergence", "bench"];

fn page(out: &Path) -> String {
    let only = MEASURED.iter().flat_map(|name| ["--only", name]);
    let status =
        Command::new(env!("CARGO_BIN_EXE_paper_figures")).args(["--scale", "0.01", "--out"]).arg(out).args(only).status();
    assert!(status.unwrap().success());
    fs::read_to_string(out.join("index.html")).unwrap()
}

/// All texts between `before` and the next quotation mark.
fn quoted<'a>(html: &'a str, before: &str) -> Vec<&'a str> {
    html.split(before).skip(1).filter_map(|rest| rest.split('"').next()).collect()
}

#[test]
fn the_page_is_whole_and_needs_no_other_file() {
    let out = tempfile::tempdir().unwrap();
    let html = page(out.path());

    let declared = fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("figures")).unwrap();
    let mut names: Vec<String> =
        declared.map(|entry| entry.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned()).collect();
    let mut shown: Vec<&str> = quoted(&html, "<h3 id=\"");
    names.sort();
    shown.sort();
    assert_eq!(shown, names);

    // Each measured figure has a picture or a plot. The page says that the others are missing.
    for part in html.split("<h3 id=\"").skip(1) {
        let name = part.split('"').next().unwrap();
        let drawn = part.contains("<svg") || part.contains("src=\"data:image/png;base64,");
        assert_eq!(drawn, MEASURED.contains(&name), "{name}");
        assert_eq!(!drawn, part.contains("Not measured yet"), "{name}");
    }

    let pictures = quoted(&html, "src=\"");
    assert!(pictures.len() >= 10, "only {} pictures", pictures.len());
    for picture in pictures {
        let start = &picture[..picture.len().min(40)];
        assert!(picture.starts_with("data:image/png;base64,iVBOR"), "{start} is not in the page");
    }
    for link in quoted(&html, "href=\"") {
        assert!(link.starts_with('#') && html.contains(&format!("id=\"{}\"", &link[1..])), "{link} leads out of the page");
    }
    for other in ["<script", "<link", "url(", "@import"] {
        assert!(!html.contains(other), "{other}");
    }
    // Twelve claims and their head. At this scale none is judged, and neither is a picture.
    let claims = html.split("class=\"claims\"").nth(1).unwrap().split("</table>").next().unwrap();
    assert_eq!(claims.matches("<tr>").count(), 13);
    assert_eq!(claims.matches("<span class=\"verdict unknown\">not judged</span>").count(), 12);
    assert_eq!(html.matches("is not judged at this scale").count(), 2);
}
