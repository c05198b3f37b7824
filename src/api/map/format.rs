//! The formats of a map's files: a request names one by `format`, or by the media type in `Accept`.

use crate::api::error::Error;
use crate::api::extract::invalid_query;
use axum::http::{HeaderMap, header};

/// A format with its name in a query and its media type.
pub(super) type Format<F> = (F, &'static str, &'static str);

/// Returns the format with a name.
pub(super) fn named<F: Copy>(formats: &[Format<F>], name: &str) -> Result<Format<F>, Error> {
    let found = formats.iter().find(|(_, other, _)| *other == name);
    found.copied().ok_or_else(|| {
        let names: Vec<&str> = formats.iter().map(|(_, name, _)| *name).collect();
        let names = match names.split_last() {
            Some((last, others)) if !others.is_empty() => format!("{} or {last}", others.join(", ")),
            _ => names.concat(),
        };
        invalid_query("format", format!("format is {names}"))
    })
}

/// Returns the name of the format with the highest weight in `Accept`; of equal ones, of the first (RFC 9110, section 12.5.1).
pub(super) fn accepted<F>(formats: &[Format<F>], headers: &HeaderMap) -> Option<&'static str> {
    let accept = headers.get(header::ACCEPT)?.to_str().ok()?;
    let (mut best, mut highest) = (None, 0.0);
    for kind in accept.split(',') {
        let mut parts = kind.split(';').map(str::trim);
        let sent = parts.next().unwrap_or_default();
        let weight = parts.find_map(|part| part.strip_prefix("q=")?.parse::<f32>().ok()).unwrap_or(1.0);
        let found = formats.iter().find(|(_, _, media_type)| media_type.eq_ignore_ascii_case(sent));
        if let Some((_, name, _)) = found.filter(|_| weight > highest) {
            (best, highest) = (Some(*name), weight);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    const FORMATS: [Format<u32>; 3] =
        [(1, "ply", "model/ply"), (2, "glb", "model/gltf-binary"), (3, "laz", "application/vnd.laszip")];

    #[test]
    fn the_known_media_type_with_the_highest_weight_is_accepted() {
        assert_eq!(accepted(&FORMATS, &HeaderMap::new()), None);
        for (accept, expected) in [
            ("", None),
            ("text/html", None),
            ("text/html, model/gltf-binary;q=0.5,application/vnd.laszip", Some("laz")),
            ("Model/PLY;q=0.5, model/gltf-binary; q=0.5, */*;q=0.9", Some("ply")),
            ("model/ply;q=0, model/gltf-binary;level=1;q=0.001", Some("glb")),
            ("model/ply;q=0", None),
        ] {
            let headers = HeaderMap::from_iter([(header::ACCEPT, HeaderValue::from_static(accept))]);
            assert_eq!(accepted(&FORMATS, &headers), expected, "{accept}");
        }
    }

    #[test]
    fn a_refusal_lists_the_names() {
        assert_eq!(named(&FORMATS, "glb").unwrap(), FORMATS[1]);
        for (formats, list) in [(&FORMATS[..], "ply, glb or laz"), (&FORMATS[..1], "ply")] {
            let Err(Error::InvalidQuery { field, detail }) = named(formats, "stl") else {
                panic!("there is no such format")
            };
            assert_eq!((field.as_deref(), detail), (Some("format"), format!("format is {list}")));
        }
    }
}
