//! Node.js and its packages, for tests of programs in JavaScript.

use crate::skipped;
use std::path::Path;
use std::process::Command;

/// Returns whether Node.js, a package in `folder` and `more` are there. Otherwise the test is skipped, or fails if
/// `VIOLA_BROWSER=1`.
pub fn has_node(test: &str, folder: &Path, package: &str, more: &[(bool, &str)]) -> bool {
    let node = Command::new("node").arg("--version").output().is_ok_and(|answer| answer.status.success());
    let packages = format!("the packages of {} (npm ci there)", folder.display());
    let is_installed = folder.join("node_modules").join(package).is_dir();
    let needs = [(node, "Node.js"), (is_installed, packages.as_str())];
    let missing: Vec<&str> =
        needs.iter().chain(more).filter(|(is_there, _)| !is_there).map(|(_, name)| *name).collect();
    if missing.is_empty() {
        return true;
    }
    let missing = missing.join(", ");
    assert!(std::env::var_os("VIOLA_BROWSER").is_none_or(|value| value != "1"), "not there: {missing}");
    skipped(test, &format!("install {missing}"));
    false
}
