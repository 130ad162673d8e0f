//! Material libraries (MTL) into materials. [`load`] is the entry point.
//!
//! As with OBJ, a scan comes before tobj: it reports errors with their lines, and it keeps from tobj what that would choke on
//! and this renderer has no use for (gloss, texture options). What is read: `Kd`, `Ke` and `map_Kd`; and where `illum` is 3 or 5, a mirror,
//! or 4, 6 or 7, glass: `Ks`, the mirror's reflectance, `Ni` and `Tf`, the glass's index of refraction and filter, and `Ns`, which tells sharp from
//! glossy. The Fresnel term of 5 is left out, that of glass is always there.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use glam::Vec3;

use super::scan::{split_word, uncomment};
use super::texture::Textures;
use super::{Material, Surface};
use crate::error::{Error, Result};

/// Reflectance where a material, or the whole file, says none.
pub const GREY: Vec3 = Vec3::splat(0.5);

/// Index of refraction of glass that says none.
pub const GLASS_INDEX: f32 = 1.5;

/// The least `Ns` of mirrors and glass: a lobe cos^Ns of this exponent is half as high 3 degrees off its axis.
const SHARP: f32 = 500.0;

pub fn load(path: &Path, bytes: &[u8], textures: &mut Textures<'_>, warnings: &mut Vec<String>) -> Result<Vec<Material>> {
    let mut scanner = Scanner { path, line: 0, text: String::new(), texture_lines: Vec::new(), optics: Vec::new(), warnings };
    let text = String::from_utf8_lossy(bytes);
    for (index, statement) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        scanner.line = index + 1;
        scanner.statement(statement)?;
    }
    let optics = std::mem::take(&mut scanner.optics);
    let surfaces: Vec<_> = optics.iter().map(|statements| scanner.surface(statements)).collect::<Result<_>>()?;
    let Scanner { text, texture_lines, .. } = scanner;
    let (materials, _) = tobj::load_mtl_buf(&mut text.as_bytes()).map_err(|error| {
        let problem = format!("this is not a material library: {error}");
        Error::input(path, None, problem, "export the model's materials again, as MTL")
    })?;
    let finish = |((material, line), (surface, reflectance)): ((tobj::Material, usize), (Surface, Option<Vec3>))| {
        let texture = material
            .diffuse_texture
            .as_deref()
            .map(|name| textures.load(&beside(path, name), &format!("{}:{line}", path.display())));
        Ok(Material {
            name: material.name,
            // A texture alone is meant to show as it is.
            albedo: reflectance
                .unwrap_or_else(|| material.diffuse.map_or(if texture.is_some() { Vec3::ONE } else { GREY }, Vec3::from)),
            emission: material.emissive.map_or(Vec3::ZERO, Vec3::from),
            albedo_texture: texture.transpose()?,
            surface,
        })
    };
    materials.into_iter().zip(texture_lines).zip(surfaces).map(finish).collect()
}

/// The path of a file that `from` names, with either kind of slash.
pub fn beside(from: &Path, name: &str) -> PathBuf {
    from.with_file_name(name.replace('\\', "/"))
}

struct Scanner<'a> {
    path: &'a Path,
    line: usize,
    /// The statements that tobj is to read.
    text: String,
    /// The line of each material's texture, or else of its name.
    texture_lines: Vec<usize>,
    /// What each material says beside that: keyword, line and the rest.
    optics: Vec<Vec<(String, usize, String)>>,
    warnings: &'a mut Vec<String>,
}

impl Scanner<'_> {
    fn statement(&mut self, statement: &str) -> Result<()> {
        let (keyword, rest) = split_word(statement);
        match keyword {
            "newmtl" if rest.is_empty() => return self.error("newmtl without a name", "name the material"),
            "newmtl" => {
                _ = writeln!(self.text, "newmtl {rest}");
                self.texture_lines.push(self.line);
                self.optics.push(Vec::new());
            }
            "Kd" | "Ke" | "map_Kd" if self.texture_lines.is_empty() => {
                return self.error(format!("{keyword} before the first newmtl"), "start each material with newmtl");
            }
            "Kd" | "Ke" => self.color(keyword, rest)?,
            "map_Kd" => self.texture(rest)?,
            "illum" | "Ks" | "Ns" | "Ni" | "Tf" => {
                if let Some(optics) = self.optics.last_mut() {
                    optics.push((keyword.to_owned(), self.line, uncomment(rest).to_owned()));
                }
            }
            "map_Ke" => self.warn("map_Ke is ignored: lights are of one radiance each, Ke"),
            _ => {}
        }
        Ok(())
    }

    fn color(&mut self, keyword: &str, text: &str) -> Result<()> {
        let [r, g, b] = self.rgb(keyword, text)?;
        _ = writeln!(self.text, "{keyword} {r} {g} {b}");
        Ok(())
    }

    /// What a material is, and its reflectance where that is not `Kd`. Exporters write these keywords everywhere: only what counts is checked.
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
                self.rgb(keyword, text).map(Vec3::from)
            }
        };
        if mirror {
            return Ok((Surface::Mirror, Some(color("Ks")?)));
        }
        let glass = Surface::Glass { index: number("Ni").unwrap_or(GLASS_INDEX), filter: color("Tf")? };
        self.line = said("Ni").map_or(*line, |(_, line, _)| *line);
        glass.check().or_else(|(problem, cure)| self.error(problem, cure)).map(|glass| (glass, None))
    }

    fn rgb(&self, keyword: &str, text: &str) -> Result<[f32; 3]> {
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
        let mut values = [0.0; 3];
        for (value, word) in values.iter_mut().zip([r, g, b]) {
            *value = match word.parse() {
                Ok(number) if accepted.contains(&number) => number,
                _ => return self.error(format!("{keyword} has the value {word}"), cure),
            };
        }
        Ok(values)
    }

    fn texture(&mut self, text: &str) -> Result<()> {
        let name = skip_options(text);
        if name.is_empty() {
            return self.error("map_Kd without a file", "name the picture file, or remove the line");
        }
        if name.len() < text.len() {
            self.warn("options of map_Kd are ignored");
        }
        _ = writeln!(self.text, "map_Kd {name}");
        if let Some(line) = self.texture_lines.last_mut() {
            *line = self.line;
        }
        Ok(())
    }

    fn warn(&mut self, what: &str) {
        self.warnings.push(format!("{}:{}: {what}", self.path.display(), self.line));
    }

    fn error<T>(&self, problem: impl Into<String>, cure: &str) -> Result<T> {
        Err(Error::input(self.path, Some(self.line), problem, cure))
    }
}

/// The file name, spaces and all, behind options such as `-clamp on` and `-s 1 1 1`.
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
            // Of the three numbers, only the first is compulsory.
            if argument > 0 && word.parse::<f32>().is_err() {
                break;
            }
            rest = after;
        }
    }
    rest
}
