//! The Python client: generated from this build's document without a warning, and run against a server.
//!
//! `VIOLA_PYTHON_CLIENT` is a Python with `openapi-python-client`; else the test is skipped.

use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::Command;
use viola_testing::process::{Process, succeed};
use viola_testing::{room, zips};

/// A Python with the generated client in a folder.
struct Python {
    program: std::ffi::OsString,
    folder: tempfile::TempDir,
}

impl Python {
    /// Generates the client; `None` without a Python that can.
    fn generated() -> Option<Python> {
        let Some(program) = std::env::var_os("VIOLA_PYTHON_CLIENT") else {
            viola_testing::skipped(
                "the Python client",
                "set VIOLA_PYTHON_CLIENT to a Python with openapi-python-client",
            );
            return None;
        };
        let python = Python { program, folder: tempfile::tempdir().unwrap() };
        let (document, config) = (python.folder.path().join("viola.json"), sources().join("config.yml"));
        std::fs::write(&document, viola::api::document_json()).unwrap();
        python.run(&[
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
        Some(python)
    }

    /// Runs Python in the folder; returns its output.
    fn run(&self, arguments: &[&str]) -> String {
        let mut command = Command::new(&self.program);
        let path = std::env::join_paths([self.folder.path(), &sources()]).unwrap();
        command.args(arguments).current_dir(self.folder.path()).env("PYTHONPATH", path);
        succeed(command.env("PYTHONDONTWRITEBYTECODE", "1"))
    }
}

fn sources() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("clients/python")
}

#[test]
fn the_generated_python_client_takes_the_tour() {
    let Some(python) = Python::generated() else { return };
    let folder = python.folder.path();
    let (map, clip) = (folder.join("map.csv"), folder.join("clip.zip"));
    std::fs::write(&map, room::lidar_csv()).unwrap();
    std::fs::write(&clip, zips::zip(&room::clip(12))).unwrap();
    let server = Process::serve(&folder.join("data"), &[]);
    let tour = sources().join("tour.py");
    let files = [tour.to_str().unwrap(), &server.client.base, map.to_str().unwrap(), clip.to_str().unwrap()];
    let answer: Value = serde_json::from_str(python.run(&files).trim()).unwrap();
    assert_eq!(answer["state"], "aligned", "{answer}");
    assert!(answer["map_from_clip"]["x_m"].is_number(), "{answer}");
}

/// Answers every request with a page of HTML, as a proxy does. The last part of the path is the status; to any other one it
/// is silent.
fn proxy_without_a_service() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        let mut silent = Vec::new();
        for connection in listener.incoming() {
            let mut connection = connection.unwrap();
            let mut head = Vec::new();
            for line in BufReader::new(&connection).lines() {
                let line = line.unwrap();
                if line.is_empty() {
                    break;
                }
                head.push(line);
            }
            let path = head[0].split(' ').nth(1).unwrap();
            let Ok(status) = path.rsplit('/').next().unwrap().parse::<u16>() else {
                silent.push(connection);
                continue;
            };
            let page = format!("<html>{status}</html>");
            write!(
                connection,
                "HTTP/1.1 {status} Page\r\ncontent-type: text/html; charset=utf-8\r\ncontent-length: {}\r\n\
                 connection: close\r\n\r\n{page}",
                page.len()
            )
            .unwrap();
        }
    });
    address
}

#[test]
fn a_page_of_a_proxy_is_a_typed_error_and_silence_ends() {
    const SCRIPT: &str = r#"
import asyncio
import sys
import httpx
from connect import connect
from viola_client.api.homes import get_home
from viola_client.errors import UnexpectedStatus
api, later = connect(sys.argv[1]), connect(sys.argv[1], key="viola_x", for_asyncio=True)
for status in ("200", "404", "502", "503"):
    try:
        print(get_home.sync(status, client=api))
    except UnexpectedStatus as error:
        print(error.status_code, error.content.decode())
try:
    asyncio.run(get_home.asyncio("503", client=later))
except UnexpectedStatus as error:
    print(error.status_code, error.content.decode())
try:
    get_home.sync("silent", client=connect(sys.argv[1], timeout=0.2))
except httpx.TimeoutException:
    print("timeout")
"#;
    let Some(python) = Python::generated() else { return };
    let told = python.run(&["-c", SCRIPT, &format!("http://{}", proxy_without_a_service())]);
    let expected =
        ["200", "404", "502", "503", "503"].map(|status| format!("{status} <html>{status}</html>"));
    assert_eq!(told.lines().collect::<Vec<_>>(), [&expected[..], &["timeout".to_owned()]].concat());
}
