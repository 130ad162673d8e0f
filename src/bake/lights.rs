//! Light without a surface, as spherical harmonics. No gather ray meets it, so each point casts rays to samples of these lights, on the CPU.

use glam::Vec3;
use rayon::prelude::*;

use crate::harmonics::basis;
use crate::image::Channel;
use crate::points::GatherPoint;
use crate::prepared::Prepared;
use crate::quantity::Quantity;
use crate::random::{shuffled, sobol};
use crate::scene::{Lights, RAY_OFFSET, Rays};

/// The fewest samples of a light that is no point.
const FEWEST: u32 = 16;

/// Adds the lights without a surface to the columns of [`Quantity::Sh`], of `order` bands. `samples`: rays of a point to all of them, but one to each
/// sharp one and [`FEWEST`] at least to each other.
pub fn add_lights(columns: &mut [Channel], order: usize, prepared: &Prepared, points: &[GatherPoint], samples: u32) {
    let Prepared { scene, bvh, .. } = prepared;
    let shining: Vec<_> = scene.lights.iter().filter(|light| light.shines()).collect();
    let each = (samples / (shining.len() as u32).max(1)).max(FEWEST);
    let lights: Vec<_> =
        shining.iter().map(|&light| (Lights::without_surface(light), if light.is_sharp() { 1 } else { each })).collect();
    let rays = Rays::new(scene, bvh);
    let coefficients = |(index, point): (usize, &GatherPoint)| {
        let origin = point.position + RAY_OFFSET * point.surface_normal;
        let mut sums = vec![Vec3::ZERO; order * order];
        for (light, samples) in &lights {
            for sample in 0..*samples {
                // Neighbours have different samples, each of them evenly.
                let place = shuffled((index as u32).wrapping_mul(*samples).wrapping_add(sample), 0);
                let (direction, reach, facing) = light.sample(sobol(place, 0)).seen_from(origin);
                let sees = point.surface_normal.dot(direction) > 0.0 && facing != Vec3::ZERO;
                let passed = if sees { rays.transmittance(origin, direction, reach) } else { 0.0 };
                if passed > 0.0 {
                    let received = passed / *samples as f32 * facing;
                    sums.iter_mut().zip(basis(direction)).for_each(|(sum, basis)| *sum += basis * received);
                }
            }
        }
        sums
    };
    let all: Vec<_> = points.par_iter().enumerate().map(coefficients).collect();
    for (number, name) in Quantity::Sh.columns(order).iter().enumerate() {
        let Some(column) = columns.iter_mut().find(|column| column.name == *name) else { continue };
        column.samples.iter_mut().zip(&all).for_each(|(value, sums)| *value += sums[number / 3][number % 3]);
    }
}
