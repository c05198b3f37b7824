//! The checksums of a body, verified before the bytes are kept: `Upload-Checksum` of tus, and the digests of RFC 9530.

use super::headers;
use super::metadata::BASE64;
use super::refusal::UploadRefusal;
use crate::api::digest::{Digests, Sha256Digest};
use crate::api::error::Error;
use axum::http::HeaderMap;
use base64::Engine;
use sha1::Sha1;
use sha2::Sha256;
use sha2::digest::DynDigest;

/// Supported algorithms; tus requires the first.
pub(super) const ALGORITHMS: &str = "sha1,sha256";

type Hasher = Box<dyn DynDigest + Send + Sync>;

/// The checksums of the bytes so far, and their expected final values.
pub(super) struct Checksum(Vec<Part>);

struct Part {
    hasher: Hasher,
    expected: Vec<u8>,
    /// The header of a digest; `None` for the checksum of tus.
    digest: Option<&'static str>,
}

/// Returns the checksums that a request has for its body; `None` without any.
pub(super) fn asked_for(headers: &HeaderMap) -> Result<Option<Checksum>, Error> {
    let mut parts: Vec<Part> = of_tus(headers)?.into_iter().collect();
    for Sha256Digest { field, expected } in Digests::of(headers)?.0 {
        let hasher = Box::<Sha256>::default();
        parts.push(Part { hasher, expected: expected.to_vec(), digest: Some(field) });
    }
    Ok((!parts.is_empty()).then_some(Checksum(parts)))
}

fn of_tus(headers: &HeaderMap) -> Result<Option<Part>, Error> {
    const NAME: &str = "Upload-Checksum";
    let Some(sent) = headers::text(headers, NAME)? else { return Ok(None) };
    let (algorithm, encoded) = sent.split_once(' ').unwrap_or((sent, ""));
    let hasher: Hasher = match algorithm {
        "sha1" => Box::<Sha1>::default(),
        "sha256" => Box::<Sha256>::default(),
        _ => return Err(UploadRefusal::OtherChecksum.into()),
    };
    let bytes = hasher.output_size();
    let expected = BASE64.decode(encoded.trim()).ok().filter(|expected| expected.len() == bytes);
    let expected = expected.ok_or_else(|| {
        let detail = format!("the sum of {algorithm} has {bytes} bytes, in base64");
        Error::InvalidHeader { field: NAME, detail }
    })?;
    Ok(Some(Part { hasher, expected, digest: None }))
}

impl Checksum {
    pub fn update(&mut self, bytes: &[u8]) {
        self.0.iter_mut().for_each(|part| part.hasher.update(bytes));
    }

    /// Refuses the bytes if one of the checksums is another one.
    pub fn check(self) -> Result<(), Error> {
        for Part { hasher, expected, digest } in self.0 {
            if *hasher.finalize() != *expected {
                return Err(match digest {
                    Some(field) => Error::OtherDigest { field },
                    None => UploadRefusal::ChecksumMismatch.into(),
                });
            }
        }
        Ok(())
    }
}
