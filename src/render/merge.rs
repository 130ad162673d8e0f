//! The blocks of a render in files: what a part holds, and how parts become the picture.

use std::path::Path;

use serde_json::Value;

use crate::blocks::{Blocks, Part};
use crate::error::{Error, Result};
use crate::film::{Film, FilmSum};
use crate::image::Image;
use crate::scene::UnitSpace;
use crate::settings::Settings;

/// Name of the film's tree in a [`Part`].
pub(super) const FILM: &str = "film";

/// A picture from the parts of one render, without a device.
pub struct RenderMerge {
    job: Value,
    settings: Settings,
    space: UnitSpace,
    film: FilmSum,
}

impl RenderMerge {
    /// Of the render that `part`, read from `path`, is of; nothing yet.
    ///
    /// # Errors
    /// [`Error::Input`] when it is damaged.
    pub fn new(path: &Path, part: &Part) -> Result<Self> {
        part.check_version(path)?;
        let mut settings: Settings = Part::parse_value(path, &part.job["settings"])?;
        settings.display.exposure = Part::parse_value(path, &part.state["exposure"])?;
        let space = Part::parse_value(path, &part.job["space"])?;
        settings.validate().map_err(|_| Error::input(path, None, "damaged: its settings are out of range", "make it again"))?;
        Ok(Self { job: part.job.clone(), settings, space, film: FilmSum::default() })
    }

    /// # Errors
    /// [`Error::Input`] when it is of another render, damaged, or has blocks that are there already.
    pub fn add(&mut self, path: &Path, part: &Part) -> Result<()> {
        part.check(path, &self.job)?;
        let blocks = blocks_of(&self.settings);
        blocks.merge(path, &mut self.film, film_of_part(path, part, &self.settings, blocks)?)
    }

    /// # Errors
    /// [`Error::Usage`] when directions are missing.
    pub fn picture(&self) -> Result<Image> {
        blocks_of(&self.settings).check_whole(&self.film)?;
        Ok(self.film.image(self.settings.film.size, &self.space))
    }

    /// As [`super::Render::job`].
    pub fn job(&self) -> &Value {
        &self.job
    }

    /// The settings of the render.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }
}

/// The film of a part that was read from `path`.
///
/// # Errors
/// [`Error::Input`] when it does not fit the settings.
pub(super) fn film_of_part(path: &Path, part: &Part, settings: &Settings, blocks: Blocks) -> Result<FilmSum> {
    let film = |range, planes: Vec<&[f32]>| Film::of_planes(settings.film.size, blocks.directions(range).len() as u32, &planes);
    part.tree(path, FILM, blocks, film)
}

/// How the directions of a render fall into blocks. A block has its own sub-pixel offset, and a direction or more for each interleaved subset.
pub fn blocks_of(settings: &Settings) -> Blocks {
    Blocks::new(settings.directions.count, settings.film.interleave * settings.film.interleave)
}
