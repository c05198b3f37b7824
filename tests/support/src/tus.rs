//! Requests of tus 1.0, valid and invalid.

use crate::client::{Answer, Client};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use reqwest::{Method, RequestBuilder};
use sha2::{Digest, Sha256};
use std::io::Write;
use std::net::TcpStream;

pub const BYTES: &str = "application/offset+octet-stream";

pub fn encoded(text: impl AsRef<[u8]>) -> String {
    BASE64_STANDARD.encode(text)
}

pub fn metadata(pairs: &[(&str, &str)]) -> String {
    let pairs: Vec<String> = pairs.iter().map(|(name, value)| format!("{name} {}", encoded(value))).collect();
    pairs.join(",")
}

pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

impl Client {
    pub fn tus(&self, method: Method, path: &str) -> RequestBuilder {
        self.request(method, path).header("Tus-Resumable", "1.0.0")
    }

    /// Returns the request that begins an upload with this metadata.
    pub fn announce(&self, length: usize, told: &[(&str, &str)]) -> RequestBuilder {
        let request = self.tus(Method::POST, "/v1/uploads").header("Upload-Length", length);
        request.header("Upload-Metadata", metadata(told))
    }

    /// Begins an upload of a clip to a home; returns its path.
    pub async fn begin(&self, home: &str, length: usize) -> String {
        let answer = self.send(self.announce(length, &[("home", home), ("filename", "a clip.zip")])).await;
        let path = answer.header("location").to_owned();
        answer.ok(201);
        path
    }

    pub fn patch(&self, upload: &str, offset: usize, bytes: &[u8]) -> RequestBuilder {
        let request = self.tus(Method::PATCH, upload).header("Upload-Offset", offset);
        request.header("Content-Type", BYTES).body(bytes.to_vec())
    }

    pub async fn head(&self, upload: &str) -> Answer {
        self.send(self.tus(Method::HEAD, upload)).await
    }

    /// Returns the number of bytes that the server has.
    pub async fn offset(&self, upload: &str) -> usize {
        let answer = self.head(upload).await;
        assert_eq!(answer.status, 200, "{answer:?}");
        answer.header("upload-offset").parse().unwrap()
    }

    /// Sends the missing bytes, as an interrupted client does; returns the last answer.
    pub async fn go_on(&self, upload: &str, bytes: &[u8]) -> Answer {
        loop {
            let offset = self.offset(upload).await;
            let answer = self.send(self.patch(upload, offset, &bytes[offset..])).await;
            if answer.status != 409 {
                return answer;
            }
        }
    }

    /// Announces `bytes` from `offset` on, and sends only `sent` of them; returns the connection, which is
    /// cut when it is dropped.
    pub fn patch_partly(&self, upload: &str, offset: usize, bytes: &[u8], sent: usize) -> TcpStream {
        let mut connection = TcpStream::connect(self.base.strip_prefix("http://").unwrap()).unwrap();
        let length = bytes.len() - offset;
        write!(
            connection,
            "PATCH {upload} HTTP/1.1\r\nhost: localhost\r\ntus-resumable: 1.0.0\r\ncontent-type: {BYTES}\r\n\
             upload-offset: {offset}\r\ncontent-length: {length}\r\n\r\n"
        )
        .unwrap();
        connection.write_all(&bytes[offset..offset + sent]).unwrap();
        connection
    }
}
