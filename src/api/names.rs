//! Names that people give to homes, rooms, objects, clips and files: one line of text that shows something.

use super::error::Error;
use super::extract::invalid_query;

const MAX_FILE_NAME_CHARACTERS: usize = 255;
const MAX_TITLE_CHARACTERS: usize = 200;
const MAX_LABEL_CHARACTERS: usize = 100;

/// Returns whether a text may name a file.
pub(super) fn is_file_name(name: &str) -> bool {
    is_name(name, MAX_FILE_NAME_CHARACTERS)
}

/// Returns whether a text may be a home's name or a clip's title.
pub(super) fn is_title(title: &str) -> bool {
    is_name(title, MAX_TITLE_CHARACTERS)
}

/// Returns whether a text may name a room or an object.
pub(super) fn is_label(name: &str) -> bool {
    is_name(name, MAX_LABEL_CHARACTERS)
}

/// A name of white space only would show nothing, like an empty one.
fn is_name(text: &str, most: usize) -> bool {
    is_line(text, most) && !text.chars().all(char::is_whitespace)
}

fn is_line(text: &str, most: usize) -> bool {
    (1..=most).contains(&text.chars().count()) && !text.chars().any(char::is_control)
}

/// Checks the name of a file in a query.
pub(super) fn file_name(asked: Option<String>) -> Result<Option<String>, Error> {
    let rule = "1 to 255 characters, no control characters, and not only spaces";
    checked(asked, "filename", is_file_name, rule)
}

/// Checks the title of a clip in a query.
pub(super) fn title(asked: Option<String>) -> Result<Option<String>, Error> {
    checked(asked, "title", is_title, "1 to 200 characters, no control characters, and not only spaces")
}

/// Checks a text to search for. Names may contain spaces, so a space is one.
pub(super) fn search(asked: Option<String>) -> Result<Option<String>, Error> {
    let is_text = |text: &str| is_line(text, MAX_TITLE_CHARACTERS);
    checked(asked, "q", is_text, "1 to 200 characters, and no control characters")
}

fn checked(
    asked: Option<String>,
    field: &'static str,
    is_good: impl Fn(&str) -> bool,
    rule: &str,
) -> Result<Option<String>, Error> {
    match asked {
        Some(text) if !is_good(&text) => Err(invalid_query(field, format!("{field} has {rule}"))),
        asked => Ok(asked),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_show_something_on_one_line() {
        let most = "n".repeat(100);
        for good in ["x", " Elm", "Flat 3,\u{a0}Elm Street", "\u{53a8}\u{623f}", most.as_str()] {
            assert!(is_label(good) && is_title(good) && is_file_name(good), "{good:?}");
        }
        for bad in ["", " ", "\u{a0}\u{2003}\u{3000}", "\t", "a\nb", "a\u{7}", "a\u{85}", "\u{7f}"] {
            assert!(!is_label(bad) && !is_title(bad) && !is_file_name(bad), "{bad:?}");
        }
        let long = [is_label, is_title, is_file_name].map(|is_good| is_good(&"n".repeat(201)));
        assert_eq!(long, [false, false, true]);
        let refused = title(Some("  ".to_owned())).unwrap_err().problem();
        assert_eq!(refused.field.as_deref(), Some("title"));
        assert_eq!(search(Some(" ".to_owned())).unwrap().as_deref(), Some(" "));
    }
}
