//! A browser that signs in with a key, and out again.

use super::{can_run, run, script};
use viola_testing::process::{Process, succeed, viola};

#[test]
fn a_person_signs_in_and_out() {
    if !can_run(true) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let key = |arguments: &[&str]| {
        let mut create = viola();
        create.args(["keys", "create", "--tenant", "acme", "--data"]).arg(&data).args(arguments);
        succeed(&mut create).trim().to_owned()
    };
    let admin = key(&["--role", "admin"]);
    let server = Process::serve(&data, &["--no-worker"]);
    run(script("session.mjs", &server)
        .env("VIOLA_KEY", admin)
        .env("VIOLA_READER", key(&["--role", "reader"]))
        .env("VIOLA_OF_HOME", key(&["--role", "reader", "--home", "flat"]))
        .env("VIOLA_UPLOADER", key(&["--role", "uploader"])));
}
