//! What a stretch of work costs on either side: the device's time in each of its stages, and the CPU's time in waits for the device.
//!
//! Passes name their stages by [`Gpu::stage`], which does nothing until there is a [`StageClock`]. Each stage is timed by queries of its own,
//! read when their results are there, so that measuring adds no waits. Where the CPU waits within a stage, the query ends before and another
//! begins after: the device's idle time while a result is on its way is no stage's.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::context::{Context, Gpu};
use super::query::TimerQuery;

/// Queries that are left alone after their end: to ask for a result makes some drivers send off what they still hold back.
const PENDING: usize = 64;

/// Measures the stages of a context as long as it lives.
pub struct StageClock {
    gpu: Gpu,
}

/// What was measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StageTimes {
    /// Device time of each stage in seconds, in the order in which they first ran. `None`: the driver tells no time.
    pub stages: Vec<(&'static str, Option<f64>)>,
    /// Seconds that the CPU spent in waits for the device.
    pub waits: f64,
}

/// The inside of a [`StageClock`].
pub(super) struct Stages {
    gpu: Gpu,
    seconds: Vec<(&'static str, f64)>,
    waits: Duration,
    /// The stage in progress.
    current: Option<&'static str>,
    running: Option<(&'static str, TimerQuery)>,
    /// Ended, the oldest first, with results that may not be there yet.
    ended: VecDeque<(&'static str, TimerQuery)>,
    unused: Vec<TimerQuery>,
}

impl StageClock {
    /// # Panics
    /// When the context has a clock already.
    pub fn start(gpu: &Gpu) -> Self {
        assert!(gpu.context().stages.borrow().is_none(), "one clock at a time");
        *gpu.context().stages.borrow_mut() = Some(Stages {
            gpu: gpu.clone(),
            seconds: Vec::new(),
            waits: Duration::ZERO,
            current: None,
            running: None,
            ended: VecDeque::new(),
            unused: Vec::new(),
        });
        Self { gpu: gpu.clone() }
    }

    /// What was measured since the start or the last call. Waits for the results.
    pub fn take(&self) -> StageTimes {
        let mut stages = self.gpu.context().stages.borrow_mut();
        stages.as_mut().map_or_else(StageTimes::default, Stages::take)
    }
}

impl Drop for StageClock {
    fn drop(&mut self) {
        // The queries know the context, and would keep each other alive.
        self.gpu.context().stages.take();
    }
}

impl Gpu {
    /// Runs `work` as part of a stage. Within another, its time counts for this one alone.
    pub fn stage<T>(&self, name: &'static str, work: impl FnOnce() -> T) -> T {
        let context = self.context();
        let outer = context.with_stages(|stages| stages.switch(Some(name)));
        let result = work();
        if let Some(outer) = outer {
            context.with_stages(|stages| stages.switch(outer));
        }
        result
    }
}

impl Context {
    /// Runs `wait`, which returns when the device has come so far.
    pub(super) fn wait<T>(&self, wait: impl FnOnce() -> T) -> T {
        let Some(stage) = self.with_stages(|stages| stages.switch(None)) else { return wait() };
        let start = Instant::now();
        let result = wait();
        self.with_stages(|stages| {
            stages.waits += start.elapsed();
            stages.switch(stage);
        });
        result
    }

    fn with_stages<T>(&self, of: impl FnOnce(&mut Stages) -> T) -> Option<T> {
        self.stages.borrow_mut().as_mut().map(of)
    }
}

impl Stages {
    /// Ends the stage in progress, begins `next`, and returns the one that has ended.
    fn switch(&mut self, next: Option<&'static str>) -> Option<&'static str> {
        if let Some((name, query)) = self.running.take() {
            query.end();
            self.ended.push_back((name, query));
        }
        while self.ended.len() > PENDING && self.ended.front().is_some_and(|(_, query)| query.is_available()) {
            self.read_oldest();
        }
        // A device that makes no query tells no time.
        self.running = next.and_then(|name| Some((name, self.unused.pop().or_else(|| TimerQuery::new(&self.gpu).ok())?)));
        if let Some((name, query)) = &self.running {
            query.begin();
            if !self.seconds.iter().any(|(other, _)| other == name) {
                self.seconds.push((name, 0.0));
            }
        }
        std::mem::replace(&mut self.current, next)
    }

    fn read_oldest(&mut self) {
        if let Some((name, query)) = self.ended.pop_front() {
            let seconds = query.seconds().unwrap_or(f64::NAN);
            self.seconds.iter_mut().filter(|(other, _)| *other == name).for_each(|(_, sum)| *sum += seconds);
            self.unused.push(query);
        }
    }

    fn take(&mut self) -> StageTimes {
        while !self.ended.is_empty() {
            self.read_oldest();
        }
        let stages = self.seconds.drain(..).map(|(name, seconds)| (name, (seconds > 0.0).then_some(seconds))).collect();
        StageTimes { stages, waits: std::mem::take(&mut self.waits).as_secs_f64() }
    }
}
