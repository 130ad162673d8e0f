//! The blocks of a render in files: reads a part's film, and merges parts into the picture.

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

/// Merges the parts of one render into its picture, without a device.
pub struct RenderMerge {
    job: Value,
    settings: Settings,
    space: UnitSpace,
    film: FilmSum,
}

impl RenderMerge {
    /// An empty merge of the render that `part` belongs to. `path` is the file of `part`.
    ///
    /// # Errors
    /// [`Error::Input`] when `part` is damaged or of another version.
    pub fn new(path: &Path, part: &Part) -> Result<Self> {
        part.check_version(path)?;
        let mut settings: Settings = Part::parse_value(path, &part.job["settings"])?;
        settings.display = Part::parse_value(path, &part.state["display"])?;
        let space = Part::parse_value(path, &part.job["space"])?;
        settings.validate().map_err(|_| Error::input(path, None, "damaged: its settings are out of range", "make it again"))?;
        Ok(Self { job: part.job.clone(), settings, space, film: FilmSum::default() })
    }

    /// Adds the blocks of `part`, read from `path`.
    ///
    /// # Errors
    /// [`Error::Input`] when `part` belongs to another render, is damaged, or holds a block that was added before.
    pub fn add(&mut self, path: &Path, part: &Part) -> Result<()> {
        part.check(path, &self.job)?;
        let blocks = blocks_of(&self.settings);
        blocks.merge(path, &mut self.film, film_of_part(path, part, &self.settings, blocks)?)
    }

    /// The picture of all blocks.
    ///
    /// # Errors
    /// [`Error::Usage`] when blocks are missing.
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

/// The film of a part, read from `path`.
///
/// # Errors
/// [`Error::Input`] when the film does not fit the settings.
pub(super) fn film_of_part(path: &Path, part: &Part, settings: &Settings, blocks: Blocks) -> Result<FilmSum> {
    let film = |range, planes: Vec<&[f32]>| Film::of_planes(settings.film.size, blocks.directions(range).len() as u32, &planes);
    part.tree(path, FILM, blocks, film)
}

/// Fewer directions than this have so many blocks at most.
const MANY: u32 = 256;
const FEW_BLOCKS: u32 = 16;

/// The blocks of a render's directions. A block has its own sub-pixel offset, and at least one direction for each interleaved subset.
pub fn blocks_of(settings: &Settings) -> Blocks {
    let count = settings.directions.count;
    // A block costs as much as some directions. The noise of few directions hides what more sub-pixel offsets would gain.
    let least = if count < MANY { count.div_ceil(FEW_BLOCKS) } else { 1 };
    Blocks::new(count, settings.film.interleave.pixels().max(least))
}
