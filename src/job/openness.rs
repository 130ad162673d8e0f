//! Ambient occlusion of what a render's camera sees, as a picture that grows beside the render.

use glam::Vec2;

use super::Receiver;
use crate::bake::{Bake, Plan, RadianceCache};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::image::Channel;
use crate::points::CameraPoints;
use crate::quantity::Quantity;
use crate::render::Render;

/// A bake of [`Quantity::Ao`] at the points that a render's camera sees.
pub struct Openness {
    /// With its receiver; `None` if the camera sees no surface.
    bake: Option<(Bake, Receiver)>,
    pixels: usize,
}

impl Openness {
    /// Shares the scene and its GL side with `render`.
    ///
    /// # Errors
    /// As [`Bake::new`].
    pub fn new(gpu: &Gpu, render: &Render) -> Result<Self> {
        let (prepared, geometry, camera) = render.gathered();
        let mut settings = *render.settings();
        settings.directions.target_error = 0.0;
        let size = settings.film.size;
        let pixels = size.iter().map(|&side| side as usize).product();
        let seen = CameraPoints::new(gpu, size)?.see(&geometry, &camera, Vec2::splat(0.5), 0);
        if seen.count == 0 {
            return Ok(Self { bake: None, pixels });
        }
        let receiver = Receiver::of_camera(&seen, size, &prepared.scene.space)?;
        let plan = Plan {
            what: vec![Quantity::Ao],
            order: 1,
            gather_bounces: 0,
            ao_distance: None,
            radiance_cache: RadianceCache::Photons,
            memory: Plan::MEMORY,
        };
        let bake = Bake::new(gpu, prepared, geometry, receiver.points().to_vec(), &settings, &plan)?;
        Ok(Self { bake: Some((bake, receiver)), pixels })
    }

    pub fn is_done(&self) -> bool {
        self.bake.as_ref().is_none_or(|(bake, _)| bake.is_done())
    }

    /// Gathers along the next directions.
    ///
    /// # Errors
    /// As [`Bake::step`].
    pub fn step(&mut self) -> Result<()> {
        self.bake.as_mut().map_or(Ok(()), |(bake, _)| bake.step())
    }

    /// The channel `AO` so far, row by row from the top. It is 1 where the camera sees no surface; `None` before the first directions.
    pub fn channel(&self) -> Option<Channel> {
        let mut samples = vec![1.0; self.pixels];
        if let Some((bake, Receiver::Camera { pixels, .. })) = &self.bake {
            let (columns, _) = bake.columns()?;
            pixels.iter().zip(&columns.first()?.samples).for_each(|(&pixel, &sample)| samples[pixel as usize] = sample);
        }
        Some(Channel { name: "AO".to_owned(), samples })
    }
}
