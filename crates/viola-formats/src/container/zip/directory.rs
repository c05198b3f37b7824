//! The directory of a zip archive: a header for each entry, and an end record that counts them (APPNOTE 4.3.12 and 4.3.16).
//!
//! Archive Utility of macOS, which makes the archives of Finder's menu, keeps the last 16 bits of the count (zlib-ng/minizip-ng,
//! issue 184; thejoshwolfe/yauzl, issue 60). The other entries are read in parts, as if each part had an archive of its own.

use crate::container::{ContainerError, MAX_ENTRIES};
use ::zip::ZipArchive;
use ::zip::read::{ArchiveOffset, Config, ZipArchiveMetadata};
use ::zip::result::ZipError;
use std::io::{self, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::sync::Arc;

/// Begins an entry's header.
pub(super) const HEADER: [u8; 4] = *b"PK\x01\x02";
/// The size of this header, up to the entry's name.
const HEADER_BYTES: usize = 46;
/// Begins the end record.
pub(super) const END: [u8; 4] = *b"PK\x05\x06";
/// The size of this record without a comment.
const END_BYTES: usize = 22;
/// A count that keeps 16 bits lacks a multiple of this number.
const LOST: usize = 1 << 16;
/// Maximum number of entries of a part: an end record can count them.
const PART: usize = 1 << 15;

/// Reads the directory, in parts if it has more entries than its end counts. `open` returns a new reader of the archive.
pub(super) fn read<R: Read + Seek>(
    open: impl Fn() -> R,
) -> Result<Vec<Arc<ZipArchiveMetadata>>, ContainerError> {
    let (counted, start) = parse(open())?;
    let headers = (0..counted.len()).filter_map(|index| counted.entry(index).ok());
    let last = headers.map(|entry| entry.central_header_start()).max();
    let most = MAX_ENTRIES.saturating_sub(counted.len());
    let Rest { parts, is_ended } = Rest::read(last, start, most, open())?;
    let more: usize = parts.iter().map(|part| part.entries).sum();
    if more > 0 && !is_ended || !more.is_multiple_of(LOST) {
        let all = counted.len() + more;
        let reason = format!("its directory has {all} entries, and its end counts {}", counted.len());
        return Err(ContainerError::ZipDamaged { reason });
    }
    let mut directories = vec![counted];
    for part in parts {
        let end = part.end_record().ok_or_else(|| ContainerError::ZipDamaged {
            reason: "its directory is too far away".to_string(),
        })?;
        directories.push(parse(WithEnd { archive: open(), at: 0, end_at: part.to, end })?.0);
    }
    Ok(directories)
}

/// Returns the entries that the end record counts, and the offset of the directory.
fn parse(archive: impl Read + Seek) -> Result<(Arc<ZipArchiveMetadata>, u64), ContainerError> {
    // A known offset keeps the crate from searching the whole file for the directory.
    let config = Config { archive_offset: ArchiveOffset::Known(0) };
    let archive = ZipArchive::with_config(config, BufReader::new(archive)).map_err(damaged)?;
    // The crate takes what lies before the end of an archive without entries for bytes before the archive.
    Ok((archive.metadata(), archive.central_directory_start().saturating_sub(archive.offset())))
}

pub(super) fn damaged(error: ZipError) -> ContainerError {
    match error {
        ZipError::Io(source) => ContainerError::damaged_zip("the archive", source),
        error => ContainerError::ZipDamaged { reason: error.to_string() },
    }
}

/// A part of the directory: headers one behind the other.
struct Part {
    from: u64,
    to: u64,
    entries: usize,
}

impl Part {
    /// Returns the record that ends a directory of this part alone; `None` if it cannot tell the part's place.
    fn end_record(&self) -> Option<[u8; END_BYTES]> {
        let entries = u16::try_from(self.entries).ok()?.to_le_bytes();
        // The largest number would leave it to a zip64 record.
        let number = |bytes: u64| u32::try_from(bytes).ok().filter(|number| *number < u32::MAX);
        let mut record = [0; END_BYTES];
        record[..4].copy_from_slice(&END);
        record[8..10].copy_from_slice(&entries);
        record[10..12].copy_from_slice(&entries);
        record[12..16].copy_from_slice(&number(self.to - self.from)?.to_le_bytes());
        record[16..20].copy_from_slice(&number(self.from)?.to_le_bytes());
        Some(record)
    }
}

/// The headers behind the last one that is counted.
struct Rest {
    parts: Vec<Part>,
    /// True if the end record follows.
    is_ended: bool,
}

impl Rest {
    /// Returns the headers behind the one at `last`, which is the last one that is counted, or an error for more than `most`.
    /// The end counts none of exactly 65 536 entries; their headers begin at `start`.
    fn read(
        last: Option<u64>,
        start: u64,
        most: usize,
        archive: impl Read + Seek,
    ) -> Result<Rest, ContainerError> {
        let failed = |source: io::Error| ContainerError::damaged_zip("the archive", source);
        let mut reader = BufReader::new(archive);
        let (mut at, mut bytes) = (last.unwrap_or(start), Vec::new());
        reader.seek(SeekFrom::Start(at)).map_err(failed)?;
        let mut parts: Vec<Part> = Vec::new();
        let counted = usize::from(last.is_some());
        for number in 0..=most + counted {
            bytes.clear();
            reader.by_ref().take(HEADER_BYTES as u64).read_to_end(&mut bytes).map_err(failed)?;
            let header = bytes.first_chunk::<HEADER_BYTES>().filter(|header| header.starts_with(&HEADER));
            let Some(header) = header else {
                return Ok(Rest { parts, is_ended: bytes.starts_with(&END) });
            };
            // A name, an extra field and a comment follow.
            let length = |at: usize| u32::from(u16::from_le_bytes([header[at], header[at + 1]]));
            let behind = length(28) + length(30) + length(32);
            reader.seek_relative(behind.into()).map_err(failed)?;
            let from = at;
            at += HEADER_BYTES as u64 + u64::from(behind);
            match parts.last_mut() {
                _ if number < counted => {}
                Some(part) if part.entries < PART => (part.to, part.entries) = (at, part.entries + 1),
                _ => parts.push(Part { from, to: at, entries: 1 }),
            }
        }
        Err(ContainerError::TooManyEntries)
    }
}

/// An archive up to the end of a part of its directory, and an end record.
struct WithEnd<R> {
    archive: R,
    at: u64,
    end_at: u64,
    end: [u8; END_BYTES],
}

impl<R: Read + Seek> Read for WithEnd<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = match self.end_at.checked_sub(self.at).filter(|left| *left > 0) {
            Some(left) => {
                self.archive.seek(SeekFrom::Start(self.at))?;
                self.archive.by_ref().take(left).read(buffer)?
            }
            None => {
                let from = usize::try_from(self.at - self.end_at).unwrap_or(usize::MAX);
                self.end.get(from..).unwrap_or_default().read(buffer)?
            }
        };
        self.at += read as u64;
        Ok(read)
    }
}

impl<R> Seek for WithEnd<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => (self.end_at + END_BYTES as u64).checked_add_signed(by),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
        };
        self.at = at.ok_or(io::Error::from(ErrorKind::InvalidInput))?;
        Ok(self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_headers_than_an_archive_may_have_are_refused() {
        let mut header = [0; HEADER_BYTES];
        header[..4].copy_from_slice(&HEADER);
        let archive = [header.repeat(4), END.to_vec()].concat();
        for (last, most, expected) in [
            (Some(0), 4, Some(3)),
            (Some(0), 3, Some(3)),
            (Some(0), 2, None),
            (Some(0), 0, None),
            (None, 4, Some(4)),
            (None, 3, None),
        ] {
            let rest = Rest::read(last, 0, most, io::Cursor::new(&archive)).ok();
            let entries = rest.map(|rest| rest.parts.iter().map(|part| part.entries).sum::<usize>());
            assert_eq!(entries, expected, "{last:?} {most}");
        }
    }

    #[test]
    fn no_number_asks_for_a_zip64_record() {
        let largest = u64::from(u32::MAX);
        for (from, to, expected) in [
            (0, largest - 1, true),
            (0, largest, false),
            (largest - 1, largest + 46, true),
            (largest, largest + 46, false),
        ] {
            let part = Part { from, to, entries: 1 };
            assert_eq!(part.end_record().is_some(), expected, "{from} to {to}");
        }
    }
}
