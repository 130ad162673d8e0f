//! What was mended in the files of a scene, for the user. Equal mends of a file become one warning with a count.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// A user does not read more than this.
const MOST: usize = 50;

/// A place in a file.
#[derive(Clone, Copy)]
pub struct Place<'a> {
    pub path: &'a Path,
    pub line: Option<usize>,
}

/// Something in a file that is wrong or unknown.
pub struct Fault<'a> {
    /// Faults of one kind in one file become one warning.
    pub kind: &'static str,
    pub problem: &'a dyn Fn() -> String,
    /// What is done about it: "it is left out".
    pub mend: &'a str,
    /// What the user can do, if the files are to be exact.
    pub cure: &'a str,
}

/// Warnings in the order in which they came.
#[derive(Default)]
pub struct Warnings {
    list: Vec<(String, usize)>,
    /// Indices of mends in the list.
    mends: HashMap<(PathBuf, &'static str), usize>,
    /// Whether faults are errors.
    strict: bool,
}

impl Warnings {
    pub fn new(strict: bool) -> Self {
        Self { strict, ..Self::default() }
    }

    /// Adds a sentence.
    pub fn say(&mut self, warning: String) {
        self.list.push((warning, 1));
    }

    /// Tells of a fault that the caller mends, or refuses the file if it must be exact.
    ///
    /// # Errors
    /// [`Error::Input`] where faults are errors.
    pub fn mend(&mut self, place: Place, fault: &Fault) -> Result<()> {
        let &Fault { kind, problem, mend, cure } = fault;
        if self.strict {
            return Err(Error::input(place.path, place.line, problem(), cure));
        }
        self.tell(place, kind, &|| format!("{}; {mend}", problem()));
        Ok(())
    }

    /// As [`Self::mend`] for a file that could not be used. `error` tells its own place, and `path` is the file that names it.
    ///
    /// # Errors
    /// `error` where faults are errors.
    pub fn mend_error(&mut self, path: &Path, kind: &'static str, error: Error, mend: &str) -> Result<()> {
        if self.strict {
            return Err(error);
        }
        let text = error.to_string();
        let (problem, _) = text.split_once("\n  cure: ").unwrap_or((&text, ""));
        self.count(path, kind, &|| format!("{problem}; {mend}"));
        Ok(())
    }

    /// Tells of something that is no fault. Equal kinds in one file become one warning.
    pub fn tell(&mut self, place: Place, kind: &'static str, text: &dyn Fn() -> String) {
        let line = place.line.map(|line| format!("{line}:")).unwrap_or_default();
        self.count(place.path, kind, &|| format!("{}:{line} {}", place.path.display(), text()));
    }

    fn count(&mut self, path: &Path, kind: &'static str, text: &dyn Fn() -> String) {
        match self.mends.get(&(path.to_owned(), kind)) {
            Some(&known) => self.list[known].1 += 1,
            None => {
                self.mends.insert((path.to_owned(), kind), self.list.len());
                self.say(text());
            }
        }
    }

    /// Whether faults are errors.
    pub fn is_strict(&self) -> bool {
        self.strict
    }

    /// All warnings as sentences, not more than a user reads.
    pub fn finish(self) -> Vec<String> {
        let sentence = |(text, count): &(String, usize)| match count {
            1 => text.clone(),
            _ => format!("{text} (and {} more like it)", count - 1),
        };
        let mut all: Vec<_> = self.list.iter().take(MOST).map(sentence).collect();
        if self.list.len() > MOST {
            all.push(format!("and {} more warnings", self.list.len() - MOST));
        }
        all
    }
}
