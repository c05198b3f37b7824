//! Headers that mean the same in every operation. A value that is not valid is refused before the operation begins.

use super::error::Error;
use super::extract::has_body;
use axum::extract::Request;
use axum::http::{HeaderMap, header};
use axum::middleware::Next;
use axum::response::Response;

/// Maximum characters of a header's value that an answer repeats.
const MAX_SHOWN_CHARACTERS: usize = 64;

/// Middleware that refuses an `If-Match` that has no entity tags, and an encoded body.
pub(super) async fn check(request: Request, next: Next) -> Result<Response, Error> {
    check_tags(request.headers())?;
    check_encoding(request.headers())?;
    Ok(next.run(request).await)
}

/// A condition that cannot be read would otherwise be one that is not met, and its sender would read the resource again and
/// again.
fn check_tags(headers: &HeaderMap) -> Result<(), Error> {
    for value in headers.get_all(header::IF_MATCH) {
        if !value.to_str().is_ok_and(is_list_of_tags) {
            let detail =
                "If-Match is `*`, or entity tags as answers have them in `ETag`, each in double quotes";
            return Err(Error::InvalidHeader { field: "If-Match", detail: detail.to_owned() });
        }
    }
    Ok(())
}

/// Returns whether a text is `*` or a list of entity tags (RFC 9110, sections 8.8.3 and 13.1.1).
fn is_list_of_tags(text: &str) -> bool {
    let mut rest = text.trim();
    if rest == "*" {
        return true;
    }
    loop {
        let tag = rest.strip_prefix("W/").unwrap_or(rest);
        let Some((opaque, after)) = tag.strip_prefix('"').and_then(|tag| tag.split_once('"')) else {
            return false;
        };
        if !opaque.bytes().all(|byte| byte.is_ascii_graphic()) {
            return false;
        }
        rest = after.trim_start();
        if rest.trim_start_matches([',', ' ', '\t']).is_empty() {
            return true;
        }
        if !rest.starts_with(',') {
            return false;
        }
        // A list may have empty elements (RFC 9110, section 5.6.1.2).
        rest = rest.trim_start_matches([',', ' ', '\t']);
    }
}

fn check_encoding(headers: &HeaderMap) -> Result<(), Error> {
    if !has_body(headers) {
        return Ok(());
    }
    let is_encoded = |coding: &&str| !coding.is_empty() && !coding.eq_ignore_ascii_case("identity");
    for value in headers.get_all(header::CONTENT_ENCODING) {
        let text = String::from_utf8_lossy(value.as_bytes());
        if let Some(coding) = text.split(',').map(str::trim).find(is_encoded) {
            let shown = coding.chars().filter(char::is_ascii_graphic).take(MAX_SHOWN_CHARACTERS).collect();
            return Err(Error::Encoded(shown));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::is_list_of_tags;

    #[test]
    fn entity_tags_are_told_from_other_texts() {
        let good =
            ["*", " * ", "\"a\"", "W/\"a\"", "\"a\", \"b\"", "\"a\",W/\"b\"", "\"a,b\"", "\"\"", "\"a\", ,"];
        for text in good {
            assert!(is_list_of_tags(text), "{text}");
        }
        let bad = ["", "a", "\"a", "a\"", "\"a\" \"b\"", "w/\"a\"", "\"a b\"", "*, \"a\"", "\"a\", *", "W/a"];
        for text in bad {
            assert!(!is_list_of_tags(text), "{text}");
        }
    }
}
