//! A page of another origin.

use super::{can_run, script};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use viola_testing::process::{Process, succeed};
use viola_testing::tus::sha256;
use viola_testing::{room, zips};

/// Answers every request with an empty page.
fn serve_page(listener: &TcpListener) {
    for connection in listener.incoming() {
        let Ok(mut connection) = connection else { return };
        let lines = BufReader::new(connection.try_clone().unwrap()).lines();
        lines.map_while(Result::ok).find(String::is_empty);
        let _ = connection.write_all(
            b"HTTP/1.1 200 OK\r\ncontent-type: text/html\r\ncontent-length: 15\r\nconnection: close\r\n\r\n<!doctype html>",
        );
    }
}

#[test]
fn a_page_of_another_origin_uploads_and_reads_the_answer() {
    if !can_run(true) {
        return;
    }
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let origin = format!("http://{}", listener.local_addr().unwrap());
    std::thread::spawn(move || serve_page(&listener));
    let folder = tempfile::tempdir().unwrap();
    let server = Process::serve(&folder.path().join("data"), &["--cors-origin", &origin, "--no-worker"]);
    let (file, clip) = (folder.path().join("clip.zip"), zips::zip(&room::clip(6)));
    std::fs::write(&file, &clip).unwrap();
    let mut script = script("origin.mjs", &server);
    script.env("VIOLA_PAGE", format!("{origin}/")).env("VIOLA_HOME", "h").env("VIOLA_FILE", &file);
    let said = succeed(&mut script);
    let told: Value = serde_json::from_str(said.trim()).unwrap();
    assert_eq!(told, json!({"sha256": sha256(&clip), "title": "From another page", "file_name": "clip.zip"}));
}
