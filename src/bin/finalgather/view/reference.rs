//! A picture to compare the render with.

use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use finalgather::error::{Error, Result};
use finalgather::image::compare::{Comparison, Selection, ViewingConditions, compare_as};
use finalgather::image::{Channel, Image, decode_srgb};

use super::picture::{Developed, DisplayContent, DisplayOptions, develop, develop_difference};

/// A reference that is open.
pub struct ReferencePicture {
    pub path: PathBuf,
    pub image: Arc<Image>,
    /// It is a PNG: its pixels have an exposure and a tone curve already.
    toned: bool,
    /// As what it was told last.
    told: Cell<Option<DisplayOptions>>,
}

impl ReferencePicture {
    /// # Errors
    /// [`Error::Input`] when it is no picture with R, G and B.
    pub fn open(path: &Path) -> Result<Self> {
        let image = Image::read(path)?;
        if let Err(Error::Usage { problem, cure }) = image.rgb() {
            return Err(Error::input(path, None, problem, cure));
        }
        let toned = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"));
        Ok(Self { path: path.to_owned(), image: Arc::new(image), toned, told: Cell::new(None) })
    }

    /// Whether it is to be shown otherwise than when this was asked last.
    pub fn is_new(&self, shown: &DisplayOptions) -> bool {
        self.told.replace(Some(*shown)).as_ref() != Some(shown)
    }

    /// Its pixels to display.
    ///
    /// # Errors
    /// If it lacks what is shown.
    pub fn develop(&self, shown: &DisplayOptions) -> Result<Developed> {
        if !self.toned {
            return develop(&self.image, shown);
        }
        self.check_shown(&DisplayOptions { difference: false, ..*shown })?;
        // Its colours are the encoded values themselves. Albedo is shown so: without exposure and tone curve.
        let names = [("R", "Albedo.R"), ("G", "Albedo.G"), ("B", "Albedo.B")];
        let channels = names.map(|(from, name)| Channel { name: name.into(), samples: self.samples(from) });
        let plain = Image { channels: channels.into(), ..*self.image };
        develop(&plain, &DisplayOptions { content: DisplayContent::Albedo, ..*shown })
    }

    fn samples(&self, name: &str) -> Vec<f32> {
        self.image.channel(name).unwrap_or_default().to_vec()
    }

    /// The difference of `picture` from it.
    ///
    /// # Errors
    /// If their sizes differ, or one lacks what is shown.
    pub fn difference(&self, picture: &Image, shown: &DisplayOptions) -> Result<Developed> {
        self.check_size(picture)?;
        // Differences have false colours anyway.
        self.check_shown(&DisplayOptions { difference: false, false_color: false, ..*shown })?;
        develop_difference(&self.like_it(picture, shown)?, &self.image, shown)
    }

    /// Bias, RMSE and FLIP of `picture`. With a PNG, of the shown colours.
    ///
    /// # Errors
    /// If their sizes differ, or a sample is not finite.
    pub fn compare(&self, picture: &Image, shown: &DisplayOptions) -> Result<Comparison> {
        self.check_size(picture)?;
        let view = ViewingConditions { exposure: if self.toned { 0.0 } else { shown.exposure.given() }, toned: [self.toned; 2] };
        let like = self.like_it(picture, shown)?;
        Ok(compare_as(&like, &self.image, Selection::default(), view)?.0)
    }

    fn check_shown(&self, shown: &DisplayOptions) -> Result<()> {
        if self.toned && !shown.is_radiance() {
            return Err(Error::usage("a PNG holds only the shown colours", "show all radiance, or open an EXR"));
        }
        Ok(())
    }

    fn check_size(&self, picture: &Image) -> Result<()> {
        let [own, other] = [&*self.image, picture].map(|image| [image.width, image.height]);
        if own == other {
            return Ok(());
        }
        let problem = format!("the reference has {} x {} pixels, the picture {} x {}", own[0], own[1], other[0], other[1]);
        Err(Error::usage(problem, "press \"Take its size\""))
    }

    /// The picture, with the exposure and curve of a PNG if the reference is one.
    fn like_it(&self, picture: &Image, shown: &DisplayOptions) -> Result<Image> {
        if !self.toned {
            return Ok(picture.clone());
        }
        let bytes = picture.to_srgba8(shown.exposure.given(), shown.background)?;
        // As a transparent PNG is read: over black.
        let over_black = |pixel: &[u8], k: usize| decode_srgb(f32::from(pixel[k]) / 255.0) * f32::from(pixel[3]) / 255.0;
        let plane = |k| bytes.chunks_exact(4).map(|pixel| over_black(pixel, k)).collect();
        let [r, g, b] = [0, 1, 2].map(plane);
        let channels = [("R", r), ("G", g), ("B", b)].map(|(name, samples)| Channel { name: name.into(), samples });
        Ok(Image { channels: channels.into(), ..*picture })
    }
}

#[cfg(test)]
mod tests {
    use finalgather::image::encode_srgb;
    use finalgather::settings::Exposure;

    use super::*;

    fn picture(side: usize, value: f32) -> Image {
        let channels = ["R", "G", "B"].map(|name| Channel { name: name.into(), samples: vec![value; side * side] });
        Image { width: side, height: side, channels: channels.into() }
    }

    fn exposed(stops: f32) -> DisplayOptions {
        DisplayOptions { exposure: Exposure::Stops(stops), ..DisplayOptions::default() }
    }

    fn reference(image: Image, toned: bool) -> ReferencePicture {
        ReferencePicture { path: "reference".into(), image: Arc::new(image), toned, told: Cell::new(None) }
    }

    #[test]
    fn sizes_must_agree() {
        let error = reference(picture(4, 1.0), false).compare(&picture(2, 1.0), &exposed(0.0)).unwrap_err().to_string();
        assert!(error.contains("4 x 4") && error.contains("2 x 2") && error.contains("Take its size"), "{error}");
    }

    #[test]
    fn a_png_is_compared_with_what_is_shown() {
        // Half of white, one stop brighter, is white in a PNG up to its tone curve.
        let shown = decode_srgb(f32::from(picture(2, 0.5).to_srgb8(1.0).unwrap()[0]) / 255.0);
        let toned = reference(picture(2, shown), true);
        assert_eq!(toned.compare(&picture(2, 0.5), &exposed(1.0)).unwrap().rmse, 0.0);
        assert!(toned.compare(&picture(2, 0.5), &exposed(0.0)).unwrap().rmse > 0.1);
        let linear = reference(picture(2, 0.5), false);
        assert_eq!(linear.compare(&picture(2, 0.75), &exposed(1.0)).unwrap().bias, 0.5);
        let developed = toned.develop(&exposed(3.0)).unwrap();
        let byte = (255.0 * encode_srgb(shown)).round() as u8;
        assert_eq!(developed.image.pixels[0].r(), byte, "its own colours, whatever the exposure");
        assert!(toned.develop(&DisplayOptions { false_color: true, ..DisplayOptions::default() }).is_err());
        let difference = |content| toned.difference(&picture(2, 0.5), &DisplayOptions { content, ..exposed(1.0) });
        assert!(difference(DisplayContent::Radiance).is_ok());
        let error = difference(DisplayContent::Albedo).err().unwrap().to_string();
        assert!(error.contains("only the shown colours"), "{error}");
    }
}
