//! JSON whose errors name the member at fault.

use serde::de::DeserializeOwned;

/// Maximum number of characters of a member's path in an error: a file may have names of any length.
const MAX_PATH_CHARS: usize = 200;
/// Maximum number of characters of the parser's words, which repeat a wrong value.
const MAX_WORDS_CHARS: usize = 300;

/// Parses a `T`. The error names the member at fault, if there is one, and its line and column.
pub(crate) fn parse<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
    let reason = match serde_json::from_slice(bytes) {
        Ok(parsed) => return Ok(parsed),
        Err(error) => reason(&error),
    };
    Err(match member_at_fault::<T>(bytes) {
        Some(member) => format!("{member}: {reason}"),
        None => reason,
    })
}

/// Returns the path of the member at fault, as in `layers[3].pixels[7]`. Paths cost time for each number of a large map, so
/// only a file with a fault is parsed with them.
fn member_at_fault<T: DeserializeOwned>(bytes: &[u8]) -> Option<String> {
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    let error = serde_path_to_error::deserialize::<_, T>(&mut deserializer).err()?;
    let path = error.path();
    path.iter().next().is_some().then(|| shortened(&path.to_string(), MAX_PATH_CHARS))
}

/// Returns the words of an error, in a bounded length, with its line and column.
fn reason(error: &serde_json::Error) -> String {
    let words = error.to_string();
    let place = format!(" at line {} column {}", error.line(), error.column());
    match words.strip_suffix(&place) {
        Some(words) => shortened(words, MAX_WORDS_CHARS) + &place,
        None => shortened(&words, MAX_WORDS_CHARS),
    }
}

fn shortened(text: &str, max_chars: usize) -> String {
    match text.char_indices().nth(max_chars) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;
    use std::collections::BTreeMap;

    #[derive(Debug, PartialEq, Deserialize)]
    #[serde(rename_all = "camelCase")]
    struct Layer {
        pixel_count: u32,
        names: Option<BTreeMap<String, u8>>,
    }

    #[test]
    fn errors_name_the_member() {
        for (text, beginning) in [
            (
                r#"[{"pixelCount": 1}, {"pixelCount": "2"}]"#,
                "[1].pixelCount: invalid type: string \"2\", expected u32 at line 1 column ",
            ),
            (
                "[{\"pixelCount\": 1,\n\"names\": {\"a\": 1, \"b\": 300}}]",
                "[0].names.b: invalid value: integer `300`, expected u8 at line 2 column ",
            ),
            ("[{}]", "[0]: missing field `pixelCount` at line 1 column "),
            ("7", "invalid type: integer `7`, expected a sequence at line 1 column "),
            ("[] 7", "trailing characters at line 1 column "),
        ] {
            let reason = parse::<Vec<Layer>>(text.as_bytes()).unwrap_err();
            assert!(reason.starts_with(beginning), "{reason}");
        }
        let layer = Layer { pixel_count: 1, names: None };
        assert_eq!(parse::<Vec<Layer>>(br#"[{"pixelCount": 1}]"#), Ok(vec![layer]));
    }

    #[test]
    fn errors_have_a_bounded_length() {
        let long = "ä".repeat(10_000);
        for text in [
            format!("[{{\"pixelCount\": \"{long}\"}}]"),
            format!("[{{\"pixelCount\": 1, \"names\": {{\"{long}\": \"{long}\"}}}}]"),
        ] {
            let reason = parse::<Vec<Layer>>(text.as_bytes()).unwrap_err();
            assert!(reason.chars().count() < 600 && reason.contains(" at line 1 column "), "{reason}");
        }
    }
}
