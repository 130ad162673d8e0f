//! What 8-bit pictures show of a picture of floats: exposure, and what stands where there is no surface.

use rayon::prelude::*;

use super::{Image, encode_srgb, tone};
use crate::error::Result;
use crate::settings::{Background, Exposure};

/// Automatic exposure brings the radiance that this share of the surfaces does not reach to `BRIGHT`, below the shoulder of the tone curve.
const MOST: f32 = 0.95;
const BRIGHT: f32 = 0.7;

/// Rec. 709 luminance.
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

impl Image {
    /// The exposure in stops that shows the light of surfaces bright but not blown. Lamps and the environment do not count. 0 without light or channels.
    pub fn automatic_exposure(&self) -> f32 {
        let parts =
            ["Direct", "Indirect", "Caustics"].map(|part| self.triple([".R", ".G", ".B"].map(|of| format!("{part}{of}"))));
        let [Some(direct), Some(indirect), Some(caustics), Some(cover)] =
            [parts[0], parts[1], parts[2], self.channel("A").map(|cover| [cover; 3])]
        else {
            return 0.0;
        };
        let of = |pixel: usize| {
            let light = [0, 1, 2].map(|k| direct[k][pixel] + indirect[k][pixel] + caustics[k][pixel]);
            (cover[0][pixel] > 0.5).then(|| luminance(light) / cover[0][pixel])
        };
        let mut seen: Vec<f32> = (0..self.width * self.height).filter_map(of).filter(|light| light.is_finite()).collect();
        if seen.is_empty() {
            return 0.0;
        }
        let place = (MOST * (seen.len() - 1) as f32) as usize;
        let (_, &mut light, _) = seen.select_nth_unstable_by(place, f32::total_cmp);
        // In hundredths, so that a person can repeat it.
        let stops = (100.0 * (BRIGHT / light).log2()).round() / 100.0;
        if light > 0.0 { stops.clamp(-Exposure::MOST, Exposure::MOST) } else { 0.0 }
    }

    /// The stops of an exposure.
    pub fn stops(&self, exposure: Exposure) -> f32 {
        match exposure {
            Exposure::Auto => self.automatic_exposure(),
            Exposure::Stops(stops) => stops,
        }
    }

    /// The bytes of a PNG: R, G, B and straight alpha of each pixel in turn. A picture without the channel `A` has no background.
    ///
    /// # Errors
    /// As [`Self::rgb`].
    pub fn to_srgba8(&self, exposure: f32, background: Background) -> Result<Vec<u8>> {
        let (rgb, scale) = (self.rgb()?, exposure.exp2());
        let cover = self.channel("A");
        let environment = self.triple(["Environment.R", "Environment.G", "Environment.B"].map(str::to_owned));
        let shadow = self.channel("Shadow");
        let pixel = |i: usize| {
            let (radiance, cover) = (rgb.map(|samples| samples[i]), cover.map_or(1.0, |cover| cover[i].clamp(0.0, 1.0)));
            let behind = environment.map_or([0.0; 3], |samples| samples.map(|samples| samples[i]));
            let shadow = shadow.map_or(0.0, |shadow| shadow[i].min(1.0 - cover).max(0.0));
            // The curve is of the surface alone. Otherwise the edge of a bright surface would turn dark.
            let surface = |k: usize| if cover > 0.0 { tone((radiance[k] - behind[k]) / cover * scale) } else { 0.0 };
            let alpha = if background == Background::Transparent { cover + shadow } else { 1.0 };
            let dark = if shadow > 0.0 { shadow / (1.0 - cover) } else { 0.0 };
            let shown = |k: usize| match background {
                Background::Environment => encode_srgb(tone((radiance[k] - dark * behind[k]) * scale)),
                Background::Color(color) => encode_srgb(cover * surface(k) + color[k] * (1.0 - cover - shadow)),
                // Viewers lay encoded values over each other. So surface and shadow meet in these too, and no edge is lighter than both.
                Background::Transparent if alpha > 0.0 => encode_srgb(surface(k)) * cover / alpha,
                Background::Transparent => 0.0,
            };
            let [r, g, b] = [0, 1, 2].map(|k| (shown(k) * 255.0).round() as u8);
            [r, g, b, (alpha * 255.0).round() as u8]
        };
        Ok((0..self.width * self.height).into_par_iter().flat_map_iter(pixel).collect())
    }

    fn triple(&self, names: [String; 3]) -> Option<[&[f32]; 3]> {
        let [r, g, b] = names.map(|name| self.channel(&name));
        Some([r?, g?, b?])
    }
}

#[cfg(test)]
mod tests {
    use super::super::Channel;
    use super::*;

    /// Pixels of these channels, one sample each.
    fn image(pixels: usize, channels: &[(&str, &[f32])]) -> Image {
        let rgb = |name: &str, samples: &[f32]| {
            let names = if ["A", "Shadow"].contains(&name) {
                vec![name.to_owned()]
            } else {
                ["R", "G", "B"].map(|of| format!("{name}{of}")).into()
            };
            names.into_iter().map(|name| Channel { name, samples: samples.to_vec() }).collect::<Vec<_>>()
        };
        let channels = channels.iter().flat_map(|(name, samples)| rgb(name, samples)).collect();
        Image { width: pixels, height: 1, channels }
    }

    #[test]
    fn automatic_exposure_is_of_the_light_of_surfaces() {
        // A lamp, an edge, and nothing beside eight pixels of 0.2.
        let (mut direct, mut cover) = (vec![0.15; 8], vec![1.0; 8]);
        direct.extend([0.0, 0.075, 0.0]);
        cover.extend([1.0, 0.75, 0.0]);
        let indirect: Vec<f32> = direct.iter().map(|light| light / 3.0).collect();
        let none = vec![0.0; 11];
        let picture = |direct: &[f32], indirect: &[f32]| {
            image(11, &[("Direct.", direct), ("Indirect.", indirect), ("Caustics.", &none), ("A", &cover)])
        };
        assert_eq!(picture(&direct, &indirect).automatic_exposure(), 1.81);
        assert_eq!(picture(&none, &none).automatic_exposure(), 0.0);
        assert_eq!(image(1, &[("", &[3.0])]).automatic_exposure(), 0.0);
    }

    #[test]
    fn an_edge_has_the_colour_of_its_surface_and_the_coverage_as_alpha() {
        // A quarter of the pixel sees a surface of 0.4, and the rest a sky of 2.
        let edge = image(1, &[("", &[0.25 * 0.4 + 0.75 * 2.0]), ("Environment.", &[0.75 * 2.0]), ("A", &[0.25])]);
        let byte = |value: f32| (255.0 * encode_srgb(value)).round() as u8;
        let shown = |background| edge.to_srgba8(1.0, background).unwrap();
        assert_eq!(shown(Background::Transparent), [byte(0.8), byte(0.8), byte(0.8), 64]);
        let [r, g, b] = [0.0, 1.0, 0.5].map(|behind: f32| byte(0.25 * 0.8 + 0.75 * behind));
        assert_eq!(shown(Background::Color([0.0, 1.0, 0.5])), [r, g, b, 255]);
        assert_eq!(shown(Background::Environment)[..3], edge.to_srgb8(1.0).unwrap());
    }

    #[test]
    fn an_edge_before_a_shadow_is_not_lighter_than_both() {
        let picture = |cover: f32| image(1, &[("", &[0.4 * cover]), ("A", &[cover]), ("Shadow", &[0.3 * (1.0 - cover)])]);
        // As a viewer lays it over white.
        let on_white = |cover| match picture(cover).to_srgba8(0.0, Background::Transparent).unwrap()[..] {
            [r, _, _, alpha] => f32::from(r) * f32::from(alpha) / 255.0 + 255.0 - f32::from(alpha),
            _ => unreachable!("one pixel"),
        };
        let [shadow, edge, surface] = [0.0, 0.5, 1.0].map(on_white);
        assert!((edge - 0.5 * (shadow + surface)).abs() < 1.0, "{shadow} {edge} {surface}");
    }
}
