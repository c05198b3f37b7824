//! A server that receives messages.

use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::thread;

/// Starts a server that passes the body of each request to `receive` and answers 200; returns its URL.
pub fn receiver(receive: impl Fn(&[u8]) + Clone + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    thread::spawn(move || {
        for connection in listener.incoming() {
            let receive = receive.clone();
            thread::spawn(move || {
                let mut connection = BufReader::new(connection.unwrap());
                while let Some(body) = read(&mut connection) {
                    receive(&body);
                    let answer = b"HTTP/1.1 200 OK\r\ncontent-length: 0\r\n\r\n";
                    if connection.get_mut().write_all(answer).is_err() {
                        return;
                    }
                }
            });
        }
    });
    url
}

/// Returns the body of the next request; `None` if the sender hung up or was killed in the middle.
fn read(connection: &mut impl BufRead) -> Option<Vec<u8>> {
    let (mut line, mut bytes) = (String::new(), None);
    while connection.read_line(&mut line).ok()? > 2 {
        if let Some(value) = line.to_lowercase().strip_prefix("content-length:") {
            bytes = Some(value.trim().parse().ok()?);
        }
        line.clear();
    }
    let mut body = vec![0; bytes?];
    connection.read_exact(&mut body).ok()?;
    Some(body)
}
