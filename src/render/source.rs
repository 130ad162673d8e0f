//! Where the pixels of a block get their points.

use glam::Vec2;

use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::Gpu;
use crate::points::{CameraPoints, EyeRays, GBuffer, GlossTextures, Ground, PointTextures, Points};
use crate::prepared::Prepared;
use crate::scene::Camera;
use crate::settings::{PointSource, Settings};

/// The source of a block's gather points.
pub(super) enum PixelSource {
    Camera {
        points: Box<CameraPoints>,
        /// The points of the block in progress, if they are not only those of the rasteriser.
        uploaded: Option<PointTextures>,
        /// The G-buffer of an earlier block, whose memory the next one takes: fresh memory costs as much time as its content.
        spare: GBuffer,
    },
    /// The points of the block in progress, once there is one.
    Traced(Option<PointTextures>),
}

/// What is seen, and how.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub gpu: &'a Gpu,
    pub all: &'a Prepared,
    pub geometry: &'a Geometry,
    pub camera: &'a Camera,
    pub settings: &'a Settings,
}

impl PixelSource {
    /// # Errors
    /// If the picture exceeds the device's limits.
    pub fn new(gpu: &Gpu, settings: &Settings) -> Result<Self> {
        Ok(match settings.film.points {
            PointSource::Camera => Self::Camera {
                points: Box::new(CameraPoints::new(gpu, settings.film.size)?),
                uploaded: None,
                spare: GBuffer::default(),
            },
            PointSource::Auto => unreachable!("auto is replaced when a job begins"),
            PointSource::Traced => Self::Traced(None),
        })
    }

    /// Finds the points of block `index`, at `offset` in each pixel.
    ///
    /// # Errors
    /// When the device has no room for them.
    pub fn see(&mut self, view: View, ground: Option<Ground>, offset: Vec2, index: u32) -> Result<GBuffer> {
        let View { gpu, all: Prepared { scene, bvh, .. }, geometry, camera, settings } = view;
        let size = settings.film.size;
        let upload = |g_buffer: &GBuffer| -> Result<PointTextures> {
            let GBuffer { position, normal, count, gloss, .. } = g_buffer;
            let gloss = (!gloss.is_empty()).then(|| GlossTextures::upload(gpu, size, gloss)).transpose()?;
            Ok(PointTextures::upload(gpu, size, position, normal, *count)?.with_gloss(gloss))
        };
        Ok(match self {
            Self::Camera { points, uploaded, spare } => {
                let mut g_buffer = points.see_into(std::mem::take(spare), geometry, camera, offset, index);
                g_buffer.add_pictures_of_emission(scene);
                g_buffer.add_environment(scene, camera, size, offset);
                let shaded = scene.is_glossy() || scene.has_normal_maps();
                if shaded {
                    g_buffer.add_gloss(scene, camera.eye);
                }
                if let Some(ground) = ground {
                    g_buffer.add_ground(&ground, camera, size, offset);
                }
                if shaded || ground.is_some() {
                    *uploaded = Some(upload(&g_buffer)?);
                }
                g_buffer
            }
            Self::Traced(uploaded) => {
                let g_buffer = EyeRays { scene, bvh, camera, size, seed: settings.seed, ground }.see(offset, index);
                *uploaded = Some(upload(&g_buffer)?);
                g_buffer
            }
        })
    }

    /// Takes back the G-buffer of a finished block.
    pub fn recycle(&mut self, g_buffer: GBuffer) {
        if let Self::Camera { spare, .. } = self {
            *spare = g_buffer;
        }
    }

    /// The points of the block in progress.
    pub fn points<'a>(&'a self, g_buffer: &GBuffer) -> Points<'a> {
        match self {
            Self::Camera { points, uploaded: None, .. } => points.points(g_buffer),
            Self::Camera { uploaded, .. } | Self::Traced(uploaded) => {
                uploaded.as_ref().expect("a block begins with its points").points()
            }
        }
    }
}
