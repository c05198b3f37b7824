//! A zip archive, read entry by entry without unpacking it (PKWARE APPNOTE 6.3).

mod directory;
mod entry;

use super::contents::{FileSum, RATIO_FREE_BYTES, read_bounded};
use super::names::{Entries, required, safe_name, shown};
use super::spool::spool;
use super::{Container, ContainerError, MAX_ENTRIES, Region, Scratch};
use ::zip::CompressionMethod;
use directory::damaged;
use entry::Entry;
use std::io::{BufReader, Cursor, ErrorKind, Read, Seek, SeekFrom};

/// Maximum declared size of one entry, unpacked: a large mesh beside the pictures passes, a bomb does not.
const MAX_ENTRY_BYTES: u64 = 4 << 30;
/// Maximum declared size of all entries, unpacked.
const MAX_TOTAL_BYTES: u64 = 64 << 30;
/// Maximum unpacked bytes per packed one. Deflate reaches 1030 on zeros; text and raw pictures stay below 50.
const MAX_RATIO: u64 = 200;
/// Archive Utility of macOS, which makes the archives of Finder's menu, keeps the last 32 bits of an offset
/// (thejoshwolfe/yauzl, issue 69).
const MAC_ADVICE: &str = "as macOS packs more than 4 GiB; pack the folder with `zip -r` or `tar` in a terminal, or split the \
    recording";

trait ReadSeek: Read + Seek + Send + Sync {}
impl<T: Read + Seek + Send + Sync> ReadSeek for T {}

enum Source {
    File(Region),
    Bytes(Vec<u8>),
}

impl Source {
    /// Returns a new reader for each caller, so that threads do not wait for each other.
    fn reader(&self) -> Box<dyn ReadSeek + '_> {
        match self {
            Source::File(region) => Box::new(region.reader()),
            Source::Bytes(bytes) => Box::new(Cursor::new(bytes.as_slice())),
        }
    }
}

/// A checked archive: its directory is in memory, its entries stay in place.
pub struct Zip {
    source: Source,
    scratch: Scratch,
    names: Vec<String>,
    /// One for each name.
    entries: Vec<Entry>,
}

impl Zip {
    /// Reads the directory of an archive on disk.
    pub(super) fn index(region: Region, scratch: &Scratch) -> Result<Zip, ContainerError> {
        Zip::check(Source::File(region), scratch)
    }

    pub fn from_bytes(bytes: Vec<u8>) -> Result<Zip, ContainerError> {
        Zip::check(Source::Bytes(bytes), &Scratch::default())
    }

    fn check(source: Source, scratch: &Scratch) -> Result<Zip, ContainerError> {
        let packed_bytes = check_footer(&mut BufReader::new(source.reader()))?;
        let mut found = Entries::new();
        let mut total_bytes = 0u64;
        for directory in directory::read(|| source.reader())? {
            if directory.has_duplicate_names() {
                return Err(ContainerError::DuplicateName { name: "the same".into() });
            }
            for index in 0..directory.len() {
                let entry = directory.entry(index).map_err(damaged)?;
                let raw = entry.name().map_err(damaged)?;
                let name = safe_name(&raw)?;
                if entry.is_symlink() {
                    return Err(ContainerError::Link { name: shown(&raw) });
                }
                if entry.is_dir() || raw.ends_with('\\') {
                    continue;
                }
                if entry.encrypted() {
                    return Err(ContainerError::ZipEncrypted { name });
                }
                if !matches!(entry.compression(), CompressionMethod::Stored | CompressionMethod::Deflated) {
                    return Err(ContainerError::ZipMethod { name });
                }
                if entry.compression() == CompressionMethod::Stored && entry.size() != entry.compressed_size()
                {
                    let reason = format!("{name} is stored, and yet its packed size is another");
                    return Err(ContainerError::ZipDamaged { reason });
                }
                check_ratio(&name, entry.size(), entry.compressed_size(), MAX_ENTRY_BYTES)?;
                total_bytes = total_bytes.saturating_add(entry.size());
                let kept = Entry {
                    header_at: entry.header_start(),
                    packed: entry.compressed_size(),
                    bytes: entry.size(),
                    crc32: entry.crc32(),
                    is_deflated: entry.compression() == CompressionMethod::Deflated,
                };
                found.push(name, kept)?;
            }
        }
        check_ratio("the archive", total_bytes, packed_bytes, MAX_TOTAL_BYTES)?;
        let (names, entries) = found.finish()?;
        Ok(Zip { source, scratch: scratch.clone(), names, entries })
    }

    /// Returns the entry, if it declares no more than `max_bytes`.
    fn sized(&self, name: &str, max_bytes: u64) -> Result<Entry, ContainerError> {
        let entry = self.entries[required(&self.names, name)?];
        if entry.bytes > max_bytes {
            return Err(ContainerError::FileTooLarge { name: shown(name), max_bytes });
        }
        Ok(entry)
    }

    /// Returns a stored entry of an archive on disk, in place. Its checksum is not checked.
    fn stored(archive: &Region, name: &str, entry: Entry) -> Result<Region, ContainerError> {
        let offset = entry.data_at(&mut archive.reader(), name)?;
        archive.part(offset, entry.bytes).map_err(|source| match source.kind() {
            ErrorKind::UnexpectedEof => {
                ContainerError::ZipDamaged { reason: format!("{name} does not lie inside the archive") }
            }
            _ => ContainerError::damaged_zip(name, source),
        })
    }
}

impl Container for Zip {
    fn scratch(&self) -> Scratch {
        self.scratch.clone()
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn read(&self, name: &str, max_bytes: u64) -> Result<Vec<u8>, ContainerError> {
        let entry = self.sized(name, max_bytes)?;
        let mut file = entry.reader(self.source.reader(), name)?;
        // An entry that unpacks to more than its declared size has evaded the checks at opening.
        match read_bounded(&mut file, name, entry.bytes) {
            Err(ContainerError::FileTooLarge { name, .. }) => Err(larger_than_declared(&name)),
            Err(ContainerError::Unreadable { name, source }) => {
                Err(ContainerError::damaged_zip(&name, source))
            }
            Ok(bytes) => entry.check(&file, name).map(|()| bytes),
            Err(other) => Err(other),
        }
    }

    fn region(&self, name: &str, max_bytes: u64) -> Result<Region, ContainerError> {
        let entry = self.sized(name, max_bytes)?;
        if let (Source::File(archive), false) = (&self.source, entry.is_deflated) {
            return Zip::stored(archive, name, entry);
        }
        let mut file = entry.reader(self.source.reader(), name)?;
        let region = spool(
            &mut file,
            name,
            &self.scratch,
            entry.bytes,
            || larger_than_declared(name),
            |source| ContainerError::damaged_zip(name, source),
        )?;
        entry.check(&file, name).map(|()| region)
    }

    fn sums(&self) -> Result<Option<Vec<FileSum>>, ContainerError> {
        let sum = |entry: &Entry| FileSum { bytes: entry.bytes, crc32: entry.crc32 };
        Ok(Some(self.entries.iter().map(sum).collect()))
    }
}

fn larger_than_declared(name: &str) -> ContainerError {
    ContainerError::ZipDamaged { reason: format!("{name} is larger than the archive says") }
}

fn check_ratio(name: &str, bytes: u64, packed: u64, max_bytes: u64) -> Result<(), ContainerError> {
    let allowed = packed.saturating_mul(MAX_RATIO).max(RATIO_FREE_BYTES).min(max_bytes);
    if bytes > allowed {
        return Err(ContainerError::ZipBomb { name: shown(name), bytes, packed });
    }
    Ok(())
}

/// Checks the start and the end of the file before the crate does, and returns the file's size.
///
/// The crate allocates for the number of entries in the end record. A plain end record has at most 65 535; a
/// zip64 record can have more, so every one that the crate could use is checked here.
fn check_footer(reader: &mut (impl Read + Seek)) -> Result<u64, ContainerError> {
    const LOCATOR: [u8; 4] = *b"PK\x06\x07";
    const LOCATOR_BYTES: usize = 20;
    /// The end record, the longest comment, the zip64 locator before it, and some slack.
    const TAIL_BYTES: u64 = 22 + 65_535 + LOCATOR_BYTES as u64 + 64;
    let io = |source: std::io::Error| ContainerError::damaged_zip("the archive", source);

    let len = reader.seek(SeekFrom::End(0)).map_err(io)?;
    reader.seek(SeekFrom::Start(0)).map_err(io)?;
    let mut head = Vec::new();
    reader.by_ref().take(4).read_to_end(&mut head).map_err(io)?;
    if head != *b"PK\x03\x04" && head != directory::END {
        return Err(ContainerError::NotAnArchive);
    }
    reader.seek(SeekFrom::Start(len.saturating_sub(TAIL_BYTES))).map_err(io)?;
    let mut tail = Vec::new();
    reader.by_ref().take(TAIL_BYTES).read_to_end(&mut tail).map_err(io)?;
    let ends: Vec<usize> =
        (0..tail.len().saturating_sub(21)).filter(|&at| tail[at..at + 4] == directory::END).collect();
    if ends.is_empty() {
        return Err(ContainerError::ZipTruncated);
    }
    check_offset(reader, ends.iter().map(|&end| &tail[end..]), len)?;
    for end in ends {
        let Some(locator) = end.checked_sub(LOCATOR_BYTES).map(|at| &tail[at..end]) else { continue };
        if locator[..4] != LOCATOR {
            continue;
        }
        let offset = u64::from_le_bytes(locator[8..16].try_into().expect("eight bytes"));
        let mut record = Vec::new();
        reader.seek(SeekFrom::Start(offset.min(len))).map_err(io)?;
        reader.by_ref().take(40).read_to_end(&mut record).map_err(io)?;
        // The number of entries is at byte 32 of the zip64 end record (APPNOTE 4.3.14).
        if record.len() == 40
            && u64::from_le_bytes(record[32..40].try_into().expect("eight bytes")) > MAX_ENTRIES as u64
        {
            return Err(ContainerError::TooManyEntries);
        }
    }
    Ok(len)
}

/// Refuses an archive of more than 4 GiB whose directory is at none of the places that its `ends` tell.
fn check_offset<'a>(
    reader: &mut (impl Read + Seek),
    ends: impl Iterator<Item = &'a [u8]>,
    len: u64,
) -> Result<(), ContainerError> {
    if len <= u64::from(u32::MAX) {
        return Ok(());
    }
    let io = |source: std::io::Error| ContainerError::damaged_zip("the archive", source);
    for end in ends {
        // The offset is at byte 16 of the end record (APPNOTE 4.3.16).
        let offset = u32::from_le_bytes([end[16], end[17], end[18], end[19]]);
        let mut head = Vec::new();
        reader.seek(SeekFrom::Start(offset.into())).map_err(io)?;
        reader.by_ref().take(4).read_to_end(&mut head).map_err(io)?;
        // The largest number leaves the offset to a zip64 record.
        if offset == u32::MAX || head == directory::HEADER {
            return Ok(());
        }
    }
    Err(ContainerError::ZipDamaged {
        reason: format!("its directory is not where its end says, {MAC_ADVICE}"),
    })
}
