//! A tar archive that was packed as a whole: unpacked once, as a stream, into a temporary file.

mod gzip;
mod zstd;

use super::contents::RATIO_FREE_BYTES;
use super::kind::{Kind, Packing};
use super::spool::spool;
use super::{Container, ContainerError, Region, is_machine_fault, tar::Tar};
use std::cell::Cell;
use std::io::{self, BufReader, Read};

/// Unpacked size of one archive. It lies on the disk as long as the archive is open.
const MAX_SPOOLED_BYTES: u64 = 16 << 30;
/// Unpacked bytes for each packed one. It is less than for a zip, because all of it is unpacked: text and raw pictures
/// stay below 50, and the pictures of a recording are packed already.
const MAX_SPOOLED_RATIO: u64 = 50;
/// Members of a gzip file, frames of a zstd file. Packers that work in parallel make one for each 64 KiB or more.
const MAX_PIECES: u32 = 1 << 19;
const BUFFER_BYTES: usize = 64 << 10;

/// Unpacks a file that must hold a tar archive, and looks at its headers.
pub(super) fn open(packed: &Region, packing: Packing) -> Result<Box<dyn Container>, ContainerError> {
    let ended = Cell::new(false);
    let source = BufReader::with_capacity(BUFFER_BYTES, Watched { reader: packed.reader(), ended: &ended });
    let mut reader: Box<dyn Read + '_> = match packing {
        Packing::Gzip => Box::new(gzip::Members::new(source)),
        Packing::Zstd => Box::new(zstd::Frames::new(source)),
    };
    let failed = |error: io::Error| refusal(error, packing, ended.get());

    // What is no archive is not unpacked any further.
    let mut head = Vec::new();
    reader.by_ref().take(Kind::HEAD_BYTES as u64).read_to_end(&mut head).map_err(failed)?;
    if Kind::of(&head) != Kind::Tar {
        return Err(ContainerError::NoTarInside { packing: packing.name() });
    }
    let max_bytes = packed.bytes.saturating_mul(MAX_SPOOLED_RATIO).clamp(RATIO_FREE_BYTES, MAX_SPOOLED_BYTES);
    let bomb = || ContainerError::ArchiveBomb { max_bytes, packed: packed.bytes };
    let mut whole = head.as_slice().chain(reader);
    Ok(Box::new(Tar::index(spool(&mut whole, "the archive", max_bytes, bomb, failed)?)?))
}

/// Notices that somebody wanted more than there is: a stream that fails then was cut, any other is damaged.
struct Watched<'a, R> {
    reader: R,
    ended: &'a Cell<bool>,
}

impl<R: Read> Read for Watched<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.reader.read(buffer)?;
        if read == 0 && !buffer.is_empty() {
            self.ended.set(true);
        }
        Ok(read)
    }
}

fn refusal(error: io::Error, packing: Packing, ended: bool) -> ContainerError {
    let packing = packing.name();
    match error.downcast::<ContainerError>() {
        Ok(refusal) => refusal,
        Err(source) if is_machine_fault(&source) => {
            ContainerError::Unreadable { name: "the archive".to_owned(), source }
        }
        Err(_) if ended => ContainerError::PackingTruncated { packing },
        Err(error) => ContainerError::PackingDamaged { packing, reason: error.to_string() },
    }
}

/// The refusal of a stream in too many pieces, each of which costs time even where it holds nothing.
fn too_many_pieces(packing: Packing) -> io::Error {
    io::Error::other(ContainerError::PackingPieces { packing: packing.name(), max: MAX_PIECES })
}
