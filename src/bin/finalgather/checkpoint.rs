//! Checkpoints of a job, and parts of its shards: one kind of file, written whole or not at all.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use finalgather::blocks::{Part, Shard};
use finalgather::error::{Error, Result};
use finalgather::export::written_with;
use finalgather::file::{Lock, place_of};

use crate::args::JobArgs;
use crate::progress::Progress;
use crate::report;

/// Unless asked for, from so many times the interval on: a job that takes less is soon done again.
const PATIENCE: u32 = 2;
/// Of a part's state: which it is.
const SHARD: &str = "shard";
/// Writing takes no more than this share of the time.
const SHARE: u32 = 20;

pub struct Checkpoint {
    path: PathBuf,
    kind: Kind,
    shard: Option<Shard>,
    resume: bool,
    /// Whether this run has written it, or goes on from it.
    own: bool,
    every: Duration,
    begun: Instant,
    /// From when on it is to be written again,
    due: Instant,
    /// if it has others than these.
    written: Vec<String>,
    /// Whether it could not be written the last time, which is said once.
    failing: bool,
    /// So that no other run writes it meanwhile.
    lock: Option<Lock>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Asked for, and kept.
    Named,
    /// Of a long job, until its end.
    Automatic,
    /// What the job is to make.
    Part,
    /// Nothing.
    None,
}

impl Checkpoint {
    /// Of a job that writes `outputs`, or of a shard.
    ///
    /// # Errors
    /// [`Error::Usage`] when the file cannot be written, or would be over what an earlier run has summed; [`Error::Output`] while another run
    /// writes it.
    pub fn new(args: &JobArgs, outputs: &[PathBuf]) -> Result<Self> {
        let shard = args.shard()?;
        let (path, kind) = match (&args.checkpoint, shard) {
            (_, Some(shard)) => (part_of(shard, args.is_automatic(), outputs)?, Kind::Part),
            (Some(path), None) if outputs.iter().any(|output| is_written_with(output, path)) => {
                let problem = format!("{}: is to hold the checkpoint and the result", path.display());
                return Err(Error::usage(problem, "give them two names"));
            }
            (Some(path), None) => (path.clone(), Kind::Named),
            (None, None) => {
                // Appended, because the name has an ending.
                let mut path = outputs.first().cloned().unwrap_or_default().into_os_string();
                path.push(".checkpoint");
                (path.into(), Kind::Automatic)
            }
        };
        Part::check_writable(&path)?;
        let lock = lock(&path)?;
        if kind != Kind::Automatic && !args.resume && path.exists() {
            let shown = path.display();
            return Err(match Part::read(&path) {
                Ok(_) => Error::usage(
                    format!("{shown}: is there already, and holds what an earlier run has summed"),
                    "go on from it with --resume, or remove it",
                ),
                Err(_) => {
                    Error::usage(format!("{shown}: is there already, and is no checkpoint or a damaged one"), "give another name")
                }
            });
        }
        let (begun, every) = (Instant::now(), Duration::from_secs(args.checkpoint_every));
        let first = if kind == Kind::Automatic { PATIENCE * every } else { every };
        let (own, written) = (false, Vec::new());
        Ok(Self { path, kind, shard, resume: args.resume, own, every, begun, due: begun + first, written, failing: false, lock })
    }

    /// That of a job that is done as soon as it begins.
    pub fn none() -> Self {
        let now = Instant::now();
        let (path, written) = (PathBuf::new(), Vec::new());
        Self {
            path,
            kind: Kind::None,
            shard: None,
            resume: false,
            own: false,
            every: Duration::ZERO,
            begun: now,
            due: now,
            written,
            failing: false,
            lock: None,
        }
    }

    pub fn shard(&self) -> Option<Shard> {
        self.shard
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the job that is to go on may be one that has ended, and left nothing but its outputs.
    pub fn may_be_over(&self) -> bool {
        self.resume && self.kind == Kind::Automatic && !self.path.exists()
    }

    /// What is there for as long as this run is.
    pub fn lock_path(&self) -> Option<&Path> {
        self.lock.as_ref().map(Lock::path)
    }

    /// Whether a run that ends now leaves it behind.
    pub fn is_kept(&self) -> bool {
        match self.kind {
            Kind::Named | Kind::Part => true,
            Kind::Automatic => self.begun.elapsed() >= PATIENCE * self.every || self.resume,
            Kind::None => false,
        }
    }

    /// What an earlier run has left, if that is to be gone on from and there is something.
    ///
    /// # Errors
    /// [`Error::Input`] when it cannot be read, is damaged or of another shard.
    pub fn found(&mut self, progress: &Progress) -> Result<Option<Part<'static>>> {
        let there = self.kind != Kind::None && self.path.exists();
        let path = self.path.display();
        if self.resume && !there && !self.may_be_over() {
            self.say_beginning(progress);
        } else if there && !self.resume {
            progress.say(&format!(
                "an earlier run has left {path}; --resume goes on from it, and without this run replaces it in time"
            ));
        }
        if !(self.resume && there) {
            return Ok(None);
        }
        let part = Part::read(&self.path)?;
        let [theirs, ours] = [part.state[SHARD].as_str().map(str::to_owned), self.shard.map(|shard| shard.to_string())];
        if theirs != ours {
            let name = |shard: Option<String>| shard.map_or("of no shard".to_owned(), |shard| format!("of shard {shard}"));
            let problem = format!("{}, and this run is {}", name(theirs), name(ours));
            return Err(Error::input(&self.path, None, problem, "give the shard that it was begun as, or another file"));
        }
        self.own = true;
        Ok(Some(part))
    }

    /// That there is nothing to go on from.
    pub fn say_beginning(&self, progress: &Progress) {
        progress.say(&format!("nothing to go on from in {}; beginning", self.path.display()));
    }

    /// Writes what `part` gives, if it is time. Where that fails the job goes on, for there may be space again later.
    pub fn keep<'a>(&mut self, progress: &Progress, part: impl FnOnce() -> Part<'a>) {
        if self.kind == Kind::None || Instant::now() < self.due {
            return;
        }
        let part = part();
        if part.names().eq(self.written.iter().map(String::as_str)) {
            return;
        }
        match self.write(part) {
            Err(error) if !self.failing => {
                self.failing = true;
                progress.say(&format!("warning: no checkpoint: {error}"));
            }
            outcome => self.failing = outcome.is_err(),
        }
    }

    /// Writes it at the end of a run that is not that of the job. Of a short job nothing is kept unless it was asked for. Whether it was.
    ///
    /// # Errors
    /// [`Error::Output`] when it cannot be written.
    pub fn stop<'a>(&mut self, part: impl FnOnce() -> Part<'a>) -> Result<bool> {
        let kept = self.is_kept();
        if kept {
            self.write(part())?;
        }
        Ok(kept)
    }

    /// At the end of the job, once its outputs are written.
    ///
    /// # Errors
    /// As [`Self::stop`].
    pub fn finish<'a>(&mut self, part: impl FnOnce() -> Part<'a>) -> Result<()> {
        match self.kind {
            Kind::Named | Kind::Part => self.write(part()),
            Kind::Automatic if self.own => {
                // What cannot be removed does no harm.
                let _ = fs::remove_file(&self.path);
                Ok(())
            }
            Kind::Automatic | Kind::None => Ok(()),
        }
    }

    fn write(&mut self, mut part: Part) -> Result<()> {
        let start = Instant::now();
        part.state[SHARD] = self.shard.map(|shard| shard.to_string()).into();
        let written = part.write(&self.path);
        if written.is_ok() {
            self.own = true;
            self.written = part.names().map(str::to_owned).collect();
        }
        // Who asks for every block gets it.
        let pause = if self.every.is_zero() { self.every } else { self.every.max(SHARE * start.elapsed()) };
        self.due = Instant::now() + pause;
        written
    }
}

/// Where the file system has no locks, as on some clusters, a job is done all the same.
fn lock(path: &Path) -> Result<Option<Lock>> {
    Lock::take(path).map(Some).or_else(|error| match error.kind() {
        ErrorKind::WouldBlock => {
            Err(Error::output(path, "another run is writing it", "wait until that has ended or end it, or give another name"))
        }
        _ => {
            let path = path.display();
            report::say(&format!("warning: {path}: cannot be locked ({error}): let no other run write it meanwhile"));
            Ok(None)
        }
    })
}

/// Whether this file is written with that output.
fn is_written_with(output: &Path, path: &Path) -> bool {
    place_of(path)
        .is_ok_and(|place| written_with(output).iter().any(|output| place_of(output).is_ok_and(|output| output == place)))
}

/// The one output of a shard.
fn part_of(shard: Shard, automatic: bool, outputs: &[PathBuf]) -> Result<PathBuf> {
    let [output] = outputs else {
        return Err(Error::usage("a shard makes one part", "give one -o, a file ending in .part"));
    };
    if output.extension().is_none_or(|ending| ending != "part") {
        let problem = format!("{}: a shard makes a part, no result", output.display());
        return Err(Error::usage(problem, "give -o a file ending in .part; `finalgather merge` makes the result of all parts"));
    }
    let name = output.to_str().ok_or_else(|| Error::usage("the part's name is not UTF-8", "give another"))?;
    if automatic && !name.contains("{shard}") {
        return Err(Error::usage(
            format!("{name}: all tasks would write this file"),
            "put {shard}, which stands for the task's number, in the name",
        ));
    }
    Ok(name.replace("{shard}", &shard.number().to_string()).into())
}
