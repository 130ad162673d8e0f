//! The page that shows all figures, in one file that needs no other.

mod claims;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::fs;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;

use crate::document::{Declaration, Document};
use crate::draw::{escaped, note, plot_in_page};
use crate::figure::{Format, Result, caught, folder, of_file};
use crate::lab::in_repository;
use crate::page::claims::claims_table;

/// `page.toml`, with the declarations that it names.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Page {
    title: String,
    /// This text and all others are HTML, as it may stand in a paragraph.
    lead: String,
    links: Vec<Link>,
    sections: Vec<Section>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Link {
    text: String,
    to: Target,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Target {
    Url(String),
    /// In the repository.
    File(String),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Section {
    title: String,
    text: String,
    /// Names.
    #[serde(default)]
    figures: Vec<String>,
    /// Whether the table of the poster's claims stands here.
    #[serde(default)]
    claims: bool,
    #[serde(skip)]
    declarations: Vec<Declaration>,
}

impl Page {
    pub fn load() -> Result<Self> {
        let path = folder().join("page.toml");
        let mut page: Self = of_file(&path, toml::from_str(&of_file(&path, fs::read_to_string(&path))?))?;
        for section in &mut page.sections {
            section.declarations = section.figures.iter().map(|name| Declaration::load(name)).collect::<Result<_>>()?;
        }
        // Every declared figure must have a place.
        for entry in fs::read_dir(folder().join("figures"))? {
            let path = entry?.path();
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            if !page.figures().any(|figure| figure.name == name) {
                return Err(format!("page.toml has no place for {}", path.display()).into());
            }
        }
        Ok(page)
    }

    /// In their order.
    pub fn figures(&self) -> impl Iterator<Item = &Declaration> {
        self.sections.iter().flat_map(|section| &section.declarations)
    }

    /// With the measurements in the folder `out`.
    pub fn html(&self, out: &Path) -> Result<String> {
        let found = Found::of(self, out);
        let mut html = String::new();
        write!(
            html,
            "<!DOCTYPE html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{0}</title>\n<style>\n{1}</style>\n\
             <h1>{0}</h1>\n<p>{2}</p>\n<p class=\"links\">{3}</p>\n{4}<nav>",
            self.title,
            include_str!("style.css"),
            self.lead,
            self.links(out)?,
            self.run(&found),
        )?;
        for (number, Section { title, .. }) in self.sections.iter().enumerate() {
            write!(html, "<a href=\"#s{number}\">{title}</a>")?;
        }
        html += "</nav>\n";
        for (number, section) in self.sections.iter().enumerate() {
            write!(html, "<h2 id=\"s{number}\">{}</h2>\n<p>{}</p>\n", section.title, section.text)?;
            if section.claims {
                html += &claims_table(&found.documents)?;
            }
            for figure in &section.declarations {
                html += &found.part(figure, out)?;
            }
        }
        Ok(html + "<script>\n" + include_str!("script.js") + "</script>\n</html>\n")
    }

    fn links(&self, out: &Path) -> Result<String> {
        let link = |Link { text, to }: &Link| {
            let address = match to {
                Target::Url(url) => url.clone(),
                Target::File(file) => relative(out, &in_repository(file))?,
            };
            Ok(format!("<a href=\"{address}\">{text}</a>"))
        };
        Ok(self.links.iter().map(link).collect::<Result<Vec<_>>>()?.join(" · "))
    }

    /// When and where the numbers were measured, and what is missing.
    fn run(&self, found: &Found) -> String {
        let Found { documents, failures } = found;
        let all_of = |of: &dyn Fn(&Document) -> String| documents.iter().map(of).collect::<BTreeSet<_>>();
        let one_of = |of: &dyn Fn(&Document) -> String| all_of(of).into_iter().collect::<Vec<_>>().join("; ");
        let minutes = documents.iter().map(|document| document.seconds).sum::<f64>() / 60.0;
        let measured = match documents.len() {
            0 => "<small>Nothing is measured yet.</small>\n".into(),
            _ => format!(
                "<small>Measured {} on {}, in {minutes:.0} minutes.</small>\n",
                one_of(&|document| document.date.clone()),
                one_of(&|document| document.machine.described()),
            ),
        };
        let link = |name: &String| format!("<a href=\"#{name}\">{name}</a>");
        let failed = match failures.len() {
            0 => String::new(),
            _ => failed(&format!("These figures say why: {}.", failures.keys().map(link).collect::<Vec<_>>().join(", "))),
        };
        let whole = documents.len() == self.figures().count() && documents.iter().all(|document| document.scale.is_whole());
        let part = "This page shows a part: some figures are missing or were measured at less than full scale, as is said below each. \
                    Claims that need them are not judged. <code>make figures</code> makes all.";
        measured + &failed + &if whole { String::new() } else { note(part) }
    }
}

/// What the folder of a run has of the figures.
struct Found {
    documents: Vec<Document>,
    /// By figure, why there is none.
    failures: BTreeMap<String, String>,
}

impl Found {
    fn of(page: &Page, out: &Path) -> Self {
        let mut found = Self { documents: Vec::new(), failures: BTreeMap::new() };
        for figure in page.figures() {
            let document = || figure.json(out).exists().then(|| Document::read(&figure.json(out)));
            let failure = match (fs::read_to_string(figure.failure(out)), document()) {
                (Ok(failure), _) => failure,
                (_, Some(Err(unread))) => unread.to_string(),
                (_, Some(Ok(document))) => {
                    found.documents.push(document);
                    continue;
                }
                (_, None) => continue,
            };
            found.failures.insert(figure.name.clone(), failure.trim().into());
        }
        found
    }

    /// A figure with its title and caption, and its drawing or why there is none.
    fn part(&self, figure: &Declaration, out: &Path) -> Result<String> {
        let name = &figure.name;
        let document = self.documents.iter().find(|document| document.figure == *name);
        let [title, caption] = figure.texts(document);
        let head = format!("<h3 id=\"{name}\"><a href=\"#{name}\">{title}</a></h3>\n<p>{caption}</p>\n");
        let again = format!(
            "Mend that, then <code>paper_figures --only {name}</code> measures it again. The rest of the page does not need it."
        );
        if let Some(failure) = self.failures.get(name) {
            return Ok(head + &failed(&format!("{}. {again}", escaped(failure))));
        }
        let Some(document) = document else {
            return Ok(head + &note("Not measured yet."));
        };
        // The document of an older version may lack fields.
        Ok(head
            + &caught(|| drawn(document, out)).unwrap_or_else(|error| {
                failed(&format!("Its measurements cannot be drawn: {}. {again}", escaped(&error.to_string())))
            }))
    }
}

fn failed(text: &str) -> String {
    format!("<p class=\"note failed\"><strong>Failed.</strong> {text}</p>\n")
}

/// A figure's drawing, with its pictures in it.
fn drawn(document: &Document, out: &Path) -> Result<String> {
    let mut drawing = document.draw()?;
    if document.format()? == Format::Svg {
        drawing = plot_in_page(&drawing);
    }
    for picture in document.pictures(out)? {
        let file = picture.file_name().unwrap_or_default().to_string_lossy();
        let data = STANDARD.encode(fs::read(&picture)?);
        drawing = drawing.replace(&format!("src=\"{file}\""), &format!("src=\"data:image/png;base64,{data}\""));
    }
    let scale = if document.scale.is_whole() { String::new() } else { format!(" at a scale of {}", document.scale.0) };
    let Document { figure, date, seconds, .. } = document;
    Ok(format!("{drawing}<small>{figure}.json, measured {date} in {seconds} s{scale}</small>\n"))
}

/// The address of a file for a page in a folder.
fn relative(folder: &Path, file: &Path) -> Result<String> {
    let [folder, file] = [of_file(folder, folder.canonicalize())?, of_file(file, file.canonicalize())?];
    let same = folder.components().zip(file.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(same).map(|_| "..".to_owned());
    let down = file.components().skip(same).map(|part| encoded(part.as_os_str().as_encoded_bytes()));
    Ok(up.chain(down).collect::<Vec<_>>().join("/"))
}

/// A name as a part of an address.
fn encoded(name: &[u8]) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~".contains(&byte);
    name.iter().map(|&byte| if plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_has_no_marks_of_its_own() {
        assert_eq!(encoded("a #1 100%.md".as_bytes()), "a%20%231%20100%25.md");
    }
}
