//! The headers of a tar archive, one after the other.

use super::super::names::{MAX_NAME_BYTES, shown};
use super::super::{ContainerError, MAX_ENTRIES, Region};
use super::extended::Extended;
use std::io;
use tar::{EntryType, Header};

const BLOCK_BYTES: u64 = 512;
/// Maximum size of an extended header: names, times and system attributes of a file.
const MAX_EXTENDED_BYTES: u64 = 1 << 20;
/// Maximum number of headers before the one that they extend.
const MAX_EXTENSIONS: u32 = 8;

/// A file or a directory of the archive. `offset .. offset + bytes` lies in the archive.
pub(super) struct Entry {
    pub name: Vec<u8>,
    pub offset: u64,
    pub bytes: u64,
    pub is_file: bool,
}

/// Iterates over the headers; ends at the archive's end mark, or with the first error.
pub(super) struct Headers<'a> {
    archive: &'a Region,
    at: u64,
    entries: usize,
    is_over: bool,
}

impl<'a> Headers<'a> {
    pub fn of(archive: &'a Region) -> Headers<'a> {
        Headers { archive, at: 0, entries: 0, is_over: false }
    }

    /// Returns the next file or directory, with its extended headers applied; `None` at the end mark.
    fn entry(&mut self) -> Result<Option<Entry>, ContainerError> {
        let mut extended = Extended::default();
        for _ in 0..=MAX_EXTENSIONS {
            let mut header = Header::new_old();
            self.read(self.at, header.as_mut_bytes())?;
            // One block of zeros ends an archive: the standard requires two, but no data follows one.
            if header.as_bytes().iter().all(|byte| *byte == 0) {
                return if extended.is_empty() {
                    Ok(None)
                } else {
                    Err(damaged("it ends before a file that is announced"))
                };
            }
            self.check(&header)?;
            let kind = header.entry_type();
            let is_extension = matches!(
                kind,
                EntryType::XHeader
                    | EntryType::XGlobalHeader
                    | EntryType::GNULongName
                    | EntryType::GNULongLink
            );
            let declared = header.entry_size().map_err(|_| damaged("a size is no number"))?;
            let bytes = if is_extension { declared } else { extended.bytes.unwrap_or(declared) };
            let offset = self.at + BLOCK_BYTES;
            let end = offset.checked_add(bytes).filter(|end| *end <= self.archive.bytes);
            let end = end.ok_or(ContainerError::TarTruncated)?;
            self.at = end.next_multiple_of(BLOCK_BYTES);
            match kind {
                EntryType::XHeader => {
                    extended.add_pax(&self.bounded(offset, bytes, MAX_EXTENDED_BYTES)?)?
                }
                EntryType::XGlobalHeader => {
                    Extended::check_global(&self.bounded(offset, bytes, MAX_EXTENDED_BYTES)?)?
                }
                EntryType::GNULongName => extended.set_long_name(self.long_name(offset, bytes)?),
                // A link is refused at its own header.
                EntryType::GNULongLink => {}
                // The name of the archive is no entry.
                _ if kind.as_byte() == b'V' => {}
                _ => return self.finish(&header, extended, offset, bytes).map(Some),
            }
        }
        Err(damaged("more headers extend one file than any program writes"))
    }

    /// Builds the entry of the last header, or refuses its kind.
    fn finish(
        &mut self,
        header: &Header,
        extended: Extended,
        offset: u64,
        bytes: u64,
    ) -> Result<Entry, ContainerError> {
        self.entries += 1;
        if self.entries > MAX_ENTRIES {
            return Err(ContainerError::TooManyEntries);
        }
        let is_sparse = extended.is_sparse || header.entry_type() == EntryType::GNUSparse;
        let name = extended.name.unwrap_or_else(|| header.path_bytes().into_owned());
        let told = || shown(&String::from_utf8_lossy(&name));
        if is_sparse {
            return Err(ContainerError::TarSparse { name: told() });
        }
        let is_file = match header.entry_type() {
            // Before POSIX, directories were files whose name ends with a slash.
            EntryType::Regular | EntryType::Continuous => !name.ends_with(b"/"),
            EntryType::Directory => false,
            EntryType::Link | EntryType::Symlink => return Err(ContainerError::Link { name: told() }),
            _ => return Err(ContainerError::TarSpecialFile { name: told() }),
        };
        if !is_file && bytes > 0 {
            return Err(damaged("a directory has content"));
        }
        Ok(Entry { name, offset, bytes, is_file })
    }

    fn check(&self, header: &Header) -> Result<(), ContainerError> {
        let told = header.cksum().map_err(|_| damaged("a header's checksum is no number"))?;
        // The checksum's own field counts as spaces.
        let bytes = header.as_bytes().iter().enumerate();
        let sum: u32 =
            bytes.map(|(i, byte)| u32::from(if (148..156).contains(&i) { b' ' } else { *byte })).sum();
        if told == sum { Ok(()) } else { Err(damaged("a header's checksum is wrong")) }
    }

    fn long_name(&self, offset: u64, bytes: u64) -> Result<Vec<u8>, ContainerError> {
        // The terminating zero counts.
        if bytes > MAX_NAME_BYTES as u64 + 1 {
            return Err(ContainerError::PathEscapes { name: "with a long name".to_owned() });
        }
        let mut name = self.bounded(offset, bytes, MAX_EXTENDED_BYTES)?;
        let end = name.iter().position(|byte| *byte == 0).unwrap_or(name.len());
        name.truncate(end);
        Ok(name)
    }

    fn bounded(&self, offset: u64, bytes: u64, max_bytes: u64) -> Result<Vec<u8>, ContainerError> {
        if bytes > max_bytes {
            return Err(damaged("a header is larger than any program writes"));
        }
        let mut buffer = vec![0; bytes as usize];
        self.read(offset, &mut buffer)?;
        Ok(buffer)
    }

    fn read(&self, at: u64, buffer: &mut [u8]) -> Result<(), ContainerError> {
        self.archive.read_exact_at(at, buffer).map_err(|source| match source.kind() {
            io::ErrorKind::UnexpectedEof => ContainerError::TarTruncated,
            _ => ContainerError::Unreadable { name: "the archive".to_owned(), source },
        })
    }
}

impl Iterator for Headers<'_> {
    type Item = Result<Entry, ContainerError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.is_over {
            return None;
        }
        let entry = self.entry().transpose();
        self.is_over = !matches!(entry, Some(Ok(_)));
        entry
    }
}

pub(super) fn damaged(reason: &str) -> ContainerError {
    ContainerError::TarDamaged { reason: reason.to_owned() }
}
