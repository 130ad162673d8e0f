//! Watches files, to read them again when they change.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// Between two looks at the files.
pub const PAUSE: Duration = Duration::from_millis(250);

/// What tells that a file is another: when it changed, and its length.
type Mark = Option<(SystemTime, u64)>;

/// Files, or a folder with all that is in it.
pub struct FileWatch {
    paths: Vec<PathBuf>,
    /// As they were last read.
    read: Vec<Mark>,
    /// As they were at the last look.
    last: Vec<Mark>,
    looked: Instant,
}

impl FileWatch {
    /// `begun` is when the reading of the files began. What changed since then may not have been read.
    pub fn new(paths: Vec<PathBuf>, begun: SystemTime) -> Self {
        let marks: Vec<Mark> = paths.iter().map(|path| mark(path)).collect();
        let now = SystemTime::now();
        // A file from the future, by another clock, is not read again and again.
        let read = marks.iter().map(|mark| mark.filter(|&(time, _)| time < begun || time > now)).collect();
        Self { paths, read, last: marks, looked: Instant::now() }
    }

    /// Whether the files have changed since they were read, and are still since the last look: a program may write them for a while.
    pub fn changed(&mut self) -> bool {
        if self.looked.elapsed() < PAUSE {
            return false;
        }
        self.looked = Instant::now();
        let now: Vec<Mark> = self.paths.iter().map(|path| mark(path)).collect();
        let still = now == self.last;
        self.last = now;
        let changed = still && self.last != self.read;
        if changed {
            self.read.clone_from(&self.last);
        }
        changed
    }
}

/// The latest change of a file or of what is in a folder, and the length of all. Files may vanish meanwhile.
fn mark(path: &Path) -> Mark {
    let own = fs::metadata(path).ok()?;
    let entries = fs::read_dir(path).into_iter().flatten().flatten();
    let all = entries.filter_map(|entry| mark(&entry.path())).chain([(own.modified().ok()?, own.len())]);
    all.reduce(|(time, length), (other, more)| (time.max(other), length + more))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(watch: &mut FileWatch) -> bool {
        watch.looked -= PAUSE;
        watch.changed()
    }

    #[test]
    fn a_change_counts_once_it_is_still() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("scene.toml");
        fs::write(&file, "a").unwrap();
        let later = SystemTime::now() + PAUSE;
        let mut watch = FileWatch::new(vec![file.clone()], later);
        assert!(!look(&mut watch));
        fs::write(&file, "ab").unwrap();
        assert!(!look(&mut watch), "it may still be written");
        fs::write(&file, "abc").unwrap();
        assert!(!look(&mut watch));
        assert!(look(&mut watch), "still since the last look");
        assert!(!look(&mut watch), "told once");
        fs::remove_file(&file).unwrap();
        assert!(!look(&mut watch) && look(&mut watch), "a vanished file is a change too");
    }

    #[test]
    fn a_change_while_it_was_read_counts() {
        let folder = tempfile::tempdir().unwrap();
        let begun = SystemTime::now() - PAUSE;
        fs::write(folder.path().join("scene.toml"), "a").unwrap();
        assert!(look(&mut FileWatch::new(vec![folder.path().join("scene.toml")], begun)));
    }
}
