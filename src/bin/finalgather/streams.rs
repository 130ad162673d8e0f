//! Scenes on stdin and results on stdout. Both are named `-`.

use std::fs;
use std::io::{self, ErrorKind, IsTerminal, Read};
use std::path::{Path, PathBuf};

use finalgather::error::{Error, Result};
use finalgather::job::Keeping;
use tempfile::TempDir;

use crate::report;

/// The name of a stream in place of a file.
pub const STREAM: &str = "-";

/// A result that goes to stdout at the end. Until then it is a file of a temporary folder, because every format is written whole.
pub struct ToStdout {
    folder: TempDir,
    path: PathBuf,
}

impl ToStdout {
    /// Replaces the output `-` or `ENDING:-` (after `RECEIVER:`, if there are several) by a file. `-` alone has the ending `plain`.
    ///
    /// # Errors
    /// [`Error::Usage`] when stdout is a terminal, is to hold something else too, or several results.
    pub fn of(outputs: &mut [String], plain: Option<&str>, json: bool) -> Result<Option<Self>> {
        let refused = |problem: &str, cure: &str| Err(Error::usage(format!("-o -: {problem}"), cure));
        let mut streams = outputs.iter_mut().filter(|output| **output == STREAM || output.ends_with(":-"));
        let Some(output) = streams.next() else { return Ok(None) };
        if streams.next().is_some() {
            return refused("stdout holds one result", "name a file for the other");
        }
        if json {
            return refused("stdout holds one thing, and --json is on it too", "name a file for the result");
        }
        if io::stdout().is_terminal() {
            return refused("stdout is a terminal", "name a file, or send stdout to a program or a file");
        }
        let before = output.strip_suffix(STREAM).unwrap_or_default().trim_end_matches(':');
        let (receiver, ending) = before.rsplit_once(':').map_or((None, before), |(receiver, ending)| (Some(receiver), ending));
        let Some(ending) = Some(ending).filter(|ending| !ending.is_empty()).or(plain) else {
            return refused("of which format?", "name it before the stream, as in -o ply:-");
        };
        if ["obj", "part"].contains(&ending) {
            return refused(
                "an OBJ has files beside it, and a part is no result",
                "name a file, or another format such as ply:-",
            );
        }
        let folder = tempfile::tempdir().map_err(|error| {
            Error::usage(format!("no temporary folder can be made: {error}"), "set TMPDIR to a folder that can be written")
        })?;
        let path = folder.path().join(format!("stdout.{ending}"));
        report::show_as(&path, "stdout");
        let name = path.display();
        *output = receiver.map_or_else(|| name.to_string(), |receiver| format!("{receiver}:{name}"));
        Ok(Some(Self { folder, path }))
    }

    /// Keeps no checkpoint in the temporary folder.
    ///
    /// # Errors
    /// [`Error::Usage`] when the job is to go on from one.
    pub fn keep(keeping: &mut Keeping) -> Result<()> {
        const NEVER: std::time::Duration = std::time::Duration::from_secs(1 << 30);
        if keeping.file.is_none() && keeping.resume {
            return Err(Error::usage(
                "-o -: stdout has no checkpoint to go on from",
                "name one by --checkpoint, or a file by -o",
            ));
        }
        if keeping.file.is_none() {
            keeping.every = NEVER;
        }
        Ok(())
    }

    /// What is left behind if the process ends at once.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Writes the result to stdout, if there is one.
    pub fn send(self) -> Result<()> {
        match fs::read(&self.path) {
            Ok(bytes) => report::print_bytes(&bytes),
            // It was stopped before there was a result.
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            Err(error) => Err(Error::output(&self.path, error.to_string(), "name a file for the result")),
        }
    }
}

/// Reads a scene from stdin. Its name is of the current folder, where its files are, with the ending of what it is.
pub fn scene() -> Result<(PathBuf, Vec<u8>)> {
    /// As of any file.
    const MOST: u64 = 4 << 30;
    let mut bytes = Vec::new();
    let cure = "send a scene file or a model to stdin";
    let path = Path::new("stdin");
    let read = io::stdin().lock().take(MOST + 1).read_to_end(&mut bytes);
    read.map_err(|error| Error::input(path, None, error.to_string(), cure))?;
    if bytes.len() as u64 > MOST {
        return Err(Error::input(path, None, format!("it has more than {MOST} bytes"), "give a file"));
    }
    if bytes.is_empty() {
        return Err(Error::input(path, None, "it is empty", cure));
    }
    Ok((path.with_extension(ending_of(&bytes)), bytes))
}

/// What a scene is by its first bytes or, for a text, by its first line that is no comment.
fn ending_of(bytes: &[u8]) -> &'static str {
    /// Comments at the head are shorter.
    const MOST: usize = 1 << 20;
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(MOST)]);
    let line = text.lines().map(str::trim).find(|line| !line.is_empty() && !line.starts_with('#')).unwrap_or_default();
    let of_obj = |word: &&str| line.split_whitespace().next() == Some(*word);
    match line {
        _ if bytes.starts_with(b"glTF") => "glb",
        "ply" => "ply",
        _ if line.starts_with("solid") => "stl",
        _ if line.starts_with('{') => "gltf",
        _ if ["v", "vn", "vt", "f", "o", "g", "s", "mtllib", "usemtl"].iter().any(of_obj) => "obj",
        _ if line.starts_with('[') || line.contains('=') => "toml",
        _ => "stl",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_are_known_by_their_first_bytes() {
        let cases: [(&[u8], &str); 7] = [
            (b"glTF\x02\0\0\0", "glb"),
            (b"ply\nformat ascii 1.0\n", "ply"),
            (b"solid cube\n", "stl"),
            (b" {\"asset\":{}}", "gltf"),
            (b"# a model = good\nmtllib a.mtl\nv 0 0 0\n", "obj"),
            (b"# a scene\nmesh = \"a.obj\"\n", "toml"),
            (&[0; 84], "stl"),
        ];
        cases.iter().for_each(|(bytes, ending)| assert_eq!(ending_of(bytes), *ending));
    }
}
