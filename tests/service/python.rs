//! The Python client: generated from this build's document without a warning, and run against a server.
//!
//! `VIOLA_PYTHON_CLIENT` is a Python with `openapi-python-client`; else the test is skipped.

use serde_json::Value;
use std::path::Path;
use std::process::Command;
use viola_testing::process::Process;
use viola_testing::{room, zips};

#[test]
fn the_generated_python_client_takes_the_tour() {
    let Some(python) = std::env::var_os("VIOLA_PYTHON_CLIENT") else {
        viola_testing::skipped(
            "the Python client",
            "set VIOLA_PYTHON_CLIENT to a Python with openapi-python-client",
        );
        return;
    };
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("clients/python");
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let mut command = Command::new(&python);
        command.args(arguments).current_dir(folder.path()).env("PYTHONPATH", folder.path());
        let output = command.output().unwrap();
        let (said, erred) =
            (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(output.status.success(), "{arguments:?}: {said}\n{erred}");
        said.into_owned()
    };
    let (document, config) = (folder.path().join("viola.json"), source.join("config.yml"));
    std::fs::write(&document, viola::api::document_json()).unwrap();
    run(&[
        "-m",
        "openapi_python_client",
        "generate",
        "--path",
        document.to_str().unwrap(),
        "--config",
        config.to_str().unwrap(),
        "--meta",
        "none",
        "--output-path",
        "viola_client",
        "--fail-on-warning",
    ]);

    let (map, clip) = (folder.path().join("map.csv"), folder.path().join("clip.zip"));
    std::fs::write(&map, room::lidar_csv()).unwrap();
    std::fs::write(&clip, zips::zip(&room::clip(12))).unwrap();
    let server = Process::serve(&folder.path().join("data"), &[]);
    let tour = source.join("tour.py");
    let files = [tour.to_str().unwrap(), &server.client.base, map.to_str().unwrap(), clip.to_str().unwrap()];
    let answer: Value = serde_json::from_str(run(&files).trim()).unwrap();
    assert_eq!(answer["state"], "aligned", "{answer}");
    assert!(answer["map_from_clip"]["x_m"].is_number(), "{answer}");
}
