//! A server on this machine for tests of downloads.

use std::io::{Read, Write};
use std::net::TcpListener;

/// Serves one request per answer; an answer is a function of the request's text.
pub fn serve(answers: Vec<fn(&str) -> Vec<u8>>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}/net.onnx", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        for answer in answers {
            let (mut stream, _) = listener.accept().unwrap();
            let mut request = Vec::new();
            while !request.ends_with(b"\r\n\r\n") {
                let mut byte = [0];
                stream.read_exact(&mut byte).unwrap();
                request.push(byte[0]);
            }
            stream.write_all(&answer(&String::from_utf8_lossy(&request).to_lowercase())).unwrap();
        }
    });
    url
}

pub fn answer(head: &str, body: &str) -> Vec<u8> {
    format!("HTTP/1.1 {head}\r\nconnection: close\r\n\r\n{body}").into_bytes()
}
