//! `--time`: the number of directions that fit into a time. Two probes measure what a block costs and what a direction costs. The sums begin anew with
//! the number that follows, so a run that is given this number as `--directions` has the same bits.

use std::time::Instant;

use crate::blocks::Blocks;
use crate::error::Result;
use crate::render::{Render, blocks_of};
use crate::settings::DIRECTIONS_PER_PHOTON_MAP;

/// Directions of the jobs of which the probes are a block. Their blocks have few directions and more.
const PROBES: [u32; 2] = [64, 512];
/// The fewest and the most directions.
const RANGE: [u32; 2] = [16, 1 << 20];
/// The share of the time that is planned. The rest is for what the probes do not show.
const PLANNED: f64 = 0.95;
/// Seconds to write a pixel.
const WRITING: f64 = 1e-6;

/// Seconds of the parts of a render.
#[derive(Clone, Copy, Debug)]
struct Costs {
    direction: f64,
    block: f64,
    /// Of new photons, after each [`DIRECTIONS_PER_PHOTON_MAP`] directions.
    photons: f64,
}

/// Gives `render`, which has not begun, as many directions as it can gather along in `seconds`, writing included. Returns their number.
///
/// # Errors
/// When the device fails.
pub(super) fn choose_directions(render: &mut Render, seconds: f64) -> Result<u32> {
    let start = Instant::now();
    let photons = render.statistics().seconds.photons;
    let mut probes = [[0.0; 2]; 2];
    for (directions, probe) in PROBES.into_iter().zip(&mut probes) {
        render.restart_with(directions)?;
        let start = Instant::now();
        loop {
            render.step()?;
            if render.is_between_blocks() {
                break;
            }
        }
        *probe = [f64::from(render.directions_done()), start.elapsed().as_secs_f64()];
    }
    let [[few, first], [many, second]] = probes;
    let direction = ((second - first) / (many - few)).max(1e-6);
    let costs = Costs { direction, block: (first - few * direction).max(0.0), photons };
    let [width, height] = render.settings().film.size.map(f64::from);
    let left = PLANNED * (seconds - start.elapsed().as_secs_f64()) - WRITING * width * height;
    let mut settings = *render.settings();
    let blocks = |directions: u32| {
        settings.directions.count = directions;
        blocks_of(&settings)
    };
    let directions = most_within(left, costs, blocks);
    render.restart_with(directions)?;
    Ok(directions)
}

/// The greatest number of directions, of numbers with three binary digits, that takes at most `seconds`.
fn most_within(seconds: f64, costs: Costs, mut blocks: impl FnMut(u32) -> Blocks) -> u32 {
    let [least, most] = RANGE;
    let mut directions = most;
    loop {
        let taken = f64::from(directions) * costs.direction
            + f64::from(blocks(directions).count()) * costs.block
            + f64::from((directions - 1) / DIRECTIONS_PER_PHOTON_MAP) * costs.photons;
        if taken <= seconds || directions <= least {
            return directions.max(least);
        }
        directions -= 1 << (directions.ilog2().max(3) - 3);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_directions_are_as_many_as_fit() {
        let blocks = |directions| Blocks::new(directions, 1);
        let costs = |direction, block, photons| Costs { direction, block, photons };
        // 22 blocks of 32 directions: 2.2 + 7.04 s. 24 of them would take 10.08 s.
        assert_eq!(most_within(10.0, costs(0.01, 0.1, 0.0), blocks), 704);
        // With photons of 2 s after 1024 directions.
        assert_eq!(most_within(12.5, costs(0.01, 0.0, 0.0), blocks), 1152);
        assert_eq!(most_within(12.5, costs(0.01, 0.0, 2.0), blocks), 1024);
        assert_eq!(most_within(0.0, costs(0.01, 0.1, 0.0), blocks), 16);
        assert_eq!(most_within(1e9, costs(1e-3, 0.0, 0.0), blocks), 1 << 20);
    }
}
