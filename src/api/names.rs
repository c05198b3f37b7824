//! Names that people give to files and clips.

use super::error::Error;

const MAX_FILE_NAME_CHARACTERS: usize = 255;
const MAX_TITLE_CHARACTERS: usize = 200;

/// Returns whether a text may name a file.
pub(super) fn is_file_name(name: &str) -> bool {
    is_line(name, MAX_FILE_NAME_CHARACTERS)
}

/// Returns whether a text may be a clip's title.
pub(super) fn is_title(title: &str) -> bool {
    is_line(title, MAX_TITLE_CHARACTERS)
}

fn is_line(text: &str, most: usize) -> bool {
    (1..=most).contains(&text.chars().count()) && !text.chars().any(char::is_control)
}

/// Checks the name of a file in a query.
pub(super) fn file_name(asked: Option<String>) -> Result<Option<String>, Error> {
    checked(asked, "filename", is_file_name, MAX_FILE_NAME_CHARACTERS)
}

/// Checks the title of a clip in a query.
pub(super) fn title(asked: Option<String>) -> Result<Option<String>, Error> {
    checked(asked, "title", is_title, MAX_TITLE_CHARACTERS)
}

/// Checks a text to search for.
pub(super) fn search(asked: Option<String>) -> Result<Option<String>, Error> {
    checked(asked, "q", is_title, MAX_TITLE_CHARACTERS)
}

fn checked(
    asked: Option<String>,
    field: &'static str,
    is_good: impl Fn(&str) -> bool,
    most: usize,
) -> Result<Option<String>, Error> {
    match asked {
        Some(text) if !is_good(&text) => {
            let detail = format!("{field} has 1 to {most} characters, and no control characters");
            Err(Error::InvalidQuery { field: Some(field), detail })
        }
        asked => Ok(asked),
    }
}
