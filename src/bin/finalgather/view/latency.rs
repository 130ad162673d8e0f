//! Measures the latency of the window: the time from an event to the frame that shows its effect.

use std::time::{Duration, Instant};

use serde::Serialize;

/// If the event loop waits for less than this, the event was there before the wait.
const NO_WAIT: Duration = Duration::from_micros(200);

pub struct Latency {
    begun: Instant,
    /// From the start to the first frame with a picture.
    first: Option<Duration>,
    /// When the loop last began to wait.
    slept: Instant,
    /// When it last woke.
    woke: Instant,
    /// When it woke before that.
    earlier: Instant,
    /// The time of the first event that no frame has answered.
    pending: Option<Instant>,
    frames: Vec<Duration>,
    answers: Vec<Duration>,
}

#[derive(Serialize)]
pub struct Times {
    pub count: usize,
    pub median_ms: f64,
    pub p99_ms: f64,
    pub max_ms: f64,
}

impl Latency {
    /// `begun`: when the program was asked for the window.
    pub fn new(begun: Instant) -> Self {
        let now = Instant::now();
        let (first, pending, frames, answers) = Default::default();
        Self { begun, first, slept: now, woke: now, earlier: now, pending, frames, answers }
    }

    pub fn sleeps(&mut self) {
        self.slept = Instant::now();
    }

    pub fn wakes(&mut self) {
        self.earlier = self.woke;
        self.woke = Instant::now();
    }

    /// Call this at input of the user. An event that was there before the wait may have come at any time since the loop last woke.
    pub fn event(&mut self) {
        let came = if self.woke - self.slept < NO_WAIT { self.earlier } else { self.woke };
        self.pending.get_or_insert(came);
    }

    /// Call this when a frame is on the screen. Frames before the first picture should not count: in them, the driver compiles egui's shaders.
    pub fn frame(&mut self, begun: Instant, counts: bool) {
        let came = self.pending.take();
        if counts {
            self.first.get_or_insert_with(|| self.begun.elapsed());
            self.frames.push(begun.elapsed());
            self.answers.extend(came.map(|came| came.elapsed()));
        }
    }

    /// Milliseconds from the start to the first picture on the screen.
    pub fn first_picture_ms(&self) -> Option<f64> {
        self.first.map(|first| 1e3 * first.as_secs_f64())
    }

    /// The times of frames, and of answers to events.
    pub fn times(&self) -> [Times; 2] {
        [times(&self.frames), times(&self.answers)]
    }
}

fn times(durations: &[Duration]) -> Times {
    let mut sorted: Vec<f64> = durations.iter().map(|duration| 1e3 * duration.as_secs_f64()).collect();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get((share * sorted.len() as f64) as usize).or(sorted.last()).copied().unwrap_or(0.0);
    Times { count: sorted.len(), median_ms: at(0.5), p99_ms: at(0.99), max_ms: at(1.0) }
}
