//! Predicts how long a gather still takes, from the steps so far.
//!
//! A step that begins a block also places points and finds direct light. The first step compiles programs too. So these are told apart.

use std::time::Duration;

/// Steps and seconds before anything is predicted.
const LEAST: (f64, f64) = (3.0, 0.5);

/// The cost of the steps so far.
pub(super) struct Remaining {
    /// Mean number of directions of a block.
    block: f64,
    first: Sums,
    /// Steps that began a block, but the first.
    beginning: Sums,
    others: Sums,
}

#[derive(Clone, Copy, Default)]
struct Sums {
    steps: f64,
    directions: f64,
    seconds: f64,
}

impl Remaining {
    /// For blocks of so many directions in the mean.
    pub fn new(block: f64) -> Self {
        Self { block: block.max(1.0), first: Sums::default(), beginning: Sums::default(), others: Sums::default() }
    }

    /// Adds a step.
    pub fn add(&mut self, begins_block: bool, directions: u64, took: Duration) {
        let sums = match (self.first.steps, begins_block) {
            (0.0, _) => &mut self.first,
            (_, true) => &mut self.beginning,
            (_, false) => &mut self.others,
        };
        sums.steps += 1.0;
        sums.directions += directions as f64;
        sums.seconds += took.as_secs_f64();
    }

    /// Seconds for this number of further directions, once enough steps are known.
    pub fn seconds(&self, directions: u64) -> Option<f64> {
        let Self { block, first, beginning, others } = *self;
        let known = beginning.plus(others);
        if known.steps + first.steps < LEAST.0 || known.seconds < LEAST.1 || known.directions == 0.0 {
            return None;
        }
        let left = directions as f64;
        if others.directions == 0.0 {
            // Every step is a block.
            return Some(left * known.seconds / known.directions);
        }
        let rate = others.seconds / others.directions;
        let begun = if beginning.steps > 0.0 { beginning } else { first };
        let of_block = ((begun.seconds - rate * begun.directions) / begun.steps).max(0.0);
        Some(left * rate + (left / block).floor() * of_block)
    }
}

impl Sums {
    fn plus(self, other: Self) -> Self {
        Self {
            steps: self.steps + other.steps,
            directions: self.directions + other.directions,
            seconds: self.seconds + other.seconds,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks of 64 directions in steps of 8 that take 0.1 s, and 1 s more at the beginning of each; the first compiles for 5 s.
    #[test]
    fn blocks_cost_their_beginning() {
        let mut remaining = Remaining::new(64.0);
        let step = |remaining: &mut Remaining, begins, seconds| remaining.add(begins, 8, Duration::from_secs_f64(seconds));
        step(&mut remaining, true, 6.1);
        assert_eq!(remaining.seconds(1000), None);
        (0..7).for_each(|_| step(&mut remaining, false, 0.1));
        step(&mut remaining, true, 1.1);
        // 56 directions of this block, and two blocks.
        let left = remaining.seconds(56 + 128).unwrap();
        assert!((left - (0.1 * (56.0 + 128.0) / 8.0 + 2.0)).abs() < 1e-6, "{left}");
    }

    #[test]
    fn steps_of_whole_blocks() {
        let mut remaining = Remaining::new(8.0);
        [9.0, 1.0, 3.0].into_iter().for_each(|seconds| remaining.add(true, 8, Duration::from_secs_f64(seconds)));
        assert_eq!(remaining.seconds(80), Some(20.0));
    }
}
