//! A gzip file: one member after another (RFC 1952, section 2.2).

use super::super::kind::Packing;
use super::{MAX_PIECES, too_many_pieces};
use flate2::bufread::GzDecoder;
use std::io::{self, BufRead, Read};

/// Reads the content of the members, one after the other. Their checksums are checked.
pub(super) struct Members<R> {
    /// `None` at the end of the file or after a failure.
    member: Option<GzDecoder<R>>,
    left: u32,
}

impl<R: BufRead> Members<R> {
    pub fn new(source: R) -> Members<R> {
        Members { member: Some(GzDecoder::new(source)), left: MAX_PIECES }
    }
}

impl<R: BufRead> Read for Members<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        loop {
            let Some(member) = &mut self.member else { return Ok(0) };
            let read = member.read(buffer)?;
            if read > 0 {
                return Ok(read);
            }
            let Some(mut source) = self.member.take().map(GzDecoder::into_inner) else { return Ok(0) };
            if source.fill_buf()?.is_empty() {
                return Ok(0);
            }
            self.left = self.left.checked_sub(1).ok_or_else(|| too_many_pieces(Packing::Gzip))?;
            self.member = Some(GzDecoder::new(source));
        }
    }
}
