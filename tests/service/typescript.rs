//! The TypeScript client: generated from this build's document, compiled, and run against a server.
//!
//! It needs Node.js and the packages of `clients/typescript` (npm ci there). Without them the test is skipped
//! with a message, or fails if `VIOLA_BROWSER=1`.

use serde_json::Value;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;
use viola_testing::process::{Process, succeed};
use viola_testing::{has_node, room, zips};

fn run(folder: &Path, program: &str, arguments: &[&str]) -> String {
    succeed(Command::new(program).args(arguments).current_dir(folder))
}

/// Copies the client's sources with the types of this build's document; `None` without Node.js or packages.
fn generated() -> Option<TempDir> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("clients/typescript");
    if !has_node("the TypeScript client", &source, "openapi-typescript", &[]) {
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    for name in ["client.ts", "tour.ts", "generate.mjs", "tsconfig.json", "package.json"] {
        std::fs::copy(source.join(name), folder.path().join(name)).unwrap();
    }
    symlink(source.join("node_modules"), folder.path().join("node_modules")).unwrap();
    std::fs::write(folder.path().join("viola.json"), viola::api::document_json()).unwrap();
    run(folder.path(), "node", &["generate.mjs", "viola.json", "schema.d.ts"]);
    Some(folder)
}

#[test]
fn a_generated_client_compiles_and_maps_a_home() {
    let Some(folder) = generated() else { return };
    run(folder.path(), "node", &["node_modules/typescript/bin/tsc"]);

    let data = tempfile::tempdir().unwrap();
    let server = Process::serve(data.path(), &[]);
    std::fs::write(folder.path().join("map.csv"), room::lidar_csv()).unwrap();
    std::fs::write(folder.path().join("clip.zip"), zips::zip(&room::clip(12))).unwrap();
    let said = run(folder.path(), "node", &["build/tour.js", &server.client.base, "map.csv", "clip.zip"]);
    let said: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(said["state"], "aligned", "{said}");
    assert!(said["map_from_clip"]["yaw_rad"].is_number());
}

#[test]
fn the_viewer_reads_the_document_s_types() {
    let Some(generated) = generated() else { return };
    let web = Path::new(env!("CARGO_MANIFEST_DIR")).join("web");
    let folder = tempfile::tempdir().unwrap();
    for name in ["src", "tests", "node_modules", "tsconfig.json"] {
        symlink(web.join(name), folder.path().join(name)).unwrap();
    }
    std::fs::copy(generated.path().join("schema.d.ts"), folder.path().join("schema.d.ts")).unwrap();
    let arguments = ["node_modules/typescript/bin/tsc", "--noEmit", "--preserveSymlinks"];
    run(folder.path(), "node", &arguments);
}
