//! Unpacks a stream into an unnamed temporary file, which is deleted when it is closed.

use super::scratch::Reservation;
use super::{ContainerError, Region, Scratch};
use std::io::{self, Read, Write};
use std::sync::Arc;

const CHUNK_BYTES: usize = 128 << 10;

/// Copies a stream into a temporary file. More than `max_bytes` return `too_many()`, a failed read
/// `unreadable(error)`; `name` is for the message of a full disk or budget.
pub(super) fn spool(
    reader: &mut dyn Read,
    name: &str,
    scratch: &Scratch,
    max_bytes: u64,
    too_many: impl FnOnce() -> ContainerError,
    unreadable: impl FnOnce(io::Error) -> ContainerError,
) -> Result<Region, ContainerError> {
    let no_room = |source| ContainerError::CannotUnpack { name: name.to_owned(), source };
    let mut file = scratch.file().map_err(no_room)?;
    let mut reservation = scratch.reserve();
    let mut chunk = vec![0; CHUNK_BYTES];
    let mut bytes = 0u64;
    loop {
        let read = match reader.read(&mut chunk) {
            Ok(0) => {
                return Ok(Region { file, offset: 0, bytes, reservation: Some(Arc::new(reservation)) });
            }
            Ok(read) => read,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(unreadable(error)),
        };
        bytes = bytes.saturating_add(read as u64);
        if bytes > max_bytes {
            return Err(too_many());
        }
        reservation.grow(read as u64, name)?;
        file.write_all(&chunk[..read]).map_err(no_room)?;
    }
}

/// An unnamed temporary file for parts that lie scattered or packed in a file.
pub struct Spool {
    file: io::BufWriter<std::fs::File>,
    reservation: Reservation,
    bytes: u64,
    max_bytes: u64,
}

/// Name of the copy in messages.
const COPY: &str = "the pictures of the recording";

impl Spool {
    /// Begins a file of at most `max_bytes`.
    pub fn new(scratch: &Scratch, max_bytes: u64) -> Result<Spool, ContainerError> {
        let file = scratch.file().map_err(Spool::no_room)?;
        let file = io::BufWriter::with_capacity(CHUNK_BYTES, file);
        Ok(Spool { file, reservation: scratch.reserve(), bytes: 0, max_bytes })
    }

    /// Appends a part and returns its offset.
    pub fn append(&mut self, part: &[u8]) -> Result<u64, ContainerError> {
        let at = self.bytes;
        self.bytes = at.saturating_add(part.len() as u64);
        if self.bytes > self.max_bytes {
            return Err(ContainerError::UnpacksTooLarge { max_bytes: self.max_bytes });
        }
        self.reservation.grow(part.len() as u64, COPY)?;
        self.file.write_all(part).map_err(Spool::no_room)?;
        Ok(at)
    }

    /// Returns the whole file.
    pub fn finish(self) -> Result<Region, ContainerError> {
        let file = self.file.into_inner().map_err(|error| Spool::no_room(error.into_error()))?;
        Ok(Region { file, offset: 0, bytes: self.bytes, reservation: Some(Arc::new(self.reservation)) })
    }

    fn no_room(source: io::Error) -> ContainerError {
        ContainerError::CannotUnpack { name: COPY.to_owned(), source }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_than_the_bound_is_refused_with_advice() {
        let mut spool = Spool::new(&Scratch::default(), 3).unwrap();
        assert_eq!(spool.append(b"ab").unwrap(), 0);
        let refused = spool.append(b"cd").unwrap_err().to_string();
        assert!(refused.contains("split the recording into several clips"), "{refused}");
    }
}
