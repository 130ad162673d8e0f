//! A render begins again: with another camera, other settings, or changed shaders.

use std::time::Instant;

use super::method::{method, seen};
use super::{Passes, Render, RenderStatistics, ShadowCatcher, StageSeconds, layer_size, view_of};
use crate::direction::Directions;
use crate::error::Result;
use crate::film::FilmSum;
use crate::photon::PhotonCounts;
use crate::points::sides;
use crate::prepared::Photons;
use crate::scene::{Camera, WorldCamera};
use crate::settings::Settings;

impl Render {
    /// Begins again with another `camera`, in world space, and other `settings`. Keeps the surfaces, and the first photons and the passes where the
    /// settings allow. A render that has already replaced the first photons traces them again. Other settings of photons trace new ones, guided to what
    /// this camera sees; until they are there, both maps are in memory.
    ///
    /// # Errors
    /// As [`Self::new`]; then the sums are as before.
    pub fn restart(&mut self, camera: WorldCamera, settings: &Settings) -> Result<()> {
        settings.validate()?;
        let camera = self.all.scene.space.enter_camera(camera);
        if (settings.photons, settings.seed) == (self.settings.photons, self.settings.seed) {
            return self.begin_again(camera, settings);
        }
        let start = Instant::now();
        let (seen, of) = (seen(&self.gathered, &camera, settings.film.size), (&settings.photons, settings.seed));
        let make_room = || self.passes.gather.shrink();
        let photons = Photons::new(&self.gpu, [&self.all, &self.gathered], of, &sides(&seen), make_room)?;
        let seconds = start.elapsed().as_secs_f64();
        self.begin_again(camera, settings)?;
        (self.photons, self.guided) = (photons, view_of(&camera, settings));
        self.statistics.seconds.photons += seconds;
        self.forget();
        Ok(())
    }

    /// Begins again with this number of directions.
    ///
    /// # Errors
    /// As [`Self::restart`].
    pub fn restart_with(&mut self, directions: u32) -> Result<()> {
        let mut settings = self.asked;
        settings.directions.count = directions;
        self.begin_again(self.camera, &settings)
    }

    /// Tells the statistics how long blocks took whose sums are not kept.
    pub fn count_probes(&mut self, seconds: f64) {
        self.statistics.seconds.probes += seconds;
    }

    /// `camera` is in unit space.
    fn begin_again(&mut self, camera: Camera, settings: &Settings) -> Result<()> {
        settings.validate()?;
        let asked = *settings;
        let seen = seen(&self.gathered, &camera, settings.film.size);
        let (settings, interleave) = &method(self.gpu.is_software(), [&self.all, &self.gathered], (&camera, &seen), settings);
        let layers = |of: &Settings| of.gather.pipeline.has_layers().then(|| of.layers());
        let passes = |of: &Settings| (of.film, of.gather, layers(of), of.photons.map, of.seed);
        if (passes(settings), *interleave) != (passes(&self.settings), self.passes.interleave) {
            self.passes = Passes::new(&self.gpu, &self.gathered, settings, *interleave)?;
        }
        self.directions = Directions::new(settings.directions.sequence, settings.seed);
        (self.asked, self.settings) = (asked, *settings);
        self.camera = camera;
        self.catcher = ShadowCatcher::new(&self.all.scene, &camera, settings.film.ground);
        self.forget();
        Ok(())
    }

    /// Compiles all programs again, after [`crate::shaders::reload`], and begins again.
    ///
    /// # Errors
    /// When a program does not compile; then nothing has changed.
    pub fn reload(&mut self) -> Result<()> {
        self.passes = Passes::new(&self.gpu, &self.gathered, &self.settings, self.passes.interleave)?;
        self.forget();
        Ok(())
    }

    /// Discards all gathered sums.
    pub(super) fn forget(&mut self) {
        self.block = None;
        self.done = 0;
        self.film = FilmSum::default();
        self.reached = false;
        // The next block traces the first photons again, and that counts them.
        if self.photons.number > 0 {
            self.photons.counts = PhotonCounts::default();
        }
        let StageSeconds { prepare, photons, probes, .. } = self.statistics.seconds;
        self.statistics = RenderStatistics {
            scene: self.statistics.scene,
            photons: self.photons.counts,
            seconds: StageSeconds { prepare, photons, probes, ..StageSeconds::default() },
            ..RenderStatistics::default()
        };
        self.statistics.gather.layer_size = layer_size(&self.settings);
    }
}
