//! A part of an open file, for readers that seek.

use super::scratch::Reservation;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::Arc;

/// The bytes `offset .. offset + bytes` of a file. Several threads can read it at once.
#[derive(Debug)]
pub struct Region {
    pub file: File,
    /// Start of the part, in bytes.
    pub offset: u64,
    /// Length of the part, in bytes.
    pub bytes: u64,
    /// Share of the budgets, if the file was unpacked.
    pub(super) reservation: Option<Arc<Reservation>>,
}

impl Region {
    /// Returns the whole file.
    pub fn whole(file: File) -> io::Result<Region> {
        let bytes = file.metadata()?.len();
        Ok(Region { file, offset: 0, bytes, reservation: None })
    }

    /// Returns a part of this part, which must lie inside it.
    pub fn part(&self, at: u64, bytes: u64) -> io::Result<Region> {
        let inside = at.checked_add(bytes).is_some_and(|end| end <= self.bytes);
        let offset = self.offset.checked_add(at).filter(|_| inside);
        let offset = offset.ok_or(io::Error::from(io::ErrorKind::UnexpectedEof))?;
        Ok(Region { file: self.file.try_clone()?, offset, bytes, reservation: self.reservation.clone() })
    }

    /// Reads as much of `buffer` as there is from `at`, counted from the part's start; returns 0 at its end.
    pub fn read_at(&self, at: u64, buffer: &mut [u8]) -> io::Result<usize> {
        let left = self.bytes.saturating_sub(at);
        let take = buffer.len().min(usize::try_from(left).unwrap_or(usize::MAX));
        if take == 0 {
            return Ok(0);
        }
        let offset = self.offset.checked_add(at).ok_or(io::Error::from(io::ErrorKind::InvalidInput))?;
        read_file_at(&self.file, &mut buffer[..take], offset)
    }

    /// Fills `buffer`, or fails with [`io::ErrorKind::UnexpectedEof`] if the part ends before.
    pub fn read_exact_at(&self, mut at: u64, mut buffer: &mut [u8]) -> io::Result<()> {
        while !buffer.is_empty() {
            match self.read_at(at, buffer) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(read) => {
                    buffer = &mut buffer[read..];
                    at += read as u64;
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Returns the first bytes; `None` if there are fewer.
    pub fn head<const N: usize>(&self) -> io::Result<Option<[u8; N]>> {
        let mut head = [0; N];
        match self.read_exact_at(0, &mut head) {
            Ok(()) => Ok(Some(head)),
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Returns an unbuffered reader of this part, with its own position.
    pub fn reader(&self) -> RegionReader<'_> {
        RegionReader { region: self, at: 0 }
    }
}

#[cfg(unix)]
fn read_file_at(file: &File, buffer: &mut [u8], offset: u64) -> io::Result<usize> {
    std::os::unix::fs::FileExt::read_at(file, buffer, offset)
}

/// Moves the file's own position, which is not used here.
#[cfg(windows)]
fn read_file_at(file: &File, buffer: &mut [u8], offset: u64) -> io::Result<usize> {
    std::os::windows::fs::FileExt::seek_read(file, buffer, offset)
}

/// Reads and seeks in a [`Region`]; position 0 is its start.
#[derive(Debug, Clone)]
pub struct RegionReader<'a> {
    region: &'a Region,
    at: u64,
}

impl Read for RegionReader<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.region.read_at(self.at, buffer)?;
        self.at += read as u64;
        Ok(read)
    }
}

impl Seek for RegionReader<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => self.region.bytes.checked_add_signed(by),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
        };
        self.at = at.ok_or(io::Error::from(io::ErrorKind::InvalidInput))?;
        Ok(self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn a_file_that_cannot_be_read_is_not_a_short_one() {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(b"1234").unwrap();
        let whole = |file: io::Result<File>| Region::whole(file.unwrap()).unwrap();
        let region = whole(File::open(file.path()));
        assert_eq!(region.head().unwrap(), Some(*b"123"));
        assert_eq!(region.head::<5>().unwrap(), None);
        let only_written = whole(File::options().write(true).open(file.path()));
        assert!(only_written.head::<3>().is_err());
    }
}
