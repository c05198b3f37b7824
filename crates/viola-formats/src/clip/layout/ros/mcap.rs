//! MCAP files: records of a length, in chunks that may be compressed (mcap.dev/spec).

use super::lz4;
use super::message::{Kind, MAX_MESSAGE_BYTES, MAX_TOPICS, ROS_1_ADVICE, Visit};
use crate::clip::ClipError;
use crate::container::{ContainerError, Region, is_machine_fault, unzstd};
use std::collections::BTreeMap;
use std::io::{self, BufReader, Read};

pub(super) const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
/// Maximum size of the compressed chunk that is unpacked at once (lz4).
const MAX_CHUNK_BYTES: u64 = 64 << 20;
/// Bounds of the unpacked size of all chunks, as of archives.
const RATIO_FREE_BYTES: u64 = 16 << 20;
const MAX_RATIO: u64 = 50;
const MAX_UNPACKED_BYTES: u64 = 16 << 30;
const MAX_TEXT_BYTES: u32 = 4 << 10;

const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;

/// A message's sequence number and two times.
const MESSAGE_TIMES_BYTES: u64 = 20;

/// Advice for a file without its end: a recorder that was killed does not write it.
const CUT_ADVICE: &str = "send the whole file, or run `mcap recover` if its recorder was killed";

/// Visits the messages of a file that is known to begin with [`MAGIC`].
pub(super) fn read(region: &Region, name: &str, visit: Visit) -> Result<(), ClipError> {
    let left = region.bytes.saturating_mul(MAX_RATIO).clamp(RATIO_FREE_BYTES, MAX_UNPACKED_BYTES);
    let mut file = File { schemas: BTreeMap::new(), channels: BTreeMap::new(), left, refusal: None, visit };
    let mut source = BufReader::with_capacity(1 << 16, region.reader());
    let done = skip(&mut source, MAGIC.len() as u64).and_then(|()| file.records(&mut source, false));
    if let Some(refusal) = file.refusal {
        return Err(refusal);
    }
    done.map_err(|source| {
        if is_machine_fault(&source) {
            return ContainerError::Unreadable { name: name.to_string(), source }.into();
        }
        let reason = match source.kind() {
            io::ErrorKind::UnexpectedEof => format!("it ends too early; {CUT_ADVICE}"),
            io::ErrorKind::InvalidData => source.to_string(),
            _ => format!("it is damaged or cut ({source}); {CUT_ADVICE}"),
        };
        ClipError::BadMetadata { name: name.to_string(), reason }
    })
}

struct File<'a> {
    /// Types of messages that are read.
    schemas: BTreeMap<u16, Kind>,
    /// Topic and kind of the channels with messages that are read.
    channels: BTreeMap<u16, (String, Kind)>,
    /// Bytes that chunks may still unpack to.
    left: u64,
    /// The refusal of a message's content, which ends the reading.
    refusal: Option<ClipError>,
    visit: Visit<'a>,
}

impl File<'_> {
    /// Reads records to the footer, or to the end of a chunk.
    fn records(&mut self, source: &mut dyn Read, in_chunk: bool) -> io::Result<()> {
        let mut opcode = [0];
        while source.read(&mut opcode)? == 1 {
            let bytes = u64_of(source)?;
            let mut body = source.take(bytes);
            match opcode[0] {
                FOOTER => return Ok(()),
                SCHEMA => {
                    let (id, name) = (u16_of(&mut body)?, text_of(&mut body)?);
                    self.schemas.extend(Kind::of(&name).map(|kind| (id, kind)));
                }
                CHANNEL => self.channel(&mut body)?,
                MESSAGE => self.message(&mut body, bytes)?,
                CHUNK if !in_chunk => self.chunk(&mut body)?,
                _ => {}
            }
            let left = body.limit();
            skip(source, left)?;
        }
        Ok(())
    }

    fn channel(&mut self, body: &mut dyn Read) -> io::Result<()> {
        let (id, schema) = (u16_of(body)?, u16_of(body)?);
        let (topic, encoding) = (text_of(body)?, text_of(body)?);
        let kind = self.schemas.get(&schema);
        if kind.is_some() && encoding == "ros1" {
            return Err(refused(format!("its messages are of ROS 1; {ROS_1_ADVICE}")));
        }
        let kind = kind.filter(|_| encoding == "cdr");
        self.channels.extend(kind.map(|kind| (id, (topic, *kind))));
        if self.channels.len() > MAX_TOPICS {
            return Err(refused(format!("it has more than {MAX_TOPICS} topics")));
        }
        Ok(())
    }

    fn message(&mut self, body: &mut dyn Read, bytes: u64) -> io::Result<()> {
        let Some((topic, kind)) = self.channels.get(&u16_of(body)?) else { return Ok(()) };
        skip(body, MESSAGE_TIMES_BYTES)?;
        let bytes = bytes.saturating_sub(2 + MESSAGE_TIMES_BYTES);
        if bytes > MAX_MESSAGE_BYTES {
            return Err(refused(format!("a message of {topic} has {bytes} bytes")));
        }
        let mut message = Vec::new();
        body.read_to_end(&mut message)?;
        if (message.len() as u64) < bytes {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        (self.visit)(topic, *kind, &message).map_err(|refusal| {
            self.refusal = Some(refusal);
            refused("a message was refused")
        })
    }

    fn chunk(&mut self, body: &mut dyn Read) -> io::Result<()> {
        // The times of the first and the last message.
        skip(body, 16)?;
        let unpacked_bytes = u64_of(body)?;
        // The checksum.
        skip(body, 4)?;
        let compression = text_of(body)?;
        let packed_bytes = u64_of(body)?;
        let mut packed = body.take(packed_bytes);
        if compression.is_empty() {
            return self.records(&mut packed, true);
        }
        self.left = self.left.checked_sub(unpacked_bytes).ok_or_else(|| {
            refused("its chunks unpack to more than a recording's; split it into several clips")
        })?;
        match compression.as_str() {
            "zstd" => {
                let mut records = unzstd(BufReader::new(packed)).take(unpacked_bytes);
                self.records(&mut records, true)
            }
            "lz4" if unpacked_bytes.max(packed_bytes) <= MAX_CHUNK_BYTES => {
                let mut bytes = Vec::new();
                packed.read_to_end(&mut bytes)?;
                let records = lz4::unpack(&bytes, unpacked_bytes as usize);
                let records = records.ok_or_else(|| refused("a chunk is not lz4"))?;
                self.records(&mut records.as_slice(), true)
            }
            other => Err(refused(format!("a chunk is compressed by {other:?}; run `mcap decompress`"))),
        }
    }
}

/// Returns the error of a file that we refuse; other errors are of the system or of a decoder.
fn refused(reason: impl Into<String>) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, reason.into())
}

fn array<const N: usize>(source: &mut dyn Read) -> io::Result<[u8; N]> {
    let mut bytes = [0; N];
    source.read_exact(&mut bytes)?;
    Ok(bytes)
}

fn u16_of(source: &mut dyn Read) -> io::Result<u16> {
    array(source).map(u16::from_le_bytes)
}

fn u64_of(source: &mut dyn Read) -> io::Result<u64> {
    array(source).map(u64::from_le_bytes)
}

fn text_of(source: &mut dyn Read) -> io::Result<String> {
    let bytes = u32::from_le_bytes(array(source)?);
    if bytes > MAX_TEXT_BYTES {
        return Err(refused(format!("a name has {bytes} bytes")));
    }
    let mut text = vec![0; bytes as usize];
    source.read_exact(&mut text)?;
    String::from_utf8(text).map_err(|_| refused("a name is not text"))
}

fn skip(source: &mut dyn Read, bytes: u64) -> io::Result<()> {
    let skipped = io::copy(&mut source.take(bytes), &mut io::sink())?;
    if skipped < bytes { Err(io::ErrorKind::UnexpectedEof.into()) } else { Ok(()) }
}
