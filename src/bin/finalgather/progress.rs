//! How far the render is, on a terminal's stderr; silent anywhere else. Plain text, so NO_COLOR has nothing to switch off.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

#[derive(Clone)]
pub struct Progress(ProgressBar);

impl Progress {
    /// A line that says which stage runs.
    pub fn new(stage: &'static str) -> Self {
        // The target hides the bar where stderr is not a terminal.
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr()).with_style(style("{spinner} {msg}"));
        bar.set_message(stage);
        if !bar.is_hidden() {
            bar.enable_steady_tick(Duration::from_millis(100));
        }
        Self(bar)
    }

    pub fn stage(&self, stage: &'static str) {
        self.0.set_message(stage);
    }

    /// Turns the line into a bar over this many directions.
    pub fn begin_directions(&self, directions: impl Into<u64>) {
        self.0.set_length(directions.into());
        self.0.set_style(style("{wide_bar} {pos}/{len} directions, {per_sec}, {eta} left"));
        // Time spent in earlier stages says nothing about the rate of this one.
        self.0.reset();
    }

    pub fn directions_done(&self, directions: impl Into<u64>) {
        self.0.set_position(directions.into());
    }

    /// Prints a line without breaking the bar.
    pub fn say(&self, line: &str) {
        self.0.suspend(|| crate::report::say(line));
    }

    /// Takes the line off the terminal for good.
    pub fn clear(&self) {
        self.0.finish_and_clear();
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
