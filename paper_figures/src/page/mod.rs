//! The page that shows all figures, in one file that needs no other.

mod claims;

use std::collections::BTreeSet;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;

use crate::document::{Declaration, Document};
use crate::draw::{note, plot_in_page};
use crate::figure::{Format, Result, folder, of_file};
use crate::page::claims::claims_table;

/// `page.toml`, with the declarations that it names.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Page {
    title: String,
    /// This text and all others are HTML, as it may stand in a paragraph.
    lead: String,
    sections: Vec<Section>,
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

    /// The documents of these figures in the folder `out`.
    fn documents(&self, out: &Path) -> Result<Vec<Document>> {
        let paths = self.figures().map(|figure| out.join(format!("{}.json", figure.name)));
        paths.filter(|path| path.exists()).map(|path| Document::read(&path)).collect()
    }

    /// With the measurements in the folder `out`.
    pub fn html(&self, out: &Path) -> Result<String> {
        let documents = self.documents(out)?;
        let mut html = String::new();
        write!(
            html,
            "<!DOCTYPE html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{0}</title>\n<style>\n{1}</style>\n\
             <h1>{0}</h1>\n<p>{2}</p>\n{3}<nav>",
            self.title,
            include_str!("style.css"),
            self.lead,
            self.run(&documents),
        )?;
        for (number, Section { title, .. }) in self.sections.iter().enumerate() {
            write!(html, "<a href=\"#s{number}\">{title}</a>")?;
        }
        html += "</nav>\n";
        for (number, section) in self.sections.iter().enumerate() {
            write!(html, "<h2 id=\"s{number}\">{}</h2>\n<p>{}</p>\n", section.title, section.text)?;
            if section.claims {
                html += &claims_table(&documents)?;
            }
            for figure in &section.declarations {
                html += &part(figure, documents.iter().find(|document| document.figure == figure.name), out)?;
            }
        }
        Ok(html + "</html>\n")
    }

    /// When and where the numbers were measured.
    fn run(&self, documents: &[Document]) -> String {
        let all_of = |of: &dyn Fn(&Document) -> String| documents.iter().map(of).collect::<BTreeSet<_>>();
        let one_of = |of: &dyn Fn(&Document) -> String| all_of(of).into_iter().collect::<Vec<_>>().join("; ");
        let minutes = documents.iter().map(|document| document.seconds).sum::<f64>() / 60.0;
        let whole = documents.len() == self.figures().count() && documents.iter().all(|document| document.scale.is_whole());
        let part = "This page shows a part: some figures are missing or were measured at less than full scale, as is said below each. \
                    Claims that need them are not judged. <code>make figures</code> makes all.";
        let note = if whole { String::new() } else { note(part) };
        format!(
            "<small>Measured {} on {}, in {minutes:.0} minutes.</small>\n{note}",
            one_of(&|document| document.date.clone()),
            one_of(&|document| document.machine.described()),
        )
    }
}

/// A figure with its title and caption.
fn part(Declaration { name, title, caption, .. }: &Declaration, document: Option<&Document>, out: &Path) -> Result<String> {
    let head = format!("<h3 id=\"{name}\"><a href=\"#{name}\">{title}</a></h3>\n<p>{caption}</p>\n");
    let Some(document) = document else {
        return Ok(head + &note("Not measured yet."));
    };
    // The document of an older version may lack fields.
    let Ok(mut drawing) = document.draw() else {
        return Ok(head + &note("Measured by another version; measure it again."));
    };
    if document.format()? == Format::Svg {
        drawing = plot_in_page(&drawing);
    }
    for picture in document.pictures(out)? {
        let file = picture.file_name().unwrap_or_default().to_string_lossy();
        let data = STANDARD.encode(fs::read(&picture)?);
        drawing = drawing.replace(&format!("src=\"{file}\""), &format!("src=\"data:image/png;base64,{data}\""));
    }
    let scale = if document.scale.is_whole() { String::new() } else { format!(" at a scale of {}", document.scale.0) };
    Ok(format!("{head}{drawing}<small>{name}.json, measured {} in {} s{scale}</small>\n", document.date, document.seconds))
}
