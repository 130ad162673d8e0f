//! The Khronos validator of glTF, as `scripts/setup.sh --tests` installs it.

use std::io::{Write, stderr};
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// What it says of a file; `None` where it is not installed, which is said past the test harness, which swallows what passing tests print.
pub fn issues(path: &Path) -> Option<Value> {
    let packages = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join("node/node_modules");
    let runs = || Command::new("node").arg("--version").output().is_ok();
    if !packages.join("gltf-validator").is_dir() || !runs() {
        let missing = "NOT TESTED: glTF by the Khronos validator, which is not here; scripts/setup.sh --tests installs it";
        let _ = writeln!(stderr(), "{missing}");
        return None;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/common/khronos.js");
    let output = Command::new("node").env("NODE_PATH", packages).arg(script).arg(path).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(serde_json::from_slice(&output.stdout).unwrap())
}

/// No errors and no warnings.
pub fn check(path: &Path) {
    if let Some(issues) = issues(path) {
        assert!(issues["numErrors"] == 0 && issues["numWarnings"] == 0, "{}: {issues:#}", path.display());
    }
}
