//! Measures the device time of each stage and the CPU time spent in waits for the device.
//!
//! Passes name their stages by [`Gpu::stage`], which does nothing without a [`StageClock`]. Each stage has its own timer queries. They are read
//! when their results are ready, so measuring adds no waits. Where the CPU waits within a stage, one query ends before the wait and another
//! begins after it. So no stage counts the time in which the device is idle while a result travels to the CPU.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::context::{Context, Gpu};
use super::query::TimerQuery;

/// This many ended queries are not asked for their results: asking makes some drivers submit work that they hold back.
const PENDING: usize = 64;

/// Measures the stages of a context until it is dropped.
pub struct StageClock {
    gpu: Gpu,
}

/// The times that a [`StageClock`] measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StageTimes {
    /// Device time of each stage in seconds, in the order in which the stages first ran. `None`: the driver measures no time.
    pub stages: Vec<(&'static str, Option<f64>)>,
    /// Seconds that the CPU spent in waits for the device.
    pub waits: f64,
}

/// The state of a [`StageClock`].
pub(super) struct Stages {
    gpu: Gpu,
    seconds: Vec<(&'static str, f64)>,
    waits: Duration,
    /// The stage in progress.
    current: Option<&'static str>,
    running: Option<(&'static str, TimerQuery)>,
    /// Ended queries, the oldest first. Their results may not be ready.
    ended: VecDeque<(&'static str, TimerQuery)>,
    unused: Vec<TimerQuery>,
}

impl StageClock {
    /// # Panics
    /// If the context has a clock already.
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

    /// Returns the times since the start or the last call. Waits for the results.
    pub fn take(&self) -> StageTimes {
        let mut stages = self.gpu.context().stages.borrow_mut();
        stages.as_mut().map_or_else(StageTimes::default, Stages::take)
    }
}

impl Drop for StageClock {
    fn drop(&mut self) {
        // The queries hold the context, and the context holds the queries: both would live for ever.
        self.gpu.context().stages.take();
    }
}

impl Gpu {
    /// Runs `work` as part of a stage. Inside another stage, only the inner stage counts this time.
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
    /// Runs `wait`, which blocks until the device has done some work.
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
    /// Ends the stage in progress, begins `next`, and returns the ended stage.
    fn switch(&mut self, next: Option<&'static str>) -> Option<&'static str> {
        if let Some((name, query)) = self.running.take() {
            query.end();
            self.ended.push_back((name, query));
        }
        while self.ended.len() > PENDING && self.ended.front().is_some_and(|(_, query)| query.is_available()) {
            self.read_oldest();
        }
        // Without a query, the stage has no time.
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
