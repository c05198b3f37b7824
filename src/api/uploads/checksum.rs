//! `Upload-Checksum`: the checksum of a body, verified before the bytes are kept.

use super::headers;
use super::metadata::BASE64;
use super::refusal::UploadRefusal;
use crate::api::error::Error;
use axum::http::HeaderMap;
use base64::Engine;
use sha1::Sha1;
use sha2::{Digest, Sha256};

/// Supported algorithms; tus requires the first.
pub(super) const ALGORITHMS: &str = "sha1,sha256";

enum Hasher {
    Sha1(Box<Sha1>),
    Sha256(Box<Sha256>),
}

/// The checksum of the bytes so far, and its expected final value.
pub(super) struct Checksum {
    hasher: Hasher,
    expected: Vec<u8>,
}

pub(super) fn asked_for(headers: &HeaderMap) -> Result<Option<Checksum>, Error> {
    const NAME: &str = "Upload-Checksum";
    let Some(sent) = headers::text(headers, NAME)? else { return Ok(None) };
    let (algorithm, encoded) = sent.split_once(' ').unwrap_or((sent, ""));
    let (hasher, bytes) = match algorithm {
        "sha1" => (Hasher::Sha1(Box::default()), 20),
        "sha256" => (Hasher::Sha256(Box::default()), 32),
        _ => return Err(UploadRefusal::OtherChecksum.into()),
    };
    let expected = BASE64.decode(encoded.trim()).ok().filter(|expected| expected.len() == bytes);
    let expected = expected.ok_or_else(|| {
        let detail = format!("the sum of {algorithm} has {bytes} bytes, in base64");
        Error::InvalidHeader { field: NAME, detail }
    })?;
    Ok(Some(Checksum { hasher, expected }))
}

impl Checksum {
    pub fn update(&mut self, bytes: &[u8]) {
        match &mut self.hasher {
            Hasher::Sha1(hasher) => hasher.update(bytes),
            Hasher::Sha256(hasher) => hasher.update(bytes),
        }
    }

    pub fn check(self) -> Result<(), UploadRefusal> {
        let found = match self.hasher {
            Hasher::Sha1(hasher) => hasher.finalize().to_vec(),
            Hasher::Sha256(hasher) => hasher.finalize().to_vec(),
        };
        if found == self.expected { Ok(()) } else { Err(UploadRefusal::ChecksumMismatch) }
    }
}
