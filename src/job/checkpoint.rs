//! The file with a job's sums: its checkpoint, or the part of a shard. A write replaces the whole file or nothing.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::Watch;
use crate::blocks::{Part, Shard};
use crate::error::{Error, Result};
use crate::export::written_with;
use crate::file::{Lock, place_of};

/// An automatic checkpoint is first written after this many intervals. A shorter job is quickly repeated.
const PATIENCE: u32 = 2;
/// Key of the shard in a part's state.
const SHARD: &str = "shard";
/// Writing takes at most 1 / `SHARE` of the time.
const SHARE: u32 = 20;

/// How a job keeps its sums.
#[derive(Clone, Debug, Default)]
pub struct Keeping {
    /// The job does this share of the directions and writes a part instead of results. It needs `file`.
    pub shard: Option<Shard>,
    /// `None`: a long job writes beside its first output, and removes the file at its end. Without outputs, nothing is kept.
    pub file: Option<PathBuf>,
    /// Time between two writes. Zero: a write after every block.
    pub every: Duration,
    /// Resumes from the file, if it exists.
    pub resume: bool,
}

pub(super) struct Checkpoint {
    path: PathBuf,
    kind: CheckpointKind,
    shard: Option<Shard>,
    resume: bool,
    /// Whether this run wrote the file or resumed from it.
    own: bool,
    every: Duration,
    begun: Instant,
    /// Time of the next write.
    due: Instant,
    /// Names of the tensors in the file. It is not written again with the same ones.
    written: Vec<String>,
    /// Whether the last write failed. The user is told once.
    failing: bool,
    /// Stops other runs from writing the file.
    lock: Result<Option<Lock>, String>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum CheckpointKind {
    /// The user asked for it. It stays at the end.
    Named,
    /// For a long job. It is removed at the end.
    Automatic,
    /// The result of a shard.
    Part,
    /// There is no file.
    Nothing,
}

impl Checkpoint {
    /// For a job that writes `outputs`.
    ///
    /// # Errors
    /// [`Error::Usage`] when the file cannot be written, or contains sums that would be lost; [`Error::Output`] while another run writes it.
    pub fn new(keeping: &Keeping, outputs: &[PathBuf]) -> Result<Self> {
        let Keeping { shard, file, every, resume } = keeping.clone();
        let (path, kind) = match (file, shard) {
            (Some(path), Some(_)) => (path, CheckpointKind::Part),
            (None, Some(_)) => return Err(Error::usage("a shard makes a part", "name its file")),
            (Some(path), None) if outputs.iter().any(|output| is_written_with(output, &path)) => {
                let problem = format!("{}: is to hold the checkpoint and the result", path.display());
                return Err(Error::usage(problem, "give them two names"));
            }
            (Some(path), None) => (path, CheckpointKind::Named),
            (None, None) if outputs.is_empty() => (PathBuf::new(), CheckpointKind::Nothing),
            (None, None) => {
                // Appended, because the name has an ending.
                let mut path = outputs.first().cloned().unwrap_or_default().into_os_string();
                path.push(".checkpoint");
                (path.into(), CheckpointKind::Automatic)
            }
        };
        let lock = if kind == CheckpointKind::Nothing {
            Ok(None)
        } else {
            Part::check_writable(&path)?;
            lock(&path)?
        };
        if kind != CheckpointKind::Automatic && !resume && path.exists() {
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
        let begun = Instant::now();
        let due = begun + if kind == CheckpointKind::Automatic { PATIENCE * every } else { every };
        Ok(Self { path, kind, shard, resume, own: false, every, begun, due, written: Vec::new(), failing: false, lock })
    }

    pub fn shard(&self) -> Option<Shard> {
        self.shard
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether an earlier run may have finished the job. Only its outputs would then exist.
    pub fn may_be_finished(&self) -> bool {
        self.resume && self.kind == CheckpointKind::Automatic && !self.path.exists()
    }

    /// A file that exists while this run lasts.
    pub fn lock_path(&self) -> Option<&Path> {
        self.lock.as_ref().ok()?.as_ref().map(Lock::path)
    }

    /// Whether the file stays if the run stops now.
    pub fn is_kept(&self) -> bool {
        match self.kind {
            CheckpointKind::Named | CheckpointKind::Part => true,
            CheckpointKind::Automatic => self.begun.elapsed() >= PATIENCE * self.every || self.resume,
            CheckpointKind::Nothing => false,
        }
    }

    /// The sums of an earlier run, if the job resumes from them.
    ///
    /// # Errors
    /// [`Error::Input`] when the file cannot be read, is damaged, or belongs to another shard.
    pub fn find(&mut self, watch: &mut dyn Watch) -> Result<Option<Part<'static>>> {
        if let Err(warning) = &self.lock {
            watch.say(warning);
        }
        let (exists, path) = (self.path.exists(), self.path.display());
        if self.resume && !exists && !self.may_be_finished() && self.kind != CheckpointKind::Nothing {
            self.say_beginning(watch);
        } else if exists && !self.resume {
            watch.say(&format!(
                "an earlier run has left {path}; --resume goes on from it, else it is replaced once this run keeps a checkpoint"
            ));
        }
        if !(self.resume && exists) {
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

    /// Says that there are no sums to resume from.
    pub fn say_beginning(&self, watch: &mut dyn Watch) {
        watch.say(&format!("nothing to go on from in {}; beginning", self.path.display()));
    }

    /// Writes `part` when a write is due. If that fails, the job continues: there may be space again later.
    pub fn keep<'a>(&mut self, watch: &mut dyn Watch, part: impl FnOnce() -> Part<'a>) {
        if Instant::now() < self.due || self.kind == CheckpointKind::Nothing {
            return;
        }
        let part = part();
        if part.names().eq(self.written.iter().map(String::as_str)) {
            return;
        }
        match self.write(part) {
            Err(error) if !self.failing => {
                self.failing = true;
                watch.say(&format!("warning: no checkpoint: {error}"));
            }
            outcome => self.failing = outcome.is_err(),
        }
    }

    /// Call it when a run ends before the job is finished. Writes the file and returns true, unless the job is short and the user asked for no file.
    ///
    /// # Errors
    /// [`Error::Output`] when the file cannot be written.
    pub fn stop<'a>(&mut self, part: impl FnOnce() -> Part<'a>) -> Result<bool> {
        let kept = self.is_kept();
        if kept {
            self.write(part())?;
        }
        Ok(kept)
    }

    /// Call it at the end of the job, after its outputs are written.
    ///
    /// # Errors
    /// As [`Self::stop`].
    pub fn finish<'a>(&mut self, part: impl FnOnce() -> Part<'a>) -> Result<()> {
        match self.kind {
            CheckpointKind::Named | CheckpointKind::Part => self.write(part())?,
            // A leftover file does no harm.
            CheckpointKind::Automatic if self.own => drop(fs::remove_file(&self.path)),
            CheckpointKind::Automatic | CheckpointKind::Nothing => {}
        }
        Ok(())
    }

    fn write(&mut self, mut part: Part) -> Result<()> {
        let start = Instant::now();
        part.state[SHARD] = self.shard.map(|shard| shard.to_string()).into();
        let written = part.write(&self.path);
        if written.is_ok() {
            self.own = true;
            self.written = part.names().map(str::to_owned).collect();
        }
        let pause = if self.every.is_zero() { self.every } else { self.every.max(SHARE * start.elapsed()) };
        self.due = Instant::now() + pause;
        written
    }
}

/// The lock. Or a warning, because some file systems, as on clusters, have no locks.
fn lock(path: &Path) -> Result<Result<Option<Lock>, String>> {
    Lock::take(path).map(|lock| Ok(Some(lock))).or_else(|error| match error.kind() {
        ErrorKind::WouldBlock => {
            Err(Error::output(path, "another run is writing it", "wait until that has ended or end it, or give another name"))
        }
        _ => {
            let path = path.display();
            Ok(Err(format!("warning: {path}: cannot be locked ({error}): let no other run write it meanwhile")))
        }
    })
}

/// Whether writing `output` also writes the file `path`.
fn is_written_with(output: &Path, path: &Path) -> bool {
    place_of(path)
        .is_ok_and(|place| written_with(output).iter().any(|output| place_of(output).is_ok_and(|output| output == place)))
}
