//! Names of the levels of a home: one LiDAR map for each storey.

use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Maximum number of levels of a home.
pub const MAX_LEVELS: usize = 8;

/// Maximum length of a name in bytes.
const MAX_BYTES: usize = 32;

/// The name of a level: 1 to 32 characters of `a-z 0-9 _ -`. It is a part of paths and file names.
///
/// The bytes after the name are 0, so names sort as text. It is `Copy`, because poses and tiles have one.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(try_from = "String")]
pub struct LevelName([u8; MAX_BYTES]);

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a level's name is 1 to 32 characters of a-z 0-9 _ -")]
pub struct InvalidLevelName;

impl LevelName {
    /// The level of a home with one LiDAR map.
    pub const MAIN: LevelName = {
        let mut bytes = [0; MAX_BYTES];
        [bytes[0], bytes[1], bytes[2], bytes[3]] = *b"main";
        LevelName(bytes)
    };

    pub fn as_str(&self) -> &str {
        let end = self.0.iter().position(|byte| *byte == 0).unwrap_or(MAX_BYTES);
        // The bytes are ASCII: every constructor checks them.
        std::str::from_utf8(&self.0[..end]).unwrap_or_default()
    }

    pub fn is_main(&self) -> bool {
        *self == LevelName::MAIN
    }
}

impl Default for LevelName {
    fn default() -> LevelName {
        LevelName::MAIN
    }
}

impl FromStr for LevelName {
    type Err = InvalidLevelName;

    fn from_str(text: &str) -> Result<LevelName, InvalidLevelName> {
        let is_allowed =
            |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || b"_-".contains(&byte);
        if text.is_empty() || text.len() > MAX_BYTES || !text.bytes().all(is_allowed) {
            return Err(InvalidLevelName);
        }
        let mut bytes = [0; MAX_BYTES];
        bytes[..text.len()].copy_from_slice(text.as_bytes());
        Ok(LevelName(bytes))
    }
}

impl TryFrom<String> for LevelName {
    type Error = InvalidLevelName;

    fn try_from(text: String) -> Result<LevelName, InvalidLevelName> {
        text.parse()
    }
}

impl fmt::Display for LevelName {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.as_str())
    }
}

impl fmt::Debug for LevelName {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), formatter)
    }
}

impl Serialize for LevelName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_checked_and_sort_as_text() {
        for good in ["main", "upper", "0", "ground_floor-2", &"a".repeat(32)] {
            assert_eq!(good.parse::<LevelName>().unwrap().as_str(), good);
        }
        for bad in ["", ".", "..", "Upper", "a b", "a/b", "a\0b", "é", &"a".repeat(33)] {
            assert_eq!(bad.parse::<LevelName>(), Err(InvalidLevelName), "{bad:?}");
        }
        let mut names: Vec<LevelName> =
            ["upper", "main", "ma", "0"].map(|name| name.parse().unwrap()).to_vec();
        names.sort();
        assert_eq!(names.iter().map(LevelName::as_str).collect::<Vec<_>>(), ["0", "ma", "main", "upper"]);
        assert_eq!(LevelName::MAIN, "main".parse().unwrap());
        assert_eq!(serde_json::to_string(&names[2]).unwrap(), "\"main\"");
        assert!(serde_json::from_str::<LevelName>("\"No\"").is_err());
    }
}
