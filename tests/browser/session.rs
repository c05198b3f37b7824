//! A browser that signs in with a key, and out again.

use super::{can_run, chromium, run, web};
use std::path::Path;
use std::process::Command;
use viola_testing::process::{Process, viola};

/// Makes a key of the tenant `acme`.
fn create_key(data: &Path, arguments: &[&str]) -> String {
    let made = viola()
        .args(["keys", "create", "--tenant", "acme", "--data"])
        .arg(data)
        .args(arguments)
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    String::from_utf8(made.stdout).unwrap().trim().to_owned()
}

#[test]
fn a_person_signs_in_and_out() {
    if !can_run(true) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let key = |arguments: &[&str]| create_key(&data, arguments);
    let admin = key(&["--role", "admin"]);
    let server = Process::serve(&data, &["--no-worker"]);
    run(Command::new("node")
        .arg("tests/session.mjs")
        .current_dir(web())
        .env("VIOLA_BASE", &server.client.base)
        .env("VIOLA_KEY", admin)
        .env("VIOLA_READER", key(&["--role", "reader"]))
        .env("VIOLA_OF_HOME", key(&["--role", "reader", "--home", "flat"]))
        .env("VIOLA_UPLOADER", key(&["--role", "uploader"]))
        .env("CHROMIUM", chromium()));
}
