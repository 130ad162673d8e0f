//! How fast the window answers: from an event to the frame that has heeded it.

use std::time::{Duration, Instant};

use serde::Serialize;

/// Shorter waits are no waits: the event was there before.
const NO_WAIT: Duration = Duration::from_micros(200);

pub struct Latency {
    /// When the loop went to wait, woke, and had woken before.
    slept: Instant,
    woke: Instant,
    earlier: Instant,
    /// The first event that no frame has answered.
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
    pub fn new() -> Self {
        let now = Instant::now();
        Self { slept: now, woke: now, earlier: now, pending: None, frames: Vec::new(), answers: Vec::new() }
    }

    pub fn sleeps(&mut self) {
        self.slept = Instant::now();
    }

    pub fn wakes(&mut self) {
        self.earlier = self.woke;
        self.woke = Instant::now();
    }

    /// A person did something. What was there when the loop went to wait may have come at any time since it woke before.
    pub fn event(&mut self) {
        let came = if self.woke - self.slept < NO_WAIT { self.earlier } else { self.woke };
        self.pending.get_or_insert(came);
    }

    /// A frame is on the screen. Those before the first picture do not count: in them the driver compiles what egui draws with.
    pub fn frame(&mut self, begun: Instant, counts: bool) {
        let came = self.pending.take();
        if counts {
            self.frames.push(begun.elapsed());
            self.answers.extend(came.map(|came| came.elapsed()));
        }
    }

    /// Of frames, and of answers.
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
