//! A browser that signs in with a key, and out again.

use super::{can_run, chromium, run, web};
use std::process::Command;
use viola_testing::process::{Process, viola};

#[test]
fn a_person_signs_in_and_out() {
    if !can_run(true) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let made =
        viola().args(["keys", "create", "--tenant", "acme", "--role", "admin", "--data"]).arg(&data).output();
    let made = made.unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let server = Process::serve(&data, &["--no-worker"]);
    run(Command::new("node")
        .arg("tests/session.mjs")
        .current_dir(web())
        .env("VIOLA_BASE", &server.client.base)
        .env("VIOLA_KEY", String::from_utf8(made.stdout).unwrap().trim())
        .env("CHROMIUM", chromium()));
}
