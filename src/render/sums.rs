//! The sums of a render: a finished block goes to the film, and the film makes the picture.

use std::time::Instant;

use super::{Block, Render};
use crate::error::Result;
use crate::film::BlockLight;
use crate::image::Image;
use crate::points::Sharing;
use crate::settings::Estimator;

impl Render {
    /// The mean so far, with the channels of [`FilmSum::image`](crate::film::FilmSum::image); black before the first direction.
    pub fn picture(&self) -> Image {
        let Some(block) = &self.block else { return self.film.image(self.settings.film.size, &self.all.scene.space) };
        let (mut film, size) = (self.film.clone(), self.settings.film.size);
        self.sum(block, |sums| film.add_block(block.index, size, sums));
        film.image(size, &self.all.scene.space)
    }

    /// Adds a finished block to the film.
    ///
    /// # Errors
    /// When the device fails; then the film is as before.
    pub(super) fn end_block(&mut self, block: Block) -> Result<()> {
        let start = Instant::now();
        let mut film = std::mem::take(&mut self.film);
        let added = self.sum(&block, |sums| {
            self.gpu.check("reading sums")?;
            film.add_block(block.index, self.settings.film.size, sums);
            Ok(())
        });
        self.film = film;
        added?;
        self.estimate_error();
        self.passes.source.recycle(block.g_buffer);
        self.statistics.seconds.film += start.elapsed().as_secs_f64();
        Ok(())
    }

    /// Gives the sums of a block to `take`.
    fn sum<T>(&self, block: &Block, take: impl FnOnce(&BlockLight) -> T) -> T {
        let mut gathered = self.passes.gather.read();
        if self.settings.directions.estimator == Estimator::Plain {
            gathered.iter_mut().enumerate().for_each(|(pixel, sum)| sum.w = self.expected_weight(block, pixel));
        }
        let sharing = Sharing::new(&self.passes.interleave, &block.g_buffer);
        let lobes = self.lobe_sums(block, &sharing, &mut gathered);
        let gathered = sharing.share(gathered, &block.taken);
        take(&BlockLight {
            directions: self.taken(block),
            g_buffer: &block.g_buffer,
            direct: &block.direct,
            caustics: &block.caustics,
            photon_map: &block.photon_map,
            environment: self.all.scene.environment.is_some(),
            ground: &self.ground_lights(block, &sharing, &gathered),
            gathered: &gathered,
            lobes: lobes.as_ref(),
        })
    }

    /// The plain estimator divides by the expected sum of the weights. Over the sphere the mean of max(n·d, 0) is 1/4, that of |n·d| 1/2.
    pub(super) fn expected_weight(&self, block: &Block, pixel: usize) -> f32 {
        let mean = if self.passes.gather.both_ends() { 0.5 } else { 0.25 };
        mean * block.taken[self.passes.interleave.subset_of(pixel).index()] as f32
    }

    /// Estimates the error after every eighth block and the last one, for the report and to stop at the target error.
    pub(super) fn estimate_error(&mut self) {
        let blocks = self.film.blocks();
        let is_last = self.next_block().is_none();
        if is_last {
            self.film.shrink();
        }
        if blocks.is_multiple_of(8) || is_last {
            self.statistics.error = self.film.error();
            let target = self.settings.directions.target_error;
            self.reached = target > 0.0 && self.statistics.error.is_some_and(|error| error <= target);
        }
    }
}
