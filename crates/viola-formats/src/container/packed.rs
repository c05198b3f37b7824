//! A tar archive compressed as a whole: unpacked once, as a stream, into a temporary file.

mod gzip;
mod zstd;

use super::contents::RATIO_FREE_BYTES;
use super::kind::{Kind, Packing};
use super::spool::spool;
use super::{Container, ContainerError, Region, Scratch, is_machine_fault, tar::Tar};
use std::cell::Cell;
use std::io::{self, BufRead, BufReader, Read};

/// Maximum unpacked size of one archive. It stays on disk as long as the archive is open.
const MAX_SPOOLED_BYTES: u64 = 16 << 30;
/// Maximum ratio of unpacked to packed bytes. It is lower than a zip's, because everything is unpacked: text
/// and raw pictures stay below 50, and a recording's pictures are compressed already.
const MAX_SPOOLED_RATIO: u64 = 50;
/// Maximum number of gzip members or zstd frames. Parallel packers make one per 64 KiB or more.
const MAX_PIECES: u32 = 1 << 19;
const BUFFER_BYTES: usize = 64 << 10;

/// Unpacks a file that must hold a tar archive, and reads its headers.
pub(super) fn open(
    packed: &Region,
    packing: Packing,
    scratch: &Scratch,
) -> Result<Box<dyn Container>, ContainerError> {
    let ended = Cell::new(false);
    let source = BufReader::with_capacity(BUFFER_BYTES, Watched { reader: packed.reader(), ended: &ended });
    let mut reader: Box<dyn Read + '_> = match packing {
        Packing::Gzip => Box::new(gzip::Members::new(source)),
        Packing::Zstd => Box::new(zstd::Frames::new(source)),
    };
    let failed = |error: io::Error| refusal(error, packing, ended.get());

    // A file without an archive is not unpacked further.
    let mut head = Vec::new();
    reader.by_ref().take(Kind::HEAD_BYTES as u64).read_to_end(&mut head).map_err(failed)?;
    if Kind::of(&head) != Kind::Tar {
        return Err(ContainerError::NoTarInside { packing: packing.name() });
    }
    let max_bytes = packed.bytes.saturating_mul(MAX_SPOOLED_RATIO).clamp(RATIO_FREE_BYTES, MAX_SPOOLED_BYTES);
    let bomb = || ContainerError::ArchiveBomb { max_bytes, packed: packed.bytes };
    let mut whole = head.as_slice().chain(reader);
    let unpacked = spool(&mut whole, "the archive", scratch, max_bytes, bomb, failed)?;
    Ok(Box::new(Tar::index(unpacked, scratch)?))
}

/// Returns a reader of the content of Zstandard frames, with a bounded window.
pub fn unzstd(source: impl BufRead) -> impl Read {
    zstd::Frames::new(source)
}

/// Records a read at the end: a stream that fails after it is truncated, any other is damaged.
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

/// Returns the error of too many pieces: each one costs time, even if it is empty.
fn too_many_pieces(packing: Packing) -> io::Error {
    io::Error::other(ContainerError::PackingPieces { packing: packing.name(), max: MAX_PIECES })
}
