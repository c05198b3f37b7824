//! A Zstandard file: one frame after another, with skippable frames between them (RFC 8878, section 3.1).

use super::super::ContainerError;
use super::super::kind::Packing;
use super::{MAX_PIECES, too_many_pieces};
use ruzstd::decoding::errors::{FrameDecoderError, ReadFrameHeaderError};
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};
use std::io::{self, BufRead, Read};

/// Maximum window of a frame, which the decoder keeps in memory. Every level up to 19 needs at most 8 MiB;
/// section 3.1.1.1.2 of the RFC recommends a limit for decoders.
const MAX_WINDOW_BYTES: u64 = 64 << 20;

/// Reads the content of the frames, one after the other. Their checksums, if any, are checked.
pub(super) struct Frames<R> {
    source: R,
    decoder: FrameDecoder,
    in_frame: bool,
    left: u32,
}

impl<R: BufRead> Frames<R> {
    pub fn new(source: R) -> Frames<R> {
        let mut decoder = FrameDecoder::new();
        decoder.set_max_window_size(MAX_WINDOW_BYTES);
        Frames { source, decoder, in_frame: false, left: MAX_PIECES }
    }

    /// Advances to the next frame with content; returns false at the end of the file.
    fn next_frame(&mut self) -> io::Result<bool> {
        while !self.source.fill_buf()?.is_empty() {
            self.left = self.left.checked_sub(1).ok_or_else(|| too_many_pieces(Packing::Zstd))?;
            match self.decoder.reset(&mut self.source) {
                Ok(()) => {
                    self.in_frame = true;
                    return Ok(true);
                }
                Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame {
                    length,
                    ..
                })) => {
                    let length = u64::from(length);
                    if io::copy(&mut self.source.by_ref().take(length), &mut io::sink())? < length {
                        return Err(io::ErrorKind::UnexpectedEof.into());
                    }
                }
                Err(FrameDecoderError::WindowSizeTooBig { .. }) => {
                    return Err(io::Error::other(ContainerError::ZstdWindow { max_bytes: MAX_WINDOW_BYTES }));
                }
                Err(error) => return Err(io::Error::other(error)),
            }
        }
        Ok(false)
    }
}

impl<R: BufRead> Read for Frames<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        loop {
            if !self.in_frame && !self.next_frame()? {
                return Ok(0);
            }
            // Decoding block by block keeps only the window and one block of at most 128 KiB in memory.
            while self.decoder.can_collect() == 0 && !self.decoder.is_finished() {
                self.decoder
                    .decode_blocks(&mut self.source, BlockDecodingStrategy::UptoBlocks(1))
                    .map_err(io::Error::other)?;
            }
            let read = self.decoder.read(buffer)?;
            if read > 0 {
                return Ok(read);
            }
            let told = self.decoder.get_checksum_from_data();
            if told.is_some() && told != self.decoder.get_calculated_checksum() {
                return Err(io::Error::other("a checksum is wrong"));
            }
            self.in_frame = false;
        }
    }
}
