//! Keeps submissions short. The system resets a device that is busy with one submission for seconds: two seconds on desktop systems.
//!
//! A draw is split into runs of rows or triangles. Their length follows from the time that earlier draws of the same program took. The order of
//! additions and tests within each pixel stays, so the result keeps its bits.

use std::cell::Cell;
use std::ops::Range;
use std::time::Instant;

use glow::HasContext;

use super::context::Context;

/// The most seconds that a submission may take.
const MOST: f64 = 0.25;
/// Up to this many texels or triangles are drawn without measuring, because devices need far less than [`MOST`] for them.
const TRUSTED: f64 = 16384.0;
/// The time that such a draw is assumed to take.
const TRUSTED_SECONDS: f64 = 1e-3;
/// A run has at most this many times the texels of the largest measured run: one corner of a picture can cost more than another.
const GROWTH: f64 = 4.0;
/// A run has a multiple of this many rows, because rasterisers shade blocks of pixels.
const ROWS: u32 = 4;

/// The measured cost of a program's draws.
#[derive(Default)]
pub(super) struct Pace {
    /// Seconds for a texel or triangle, the most in the last measured draw; 0 before the first.
    seconds: Cell<f64>,
    /// The most texels or triangles that were measured in one run.
    tried: Cell<f64>,
    draws: Cell<u64>,
}

impl Pace {
    /// Calls `draw` for consecutive parts of `0..count`, as few as stay short. An item is a row of `width` texels or a triangle of `width` instances.
    pub fn run(&self, context: &Context, count: u32, width: u32, draw: impl Fn(Range<u32>)) {
        let width = f64::from(width);
        if f64::from(count) * width <= TRUSTED {
            context.queue(TRUSTED_SECONDS);
            return draw(0..count);
        }
        // Short draws are measured at powers of two only, because measuring needs a wait.
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
            // A cheap draw, such as a batch of few directions, lowers the estimate by half at most: the next may cost more.
            self.seconds.set(worst.max(0.5 * self.seconds.get()));
        }
    }
}

impl Context {
    /// Adds to the queued seconds, and flushes the queue before it exceeds [`MOST`].
    fn queue(&self, seconds: f64) {
        let queued = self.queued.get() + seconds;
        if queued > MOST {
            unsafe { self.current().flush() };
        }
        self.queued.set(if queued > MOST { seconds } else { queued });
    }
}
