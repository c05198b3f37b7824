//! JSON files that describe a clip or one of its frames.

use super::ClipError;
use crate::clip::MAX_FRAMES;
use crate::container::Container;
use crate::json;
use serde::de::{DeserializeOwned, IgnoredAny, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::marker::PhantomData;

/// Deserializes a member; `null` is the default value, as if the member were absent. It needs `#[serde(default)]` beside it.
pub(super) fn or_default<'de, D: Deserializer<'de>, T: Deserialize<'de> + Default>(
    deserializer: D,
) -> Result<T, D::Error> {
    Ok(Option::<T>::deserialize(deserializer)?.unwrap_or_default())
}

/// Deserializes a list with an item for each frame; `null` is an empty one. Of more frames than a clip may have, one more is
/// kept, so that the clip is refused, and the others are skipped: a hostile file has millions.
pub(super) fn first_frames<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    deserializer: D,
) -> Result<Vec<T>, D::Error> {
    struct First<T>(PhantomData<T>);
    impl<'de, T: Deserialize<'de>> Visitor<'de> for First<T> {
        type Value = Vec<T>;
        fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
            formatter.write_str("a list")
        }
        fn visit_unit<E>(self) -> Result<Vec<T>, E> {
            Ok(Vec::new())
        }
        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<T>, A::Error> {
            let mut items = Vec::new();
            while items.len() <= MAX_FRAMES
                && let Some(item) = list.next_element()?
            {
                items.push(item);
            }
            while list.next_element::<IgnoredAny>()?.is_some() {}
            Ok(items)
        }
    }
    deserializer.deserialize_any(First(PhantomData))
}

/// Reads a `T` from a JSON file of at most `max_bytes`, which may begin with a byte order mark.
pub(super) fn read_json<T: DeserializeOwned>(
    container: &dyn Container,
    name: &str,
    max_bytes: u64,
) -> Result<T, ClipError> {
    parse_json(&container.read(name, max_bytes)?, name)
}

/// Parses a `T` from the bytes of a JSON file, which may begin with a byte order mark.
pub(super) fn parse_json<T: DeserializeOwned>(bytes: &[u8], name: &str) -> Result<T, ClipError> {
    json::parse(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
        .map_err(|reason| ClipError::BadMetadata { name: name.to_string(), reason })
}
