//! Request headers of tus. A header that is sent twice is refused: a proxy could read the other value.

use super::refusal::UploadRefusal;
use crate::api::bodies::media_type;
use crate::api::error::Error;
use axum::http::{HeaderMap, HeaderName, HeaderValue};
use uuid::Uuid;

pub(super) const RESUMABLE: HeaderName = HeaderName::from_static("tus-resumable");
pub(super) const VERSION: HeaderName = HeaderName::from_static("tus-version");
/// The version of tus that is served.
pub(super) const SERVED: HeaderValue = HeaderValue::from_static("1.0.0");

const MAX_METADATA_BYTES: usize = 4096;
const MAX_PARTS: usize = 128;
const MAX_CONCAT_BYTES: usize = 16 << 10;
const MEDIA_TYPE: &str = "application/offset+octet-stream";

/// Length of a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Length {
    Known(u64),
    /// A later request gives it.
    Deferred,
}

impl Length {
    pub fn known(self) -> Option<u64> {
        match self {
            Length::Known(bytes) => Some(bytes),
            Length::Deferred => None,
        }
    }
}

/// Kind of an upload, from `Upload-Concat`.
#[derive(Debug, PartialEq)]
pub(super) enum Concat {
    Whole,
    Partial,
    Final { ids: Vec<Uuid>, sent: String },
}

fn invalid(field: &'static str, detail: impl Into<String>) -> Error {
    Error::InvalidHeader { field, detail: detail.into() }
}

/// Returns the only value of a header, in visible ASCII and spaces.
pub(super) fn text<'a>(headers: &'a HeaderMap, name: &'static str) -> Result<Option<&'a str>, Error> {
    let mut values = headers.get_all(name).iter();
    let Some(value) = values.next() else { return Ok(None) };
    if values.next().is_some() {
        return Err(invalid(name, format!("{name} was sent twice")));
    }
    value.to_str().map(Some).map_err(|_| invalid(name, format!("{name} has bytes that are not ASCII")))
}

fn number(headers: &HeaderMap, name: &'static str) -> Result<Option<u64>, Error> {
    let Some(text) = text(headers, name)? else { return Ok(None) };
    // Rust would also parse a sign, and the database stores numbers below 2^63.
    let digits = text.bytes().all(|byte| byte.is_ascii_digit());
    let number = text.parse().ok().filter(|number| digits && i64::try_from(*number).is_ok());
    number.map(Some).ok_or_else(|| invalid(name, format!("{name} is a number of bytes")))
}

/// Refuses a request that speaks another version of tus, or does not say which.
pub(super) fn check_version(headers: &HeaderMap) -> Result<(), Error> {
    const NAME: &str = "Tus-Resumable";
    let Some(sent) = text(headers, NAME)? else {
        return Err(invalid(NAME, "send the header Tus-Resumable: 1.0.0"));
    };
    if SERVED == sent {
        return Ok(());
    }
    let is_number = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    if sent.split('.').count() == 3 && sent.split('.').all(is_number) {
        return Err(UploadRefusal::OtherVersion.into());
    }
    Err(invalid(NAME, "Tus-Resumable is a version: 1.0.0"))
}

pub(super) fn offset(headers: &HeaderMap) -> Result<u64, Error> {
    number(headers, "Upload-Offset")?
        .ok_or_else(|| invalid("Upload-Offset", "Upload-Offset says where the body belongs; HEAD tells it"))
}

pub(super) fn length(headers: &HeaderMap) -> Result<Option<Length>, Error> {
    match (number(headers, "Upload-Length")?, text(headers, "Upload-Defer-Length")?) {
        (Some(_), Some(_)) => {
            Err(invalid("Upload-Defer-Length", "give one of Upload-Length and Upload-Defer-Length"))
        }
        (Some(bytes), None) => Ok(Some(Length::Known(bytes))),
        (None, Some("1")) => Ok(Some(Length::Deferred)),
        (None, Some(_)) => Err(invalid("Upload-Defer-Length", "Upload-Defer-Length is 1, or not sent")),
        (None, None) => Ok(None),
    }
}

pub(super) fn no_length() -> Error {
    invalid("Upload-Length", "send Upload-Length, or Upload-Defer-Length: 1 if the length is unknown")
}

pub(super) fn check_length(length: Length, max_bytes: u64) -> Result<(), Error> {
    match length {
        Length::Known(0) => Err(UploadRefusal::EmptyFile.into()),
        Length::Known(length) if length > max_bytes => {
            Err(UploadRefusal::FileTooLarge { length, limit: max_bytes }.into())
        }
        _ => Ok(()),
    }
}

pub(super) fn metadata(headers: &HeaderMap) -> Result<String, Error> {
    let sent = text(headers, "Upload-Metadata")?.unwrap_or_default();
    if sent.len() > MAX_METADATA_BYTES {
        let detail = format!("Upload-Metadata has at most {MAX_METADATA_BYTES} bytes");
        return Err(invalid("Upload-Metadata", detail));
    }
    Ok(sent.to_owned())
}

/// Reads `Upload-Concat`. Parts are named by their paths, relative or absolute.
pub(super) fn concat(headers: &HeaderMap) -> Result<Concat, Error> {
    const NAME: &str = "Upload-Concat";
    let Some(sent) = text(headers, NAME)? else { return Ok(Concat::Whole) };
    if sent == "partial" {
        return Ok(Concat::Partial);
    }
    if sent.len() > MAX_CONCAT_BYTES {
        return Err(invalid(NAME, format!("Upload-Concat has at most {MAX_CONCAT_BYTES} bytes")));
    }
    let Some(list) = sent.strip_prefix("final;") else {
        return Err(invalid(NAME, "Upload-Concat is partial, or final; and the paths of partial uploads"));
    };
    let paths: Vec<&str> = list.split(' ').filter(|path| !path.is_empty()).take(MAX_PARTS + 1).collect();
    if paths.is_empty() || paths.len() > MAX_PARTS {
        return Err(invalid(NAME, format!("a final upload has 1 to {MAX_PARTS} parts")));
    }
    let id = |path: &&str| {
        let (before, id) = path.rsplit_once('/')?;
        before.ends_with("/v1/uploads").then(|| Uuid::try_parse(id).ok())?
    };
    let ids: Option<Vec<Uuid>> = paths.iter().map(id).collect();
    let ids =
        ids.ok_or_else(|| invalid(NAME, "the parts of a final upload are named as Location told them"))?;
    let mut each = ids.clone();
    each.sort();
    each.dedup();
    if each.len() < ids.len() {
        return Err(invalid(NAME, "a part is named twice; each goes into one final upload, once"));
    }
    Ok(Concat::Final { ids, sent: sent.to_owned() })
}

pub(super) fn check_media_type(headers: &HeaderMap) -> Result<(), Error> {
    if media_type(headers) == MEDIA_TYPE {
        return Ok(());
    }
    Err(UploadRefusal::MediaType { expected: MEDIA_TYPE }.into())
}
