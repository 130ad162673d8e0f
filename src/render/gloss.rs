//! Gloss in a render: the sums of lobes at the pixels of a block.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::{Block, Render};
use crate::film::LobeSums;
use crate::photon::CausticMap;
use crate::points::{GatherPoint, PointGloss, Sharing};
use crate::scene::LobeWeights;
use crate::settings::Estimator;

impl Render {
    /// Divides the gather's sums by what the points pass or reflect of even light, and returns those of the lobes; `None` in a scene without gloss. `sums`
    /// are those of the bases.
    pub(super) fn lobe_sums<'a>(&self, block: &'a Block, sharing: &Sharing, sums: &mut [Vec4]) -> Option<LobeSums<'a>> {
        let gloss = &block.g_buffer.gloss;
        let [mut lobes, mut weights] = self.passes.gather.read_lobes()?;
        let over =
            |sum: Vec4, share: Vec3| Vec4::select(share.extend(0.0).cmpgt(Vec4::ZERO), sum / share.extend(1.0), Vec4::ZERO);
        let plain = self.settings.directions.estimator == Estimator::Plain;
        let expected: Vec<f32> = (0..gloss.len()).map(|pixel| FRAC_1_PI * self.expected_weight(block, pixel)).collect();
        let each = sums.par_iter_mut().zip(&mut lobes).zip(&mut weights).zip(gloss).enumerate();
        each.for_each(|(pixel, (((sum, lobe), weight), gloss))| {
            let share = gloss.lobe_share();
            (*lobe, *weight) = (over(*lobe, share), over(*weight, share));
            // The expected weights of the plain estimator are those of even light. That of a lobe, over its share, is a π-th of a cosine's.
            match (gloss.is_glossy(), plain) {
                (false, _) => {}
                (true, false) => *sum /= gloss.shares.passing,
                (true, true) => {
                    *sum = (sum.truncate() / gloss.shares.passing).extend(sum.w);
                    *weight = if gloss.counts { Vec4::splat(expected[pixel]) } else { Vec4::ZERO };
                }
            }
        });
        let share = |sums| sharing.share(sums, &block.taken);
        Some(LobeSums { lobes: share(lobes), weights: share(weights), direct: block.lobes.each_ref().map(Vec::as_slice) })
    }
}

/// Divides irradiance that has passed lobes by what passes of even light. The albedo of a base has that factor.
pub(super) fn even_out(irradiance: &mut [Vec3], gloss: &[PointGloss]) {
    let glossy = irradiance.par_iter_mut().zip(gloss).filter(|(_, gloss)| gloss.is_glossy());
    glossy.for_each(|(irradiance, gloss)| *irradiance /= gloss.shares.passing);
}

/// What the caustics of a block bring to a point: to its base, as irradiance, and by its lobe, as radiance.
pub(super) fn caustic_light(map: &CausticMap, point: &GatherPoint, gloss: Option<&PointGloss>) -> [Vec3; 2] {
    match gloss.filter(|gloss| gloss.is_glossy()) {
        None => [map.irradiance(point.position, point.surface_normal), Vec3::ZERO],
        Some(gloss) => {
            let [base, lobe] = map.weighted(point.position, point.surface_normal, |to_light| {
                let above = point.cosine(to_light) > 0.0;
                let weights = if above { gloss.weights(point.normal, to_light) } else { LobeWeights::default() };
                [Vec3::splat(weights.base), weights.lobe]
            });
            [base / gloss.shares.passing, lobe]
        }
    }
}
