//! Notes what a material library says and pictures do not show yet.

use super::number::{Word, read, words};
use super::picture::PictureName;
use crate::scene::Surface;

/// What one material says.
#[derive(Default)]
pub struct Unshaded {
    opacity: Option<f32>,
    /// From `Tr`, which `d` overrides.
    transparency: Option<f32>,
    /// Kinds with their values; the last statement of a kind counts.
    notes: Vec<(&'static str, String)>,
}

impl Unshaded {
    /// Reads a statement, if it is one of these.
    pub fn note(&mut self, keyword: &str, text: &str) {
        let number = || {
            words(text.trim_start_matches("-halo")).next().and_then(|word| match read(word) {
                Word::Number(value) | Word::Odd(value) if value.is_finite() => Some(value as f32),
                _ => None,
            })
        };
        let mut unless = |what, unsaid: f32| {
            if let Some(value) = number().filter(|&value| value != unsaid) {
                self.put(what, value.to_string());
            }
        };
        match keyword.to_ascii_lowercase().as_str() {
            "d" => self.opacity = number(),
            "tr" => self.transparency = number(),
            "ps" => unless("sheen", 0.0),
            "pc" => unless("clear coat", 0.0),
            "map_d" | "map_tr" | "map_opacity" => self.picture("opacity map", text),
            "disp" | "map_disp" => self.picture("displacement map", text),
            "map_ks" => self.picture("highlight map", text),
            "map_ns" => self.picture("gloss map", text),
            "refl" | "map_refl" => self.picture("reflection map", text),
            _ => {}
        }
    }

    fn picture(&mut self, what: &'static str, text: &str) {
        let (picture, _) = PictureName::parse(text, 0);
        if !picture.name.is_empty() {
            self.put(what, picture.base());
        }
    }

    fn put(&mut self, what: &'static str, value: String) {
        self.notes.retain(|(known, _)| *known != what);
        self.notes.push((what, value));
    }

    /// All notes on a material of this surface. `gloss` are its statements about mirrors, which a diffuse surface takes for highlights.
    pub fn notes<'a>(self, surface: Surface, gloss: impl Iterator<Item = (&'a str, &'a str)>) -> Vec<String> {
        let mut notes = Vec::new();
        let opacity = self.opacity.or(self.transparency.map(|transparency| 1.0 - transparency));
        if let Some(opacity) = opacity.filter(|&opacity| opacity < 1.0 && !matches!(surface, Surface::Glass { .. })) {
            notes.push(format!("opacity {}", opacity.max(0.0)));
        }
        let (mut illum, mut color, mut exponent) = ("", "", "");
        for (keyword, text) in gloss {
            match keyword {
                "illum" => illum = text.trim(),
                "Ks" => color = text.trim(),
                "Ns" => exponent = text.trim(),
                _ => {}
            }
        }
        let color = words(color).take(3).collect::<Vec<_>>();
        let shines = color.iter().any(|word| matches!(read(word), Word::Number(value) if value > 0.0));
        if shines && surface == Surface::Diffuse && !matches!(illum, "0" | "1") {
            let exponent = if exponent.is_empty() { String::new() } else { format!(", Ns {exponent}") };
            notes.push(format!("highlight (Ks {}{exponent})", color.join(" ")));
        }
        notes.extend(self.notes.into_iter().map(|(what, value)| format!("{what} {value}")));
        notes
    }
}
