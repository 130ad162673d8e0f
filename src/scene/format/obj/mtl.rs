//! Reads materials from material libraries (MTL). [`load`] is the entry point.
//!
//! Statements: `Kd`, `Ke` and `map_Kd`. `illum` 3 or 5 is a mirror, 4, 6 or 7 glass. Only these use `Ks` (mirror reflectance), `Ni` (index of
//! refraction), `Tf` (filter) and `Ns` (sharp or glossy). Only glass has a Fresnel term, not `illum` 5. Gloss and texture options are ignored.

use std::path::Path;

use glam::Vec3;

use super::super::warnings::Warnings;
use super::scan::{split_word, uncomment};
use super::{Loader, beside};
use crate::error::{Error, Result};
use crate::scene::{Material, Surface};

/// Minimum `Ns` of mirrors and glass. A lobe cos^Ns with this exponent falls to half at 3 degrees from its axis.
const SHARP: f32 = 500.0;

pub fn load(loader: &mut Loader, path: &Path, bytes: &[u8]) -> Result<Vec<Material>> {
    let mut scanner = Scanner { path, line: 0, materials: Vec::new(), warnings: &mut loader.warnings };
    let text = String::from_utf8_lossy(bytes);
    for (index, statement) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        scanner.line = index + 1;
        scanner.statement(statement)?;
    }
    let said = std::mem::take(&mut scanner.materials);
    let surfaces = said.iter().map(|said| scanner.surface(&said.optics)).collect::<Result<Vec<_>>>()?;
    let finish = |(said, (surface, reflectance)): (Statements, (Surface, Option<Vec3>))| {
        let mut load =
            |(name, line): &(String, usize)| loader.textures.load(&beside(path, name), &format!("{}:{line}", path.display()));
        // A texture without `Kd` shows its own colours.
        let unsaid = if said.texture.is_some() { Vec3::ONE } else { Material::GREY };
        Ok(Material {
            albedo_texture: said.texture.as_ref().map(&mut load).transpose()?,
            name: said.name,
            albedo: reflectance.or(said.diffuse).unwrap_or(unsaid),
            emission: said.emission,
            surface,
            ..Material::default()
        })
    };
    said.into_iter().zip(surfaces).map(finish).collect()
}

struct Scanner<'a> {
    path: &'a Path,
    line: usize,
    materials: Vec<Statements>,
    warnings: &'a mut Warnings,
}

/// The statements of one material.
#[derive(Default)]
struct Statements {
    name: String,
    diffuse: Option<Vec3>,
    emission: Vec3,
    /// The texture file, and the line that names it.
    texture: Option<(String, usize)>,
    /// The statements about mirrors and glass: keyword, line and arguments.
    optics: Vec<(String, usize, String)>,
}

impl Scanner<'_> {
    fn statement(&mut self, statement: &str) -> Result<()> {
        let (keyword, rest) = split_word(statement);
        match (keyword, self.materials.len().checked_sub(1)) {
            ("newmtl", _) if rest.is_empty() => return self.error("newmtl without a name", "name the material"),
            ("newmtl", _) => self.materials.push(Statements { name: rest.to_owned(), ..Statements::default() }),
            ("map_Ke", _) => self.warn("map_Ke is ignored: lights are of one radiance each, Ke"),
            ("Kd" | "Ke" | "map_Kd", None) => {
                return self.error(format!("{keyword} before the first newmtl"), "start each material with newmtl");
            }
            ("Kd", Some(last)) => self.materials[last].diffuse = Some(self.rgb(keyword, rest)?),
            ("Ke", Some(last)) => self.materials[last].emission = self.rgb(keyword, rest)?,
            ("map_Kd", Some(last)) => self.materials[last].texture = Some((self.texture(rest)?, self.line)),
            ("illum" | "Ks" | "Ns" | "Ni" | "Tf", Some(last)) => {
                self.materials[last].optics.push((keyword.to_owned(), self.line, uncomment(rest).to_owned()));
            }
            _ => {}
        }
        Ok(())
    }

    /// Surface kind, and reflectance if that is not `Kd`. Only values in use are checked, because exporters write these keywords everywhere.
    fn surface(&mut self, statements: &[(String, usize, String)]) -> Result<(Surface, Option<Vec3>)> {
        let said = |keyword: &str| statements.iter().rev().find(|statement| statement.0 == keyword);
        let number = |keyword: &str| said(keyword).map(|(_, _, text)| text.trim().parse().unwrap_or(f32::NAN));
        let Some((_, line, illum)) = said("illum") else { return Ok((Surface::Diffuse, None)) };
        self.line = *line;
        let mirror = matches!(illum.trim(), "3" | "5");
        if !mirror && !matches!(illum.trim(), "4" | "6" | "7") {
            return Ok((Surface::Diffuse, None));
        }
        if let Some(gloss) = number("Ns").filter(|&gloss| gloss < SHARP) {
            let kind = if mirror { "a mirror" } else { "glass" };
            self.warn(&format!(
                "illum says {kind}, but Ns {gloss} is below {SHARP}: gloss is not rendered, it is taken as diffuse"
            ));
            return Ok((Surface::Diffuse, None));
        }
        let mut color = |keyword: &str| match said(keyword) {
            None => Ok(Vec3::ONE),
            Some((_, line, text)) => {
                self.line = *line;
                self.rgb(keyword, text)
            }
        };
        if mirror {
            return Ok((Surface::Mirror, Some(color("Ks")?)));
        }
        let glass = Surface::Glass { index: number("Ni").unwrap_or(Surface::GLASS_INDEX), filter: color("Tf")? };
        self.line = said("Ni").map_or(*line, |(_, line, _)| *line);
        glass.check().or_else(|(problem, cure)| self.error(problem, cure)).map(|glass| (glass, None))
    }

    fn rgb(&self, keyword: &str, text: &str) -> Result<Vec3> {
        let (accepted, cure) = match keyword {
            "Ke" => (0.0..=f32::MAX, "give a finite radiance of 0 or more for each of red, green and blue"),
            "Tf" => (0.0..=1.0, "give a share from 0 to 1 for each of red, green and blue"),
            _ => (0.0..=1.0, "give a reflectance from 0 to 1 for each of red, green and blue"),
        };
        let words: Vec<_> = uncomment(text).split_whitespace().collect();
        let [r, g, b] = match words[..] {
            [grey] => [grey; 3],
            [r, g, b, ..] => [r, g, b],
            _ => return self.error(format!("{keyword} has {} numbers", words.len()), cure),
        };
        let number = |word: &str| match word.parse() {
            Ok(number) if accepted.contains(&number) => Ok(number),
            _ => self.error(format!("{keyword} has the value {word}"), cure),
        };
        Ok(Vec3::new(number(r)?, number(g)?, number(b)?))
    }

    fn texture(&mut self, text: &str) -> Result<String> {
        let name = skip_options(text);
        if name.is_empty() {
            return self.error("map_Kd without a file", "name the picture file, or remove the line");
        }
        if name.len() < text.len() {
            self.warn("options of map_Kd are ignored");
        }
        Ok(name.to_owned())
    }

    fn warn(&mut self, what: &str) {
        self.warnings.say(format!("{}:{}: {what}", self.path.display(), self.line));
    }

    fn error<T>(&self, problem: impl Into<String>, cure: &str) -> Result<T> {
        Err(Error::input(self.path, Some(self.line), problem, cure))
    }
}

/// Skips options such as `-clamp on` and `-s 1 1 1`. The rest is the file name, with its spaces.
fn skip_options(text: &str) -> &str {
    let mut rest = text.trim();
    while rest.starts_with('-') {
        let (option, arguments) = split_word(rest);
        rest = arguments;
        let most = match option {
            "-o" | "-s" | "-t" => 3,
            "-mm" => 2,
            _ => 1,
        };
        for argument in 0..most {
            let (word, after) = split_word(rest);
            // Of the three numbers, only the first is required.
            if argument > 0 && word.parse::<f32>().is_err() {
                break;
            }
            rest = after;
        }
    }
    rest
}
