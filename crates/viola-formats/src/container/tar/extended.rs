//! Headers that extend the next one: pax extended headers (POSIX.1-2017, pax, "pax Extended Header") and GNU
//! tar's long names.

use super::super::ContainerError;
use super::super::names::MAX_NAME_BYTES;
use super::headers::damaged;

/// GNU tar writes a sparse file as a plain one whose content begins with a list of its holes.
const SPARSE: &[u8] = b"GNU.sparse.";

/// Replacements of the fields of the next header.
#[derive(Debug, Default)]
pub(super) struct Extended {
    pub name: Option<Vec<u8>>,
    pub bytes: Option<u64>,
    pub is_sparse: bool,
    /// A pax name takes precedence over a GNU name, in any order.
    has_pax_name: bool,
    has_any: bool,
}

impl Extended {
    pub fn is_empty(&self) -> bool {
        !self.has_any
    }

    pub fn set_long_name(&mut self, name: Vec<u8>) {
        self.has_any = true;
        if !self.has_pax_name {
            self.name = Some(name);
        }
    }

    /// Adds the records of an extended header for one file.
    pub fn add_pax(&mut self, records: &[u8]) -> Result<(), ContainerError> {
        self.has_any = true;
        for record in Records(records) {
            match record? {
                // An empty value removes an earlier one.
                (b"path", b"") => self.name = None,
                (b"path", path) if path.len() > MAX_NAME_BYTES => {
                    return Err(ContainerError::PathEscapes { name: "with a long name".to_owned() });
                }
                (b"path", path) => (self.name, self.has_pax_name) = (Some(path.to_vec()), true),
                (b"size", b"") => self.bytes = None,
                (b"size", size) => self.bytes = Some(number(size).ok_or(damaged("a size is no number"))?),
                (key, _) if key.starts_with(SPARSE) => self.is_sparse = true,
                _ => {}
            }
        }
        Ok(())
    }

    /// Checks the records of a header for all files that follow. Comments and times in it are ignored; one
    /// name or one size for all files is an error.
    pub fn check_global(records: &[u8]) -> Result<(), ContainerError> {
        for record in Records(records) {
            let (key, _) = record?;
            if key == b"path" || key == b"size" || key.starts_with(SPARSE) {
                return Err(damaged("one name or size is given for all files"));
            }
        }
        Ok(())
    }
}

/// Records of `LENGTH KEY=VALUE\n`; the length is that of the whole record. A value may have any bytes.
struct Records<'a>(&'a [u8]);

impl<'a> Iterator for Records<'a> {
    type Item = Result<(&'a [u8], &'a [u8]), ContainerError>;

    fn next(&mut self) -> Option<Self::Item> {
        // Some programs pad with zeros.
        if self.0.first().is_none_or(|byte| *byte == 0) {
            return None;
        }
        let record = self.split();
        if record.is_none() {
            self.0 = &[];
        }
        Some(record.ok_or(damaged("an extended header cannot be read")))
    }
}

impl<'a> Records<'a> {
    fn split(&mut self) -> Option<(&'a [u8], &'a [u8])> {
        let space = self.0.iter().take(20).position(|byte| *byte == b' ')?;
        let length = usize::try_from(number(&self.0[..space])?).ok()?;
        let (record, rest) = self.0.split_at_checked(length)?;
        let record = record.get(space + 1..)?.strip_suffix(b"\n")?;
        let equals = record.iter().position(|byte| *byte == b'=')?;
        self.0 = rest;
        Some((&record[..equals], &record[equals + 1..]))
    }
}

fn number(digits: &[u8]) -> Option<u64> {
    let text = std::str::from_utf8(digits).ok()?;
    if text.bytes().all(|byte| byte.is_ascii_digit()) { text.parse().ok() } else { None }
}
