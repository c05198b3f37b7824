//! A public client of tus, from npm, against the server. It needs Node.js and the packages of `web/`, which a
//! build fetches. Without them the test is skipped with a message, or fails if `VIOLA_BROWSER=1`.

use crate::server::Server;
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;
use viola_testing::process::succeed;
use viola_testing::tus::sha256;
use viola_testing::{has_node, room, zips};

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
    if !has_node("a public tus client", &web, "tus-js-client", &[]) {
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
    let said = tokio::task::spawn_blocking(move || succeed(&mut command)).await.unwrap();
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
