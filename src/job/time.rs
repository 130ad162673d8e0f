//! `--time`: the number of directions that fit into a time. A probe measures what a block costs and what a direction costs. The sums begin anew with the
//! number that follows, so a run that is given this number as `--directions` has the same bits.

use std::time::Instant;

use super::Watch;
use crate::blocks::Blocks;
use crate::error::Result;
use crate::render::{Render, blocks_of};
use crate::settings::DIRECTIONS_PER_PHOTON_MAP;

/// Directions of the job of which the probe is a block.
const PROBE: u32 = 256;
/// The fewest and the most directions.
const RANGE: [u32; 2] = [16, 1 << 20];
/// The share of the time that is planned. The rest is for what the probe does not show.
const PLANNED: f64 = 0.95;
/// The number of directions is corrected while it takes this many times the time, so often at most.
const TOO_LONG: f64 = 1.1;
const CORRECTIONS: u32 = 3;
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

impl Costs {
    fn of(self, blocks: Blocks) -> f64 {
        let directions = blocks.directions(0..blocks.count()).end;
        let maps = (directions.max(1) - 1) / DIRECTIONS_PER_PHOTON_MAP;
        f64::from(directions) * self.direction + f64::from(blocks.count()) * self.block + f64::from(maps) * self.photons
    }
}

/// Gives `render`, which has not begun, as many directions as it can gather along in `seconds`, writing included. Returns their number. It may have
/// gathered along some of them. When `watch` wants to stop, it returns at once.
///
/// # Errors
/// When the device fails.
pub(super) fn choose_directions(render: &mut Render, seconds: f64, watch: &mut dyn Watch) -> Result<u32> {
    let (start, settings) = (Instant::now(), *render.settings());
    let photons = render.statistics().seconds.photons;
    let writing = WRITING * settings.film.size.map(f64::from).iter().product::<f64>();
    let left = || PLANNED * (seconds - start.elapsed().as_secs_f64()) - writing;
    let blocks = |directions: u32| blocks_of(&settings.with(|settings| settings.directions.count = directions));
    // Programs are compiled when they are first used, so the first block is no measure.
    let mut block = 0.0;
    for _ in 0..2 {
        render.restart_with(PROBE)?;
        block = one_block(render, watch)?;
    }
    let (gather, done) = (render.statistics().seconds.gather, f64::from(render.directions_done().max(1)));
    let costs = Costs { direction: gather / done, block: (block - gather).max(0.0), photons };
    let mut directions = most_within(left(), |directions| costs.of(blocks(directions)));
    // Layers grow with the directions, and other blocks have other shares of the light samples. So a block of the job itself corrects the number.
    for _ in 0..CORRECTIONS {
        render.restart_with(directions)?;
        let (before, probing) = (left(), start.elapsed().as_secs_f64());
        let whole = Costs { direction: 0.0, block: one_block(render, watch)?, photons }.of(blocks(directions));
        if whole <= TOO_LONG * before || directions == RANGE[0] {
            if whole > TOO_LONG * before.max(0.0) {
                watch.say(&format!("warning: the time is too short, even for {directions} directions"));
            }
            render.count_probes(probing);
            return Ok(directions);
        }
        let share = before.max(0.0) / whole;
        directions = most_within(share * f64::from(directions), f64::from);
    }
    render.restart_with(directions)?;
    render.count_probes(start.elapsed().as_secs_f64());
    Ok(directions)
}

/// Gathers along the directions of one block. Returns the seconds.
fn one_block(render: &mut Render, watch: &mut dyn Watch) -> Result<f64> {
    let start = Instant::now();
    while watch.goes_on(true) {
        render.step()?;
        // A step without memory begins again.
        if render.is_between_blocks() && render.directions_done() > 0 {
            break;
        }
    }
    Ok(start.elapsed().as_secs_f64())
}

/// The greatest number of directions whose `cost` is at most `most`, of powers of two and of one and a half times these. With other numbers the two halves
/// of the blocks, whose difference tells the error, are too different.
fn most_within(most: f64, cost: impl Fn(u32) -> f64) -> u32 {
    let mut directions = RANGE[1];
    while directions > RANGE[0] && cost(directions) > most {
        let power = 1 << directions.ilog2();
        directions = if directions > power { power } else { power / 4 * 3 };
    }
    directions
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_directions_are_as_many_as_fit() {
        let within = |most, direction, block, photons| {
            most_within(most, |directions| Costs { direction, block, photons }.of(Blocks::new(directions, 1)))
        };
        // 24 blocks of 32 directions: 2.4 + 7.68 s.
        assert_eq!([10.1, 10.0].map(|most| within(most, 0.01, 0.1, 0.0)), [768, 512]);
        // With photons of 2 s after 1024 directions.
        assert_eq!(within(15.5, 0.01, 0.0, 0.0), 1536);
        assert_eq!(within(15.5, 0.01, 0.0, 2.0), 1024);
        assert_eq!(within(0.0, 0.01, 0.1, 0.0), 16);
        assert_eq!(within(1e9, 1e-3, 0.0, 0.0), 1 << 20);
        assert_eq!(within(f64::NEG_INFINITY, 1e-3, 0.0, 0.0), 16);
    }
}
