//! The Khronos glTF validator, as installed by `scripts/setup.sh --tests`.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use super::need::need;
use super::tool::json;

/// The validator's report on a file. `None` if it is not installed.
pub fn issues(path: &Path) -> Option<Value> {
    let packages = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join("node/node_modules");
    let installed = packages.join("gltf-validator").is_dir() && Command::new("node").arg("--version").output().is_ok();
    need("glTF by the Khronos validator", installed.then_some(()).ok_or("node or gltf-validator is not installed"))?;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/common/khronos.js");
    Some(json(Command::new("node").env("NODE_PATH", packages).arg(script).arg(path)))
}

/// Asserts that the validator finds no errors and no warnings.
pub fn check(path: &Path) {
    if let Some(issues) = issues(path) {
        assert!(issues["numErrors"] == 0 && issues["numWarnings"] == 0, "{}: {issues:#}", path.display());
    }
}
