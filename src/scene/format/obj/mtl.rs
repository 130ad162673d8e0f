//! Reads materials from material libraries (MTL). [`load`] is the entry point.
//!
//! Shaded statements: `Kd`, `Ke`, `map_Kd`, `map_Ke`, `d`, `Tr`, `map_d`. `illum` 3 or 5 is a mirror, 4, 6 or 7 glass. Only these use `Ks` (mirror
//! reflectance), `Ni` (index of refraction), `Tf` (filter) and `Ns` (sharp or glossy). Only glass has a Fresnel term, not `illum` 5.
//! `gloss.rs` reads gloss and normals. `unshaded.rs` notes what is read and not shaded, and `picture.rs` reads the statements that name pictures.

use std::path::Path;

use glam::Vec3;

use super::gloss::GlossStatements;
use super::number::{Word, read, words};
pub use super::picture::Placement;
use super::picture::{PictureName, Pictures};
use super::search::Search;
use super::text::{Decoder, Lines, split_word, uncomment};
use super::unshaded::Unshaded;
use crate::error::Result;
use crate::scene::format::Loader;
use crate::scene::format::warnings::{Fault, Place, Warnings};
use crate::scene::{Material, Opacity, Surface};

/// Minimum `Ns` of mirrors and glass. A lobe cos^Ns with this exponent falls to half at 3 degrees from its axis.
const SHARP: f32 = 500.0;

/// Reads a library. `files` are the library and its model.
pub fn load<'a>(
    loader: &mut Loader<'a>,
    search: &mut Search<'a>,
    decoder: &mut Decoder,
    files: [&Path; 2],
    text: &str,
) -> Result<Vec<(Material, Placement)>> {
    let path = files[0];
    let mut scanner = MtlScanner { path, line: 0, materials: Vec::new(), warnings: &mut loader.warnings };
    let mut lines = Lines::new(text);
    for (line, statement) in lines.by_ref() {
        scanner.line = line;
        scanner.statement(&statement)?;
    }
    decoder.check_ends(scanner.warnings, path, &lines)?;
    let said = std::mem::take(&mut scanner.materials);
    let surfaces = said.iter().map(|said| scanner.surface(&said.optics)).collect::<Result<Vec<_>>>()?;
    let mut pictures = Pictures::new(loader, search, files);
    said.into_iter().zip(surfaces).map(|(said, surface)| said.finish(&mut pictures, surface)).collect()
}

struct MtlScanner<'a> {
    path: &'a Path,
    line: usize,
    materials: Vec<Statements>,
    warnings: &'a mut Warnings,
}

/// What `illum` makes of a material.
#[derive(Default)]
struct MtlSurface {
    surface: Surface,
    /// If it is not `Kd`.
    reflectance: Option<Vec3>,
    /// Of a mirror that is not sharp.
    exponent: Option<f32>,
}

/// The statements of one material.
#[derive(Default)]
struct Statements {
    name: String,
    diffuse: Option<Vec3>,
    emission: Option<Vec3>,
    /// `map_Kd`.
    texture: Option<PictureName>,
    /// `map_Ke`.
    glow: Option<PictureName>,
    /// `d`, and 1 - `Tr`, which `d` overrides.
    opacity: Option<f32>,
    opacity_line: usize,
    clearness: Option<f32>,
    /// `map_d`.
    mask: Option<PictureName>,
    /// The statements about mirrors and glass: keyword, line and arguments.
    optics: Vec<(&'static str, usize, String)>,
    gloss: GlossStatements,
    unshaded: Unshaded,
}

impl Statements {
    /// The material.
    fn finish(mut self, pictures: &mut Pictures, looks: MtlSurface) -> Result<(Material, Placement)> {
        let MtlSurface { surface, reflectance, exponent } = looks;
        if let Some(exponent) = exponent {
            self.gloss.reflect_by_exponent(exponent);
        }
        let open = |picture| pictures.texture(picture, "the material has its Kd alone");
        let texture = self.texture.as_ref().map(open).transpose()?.flatten();
        let mut placement = self.texture.as_ref().filter(|_| texture.is_some()).map(|picture| picture.placement);
        let (mut emission, mut emission_texture) = (self.emission.unwrap_or(Vec3::ZERO), None);
        if let Some(picture) = &self.glow {
            (emission, emission_texture) = pictures.glow(picture, self.emission, placement)?;
            placement = placement.or(emission_texture.map(|_| picture.placement));
        }
        // A texture without `Kd` shows its own colours.
        let unsaid = if texture.is_some() { Vec3::ONE } else { Material::GREY };
        let mut of_gloss = Vec::new();
        let (gloss, normal_map) = std::mem::take(&mut self.gloss).finish(pictures, surface, &mut placement, &mut of_gloss)?;
        let highlights = self.optics.iter().filter(|_| gloss.is_none()).map(|(keyword, _, text)| (*keyword, text.as_str()));
        let mut unshaded = std::mem::take(&mut self.unshaded).notes(surface, highlights);
        let opacity = match surface {
            Surface::Glass { .. } => Opacity::default(),
            _ => self.opacity(pictures, texture, &mut placement, &mut unshaded)?,
        };
        if let Some(picture) = self.glow.as_ref().filter(|_| emission_texture.is_none()) {
            unshaded.push(format!("emission map {}", picture.base()));
        }
        unshaded.extend(of_gloss);
        let material = Material {
            name: self.name,
            albedo: reflectance.or(self.diffuse).unwrap_or(unsaid),
            emission,
            albedo_texture: texture,
            opacity,
            emission_texture,
            gloss,
            normal_map,
            surface,
            unshaded,
            ..Material::default()
        };
        Ok((material, placement.unwrap_or_default()))
    }

    /// How much light it stops. Without `map_d` the alpha of `texture`, that of `map_Kd`, counts. `placement` is that of the pictures so far.
    fn opacity(
        &self,
        pictures: &mut Pictures,
        texture: Option<usize>,
        placement: &mut Option<Placement>,
        unshaded: &mut Vec<String>,
    ) -> Result<Opacity> {
        let share = self.opacity.or(self.clearness).unwrap_or(1.0);
        let mask = match &self.mask {
            Some(mask) if placement.is_some_and(|placed| placed != mask.placement) => {
                unshaded.push(format!("opacity map {}, placed otherwise than map_Kd", mask.base()));
                None
            }
            Some(mask) => {
                let found = pictures.mask(mask)?;
                *placement = placement.or(found.map(|_| mask.placement));
                found
            }
            None => texture.filter(|&texture| pictures.has_alpha(texture)),
        };
        let seen = mask.filter(|&mask| !pictures.is_clear(mask));
        if share > 0.0 && seen == mask {
            return Ok(Opacity { share, texture: mask, cutoff: None });
        }
        // Exporters write that by mistake.
        pictures.tell_invisible(&self.name, self.opacity_line);
        Ok(Opacity { share: if share > 0.0 { share } else { 1.0 }, texture: seen, cutoff: None })
    }
}

/// Keywords whose spelling is checked.
const SHADED: [&str; 10] = ["newmtl", "Kd", "Ke", "map_Kd", "map_Ke", "illum", "Ks", "Ns", "Ni", "Tf"];

impl MtlScanner<'_> {
    fn statement(&mut self, statement: &str) -> Result<()> {
        let (word, rest) = split_word(statement);
        let keyword = SHADED.into_iter().find(|known| word.eq_ignore_ascii_case(known)).unwrap_or(word);
        if keyword != word {
            let problem = || format!("keyword {word} is not spelt {keyword}");
            self.mend("keyword", &problem, "it is read all the same", "correct the spelling")?;
        }
        if keyword == "newmtl" {
            if rest.is_empty() {
                self.mend("newmtl", &|| "newmtl without a name".into(), "its name is empty", "name the material")?;
            }
            self.materials.push(Statements { name: rest.to_owned(), ..Statements::default() });
            return Ok(());
        }
        if self.materials.is_empty() {
            if matches!(keyword, "Kd" | "Ke" | "map_Kd") {
                let problem = || format!("{keyword} before the first newmtl");
                self.mend("before", &problem, "it is left out", "start each material with newmtl")?;
            }
            return Ok(());
        }
        let lower = keyword.to_ascii_lowercase();
        match keyword {
            "Kd" => {
                let color = self.color("Kd", rest)?;
                self.last().diffuse = color;
            }
            "Ke" => {
                let color = self.color("Ke", rest)?;
                self.last().emission = color;
            }
            "map_Kd" | "map_Ke" => {
                let picture = self.picture(if keyword == "map_Kd" { "map_Kd" } else { "map_Ke" }, rest)?;
                *(if keyword == "map_Kd" { &mut self.last().texture } else { &mut self.last().glow }) = picture;
            }
            _ if matches!(lower.as_str(), "d" | "tr") => {
                let share = self.share(keyword, rest)?;
                let is_opacity = lower == "d";
                let (line, last) = (self.line, self.last());
                last.opacity_line = line;
                *(if is_opacity { &mut last.opacity } else { &mut last.clearness }) =
                    share.map(|share| if is_opacity { share } else { 1.0 - share });
            }
            _ if matches!(lower.as_str(), "pr" | "pm") => {
                let is_roughness = lower == "pr";
                let share = self.share(if is_roughness { "Pr" } else { "Pm" }, rest)?;
                *(if is_roughness { &mut self.last().gloss.roughness } else { &mut self.last().gloss.metallic }) = share;
            }
            _ if matches!(lower.as_str(), "map_d" | "map_tr" | "map_opacity") => {
                let picture = self.picture("map_d", rest)?;
                let (line, last) = (self.line, self.last());
                (last.opacity_line, last.mask) = (line, picture);
            }
            _ => {
                let line = self.line;
                match SHADED.into_iter().find(|known| *known == keyword) {
                    Some(optic) => self.last().optics.push((optic, line, uncomment(rest).to_owned())),
                    None if self.last().gloss.read(keyword, rest, line) => {}
                    None => self.last().unshaded.note(keyword, rest),
                }
            }
        }
        Ok(())
    }

    fn last(&mut self) -> &mut Statements {
        self.materials.last_mut().expect("a newmtl stands before")
    }

    /// Only values in use are checked, because exporters write these keywords everywhere.
    fn surface(&mut self, statements: &[(&'static str, usize, String)]) -> Result<MtlSurface> {
        let said = |keyword: &str| statements.iter().rev().find(|statement| statement.0 == keyword);
        let number = |keyword: &str| said(keyword).map(|(_, _, text)| text.trim().parse().unwrap_or(f32::NAN));
        let Some((_, line, illum)) = said("illum") else { return Ok(MtlSurface::default()) };
        self.line = *line;
        let mirror = matches!(illum.trim(), "3" | "5");
        if !mirror && !matches!(illum.trim(), "4" | "6" | "7") {
            return Ok(MtlSurface::default());
        }
        let exponent = number("Ns").filter(|&exponent| exponent < SHARP);
        if let Some(exponent) = exponent.filter(|_| !mirror) {
            let text = || format!("illum says glass, but Ns {exponent} is below {SHARP}: rough glass is taken as diffuse");
            self.warnings.tell(Place { path: self.path, line: Some(self.line) }, "gloss", &text);
            return Ok(MtlSurface::default());
        }
        let mut color = |keyword: &'static str| match said(keyword) {
            None => Ok(Vec3::ONE),
            Some((_, line, text)) => {
                self.line = *line;
                Ok(self.color(keyword, text)?.unwrap_or(Vec3::ONE))
            }
        };
        if mirror {
            let surface = if exponent.is_some() { Surface::Diffuse } else { Surface::Mirror };
            return Ok(MtlSurface { surface, reflectance: Some(color("Ks")?), exponent });
        }
        let glass = Surface::Glass { index: number("Ni").unwrap_or(Surface::GLASS_INDEX), filter: color("Tf")? };
        self.line = said("Ni").map_or(*line, |(_, line, _)| *line);
        match glass.check() {
            Ok(surface) => Ok(MtlSurface { surface, ..MtlSurface::default() }),
            Err((problem, cure)) => {
                let mend = format!("it is {}", Surface::GLASS_INDEX);
                self.mend("Ni", &|| problem.clone(), &mend, cure)?;
                let surface = match glass {
                    Surface::Glass { filter, .. } => Surface::Glass { index: Surface::GLASS_INDEX, filter },
                    other => other,
                };
                Ok(MtlSurface { surface, ..MtlSurface::default() })
            }
        }
    }

    /// A share of the light, brought into its range. `None` if there is none to understand.
    fn share(&mut self, keyword: &str, text: &str) -> Result<Option<f32>> {
        let cure = "give a number from 0 to 1";
        let word = words(text.trim_start_matches("-halo")).next().unwrap_or_default();
        let problem = || format!("{keyword} has the value {word}");
        let (Word::Number(value) | Word::Odd(value)) = read(word) else {
            self.mend("share", &problem, "it is left out", cure)?;
            return Ok(None);
        };
        if value.is_nan() {
            self.mend("share", &problem, "it is left out", cure)?;
            return Ok(None);
        }
        if !(0.0..=1.0).contains(&value) {
            self.mend("share", &problem, "it is clamped to 0 to 1", cure)?;
        }
        Ok(Some(value.clamp(0.0, 1.0) as f32))
    }

    /// A colour, brought into its range. `None` if there is none to understand.
    fn color(&mut self, keyword: &'static str, text: &str) -> Result<Option<Vec3>> {
        let (most, cure) = match keyword {
            "Ke" => (f32::MAX, "give a finite radiance of 0 or more for each of red, green and blue"),
            "Tf" => (1.0, "give a share from 0 to 1 for each of red, green and blue"),
            _ => (1.0, "give a reflectance from 0 to 1 for each of red, green and blue"),
        };
        let words: Vec<_> = words(text).take(3).collect();
        let mut values = Vec::new();
        for word in &words {
            values.push(match read(word) {
                Word::Number(value) if (value as f32).is_finite() => value as f32,
                Word::Odd(value) if (value as f32).is_finite() => {
                    let problem = || format!("{keyword} has the value {word}");
                    self.mend("odd number", &problem, "it is taken for a number", "write numbers such as 0.5")?;
                    value as f32
                }
                _ => {
                    self.mend(keyword, &|| format!("{keyword} has the value {word}"), "it is left out", cure)?;
                    return Ok(None);
                }
            });
        }
        let color = match values[..] {
            [grey] => Vec3::splat(grey),
            [r, g, b] => Vec3::new(r, g, b),
            _ => {
                self.mend(keyword, &|| format!("{keyword} has {} numbers", words.len()), "it is left out", cure)?;
                return Ok(None);
            }
        };
        let Some(outside) = values.iter().position(|value| !(0.0..=most).contains(value)) else { return Ok(Some(color)) };
        let problem = || format!("{keyword} has the value {}", words[outside]);
        if most == 1.0 && is_bytes(color) {
            self.mend("bytes", &problem, "it is divided by 255", cure)?;
            return Ok(Some(color / 255.0));
        }
        let mend = if most == 1.0 { "it is clamped to 0 to 1" } else { "it is clamped to 0" };
        self.mend("clamp", &problem, mend, cure)?;
        Ok(Some(color.clamp(Vec3::ZERO, Vec3::splat(most))))
    }

    fn picture(&mut self, keyword: &'static str, text: &str) -> Result<Option<PictureName>> {
        let (picture, ignored) = PictureName::parse(text, self.line);
        if picture.name.is_empty() {
            let problem = || format!("{keyword} without a file");
            self.mend("no picture", &problem, "it is left out", "name the picture file, or remove the line")?;
            return Ok(None);
        }
        if let Some(option) = ignored {
            let text = || format!("option {option} of {keyword} is ignored");
            self.warnings.tell(Place { path: self.path, line: Some(self.line) }, "option", &text);
        }
        Ok(Some(picture))
    }

    fn mend(&mut self, kind: &'static str, problem: &dyn Fn() -> String, mend: &str, cure: &str) -> Result<()> {
        self.warnings.mend(Place { path: self.path, line: Some(self.line) }, &Fault { kind, problem, mend, cure })
    }
}

/// Whether a colour is one of 0 to 255. A reflectance just above 1 is none.
pub fn is_bytes(color: Vec3) -> bool {
    let whole = color.fract() == Vec3::ZERO;
    color.min_element() >= 0.0
        && color.max_element() <= 255.0
        && (whole && color.max_element() > 2.0 || color.max_element() > 16.0)
}
