//! Runs the command-line tool in a folder of the test. Gives its exit code, its output and its files.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

pub fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

/// The tool, to run in this folder.
pub fn tool(folder: impl AsRef<Path>) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_finalgather"));
    command.current_dir(folder);
    command
}

/// A file of `scenes/`.
pub fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

/// A scene file `name` in `folder`: the Cornell box with these settings and no others.
pub fn cornell_with(folder: &Path, name: &str, settings: &str) -> PathBuf {
    for name in ["cornell.obj", "cornell.mtl"] {
        fs::copy(scene(name), folder.join(name)).unwrap();
    }
    let text = fs::read_to_string(scene("cornell.toml")).unwrap();
    let (text, _) = text.split_once("[settings]").expect("settings come last");
    let path = folder.join(name);
    fs::write(&path, format!("{text}[settings]\n{settings}")).unwrap();
    path
}

/// The Cornell box with settings that Mesa's reference rasteriser renders in seconds.
pub fn small_scene(folder: &Path) -> PathBuf {
    cornell_with(folder, "small.toml", "photons = 10000\nlayer_size = 64\nlight_samples = 32\n")
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// What was written to stderr.
pub fn stderr(output: &Output) -> String {
    text(&output.stderr)
}

/// Runs a command that must exit with code 0.
pub fn success(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(output.status.success(), "{command:?}: {:?}: {}{}", output.status, text(&output.stdout), stderr(&output));
    output
}

/// Runs a command that must exit with code 0 and write one JSON value to stdout.
pub fn json(command: &mut Command) -> Value {
    let output = success(command);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{command:?}: {error}: {output:?}"))
}

/// Runs a command that must exit with this code and write nothing to stdout. Returns its stderr.
pub fn refusal(command: &mut Command, code: i32) -> String {
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(code), "{command:?}: {}", stderr(&output));
    assert!(output.stdout.is_empty(), "{command:?} wrote to stdout");
    stderr(&output)
}

pub fn bytes(folder: impl AsRef<Path>, name: &str) -> Vec<u8> {
    fs::read(folder.as_ref().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// The sorted names of all entries of a folder.
pub fn names_in(folder: impl AsRef<Path>) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// The whole number after `before` in a message.
pub fn number_after(message: &str, before: &str) -> u64 {
    let after = message.split_once(before).map(|(_, after)| after.split(|c: char| !c.is_ascii_digit()).next().unwrap());
    after.and_then(|digits| digits.parse().ok()).unwrap_or_else(|| panic!("no number after {before:?}: {message}"))
}

/// Sends a signal, such as `TERM`, to a process that the test started.
pub fn signal(name: &str, process: impl std::fmt::Display) -> bool {
    Command::new("sh").args(["-c", &format!("kill -{name} {process}")]).status().unwrap().success()
}

/// Polls until `look` returns something.
pub fn wait_for<T>(what: &str, patience: Duration, mut look: impl FnMut() -> Option<T>) -> T {
    let began = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(began.elapsed() < patience, "waited in vain for {what}");
        sleep(Duration::from_millis(5));
    }
}

/// Waits for the exit status of a process. If it does not end in time, the process is killed and the test fails.
pub fn ended(child: &mut Child, patience: Duration) -> ExitStatus {
    let began = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if began.elapsed() > patience {
            child.kill().unwrap();
            panic!("it does not end");
        }
        sleep(Duration::from_millis(5));
    }
}
