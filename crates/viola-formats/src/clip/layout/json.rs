//! JSON files that describe a clip or one of its frames.

use super::ClipError;
use crate::container::Container;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer};

/// Deserializes a member; `null` is the default value, as if the member were absent. It needs `#[serde(default)]` beside it.
pub(super) fn or_default<'de, D: Deserializer<'de>, T: Deserialize<'de> + Default>(
    deserializer: D,
) -> Result<T, D::Error> {
    Ok(Option::<T>::deserialize(deserializer)?.unwrap_or_default())
}

/// Reads a `T` from a JSON file of at most `max_bytes`, which may begin with a byte order mark.
pub(super) fn read_json<T: DeserializeOwned>(
    container: &dyn Container,
    name: &str,
    max_bytes: u64,
) -> Result<T, ClipError> {
    let bytes = container.read(name, max_bytes)?;
    serde_json::from_slice(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes))
        .map_err(|error| ClipError::BadMetadata { name: name.to_string(), reason: error.to_string() })
}
