//! One entry of a zip archive: its data from the directory, and a reader of its bytes (APPNOTE 4.3.7, 4.4).

use crate::container::ContainerError;
use flate2::CrcReader;
use flate2::read::DeflateDecoder;
use std::io::{Read, Seek, SeekFrom};

const LOCAL_HEADER: [u8; 4] = *b"PK\x03\x04";
/// Length up to the name.
const LOCAL_HEADER_BYTES: usize = 30;

/// Compact data of an entry. The crate's own has some hundred bytes more, which add up in a long recording.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry {
    /// Offset of its local header.
    pub header_at: u64,
    /// Its size in the archive, in bytes.
    pub packed: u64,
    /// Its declared unpacked size, in bytes.
    pub bytes: u64,
    pub crc32: u32,
    /// True if deflated, false if stored.
    pub is_deflated: bool,
}

impl Entry {
    /// Returns the offset of the data. The local header's name and extra field have their own lengths.
    pub fn data_at(&self, reader: &mut (impl Read + Seek), name: &str) -> Result<u64, ContainerError> {
        let damaged = |reason: String| ContainerError::ZipDamaged { reason: format!("{name}: {reason}") };
        let mut header = [0; LOCAL_HEADER_BYTES];
        let failed = |error| ContainerError::damaged_zip(name, error);
        reader.seek(SeekFrom::Start(self.header_at)).map_err(failed)?;
        reader.read_exact(&mut header).map_err(failed)?;
        if header[..4] != LOCAL_HEADER {
            return Err(damaged("it is not where the directory says".into()));
        }
        let length = |at: usize| u64::from(u16::from_le_bytes([header[at], header[at + 1]]));
        let behind = LOCAL_HEADER_BYTES as u64 + length(26) + length(28);
        self.header_at.checked_add(behind).ok_or_else(|| damaged("it lies too far away".into()))
    }

    /// Returns a reader of the unpacked bytes, which may be more or fewer than declared.
    pub fn reader<'a, R: Read + Seek + 'a>(
        &self,
        mut reader: R,
        name: &str,
    ) -> Result<CrcReader<Box<dyn Read + 'a>>, ContainerError> {
        let at = self.data_at(&mut reader, name)?;
        reader.seek(SeekFrom::Start(at)).map_err(|error| ContainerError::damaged_zip(name, error))?;
        let packed = reader.take(self.packed);
        let unpacked: Box<dyn Read + 'a> =
            if self.is_deflated { Box::new(DeflateDecoder::new(packed)) } else { Box::new(packed) };
        Ok(CrcReader::new(unpacked))
    }

    /// Checks the checksum of an entry that was read to its end.
    pub fn check(&self, read: &CrcReader<Box<dyn Read + '_>>, name: &str) -> Result<(), ContainerError> {
        if read.crc().sum() == self.crc32 {
            return Ok(());
        }
        Err(ContainerError::ZipDamaged { reason: format!("{name}: its checksum is another") })
    }
}
