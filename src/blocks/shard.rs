//! A job's blocks, split into shards for several machines.

use std::fmt;
use std::ops::Range;

use crate::error::{Error, Result};

/// Shard `index` of `count`, counted from 0 here and from 1 in texts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: u32,
    count: u32,
}

/// Environment variables of engines for array jobs: the task's number, the number of the first task, and the count of tasks.
const ENGINES: [(&str, FirstTask, &str); 4] = [
    ("SLURM_ARRAY_TASK_ID", FirstTask::Variables("SLURM_ARRAY_TASK_MIN", "SLURM_ARRAY_TASK_STEP"), "SLURM_ARRAY_TASK_COUNT"),
    ("AWS_BATCH_JOB_ARRAY_INDEX", FirstTask::Number(0), "AWS_BATCH_JOB_ARRAY_SIZE"),
    ("JOB_COMPLETION_INDEX", FirstTask::Number(0), ""),
    ("PBS_ARRAY_INDEX", FirstTask::Number(1), ""),
];

#[derive(Clone, Copy)]
enum FirstTask {
    Number(u32),
    /// The variables of the first task's number, and of the step from one task to the next.
    Variables(&'static str, &'static str),
}

impl Shard {
    /// `index` counts from 1.
    fn new(index: u32, count: u32) -> Option<Self> {
        (1..=count).contains(&index).then(|| Self { index: index - 1, count })
    }

    /// Parses `3/16`; `auto`, by the variables of an engine for array jobs; or `auto/16`, for engines that do not tell the count of tasks.
    /// `variable` returns the value of an environment variable.
    ///
    /// # Errors
    /// [`Error::Usage`] if `text` or the variables give no shard.
    pub fn parse(text: &str, variable: impl Fn(&str) -> Option<String>) -> Result<Self> {
        let bad = |problem: String| Error::usage(problem, "give I/N with I from 1 to N, as in 3/16; auto; or auto/N");
        let (index, count) = match text.split_once('/') {
            Some((index, count)) => {
                (index, Some(count.parse::<u32>().map_err(|_| bad(format!("shard {text}: no number of shards")))?))
            }
            None => (text, None),
        };
        if index != "auto" {
            let shard = index.parse().ok().zip(count).and_then(|(index, count)| Self::new(index, count));
            return shard.ok_or_else(|| bad(format!("shard {text} is none")));
        }
        let number = |name: &str| variable(name).and_then(|value| value.trim().parse::<u32>().ok());
        let engine = ENGINES.into_iter().find_map(|(name, first, all)| Some((name, number(name)?, first, all)));
        let Some((name, task, first, all)) = engine else {
            let names = ENGINES.map(|(name, ..)| name).join(", ");
            return Err(Error::usage(
                format!("shard {text}: none of {names} is set"),
                "run it as a task of an array job, or give I/N",
            ));
        };
        let first = match first {
            FirstTask::Number(first) => Some(first),
            // An array that repeats failed tasks counts from another number.
            FirstTask::Variables(first, step) => number(first).filter(|&first| first <= 1 && number(step).unwrap_or(1) == 1),
        };
        let Some(count) = count.or_else(|| number(all)) else {
            let problem = format!("shard {text}: {name} tells which task it is, and nothing how many there are");
            return Err(Error::usage(problem, "say so: auto/N"));
        };
        let index = first.and_then(|first| task.checked_sub(first));
        let shard = index.and_then(|index| Self::new(index.checked_add(1)?, count));
        let problem = || format!("shard {text}: {name} is {task}, and of {count} tasks from 0 or 1 on that is none");
        shard.ok_or_else(|| bad(problem()))
    }

    /// The shard's blocks of `blocks` in all.
    ///
    /// # Errors
    /// [`Error::Usage`] if there are more shards than blocks.
    pub fn range(self, blocks: u32) -> Result<Range<u32>> {
        if self.count > blocks {
            let problem = format!("{} shards, and the directions fall into {blocks} blocks", self.count);
            return Err(Error::usage(problem, format!("give {blocks} shards or fewer, or more directions")));
        }
        let first = |index: u32| (u64::from(blocks) * u64::from(index) / u64::from(self.count)) as u32;
        Ok(first(self.index)..first(self.index + 1))
    }

    /// The shard's number, from 1.
    pub fn number(self) -> u32 {
        self.index + 1
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number(), self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str, variables: &[(&str, &str)]) -> Result<String> {
        let value = |name: &str| Some(variables.iter().find(|(other, _)| *other == name)?.1.to_owned());
        Shard::parse(text, value).map(|shard| shard.to_string())
    }

    #[test]
    fn shards_take_every_block_once() {
        for (blocks, count) in [(32, 16), (32, 5), (7, 7), (100, 3), (1, 1), (u32::MAX, 7)] {
            let range = |index| Shard { index, count }.range(blocks).unwrap();
            assert_eq!(range(0).start, 0);
            assert_eq!(range(count - 1).end, blocks);
            for index in 1..count {
                assert_eq!(range(index - 1).end, range(index).start);
                assert!(range(index).len() >= (blocks / count) as usize);
            }
        }
        assert!(Shard { index: 0, count: 9 }.range(8).is_err());
    }

    #[test]
    fn engines_tell_the_shard() {
        assert_eq!(parse("3/16", &[]).unwrap(), "3/16");
        let slurm = [("SLURM_ARRAY_TASK_ID", "3"), ("SLURM_ARRAY_TASK_MIN", "1"), ("SLURM_ARRAY_TASK_COUNT", "16")];
        assert_eq!(parse("auto", &slurm).unwrap(), "3/16");
        assert_eq!(parse("auto", &[("AWS_BATCH_JOB_ARRAY_INDEX", "0"), ("AWS_BATCH_JOB_ARRAY_SIZE", "4")]).unwrap(), "1/4");
        assert_eq!(parse("auto/8", &[("JOB_COMPLETION_INDEX", "7")]).unwrap(), "8/8");
        assert_eq!(parse("auto/8", &[("PBS_ARRAY_INDEX", "8")]).unwrap(), "8/8");
    }

    #[test]
    fn what_is_no_shard_is_refused_with_a_cure() {
        let out_of_range = [("JOB_COMPLETION_INDEX", "8")];
        // A task that was submitted again alone, and every second task.
        let one = [("SLURM_ARRAY_TASK_ID", "5"), ("SLURM_ARRAY_TASK_MIN", "5"), ("SLURM_ARRAY_TASK_COUNT", "1")];
        let even = [
            ("SLURM_ARRAY_TASK_ID", "2"),
            ("SLURM_ARRAY_TASK_MIN", "0"),
            ("SLURM_ARRAY_TASK_COUNT", "8"),
            ("SLURM_ARRAY_TASK_STEP", "2"),
        ];
        let cases: [(&str, &[(&str, &str)]); 12] = [
            ("auto", &one),
            ("auto/16", &one),
            ("auto", &even),
            ("0/4", &[]),
            ("5/4", &[]),
            ("1/0", &[]),
            ("1", &[]),
            ("-1/4", &[]),
            ("auto", &[]),
            ("auto", &out_of_range),
            ("auto/8", &out_of_range),
            ("auto/x", &out_of_range),
        ];
        for (text, variables) in cases {
            let error = parse(text, variables).unwrap_err();
            assert!(matches!(error, Error::Usage { .. }), "{text}: {error}");
            assert!(error.to_string().contains("/N"), "{text}: {error}");
        }
    }
}
