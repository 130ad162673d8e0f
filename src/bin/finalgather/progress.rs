//! How far a job is, on stderr if that is a terminal. It is plain text, so that NO_COLOR has nothing to switch off.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

#[derive(Clone)]
pub struct ProgressLine(ProgressBar);

impl ProgressLine {
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

    /// Directions that are done, and in all; the first time it turns the line into a bar.
    pub fn progress(&self, [done, total]: [u64; 2]) {
        if self.0.length() != Some(total) {
            self.0.set_length(total);
            self.0.set_style(style("{wide_bar} {pos}/{len} directions, {per_sec}, {eta} left"));
            // The rate of earlier stages is another.
            self.0.reset();
        }
        self.0.set_position(done);
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
