//! The page that shows all figures: one file that needs no other.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;

use crate::claims;
use crate::figure::{Declaration, Document, Figure, Format, Result, folder};

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

/// The documents that a folder has.
pub struct Documents(Vec<(String, Document)>);

impl Documents {
    /// What was measured for a figure; `None` where it is missing.
    pub fn data<F: Figure>(&self, name: &str) -> Option<F> {
        self.of(name)?.data()
    }

    pub fn of(&self, name: &str) -> Option<&Document> {
        self.0.iter().find(|(figure, _)| figure == name).map(|(_, document)| document)
    }
}

impl Page {
    pub fn load() -> Result<Self> {
        let mut page: Self = toml::from_str(&fs::read_to_string(folder().join("page.toml"))?)?;
        for section in &mut page.sections {
            section.declarations = section.figures.iter().map(|name| Declaration::load(name)).collect::<Result<_>>()?;
        }
        // What is declared must be shown.
        for entry in fs::read_dir(folder().join("figures"))? {
            let path = entry?.path();
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            if page.figure(&name).is_none() {
                return Err(format!("page.toml has no place for {}", path.display()).into());
            }
        }
        Ok(page)
    }

    /// In their order.
    pub fn figures(&self) -> impl Iterator<Item = &Declaration> {
        self.sections.iter().flat_map(|section| &section.declarations)
    }

    pub fn figure(&self, name: &str) -> Option<&Declaration> {
        self.figures().find(|figure| figure.name == name)
    }

    /// What was measured into the folder `out`.
    pub fn documents(&self, out: &Path) -> Result<Documents> {
        let read = |figure: &Declaration| {
            let path = out.join(format!("{}.json", figure.name));
            path.exists().then(|| Ok((figure.name.clone(), Document::read(&path)?)))
        };
        Ok(Documents(self.figures().filter_map(read).collect::<Result<_>>()?))
    }

    /// With what was measured into the folder `out`.
    pub fn html(&self, out: &Path) -> Result<String> {
        let documents = self.documents(out)?;
        let mut html = String::new();
        write!(
            html,
            "<!DOCTYPE html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{0}</title>\n<style>\n{1}</style>\n\
             <h1>{0}</h1>\n<p>{2}</p>\n{3}<nav>",
            self.title,
            include_str!("page.css"),
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
                html += &claims::table(&documents);
            }
            for figure in &section.declarations {
                html += &part(figure, documents.of(&figure.name), out)?;
            }
        }
        Ok(html + "</html>\n")
    }

    /// What the numbers are of.
    fn run(&self, Documents(documents): &Documents) -> String {
        let one_of = |of: &dyn Fn(&Document) -> String| -> String {
            documents.iter().map(|(_, document)| of(document)).collect::<BTreeSet<_>>().into_iter().collect::<Vec<_>>().join("; ")
        };
        let minutes = documents.iter().map(|(_, document)| document.seconds).sum::<f64>() / 60.0;
        let whole = documents.len() == self.figures().count() && documents.iter().all(|(_, document)| document.scale.is_whole());
        let note = "This page is a look at a part: some figures are missing or were measured at less than full scale, as is said below each, \
                    and claims are judged by what there is. <code>make figures</code> makes all.";
        let note = if whole { String::new() } else { format!("<p class=\"note\">{note}</p>\n") };
        format!(
            "<small>Measured {} on {}, in {minutes:.0} minutes.</small>\n{note}",
            one_of(&|document| document.date.clone()),
            one_of(&|document| document.machine.described()),
        )
    }
}

/// A figure with its title and what is said about it.
fn part(figure: &Declaration, document: Option<&Document>, out: &Path) -> Result<String> {
    let Declaration { name, title, caption, .. } = figure;
    let head = format!("<h3 id=\"{name}\"><a href=\"#{name}\">{title}</a></h3>\n<p>{caption}</p>\n");
    let Some(document) = document else {
        return Ok(head + "<p class=\"note\">Not measured yet.</p>\n");
    };
    // What an older version measured may lack what is asked for now.
    let Ok(mut drawing) = document.draw() else {
        return Ok(head + "<p class=\"note\">Measured by another version; measure it again.</p>\n");
    };
    if document.format()? == Format::Svg {
        drawing = format!("<div class=\"plot\">\n{drawing}</div>\n");
    }
    for picture in document.pictures(out)? {
        let file = picture.file_name().unwrap_or_default().to_string_lossy();
        let data = STANDARD.encode(fs::read(&picture)?);
        drawing = drawing.replace(&format!("src=\"{file}\""), &format!("src=\"data:image/png;base64,{data}\""));
    }
    let scale = if document.scale.is_whole() { String::new() } else { format!(" at a scale of {}", document.scale) };
    Ok(format!("{head}{drawing}<small>{name}.json, measured {} in {} s{scale}</small>\n", document.date, document.seconds))
}
