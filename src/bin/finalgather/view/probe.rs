//! The values under the cursor.

use egui::text::{LayoutJob, TextFormat};
use egui::{FontId, Visuals};
use finalgather::image::{Image, luminance};
use finalgather::render::SeenSurface;
use glam::{DVec3, Vec2, Vec3};
use serde::Serialize;

use super::false_color::short;

/// The channels of a picture at one pixel, in world space.
#[derive(Clone, Debug, Serialize)]
pub struct PixelValues {
    pub pixel: [usize; 2],
    pub radiance: Vec3,
    pub luminance: f32,
    /// `None` where no surface is seen.
    pub surface: Option<SurfaceValues>,
    /// Share of the sky, if ambient occlusion is shown.
    pub occlusion: Option<f32>,
    /// Standard error of the luminance, from two blocks of directions on.
    pub error: Option<f32>,
    /// Radiance of the reference.
    pub reference: Option<Vec3>,
}

#[derive(Clone, Debug, Serialize)]
pub struct SurfaceValues {
    pub position: DVec3,
    pub normal: Vec3,
    pub albedo: Vec3,
    /// Distance along the view axis.
    pub depth: f32,
    pub object: String,
    pub material: String,
}

impl PixelValues {
    /// The values at `place` in the picture, both coordinates in [0, 1). Positions of pictures are relative to `origin`. `None` if the picture has
    /// no radiance.
    pub fn new(
        picture: &Image,
        place: Vec2,
        origin: DVec3,
        seen: Option<&SeenSurface>,
        reference: Option<&Image>,
    ) -> Option<Self> {
        let three = |image: &Image, [a, b, c]: [&str; 3]| {
            let at = pixel_at(image, place);
            let index = at[1] * image.width + at[0];
            let value = |name: &str| image.channel(name)?.get(index).copied();
            Some(Vec3::new(value(a)?, value(b)?, value(c)?))
        };
        let one = |name: &str| three(picture, [name; 3]).map(|value| value.x);
        let radiance = three(picture, ["R", "G", "B"])?;
        let surface = || {
            let named = |name: fn(&SeenSurface) -> &String| seen.map(name).cloned().unwrap_or_default();
            Some(SurfaceValues {
                position: origin + three(picture, ["P.X", "P.Y", "P.Z"])?.as_dvec3(),
                normal: three(picture, ["N.X", "N.Y", "N.Z"])?,
                albedo: three(picture, ["Albedo.R", "Albedo.G", "Albedo.B"])?,
                depth: one("Z")?,
                object: named(|seen| &seen.object),
                material: named(|seen| &seen.material),
            })
        };
        Some(Self {
            pixel: pixel_at(picture, place),
            radiance,
            luminance: luminance(radiance.to_array()),
            surface: one("A").filter(|&coverage| coverage > 0.0).and_then(|_| surface()),
            occlusion: one("AO"),
            error: three(picture, ["Error.R", "Error.G", "Error.B"]).map(|error| luminance(error.to_array())),
            reference: reference.and_then(|reference| three(reference, ["R", "G", "B"])),
        })
    }

    /// Names and values, for the reader.
    fn words(&self) -> Vec<(&'static str, String)> {
        let three = |value: Vec3| value.to_array().map(short).join(" ");
        let mut words = vec![
            ("pixel", format!("{}, {}", self.pixel[0], self.pixel[1])),
            // With both, each has its name: the strip is the same while the reference is shown.
            (if self.reference.is_some() { "render" } else { "R G B" }, three(self.radiance)),
            ("luminance", short(self.luminance)),
        ];
        words.extend(self.reference.map(|reference| ("reference", three(reference))));
        words.extend(self.occlusion.map(|share| ("open", format!("{:.1} %", 100.0 * share))));
        words.extend(self.error.map(|error| ("error", short(error))));
        match &self.surface {
            None => words.push(("", "no surface".into())),
            Some(surface) => {
                let SurfaceValues { position, normal, albedo, depth, object, material } = surface;
                words.push(("position", position.to_array().map(coordinate).join(" ")));
                words.push((
                    "normal",
                    normal.to_array().map(|part| format!("{:.2}", (100.0 * part).round() / 100.0 + 0.0)).join(" "),
                ));
                words.push(("albedo", three(*albedo)));
                words.push(("depth", short(*depth)));
                let names = [("object", object), ("material", material)].into_iter().filter(|(_, name)| !name.is_empty());
                words.extend(names.map(|(what, name)| (what, name.clone())));
            }
        }
        words
    }

    /// The values as text that breaks between them only.
    pub fn text(&self, visuals: &Visuals, width: f32) -> LayoutJob {
        let mut job = LayoutJob::default();
        job.wrap.max_width = width;
        let format = |color| TextFormat { font_id: FontId::proportional(12.5), color, ..TextFormat::default() };
        for (name, value) in self.words() {
            let bound = |text: &str| text.replace(' ', "\u{a0}");
            job.append(&bound(&format!("{name} ")), 0.0, format(visuals.weak_text_color()));
            job.append(&bound(&value), 0.0, format(visuals.strong_text_color()));
            job.append("    ", 0.0, format(visuals.weak_text_color()));
        }
        job
    }
}

/// A coordinate of the scene. It keeps its digits before the point.
fn coordinate(value: f64) -> String {
    let digits = if value.abs() >= 100.0 { 1 } else { 3 };
    let scale = 10_f64.powi(digits);
    // Plus 0 takes the sign from a zero.
    format!("{:.*}", digits as usize, (scale * value).round() / scale + 0.0)
}

/// The pixel at `place`, both coordinates in [0, 1).
fn pixel_at(image: &Image, place: Vec2) -> [usize; 2] {
    let side = |part: f32, side: usize| ((part * side as f32) as usize).min(side.saturating_sub(1));
    [side(place.x, image.width), side(place.y, image.height)]
}

#[cfg(test)]
mod tests {
    use finalgather::image::Channel;

    use super::*;

    #[test]
    fn values_are_those_of_the_pixel() {
        let names = ["R", "G", "B", "A", "P.X", "P.Y", "P.Z", "N.X", "N.Y", "N.Z", "Albedo.R", "Albedo.G", "Albedo.B", "Z"];
        let channel = |(k, name): (usize, &&str)| Channel { name: (*name).into(), samples: vec![0.0, 1.0 + k as f32, 0.0, 0.0] };
        let image = Image { width: 2, height: 2, channels: names.iter().enumerate().map(channel).collect() };
        let at = |x, y| PixelValues::new(&image, Vec2::new(x, y), DVec3::new(1000.0, 0.0, 0.0), None, None).unwrap();
        let values = at(0.75, 0.25);
        assert_eq!((values.pixel, values.radiance), ([1, 0], Vec3::new(1.0, 2.0, 3.0)));
        let surface = values.surface.unwrap();
        assert_eq!((surface.position, surface.depth), (DVec3::new(1005.0, 6.0, 7.0), 14.0));
        assert!(at(0.25, 0.25).surface.is_none(), "nothing is seen there");
        assert_eq!([-1e-5, -0.5, -1234.56].map(coordinate), ["0.000", "-0.500", "-1234.6"]);
    }
}
