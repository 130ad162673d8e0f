//! The error type of the library. Each error tells where it happened, what is wrong and how to fix it.

use std::fmt;
use std::path::{Path, PathBuf};

pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Kinds of errors, by who can fix them. `Display` gives two lines: the problem with its place, then the cure.
#[derive(Debug)]
pub enum Error {
    /// An input file is missing, unreadable or has unusable contents.
    Input {
        path: PathBuf,
        line: Option<usize>,
        problem: String,
        cure: String,
        /// What was mended in the files before.
        warnings: Vec<String>,
    },
    /// The request is impossible: for example a setting is out of range, or an output path cannot be used.
    Usage { problem: String, cure: String },
    /// OpenGL 3.3 is missing, or the driver refused something that 3.3 guarantees.
    Gl { problem: String, cure: String },
    /// A result could not be written. It may work later or elsewhere.
    Output { path: PathBuf, problem: String, cure: String },
}

impl Error {
    pub fn input(path: &Path, line: Option<usize>, problem: impl Into<String>, cure: impl Into<String>) -> Self {
        let (path, problem, cure) = (path.to_owned(), shortened(problem.into()), shortened(cure.into()));
        Self::Input { path, line, problem, cure, warnings: Vec::new() }
    }

    /// The error after warnings of the same load.
    pub(crate) fn after(mut self, before: Vec<String>) -> Self {
        if let Self::Input { warnings, .. } = &mut self {
            *warnings = before;
        }
        self
    }

    pub fn usage(problem: impl Into<String>, cure: impl Into<String>) -> Self {
        Self::Usage { problem: problem.into(), cure: cure.into() }
    }

    pub fn gl(problem: impl Into<String>, cure: impl Into<String>) -> Self {
        Self::Gl { problem: problem.into(), cure: cure.into() }
    }

    pub fn output(path: &Path, problem: impl Into<String>, cure: impl Into<String>) -> Self {
        Self::Output { path: path.to_owned(), problem: problem.into(), cure: cure.into() }
    }
}

/// Cuts the middle out of a text that is too long for a message. Names in files can have any length.
fn shortened(text: String) -> String {
    const ENDS: usize = 500;
    if text.len() <= 3 * ENDS {
        return text;
    }
    let (head, tail) = (text.floor_char_boundary(ENDS), text.ceil_char_boundary(text.len() - ENDS));
    format!("{} [...] {}", &text[..head], &text[tail..])
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (problem, cure) = match self {
            Self::Input { path, line, problem, cure, .. } => {
                write!(f, "{}:", path.display())?;
                if let Some(line) = line {
                    write!(f, "{line}:")?;
                }
                write!(f, " ")?;
                (problem, cure)
            }
            Self::Output { path, problem, cure } => {
                write!(f, "{}: ", path.display())?;
                (problem, cure)
            }
            Self::Usage { problem, cure } | Self::Gl { problem, cure } => (problem, cure),
        };
        write!(f, "{problem}\n  cure: {cure}")
    }
}

impl std::error::Error for Error {}
