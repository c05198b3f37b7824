//! Metadata of a file from its sender: pairs of a name and a value in base64, separated by commas.

use crate::api::clips;
use crate::api::error::Error;
use crate::api::extract::is_idempotency_key;
use crate::api::names::{is_file_name, is_title};
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use jiff::Timestamp;
use std::collections::BTreeMap;
use viola_storage::HomeId;

const NAME: &str = "Upload-Metadata";

/// Base64 with optional padding, because some clients omit it.
pub(super) const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// The metadata that the service uses. Other names are stored for the client and ignored.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Metadata {
    home: Option<HomeId>,
    pub filename: Option<String>,
    pub title: Option<String>,
    pub recorded_at: Option<Timestamp>,
    /// True if poses and depth have an unknown unit.
    pub unknown_scale: bool,
    pub idempotency_key: Option<String>,
    /// SHA-256 of the whole file, in lower-case hexadecimal.
    pub sha256: Option<String>,
}

fn invalid(detail: impl Into<String>) -> Error {
    Error::InvalidHeader { field: NAME, detail: detail.into() }
}

impl Metadata {
    pub fn parse(sent: &str) -> Result<Metadata, Error> {
        let mut values = BTreeMap::new();
        for pair in sent.split(',').map(str::trim).filter(|pair| !pair.is_empty()) {
            let (name, value) = pair.split_once(' ').unwrap_or((pair, ""));
            if values.insert(name, value.trim()).is_some() {
                return Err(invalid(format!("{name} is named twice")));
            }
        }
        let mut value = |name: &str| {
            let Some(encoded) = values.remove(name) else { return Ok(None) };
            let bytes = BASE64.decode(encoded).map_err(|_| invalid(format!("{name} is not base64")))?;
            let text = String::from_utf8(bytes);
            text.map(Some).map_err(|_| invalid(format!("{name} is not text in UTF-8")))
        };
        let home = value("home")?;
        // Some clients send an empty name for a file without one.
        let filename = value("filename")?.filter(|name| !name.is_empty());
        let title = value("title")?;
        let recorded_at = value("recorded_at")?;
        let scale = value("scale")?;
        let idempotency_key = value("idempotency_key")?;
        let sha256 = values.remove("sha256").map(sha256_of).transpose()?;
        if filename.as_ref().is_some_and(|name| !is_file_name(name)) {
            return Err(invalid(
                "filename has at most 255 characters, no control characters, and not only spaces",
            ));
        }
        if title.as_ref().is_some_and(|title| !is_title(title)) {
            return Err(invalid("title has 1 to 200 characters, no control characters, and not only spaces"));
        }
        if idempotency_key.as_ref().is_some_and(|key| !is_idempotency_key(key.as_bytes())) {
            return Err(invalid("idempotency_key is 1 to 255 visible ASCII characters"));
        }
        Ok(Metadata {
            home: home
                .map(HomeId::try_from)
                .transpose()
                .map_err(|error| invalid(format!("home: {error}")))?,
            filename,
            title,
            recorded_at: recorded_at.map(|text| clips::recorded_at(&text)).transpose().map_err(invalid)?,
            unknown_scale: clips::is_scale_unknown(scale.as_deref())
                .map_err(|error| invalid(error.to_string()))?,
            idempotency_key,
            sha256,
        })
    }

    /// Returns the name of the file's bytes, if their sender knows it: the SHA-256, and the idempotency key if there is one.
    /// Equal requests have one upload.
    pub fn content_key(&self) -> Option<String> {
        let key = self.idempotency_key.as_deref().unwrap_or_default();
        self.sha256.as_ref().map(|sum| format!("{sum} {key}").trim_end().to_owned())
    }

    /// Returns the key that makes one clip of repeated uploads: that of the sender, else the file's SHA-256.
    pub fn clip_key(self) -> Option<String> {
        self.idempotency_key.or(self.sha256.map(|sum| format!("sha256:{sum}")))
    }

    pub fn home(&self) -> Result<HomeId, Error> {
        self.home.clone().ok_or_else(|| invalid("home names the home that the clip belongs to, in base64"))
    }
}

/// Returns a SHA-256 in lower-case hexadecimal. Its sender encoded the 32 bytes, or their hexadecimal digits.
fn sha256_of(encoded: &str) -> Result<String, Error> {
    let bytes = BASE64.decode(encoded).unwrap_or_default();
    if bytes.len() == 64 && bytes.iter().all(u8::is_ascii_hexdigit) {
        return Ok(String::from_utf8_lossy(&bytes).to_ascii_lowercase());
    }
    if bytes.len() == 32 {
        return Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect());
    }
    Err(invalid("sha256 is the SHA-256 of the file: 64 hexadecimal digits, or its 32 bytes"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_time_is_explained_without_the_rules_of_queries() {
        for text in ["2026-03-14T15:09", "yesterday"] {
            let refused = Metadata::parse(&format!("recorded_at {}", BASE64.encode(text))).unwrap_err();
            let detail = refused.problem().detail;
            assert!(detail.contains("RFC 3339") && !detail.contains("query"), "{detail}");
        }
    }
}
