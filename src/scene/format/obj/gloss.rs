//! Gloss and normals of a material library: the PBR extension (`Pr`, `Pm` and their maps), normal maps (`norm`) and bump maps.
//!
//! `Ks` and `Ns` of `illum` 2 make no gloss. Exporters write them everywhere, by default, and few materials mean them.

use glam::{Vec2, vec2};

use super::number::{Word, read};
use super::picture::{PictureName, Pictures, Placement};
use crate::error::Result;
use crate::scene::{Gloss, ImageTexture, NormalMap, Surface};

/// A height of 1 is this share of the picture's width, with `-bm 1`.
const HEIGHT: f32 = 0.01;
/// A bump map with so much more blue than red and green, in the mean, is a normal map.
const BLUE: f32 = 0.15;

/// What one material says.
#[derive(Default)]
pub struct GlossStatements {
    /// Shares from 0 to 1.
    pub roughness: Option<f32>,
    pub metallic: Option<f32>,
    roughness_map: Option<PictureName>,
    metallic_map: Option<PictureName>,
    normal_map: Option<PictureName>,
    /// With its factor.
    bump_map: Option<(PictureName, f32)>,
}

impl GlossStatements {
    /// Reads a statement, if it is one of these.
    pub fn read(&mut self, keyword: &str, text: &str, line: usize) -> bool {
        let picture = || Some(PictureName::parse(text, line).0).filter(|picture| !picture.name.is_empty());
        match keyword.to_ascii_lowercase().as_str() {
            "map_pr" => self.roughness_map = picture(),
            "map_pm" => self.metallic_map = picture(),
            "norm" | "map_kn" | "map_norm" => self.normal_map = picture(),
            "bump" | "map_bump" => self.bump_map = picture().map(|picture| (picture, factor(text))),
            _ => return false,
        }
        true
    }

    /// Makes it a metal with a highlight of this Phong exponent, as far as it says nothing else. A lobe cos^n has about the width α² = 2/(n + 2).
    pub fn reflect_by_exponent(&mut self, exponent: f32) {
        self.roughness.get_or_insert((2.0 / (exponent.max(0.0) + 2.0)).powf(0.25));
        self.metallic.get_or_insert(1.0);
    }

    /// The gloss and the normals of a material of this surface. `placement` is that of the textures before. `unshaded` gets what is not shown.
    pub fn finish(
        self,
        pictures: &mut Pictures,
        surface: Surface,
        placement: &mut Option<Placement>,
        unshaded: &mut Vec<String>,
    ) -> Result<(Option<Gloss>, Option<NormalMap>)> {
        let mut texture = |pictures: &mut Pictures, what: &str, picture: &Option<PictureName>| {
            let Some(picture) = picture else { return Ok(None) };
            if placement.is_some_and(|placement| placement != picture.placement) {
                unshaded.push(format!("{what} {} with other -s or -o than map_Kd", picture.base()));
                return Ok(None);
            }
            let texture = pictures.texture(picture, "the material goes without")?;
            if texture.is_some() {
                *placement = Some(picture.placement);
            }
            Ok(texture)
        };
        let maps = self.roughness_map.is_some() || self.metallic_map.is_some();
        // Exporters write `Pm 0` of anything.
        let said = maps || self.roughness.is_some() || self.metallic.is_some_and(|metallic| metallic > 0.0);
        let gloss = if said && surface == Surface::Diffuse {
            let rough = texture(pictures, "roughness map", &self.roughness_map)?;
            let metal = texture(pictures, "metalness map", &self.metallic_map)?;
            let missing = metal.is_none() && self.metallic_map.is_some();
            Some(Gloss {
                roughness: self.roughness.unwrap_or(1.0),
                // A map without a factor shows its own values.
                metallic: self.metallic.unwrap_or(if metal.is_some() { 1.0 } else { 0.0 }) * if missing { 0.0 } else { 1.0 },
                texture: joined(pictures, rough, metal)?,
                ..Gloss::default()
            })
        } else {
            None
        };
        if let Some(texture) = texture(pictures, "normal map", &self.normal_map)? {
            return Ok((gloss, Some(NormalMap { texture, scale: 1.0 })));
        }
        let (bump_map, factor) = self.bump_map.unzip();
        let Some(texture) = texture(pictures, "bump map", &bump_map)? else { return Ok((gloss, None)) };
        if looks_like_normals(pictures.picture(texture)) {
            if let Some(picture) = bump_map {
                let text = format!("bump map {} is blue as a normal map, and is taken for one", picture.base());
                pictures.tell(&picture, "normal map", &text);
            }
            return Ok((gloss, Some(NormalMap { texture, scale: 1.0 })));
        }
        let texture = pictures.derived(&format!("normals of {texture}"), &[texture], |pictures| normals_of(pictures[0]))?;
        Ok((gloss, Some(NormalMap { texture, scale: factor.unwrap_or(1.0) })))
    }
}

/// The number after `-bm`.
fn factor(text: &str) -> f32 {
    let after = text.split_whitespace().skip_while(|word| !word.eq_ignore_ascii_case("-bm")).nth(1);
    match after.map(read) {
        Some(Word::Number(value) | Word::Odd(value)) if value.is_finite() => value as f32,
        _ => 1.0,
    }
}

/// A texture with the red of the first picture in green and that of the second in blue, as glTF has them.
fn joined(pictures: &mut Pictures, rough: Option<usize>, metal: Option<usize>) -> Result<Option<usize>> {
    let from: Vec<usize> = rough.into_iter().chain(metal).collect();
    if from.is_empty() {
        return Ok(None);
    }
    let join = |pictures: &[&ImageTexture]| {
        let (rough, metal) = (rough.map(|_| pictures[0]), metal.map(|_| pictures[pictures.len() - 1]));
        let size = if pictures[pictures.len() - 1].width > pictures[0].width { pictures[1] } else { pictures[0] };
        let texel = |place: u32| {
            let red = |picture: Option<&ImageTexture>| {
                picture.map_or(255, |picture| {
                    let x = place % size.width * picture.width / size.width;
                    let y = place / size.width * picture.height / size.height;
                    picture.texels[(y * picture.width + x) as usize][0]
                })
            };
            [255, red(rough), red(metal), 255]
        };
        ImageTexture { texels: (0..size.width * size.height).map(texel).collect(), ..size.clone() }
    };
    pictures.derived(&format!("roughness {rough:?} and metalness {metal:?}"), &from, join).map(Some)
}

fn looks_like_normals(picture: &ImageTexture) -> bool {
    let mean = |channel: usize| {
        picture.texels.iter().map(|texel| f64::from(texel[channel])).sum::<f64>() as f32 / picture.texels.len() as f32 / 255.0
    };
    mean(2) > mean(0).max(mean(1)) + BLUE
}

/// The normals of a height map. Differences of neighbours are slopes, in a picture that repeats.
fn normals_of(picture: &ImageTexture) -> ImageTexture {
    let [width, height] = [picture.width as usize, picture.height as usize];
    let at = |x: usize, y: usize| {
        let [r, g, b, _] = picture.texels[y % height * width + x % width];
        (f32::from(r) + f32::from(g) + f32::from(b)) / 765.0
    };
    let texel = |place: usize| {
        let (x, y) = (place % width, place / width);
        // Rows run down, v runs up.
        let rise = vec2(at(x + 1, y) - at(x + width - 1, y), at(x, y + height - 1) - at(x, y + 1));
        let slope: Vec2 = -0.5 * HEIGHT * rise * picture.width as f32;
        let normal = slope.extend(1.0).normalize();
        let [x, y, z] = normal.to_array().map(|value| (127.5 * (value + 1.0)).round() as u8);
        [x, y, z, 255]
    };
    ImageTexture { texels: (0..width * height).map(texel).collect(), ..picture.clone() }
}
