//! Metadata of a file from its sender: pairs of a name and a value in base64, separated by commas.

use crate::api::clips;
use crate::api::error::Error;
use crate::api::extract::is_idempotency_key;
use crate::api::names::{is_file_name, is_title};
use crate::storage::HomeId;
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use jiff::Timestamp;
use std::collections::BTreeMap;

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
    pub idempotency_key: Option<String>,
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
        let idempotency_key = value("idempotency_key")?;
        if filename.as_ref().is_some_and(|name| !is_file_name(name)) {
            return Err(invalid("filename has at most 255 characters, and no control characters"));
        }
        if title.as_ref().is_some_and(|title| !is_title(title)) {
            return Err(invalid("title has 1 to 200 characters, and no control characters"));
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
            recorded_at: recorded_at
                .map(|text| clips::recorded_at(&text))
                .transpose()
                .map_err(|error| invalid(error.to_string()))?,
            idempotency_key,
        })
    }

    pub fn home(&self) -> Result<HomeId, Error> {
        self.home.clone().ok_or_else(|| invalid("home names the home that the clip belongs to, in base64"))
    }
}
