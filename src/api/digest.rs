//! `Content-Digest` and `Repr-Digest` (RFC 9530): the SHA-256 of a body from its sender, which is verified before the body is
//! kept. Encoded bodies are refused, so both are of the bytes of the body. Other algorithms are ignored.

use super::error::Error;
use axum::http::HeaderMap;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;

const FIELDS: [&str; 2] = ["Content-Digest", "Repr-Digest"];
const ALGORITHM: &str = "sha-256";

/// The SHA-256 of a body by one header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sha256Digest {
    pub field: &'static str,
    pub expected: [u8; 32],
}

/// The digests of a body, as its sender gave them.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Digests(pub Vec<Sha256Digest>);

impl Digests {
    /// Parses the digests of a request; none if it has none by SHA-256. Refuses malformed ones.
    pub fn of(headers: &HeaderMap) -> Result<Digests, Error> {
        let mut found = Vec::new();
        for field in FIELDS {
            found.extend(sent(headers, field)?.map(|expected| Sha256Digest { field, expected }));
        }
        Ok(Digests(found))
    }

    /// Refuses a body with another SHA-256, which is given in lower-case hexadecimal.
    pub fn check(&self, sha256: &str) -> Result<(), Error> {
        let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>();
        match self.0.iter().find(|digest| hex(&digest.expected) != sha256) {
            Some(Sha256Digest { field, .. }) => Err(Error::OtherDigest { field }),
            None => Ok(()),
        }
    }
}

/// Returns the SHA-256 in a header: the last one, as of equal keys of a dictionary (RFC 9651, section 3.2).
fn sent(headers: &HeaderMap, field: &'static str) -> Result<Option<[u8; 32]>, Error> {
    let malformed = || {
        let detail =
            format!("{field} has digests as {ALGORITHM}=:BASE64:, with commas between them (RFC 9530)");
        Error::InvalidHeader { field, detail }
    };
    let mut found = None;
    for value in headers.get_all(field) {
        for member in value.to_str().map_err(|_| malformed())?.split(',') {
            let (name, value) = member.split_once('=').ok_or_else(malformed)?;
            let (name, value) = (name.trim(), value.trim());
            if name == ALGORITHM {
                found = Some(bytes(value).ok_or_else(malformed)?);
            } else if !is_key(name) || !value.starts_with(':') {
                return Err(malformed());
            }
        }
    }
    Ok(found)
}

/// Returns whether a text is a key of a dictionary (RFC 9651, section 3.1.2).
fn is_key(text: &str) -> bool {
    let is_first = |c: u8| c.is_ascii_lowercase() || c == b'*';
    text.bytes().next().is_some_and(is_first)
        && text.bytes().all(|c| is_first(c) || c.is_ascii_digit() || b"_-.".contains(&c))
}

/// Returns the 32 bytes of a byte sequence: base64 between colons, perhaps with parameters after it.
fn bytes(value: &str) -> Option<[u8; 32]> {
    let (encoded, parameters) = value.strip_prefix(':')?.split_once(':')?;
    if !parameters.is_empty() && !parameters.starts_with(';') {
        return None;
    }
    BASE64_STANDARD.decode(encoded).ok()?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SHA-256 of the empty text, by coreutils.
    const EMPTY: &str = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
    const EMPTY_BASE64: &str = "47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU=";

    fn of(values: &[&str]) -> Result<Digests, Error> {
        let values = values.iter().map(|value| ("content-digest".parse().unwrap(), value.parse().unwrap()));
        Digests::of(&HeaderMap::from_iter(values))
    }

    #[test]
    fn digests_are_parsed_as_dictionaries() {
        let good = format!("sha-256=:{EMPTY_BASE64}:");
        let found = |values: &[&str]| of(values).unwrap().0.len();
        assert_eq!(found(&[]), 0);
        for value in [
            good.clone(),
            format!("sha-512=:AAAA:, {good}"),
            format!(" {good};q=1"),
            format!("sha-256=:{}:,{good}", BASE64_STANDARD.encode([7; 32])),
        ] {
            let digests = of(&[&value]).unwrap();
            assert_eq!(digests.0.len(), 1, "{value}");
            digests.check(EMPTY).unwrap();
            let other = digests.check(&EMPTY.replace('e', "f")).unwrap_err();
            assert_eq!(other.problem().kind, "urn:viola:problem:digest-mismatch");
        }
        assert_eq!(found(&["sha-512=:AAAA:", &good]), 1);
        assert_eq!(found(&["md5=:AAAA:"]), 0, "another algorithm is ignored");
        let short = BASE64_STANDARD.encode([7; 31]);
        for bad in [
            "sha-256".to_owned(),
            String::new(),
            format!("sha-256={EMPTY_BASE64}"),
            format!("sha-256=:{EMPTY_BASE64}"),
            format!("sha-256=:{EMPTY_BASE64}:x"),
            format!("sha-256=:{EMPTY}:"),
            format!("sha-256=:{short}:"),
            "x![v|=%CJV)".to_owned(),
            "md5=AAAA".to_owned(),
        ] {
            assert_eq!(of(&[&bad]).unwrap_err().problem().kind, "urn:viola:problem:invalid-header", "{bad}");
        }
    }
}
