//! Text in UTF-16 with a byte order mark, as Excel ("Unicode text") and PowerShell's `>` write it.

use super::{LidarError, MAX_FILE_BYTES};

const LITTLE_ENDIAN: [u8; 2] = [0xff, 0xfe];
const BIG_ENDIAN: [u8; 2] = [0xfe, 0xff];

/// Returns whether the bytes begin with the mark.
pub(super) fn is(bytes: &[u8]) -> bool {
    bytes.starts_with(&LITTLE_ENDIAN) || bytes.starts_with(&BIG_ENDIAN)
}

/// Converts to UTF-8, without the mark. Refuses bytes that are not UTF-16, and a text that gets too large.
pub(super) fn to_utf8(bytes: &[u8]) -> Result<String, LidarError> {
    let unit = if bytes.starts_with(&BIG_ENDIAN) { u16::from_be_bytes } else { u16::from_le_bytes };
    let (units, rest) = bytes.get(2..).unwrap_or_default().as_chunks::<2>();
    if !rest.is_empty() {
        return Err(LidarError::UnknownFormat);
    }
    let mut text = String::new();
    for character in char::decode_utf16(units.iter().map(|bytes| unit(*bytes))) {
        text.push(character.map_err(|_| LidarError::UnknownFormat)?);
        if text.len() as u64 > MAX_FILE_BYTES {
            return Err(LidarError::FileTooLarge { max_bytes: MAX_FILE_BYTES });
        }
    }
    Ok(text)
}
