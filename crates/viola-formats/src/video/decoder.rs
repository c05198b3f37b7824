//! The two decoders behind one interface.
//!
//! In all tests `rust_h264` and `rust_h265` gave ffmpeg's pictures bit for bit, and refused by name what they
//! do not decode (`docs/experiments.md`, Video). Both are pure Rust and decode two pictures at a time.

use super::Codec;
use super::parameters::Format;
use super::track::Track;
use rust_h264::nal::parse_avcc;
use rust_h264::threading::ThreadedDecoder;
use rust_h265::PixelData;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Number of pictures decoded at a time; the pixels are the same for any number.
const THREADS: usize = 2;

/// Length of a unit's length, as it is given to the decoder of H.264.
const LENGTH_BYTES: usize = size_of::<u32>();

/// A decoded picture: three planes without padding, chroma half as wide and half as high.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Planes {
    pub width: u32,
    pub height: u32,
    /// Bits per sample.
    pub bits: u8,
    pub samples: Samples,
}

/// Luma, then the two chroma planes; words if a sample has more than eight bits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Samples {
    Bytes([Vec<u8>; 3]),
    Words([Vec<u16>; 3]),
}

impl Planes {
    /// Returns whether the planes have this size and depth, both declared and actual.
    pub(super) fn are(&self, format: Format) -> bool {
        let luma = format.width as usize * format.height as usize;
        let lengths = match &self.samples {
            Samples::Bytes(planes) => planes.each_ref().map(Vec::len),
            Samples::Words(planes) => planes.each_ref().map(Vec::len),
        };
        (self.width, self.height, self.bits) == (format.width, format.height, format.bits)
            && matches!(self.samples, Samples::Words(_)) == (format.bits > 8)
            && lengths == [luma, luma / 4, luma / 4]
    }

    /// Returns all samples, in ffmpeg's layout `yuv420p` or `yuv420p10le`.
    pub fn bytes(&self) -> Vec<u8> {
        match &self.samples {
            Samples::Bytes(planes) => planes.concat(),
            Samples::Words(planes) => planes.iter().flatten().flat_map(|word| word.to_le_bytes()).collect(),
        }
    }
}

/// Failure of a decoder.
pub enum Failure {
    Refused(String),
    /// It panicked, which untrusted data can cause; its state must not be used again.
    Broke,
}

pub enum Decoder {
    H264(Box<ThreadedDecoder>),
    Hevc(Box<rust_h265::Decoder>),
}

impl Decoder {
    /// Returns a decoder with the track's parameter sets.
    pub fn new(track: &Track) -> Result<Decoder, Failure> {
        let mut decoder = match track.codec {
            Codec::H264 => Decoder::H264(Box::new(ThreadedDecoder::with_max_depth(THREADS, track.reorder))),
            Codec::Hevc => Decoder::Hevc(Box::new(rust_h265::Decoder::new().with_threads(THREADS))),
        };
        for unit in track.vps.iter().chain([&track.sps]).chain(&track.pps) {
            decoder.feed(&[unit])?;
        }
        Ok(decoder)
    }

    /// Returns whether pictures come out in presentation order, otherwise in decoding order.
    pub fn in_order_of_showing(codec: Codec) -> bool {
        codec == Codec::H264
    }

    /// Decodes the units of one picture, and returns the completed pictures.
    pub fn feed(&mut self, units: &[&[u8]]) -> Result<Vec<Planes>, Failure> {
        guarded(|| match self {
            Decoder::H264(decoder) => {
                let mut done = Vec::new();
                let mut sized = Vec::new();
                for unit in units {
                    sized.clear();
                    sized.extend_from_slice(&(unit.len() as u32).to_be_bytes());
                    sized.extend_from_slice(unit);
                    for nal in parse_avcc(&sized, LENGTH_BYTES) {
                        let frames = decoder.decode_nal(&nal).map_err(refused)?;
                        done.extend(frames.into_iter().map(from_h264));
                    }
                }
                Ok(done)
            }
            Decoder::Hevc(decoder) => {
                let mut done = Vec::new();
                for nal in units.iter().filter_map(|unit| rust_h265::parse_nal(unit)) {
                    done.extend(decoder.decode_nal(&nal).map_err(refused)?);
                }
                done.into_iter().map(from_hevc).collect()
            }
        })
    }

    /// Returns the remaining pictures, at the end of the input.
    pub fn finish(&mut self) -> Result<Vec<Planes>, Failure> {
        guarded(|| match self {
            Decoder::H264(decoder) => Ok(decoder.flush().into_iter().map(from_h264).collect()),
            Decoder::Hevc(decoder) => {
                let done: Vec<_> = std::iter::from_fn(|| decoder.flush()).collect();
                match decoder.next_error() {
                    Some(error) => Err(refused(error)),
                    None => done.into_iter().map(from_hevc).collect(),
                }
            }
        })
    }
}

fn guarded<T>(work: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or(Err(Failure::Broke))
}

fn refused(error: impl std::fmt::Display) -> Failure {
    Failure::Refused(error.to_string())
}

fn from_h264(frame: rust_h264::decoder::Frame) -> Planes {
    let planes = [frame.y, frame.u, frame.v];
    let samples = match frame.bit_depth {
        8 => Samples::Bytes(planes),
        _ => Samples::Words(planes.map(|plane| little_endian(&plane))),
    };
    Planes { width: frame.width, height: frame.height, bits: frame.bit_depth, samples }
}

fn from_hevc(frame: rust_h265::Frame) -> Result<Planes, Failure> {
    let samples = match (frame.y, frame.u, frame.v) {
        (PixelData::U8(y), PixelData::U8(u), PixelData::U8(v)) => Samples::Bytes([y, u, v]),
        (PixelData::U16(y), PixelData::U16(u), PixelData::U16(v)) => Samples::Words([y, u, v]),
        _ => return Err(Failure::Refused("planes of different depth".to_owned())),
    };
    Ok(Planes { width: frame.width, height: frame.height, bits: frame.bit_depth, samples })
}

/// Converts pairs of bytes to words, the lower byte first.
pub fn little_endian(bytes: &[u8]) -> Vec<u16> {
    bytes.as_chunks::<2>().0.iter().map(|pair| u16::from_le_bytes(*pair)).collect()
}
