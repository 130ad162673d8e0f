//! Shows how far a job is: one line of a terminal, else a line every ten seconds.

use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use finalgather::job::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::report;

/// Time between two lines of a log.
const PERIOD: Duration = Duration::from_secs(10);

const STAGE: &str = "{spinner} {prefix:<15} {elapsed}";
/// The columns stay where they are, whatever stands in them.
const GATHER: &str = "{spinner} {prefix:<15} {wide_bar} {percent:>3} % {msg:>16}";

pub struct ProgressLine {
    bar: ProgressBar,
    state: Arc<Mutex<State>>,
    /// Prints lines for a log until the sender is dropped.
    log: Option<(Sender<()>, JoinHandle<()>)>,
}

struct State {
    stage: &'static str,
    since: Instant,
    /// Directions done and in total, while it gathers.
    directions: Option<[u64; 2]>,
    left: Option<Countdown>,
}

impl ProgressLine {
    pub fn new() -> Self {
        let target = if report::is_talkative() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        // The target hides the bar if stderr is not a terminal.
        let bar = ProgressBar::with_draw_target(None, target).with_style(style(STAGE));
        let state = State { stage: "loading", since: Instant::now(), directions: None, left: None };
        let state = Arc::new(Mutex::new(state));
        bar.set_prefix("loading");
        let mut log = None;
        if !bar.is_hidden() {
            bar.enable_steady_tick(Duration::from_millis(100));
        } else if report::is_talkative() {
            log = log_to(Arc::clone(&state));
        }
        Self { bar, state, log }
    }

    /// The bar, for a thread that must remove it.
    pub fn bar(&self) -> ProgressBar {
        self.bar.clone()
    }

    pub fn stage(&self, stage: &'static str) {
        let mut state = locked(&self.state);
        if state.stage == stage {
            return;
        }
        self.bar.suspend(|| report::detail(&state.took()));
        *state = State { stage, since: Instant::now(), directions: None, left: None };
        self.bar.reset_elapsed();
        self.bar.set_style(style(STAGE));
        self.bar.set_prefix(stage);
    }

    pub fn progress(&self, Progress { done, total, seconds_left }: Progress) {
        let mut state = locked(&self.state);
        if state.directions.is_none() {
            self.bar.set_length(total);
            self.bar.set_style(style(GATHER));
        }
        state.directions = Some([done, total]);
        state.left = seconds_left.map(|seconds| Countdown::after(state.left, seconds));
        self.bar.set_position(done);
        self.bar.set_message(state.left.map_or(String::new(), |left| format!("{} left", in_words(left.seconds))));
    }

    /// Prints between two states of the line.
    pub fn suspend(&self, print: impl FnOnce()) {
        self.bar.suspend(print);
    }

    /// Removes the line for good.
    pub fn clear(&mut self) {
        if !self.bar.is_finished() {
            self.bar.finish_and_clear();
            report::detail(&locked(&self.state).took());
        }
        if let Some((sender, thread)) = self.log.take() {
            drop(sender);
            // It has nothing to say.
            let _ = thread.join();
        }
    }
}

/// Prints the state every ten seconds. No thread, no lines.
fn log_to(state: Arc<Mutex<State>>) -> Option<(Sender<()>, JoinHandle<()>)> {
    let (sender, end) = channel::<()>();
    let print = move || {
        while end.recv_timeout(PERIOD).is_err_and(|error| error == std::sync::mpsc::RecvTimeoutError::Timeout) {
            report::say(&locked(&state).line());
        }
    };
    thread::Builder::new().name("progress".into()).spawn(print).ok().map(|thread| (sender, thread))
}

impl State {
    fn took(&self) -> String {
        format!("{} took {:.2} s", self.stage, self.since.elapsed().as_secs_f64())
    }

    /// A line of a log.
    fn line(&self) -> String {
        let Some([done, total]) = self.directions else {
            return format!("{}: {:.0} s so far", self.stage, self.since.elapsed().as_secs_f64());
        };
        let left = self.left.map_or(String::new(), |left| format!(", {} left", in_words(left.now())));
        format!("{}: {} %, {done} of {total} directions{left}", self.stage, 100 * done / total.max(1))
    }
}

/// Predicted seconds, as shown. They run down with the clock, and follow new predictions slowly.
#[derive(Clone, Copy)]
struct Countdown {
    seconds: f64,
    at: Instant,
}

impl Countdown {
    /// The prediction `new` after what was shown before. One that is far off replaces it.
    fn after(before: Option<Self>, new: f64) -> Self {
        let shown = before.map(Self::now).filter(|shown| (new - shown).abs() < 0.5 * new.max(*shown));
        Self { seconds: shown.map_or(new, |shown| shown + 0.1 * (new - shown)), at: Instant::now() }
    }

    fn now(self) -> f64 {
        (self.seconds - self.at.elapsed().as_secs_f64()).max(0.0)
    }
}

/// Coarse, because more digits would be wrong.
fn in_words(seconds: f64) -> String {
    let up = |unit: f64| (seconds / unit).ceil() as u64;
    match seconds {
        ..10.0 => format!("{} s", up(1.0)),
        ..60.0 => format!("{} s", 5 * up(5.0)),
        ..3600.0 => format!("{} min", up(60.0)),
        _ => format!("{} h {} min", up(60.0) / 60, up(60.0) % 60),
    }
}

fn locked(state: &Mutex<State>) -> MutexGuard<'_, State> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_in_words() {
        let words = [0.2, 9.5, 12.0, 61.0, 3599.0, 3700.0].map(in_words);
        assert_eq!(words, ["1 s", "10 s", "15 s", "2 min", "60 min", "1 h 2 min"]);
    }

    #[test]
    fn predictions_are_followed_slowly_unless_far_off() {
        let shown = Countdown { seconds: 100.0, at: Instant::now() };
        let near = Countdown::after(Some(shown), 120.0).seconds;
        assert!((near - 102.0).abs() < 0.1, "{near}");
        assert_eq!(Countdown::after(Some(shown), 10.0).seconds, 10.0);
        assert_eq!(Countdown::after(None, 7.0).seconds, 7.0);
    }

    #[test]
    fn lines_of_a_log() {
        let mut state = State { stage: "gathering", since: Instant::now(), directions: None, left: None };
        assert_eq!(state.line(), "gathering: 0 s so far");
        state.directions = Some([450, 1000]);
        assert_eq!(state.line(), "gathering: 45 %, 450 of 1000 directions");
        state.left = Some(Countdown { seconds: 59.0, at: Instant::now() });
        assert_eq!(state.line(), "gathering: 45 %, 450 of 1000 directions, 60 s left");
    }
}
