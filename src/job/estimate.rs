//! A rough estimate of what a picture takes, before it is rendered.
//!
//! Rays on the CPU are timed, a few thousand from what the camera sees. How many of them cost as much as one ray of a pipeline was measured on a software
//! driver, which shares the CPU (`docs/performance.md`). A GPU takes less.

use std::time::Instant;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::Serialize;

use crate::gather::chosen_for_picture;
use crate::math::cosine_direction;
use crate::points::{GatherPoint, Interleave};
use crate::prepared::Prepared;
use crate::random::Random;
use crate::render::{blocks_of, memory_of};
use crate::scene::{Bvh, RAY_OFFSET};
use crate::settings::{DIRECTIONS_PER_PHOTON_MAP, Pipeline, Settings, Squares};

/// Rays along each side of the sparse picture.
const SIDE: usize = 64;
/// Timed rays at each point.
const RAYS: u64 = 16;
/// The fastest of these counts.
const ROUNDS: u64 = 5;
/// How many of the timed rays cost as much as a shadow ray in a packet.
const SHADOW: f64 = 0.2;
/// Rays of a photon: as many surfaces as it meets.
const PHOTON_RAYS: f64 = 8.0;

/// What a render takes. Seconds and rays are about right, not exact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// The pipeline that `auto` takes with a software driver, or that of the settings.
    pub pipeline: Pipeline,
    /// On the GL side and the CPU together.
    pub memory_bytes: u64,
    /// Wall-clock time with a software driver, without loading.
    pub seconds: f64,
    /// Rays on all cores of this CPU.
    pub rays_per_second: f64,
}

/// An estimate for a picture of `prepared`.
pub fn estimate(prepared: &Prepared, settings: &Settings) -> Estimate {
    let Prepared { scene, bvh, lights } = prepared;
    // A count of references cannot go to other threads.
    let bvh: &Bvh = bvh;
    let size = settings.film.size;
    let camera = scene.camera(size);
    let seen = (0..SIDE * SIDE).into_par_iter().filter_map(|i| {
        let place = Vec2::new((i % SIDE) as f32 + 0.5, (i / SIDE) as f32 + 0.5) / SIDE as f32;
        let direction = camera.ray(place, size[0] as f32 / size[1] as f32);
        let hit = bvh.nearest(camera.eye, direction, None)?;
        Some(GatherPoint::flat(camera.eye + hit.distance * direction, scene.mesh.side_met(hit.triangle, direction)))
    });
    let seen: Vec<GatherPoint> = seen.collect();
    let pipeline = match settings.gather.pipeline {
        Pipeline::Auto => chosen_for_picture(true, settings, scene, bvh, &seen),
        other => other,
    };
    // Other programs slow some rounds down.
    let rays_per_second = (0..ROUNDS).map(|round| rays_per_second(bvh, &seen, round)).fold(0.0, f64::max);

    let pixels = f64::from(size[0]) * f64::from(size[1]) * seen.len() as f64 / (SIDE * SIDE) as f64;
    let directions = f64::from(settings.directions.count);
    let directions_of_pixel = match (settings.film.interleave, pipeline) {
        (Squares::Pixels(side), _) => directions / f64::from(side * side),
        (Squares::Auto, Pipeline::Raycast) if settings.gather.pipeline == Pipeline::Auto => {
            let interleave = Interleave::spread(size, settings.seed, settings.directions.count);
            f64::from(interleave.numbers(0..settings.directions.count).end) / interleave.subsets() as f64
        }
        (Squares::Auto, _) => directions,
    };
    let maps = f64::from(settings.directions.count.div_ceil(DIRECTIONS_PER_PHOTON_MAP));
    let photon_rays = if lights.is_dark() { 0.0 } else { maps * settings.photons.count as f64 * PHOTON_RAYS };
    let shadow_rays = if lights.are_sampled() { pixels * f64::from(settings.direct.light_samples) } else { 0.0 };
    let gathered = pixels * directions_of_pixel * cost(pipeline, scene.mesh.triangles.len());
    let rays = photon_rays + gathered + shadow_rays * SHADOW;
    Estimate {
        pipeline,
        memory_bytes: memory_of(scene, settings, blocks_of(settings).count(), false),
        seconds: rays / rays_per_second,
        rays_per_second,
    }
}

/// How many rays on the CPU cost as much as one of a pipeline.
fn cost(pipeline: Pipeline, triangles: usize) -> f64 {
    match pipeline {
        // A bundle is a pass over all triangles.
        Pipeline::Fused | Pipeline::Auto => 0.29 * (1.0 + triangles as f64 / 500_000.0),
        Pipeline::RaycastGl => 0.52,
        Pipeline::Raycast => 0.15,
        Pipeline::Kill | Pipeline::EarlyKill => 2.0 * (1.0 + triangles as f64 / 250_000.0),
    }
}

/// Times rays from these points, with the cosine distribution about their normals. A scene that the camera does not see counts as fast.
fn rays_per_second(bvh: &Bvh, points: &[GatherPoint], round: u64) -> f64 {
    let start = Instant::now();
    let cast = |(number, point): (usize, &GatherPoint)| {
        let mut random = Random::new(round, number as u64);
        let origin = point.position + 3.0 * RAY_OFFSET * point.surface_normal;
        let ray = |_| cosine_direction(point.surface_normal, random.uniform(), random.uniform());
        let hits = |direction: Vec3| bvh.nearest(origin, direction, None).is_some();
        (0..RAYS).map(ray).filter(|&direction| hits(direction)).count()
    };
    let hits: usize = points.par_iter().enumerate().map(cast).sum();
    std::hint::black_box(hits);
    (points.len() as u64 * RAYS).max(1) as f64 / start.elapsed().as_secs_f64().max(1e-6)
}
