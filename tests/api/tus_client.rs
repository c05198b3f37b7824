//! A public client of tus, from npm, against the server. It needs Node.js and the packages of `web/`, which a
//! build fetches. Without them the test is skipped with a message, or fails if `VIOLA_BROWSER=1`.

use crate::server::Server;
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;
use viola_testing::tus::sha256;
use viola_testing::{room, zips};

/// Ways of uploading that `web/tests/tus.mjs` tests.
const WAYS: [&str; 9] = [
    "whole",
    "chunks",
    "with creation",
    "chunks from creation on",
    "length told last",
    "in parallel",
    "only POST",
    "resumed",
    "over a bad network",
];

#[tokio::test(flavor = "multi_thread")]
async fn a_public_client_uploads_in_every_way() {
    let web = Path::new(env!("CARGO_MANIFEST_DIR")).join("web");
    let node = Command::new("node").arg("--version").output().is_ok_and(|answer| answer.status.success());
    if !node || !web.join("node_modules/tus-js-client").is_dir() {
        let must = std::env::var_os("VIOLA_BROWSER").is_some_and(|value| value == "1");
        assert!(!must, "not there: Node.js, or web/node_modules (npm ci in web/)");
        viola_testing::skipped("a public tus client", "install Node.js; npm ci in web");
        return;
    }
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("clip.zip");
    // Longer than the bytes that arrive before the last of the cuts.
    let clip = zips::zip(&room::clip(24));
    std::fs::write(&file, &clip).unwrap();
    let mut command = Command::new("node");
    command.arg("tests/tus.mjs").current_dir(web);
    command.env("VIOLA_BASE", &server.base).env("VIOLA_HOME", "h").env("VIOLA_FILE", &file);
    let output = tokio::task::spawn_blocking(move || command.output()).await.unwrap().unwrap();
    let (said, erred) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}\n{erred}");
    let lines: Vec<Value> = said.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let ways: Vec<&str> = lines.iter().map(|line| line["way"].as_str().unwrap()).collect();
    assert_eq!(ways, WAYS);
    for line in &lines {
        let path = line["clip"].as_str().unwrap_or_else(|| panic!("{line} has no clip"));
        let made = server.get(path).await.ok(200);
        assert_eq!(made["sha256"], json!(sha256(&clip)), "{line}");
    }
    assert_eq!(server.get(&home).await.ok(200)["clips"], WAYS.len());
    // Each clip's file, and nothing of the parts.
    assert_eq!(server.blobs().len(), WAYS.len());
}
