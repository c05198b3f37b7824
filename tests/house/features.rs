//! `cargo build` after the tests were built compiles no dependency again: the tests ask for no further features.

use super::{check, root};
use std::collections::BTreeSet;
use std::process::Command;

/// Every package that cargo builds for `arguments`, with its features.
fn packages(arguments: &[&str]) -> BTreeSet<String> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(["tree", "--offline", "--prefix", "none", "--no-dedupe", "--format", "{p} {f}"])
        .args(arguments)
        .current_dir(root())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect()
}

#[test]
fn tests_widen_no_features_of_the_program_s_dependencies() {
    let with_tests = packages(&["--workspace", "--edges", "normal,build,dev"]);
    let program = packages(&["--package", "viola", "--edges", "normal,build"]);
    let widened = program.difference(&with_tests);
    check(
        widened
            .map(|package| format!("{package}: name it in Cargo.toml with what the tests ask for"))
            .collect(),
    );
}
