//! What `auto` stands for in a render.

use glam::Vec2;

use crate::gather::chosen_for_picture;
use crate::points::{GatherPoint, Interleave, chosen_source};
use crate::prepared::Prepared;
use crate::scene::{Camera, Chance, Rays};
use crate::settings::{Pipeline, Settings, Squares};

/// Eye rays along each side of the picture that stand for its points.
const SIDE: u32 = 32;

/// The settings with a pipeline and points that are not `auto`, and how pixels share its directions. The scenes are that with glass and that without, and
/// `seen` is what the camera sees of the second.
/// `software`: [`Gpu::is_software`](crate::gpu::Gpu::is_software).
pub(super) fn method(
    software: bool,
    [all, gathered]: [&Prepared; 2],
    (camera, seen): (&Camera, &[GatherPoint]),
    asked: &Settings,
) -> (Settings, Interleave) {
    let mut settings = *asked;
    settings.film.points = chosen_source(&all.scene, camera.lens.is_some(), &asked.film);
    if asked.gather.pipeline == Pipeline::Auto {
        settings.gather.pipeline = chosen_for_picture(software, asked, &gathered.scene, &gathered.bvh, seen);
    }
    let (size, seed) = (settings.film.size, settings.seed);
    let interleave = match settings.film.interleave {
        Squares::Pixels(side) => Interleave::new(side, size, seed),
        Squares::Auto if asked.gather.pipeline == Pipeline::Auto && !settings.gather.pipeline.has_layers() => {
            Interleave::spread(size, seed, settings.directions.count)
        }
        Squares::Auto => Interleave::new(1, size, seed),
    };
    (settings, interleave)
}

/// Points that the camera sees, through a pinhole and on the first surface.
pub(super) fn seen(gathered: &Prepared, camera: &Camera, [width, height]: [u32; 2]) -> Vec<GatherPoint> {
    let rays = Rays::new(&gathered.scene, &gathered.bvh);
    let see = |number: u32| {
        let place = (Vec2::new((number % SIDE) as f32, (number / SIDE) as f32) + 0.5) / SIDE as f32;
        let ray = camera.ray(place, width as f32 / height as f32);
        let hit = rays.nearest(camera.eye, ray, None, Chance::of_pixel(number, 0, 0))?;
        Some(GatherPoint::flat(camera.eye + hit.distance * ray, gathered.scene.mesh.side_met(hit.triangle, ray)))
    };
    (0..SIDE * SIDE).filter_map(see).collect()
}

/// What decides which points a picture sees.
pub(super) fn view_of(camera: &Camera, settings: &Settings) -> String {
    format!("{camera:?} at {:?}", settings.film.size)
}
