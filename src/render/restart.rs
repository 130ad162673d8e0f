//! A render begins again: with another camera, other settings, or changed shaders.

use super::method::{method, seen};
use super::{Passes, Render, RenderStatistics, ShadowCatcher, StageSeconds, layer_size};
use crate::direction::Directions;
use crate::error::{Error, Result};
use crate::film::FilmSum;
use crate::photon::PhotonCounts;
use crate::scene::{Camera, WorldCamera};
use crate::settings::Settings;

impl Render {
    /// Begins again with another `camera`, in world space, and other `settings`. Keeps the surfaces, the first photons, and the passes where the
    /// settings allow. A render that has already replaced the first photons traces them again.
    ///
    /// # Errors
    /// As [`Self::new`], and when `settings` change the photons; then nothing has changed.
    pub fn restart(&mut self, camera: WorldCamera, settings: &Settings) -> Result<()> {
        if (settings.photons, settings.seed) != (self.settings.photons, self.settings.seed) {
            return Err(Error::usage("the photons of a render in progress cannot change", "open the scene again"));
        }
        self.begin_again(self.all.scene.space.enter_camera(camera), settings)
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
        let passes = |of: &Settings| (of.film, of.gather, of.gather.pipeline.has_layers().then(|| of.layers()));
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
