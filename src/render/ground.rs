//! Light on the ground under a scene, and what it would be without the scene.

use std::collections::HashSet;
use std::f32::consts::PI;

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::{Block, Render, blocks_of};
use crate::direction::Direction;
use crate::image::luminance;
use crate::points::{Ground, Sharing};
use crate::scene::{Camera, Scene};

/// The ground of a render.
pub(super) struct ShadowCatcher {
    pub ground: Ground,
    /// See [`Ground::bright`].
    bright: Vec3,
}

impl ShadowCatcher {
    /// `None` without an environment: then no light is missing in the shadow.
    pub fn new(scene: &Scene, camera: &Camera, wanted: bool) -> Option<Self> {
        let environment = scene.environment.as_ref().filter(|_| wanted)?;
        // A view from above has its up in the plane of the ground.
        let forward = (camera.target - camera.eye).normalize_or_zero();
        let up = if forward.y.abs() > 0.9 && camera.up.y.abs() < 0.5 { Vec3::Y } else { camera.up };
        let ground = Ground::under(&scene.mesh, up);
        Some(Self { bright: ground.bright(environment), ground })
    }
}

impl Render {
    /// Luminous irradiance of each pixel that sees the ground, and the same without the scene, for [`BlockLight`](crate::film::BlockLight).
    /// `gathered` are the sums of the pixels. Both are sums along the same directions, so without a shadow they are equal.
    pub(super) fn ground_lights(&self, block: &Block, sharing: &Sharing, gathered: &[Vec4]) -> Vec<Option<[f32; 2]>> {
        let Some((ShadowCatcher { ground, bright }, environment)) =
            self.catcher.as_ref().zip(self.all.scene.environment.as_ref())
        else {
            return Vec::new();
        };
        let (interleave, both_ends) = (&self.passes.interleave, self.passes.gather.both_ends());
        let left: HashSet<u32> = block.left.iter().copied().collect();
        let mut done = vec![Vec::new(); interleave.subsets()];
        for number in interleave.numbers(blocks_of(&self.settings).directions(block.index..block.index + 1)) {
            if !left.contains(&number) {
                done[interleave.subset(number, block.index).index()].push(self.direction(number));
            }
        }
        let open = |directions: Vec<Direction>| ground.open(environment, directions.into_iter(), both_ends);
        let open: Vec<Vec4> = done.into_iter().map(open).collect();
        let open = (0..gathered.len()).map(|pixel| open[interleave.subset_of(pixel).index()]).collect();
        let open = sharing.share(open, &block.taken);

        // The mean weight of a direction is 1/4, or 1/2 at both ends.
        let directions = block.taken.iter().sum::<u32>().max(1) as f32;
        let scale = PI / (directions * if both_ends { 0.5 } else { 0.25 });
        let lights = |pixel: usize| {
            let buffer = &block.g_buffer;
            let is_ground = buffer.emission[pixel].w == 0.0 && buffer.normal[pixel].truncate() != Vec3::ZERO;
            let irradiance = |sum: Vec4, direct: Vec3| luminance((scale * sum.truncate() + direct).to_array());
            is_ground.then(|| {
                let open = irradiance(open[pixel], *bright);
                let caustics = block.caustics.get(pixel).copied().unwrap_or_default();
                let light = irradiance(gathered[pixel], block.direct[pixel] + caustics);
                [open + ground.fade(buffer.position[pixel].truncate()) * (light - open), open]
            })
        };
        (0..gathered.len()).into_par_iter().map(lights).collect()
    }
}
