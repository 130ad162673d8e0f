//! Keeps submissions short. A device that works on one thing for seconds is taken for hung, and reset: after two on desktop systems.
//!
//! Draws are cut into runs of rows or of triangles by what earlier ones of the same program took. No pixel's own order of additions or tests
//! changes by that, and so no bit.

use std::cell::Cell;
use std::ops::Range;
use std::time::Instant;

use glow::HasContext;

use super::context::Context;

/// Seconds that a submission may take.
const MOST: f64 = 0.25;
/// So many texels or triangles are drawn on trust, for devices do them in a small part of that; and what they count for.
const TRUSTED: f64 = 16384.0;
const TRUSTED_SECONDS: f64 = 1e-3;
/// How many times as many as were ever tried are tried next: what is cheap in one corner of a picture may not be in another.
const GROWTH: f64 = 4.0;
/// Runs are of a multiple of so many rows, the blocks in which rasterisers shade.
const ROWS: u32 = 4;

/// What draws of a program cost so far.
#[derive(Default)]
pub(super) struct Pace {
    /// Of a texel or triangle, at worst in the last draw that was measured; 0 before.
    seconds: Cell<f64>,
    /// The most texels or triangles that were measured together.
    tried: Cell<f64>,
    draws: Cell<u64>,
}

impl Pace {
    /// Runs `draw` over all of `0..count`, rows of `width` texels or triangles, of so many instances, in as few runs as are short.
    pub fn run(&self, context: &Context, count: u32, width: u32, draw: impl Fn(Range<u32>)) {
        let width = f64::from(width);
        if f64::from(count) * width <= TRUSTED {
            context.queue(TRUSTED_SECONDS);
            return draw(0..count);
        }
        // Others are measured now and then, ever more seldom: to measure is to wait.
        let draws = self.draws.get() + 1;
        self.draws.set(draws);
        let (mut first, mut worst) = (0, 0.0_f64);
        while first < count {
            let seconds = width * worst.max(self.seconds.get());
            let most = (MOST / seconds).min((GROWTH * self.tried.get()).max(TRUSTED) / width);
            let rows = (most as u32 / ROWS * ROWS).max(ROWS).min(count - first);
            let expected = seconds * f64::from(rows);
            if rows < count || expected > MOST / 4.0 || draws.is_power_of_two() {
                context.finish();
                let start = Instant::now();
                draw(first..first + rows);
                context.finish();
                let elements = width * f64::from(rows);
                worst = worst.max(start.elapsed().as_secs_f64() / elements);
                self.tried.set(self.tried.get().max(elements));
            } else {
                context.queue(expected);
                draw(first..first + rows);
            }
            first += rows;
        }
        if worst > 0.0 {
            // A batch of few directions does not tell what the next one takes.
            self.seconds.set(worst.max(0.5 * self.seconds.get()));
        }
    }
}

impl Context {
    /// Counts work in. What is queued is handed over before it would get long together.
    fn queue(&self, seconds: f64) {
        let queued = self.queued.get() + seconds;
        if queued > MOST {
            unsafe { self.current().flush() };
        }
        self.queued.set(if queued > MOST { seconds } else { queued });
    }
}
