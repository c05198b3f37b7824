//! Robots' own files: in a vendor's layout, often compressed.

mod dreame;
mod roborock;
mod viomi;

pub(super) use dreame::is_text;
pub(super) use dreame::{is_inflated as is_inflated_dreame, read as read_inflated_dreame};
pub(super) use roborock::{is as is_roborock, read as read_roborock};

use super::{LidarError, LidarMap, valetudo};
use flate2::read::{MultiGzDecoder, ZlibDecoder};
use std::io::Read;

/// Maximum inflated size of a robot's map in bytes; the largest known has 0.7 MB.
const MAX_INFLATED_BYTES: u64 = 8 << 20;
/// Maximum number of cells along each side of a robot's map; the largest known has 1024.
const MAX_SIDE: i64 = 4096;

/// Returns whether the bytes begin as a zlib stream without a preset dictionary (RFC 1950).
pub(super) fn is_zlib(bytes: &[u8]) -> bool {
    let &[method, flags, ..] = bytes else { return false };
    // A table whose head begins with a column `X` and a tab looks like one.
    if bytes.starts_with(b"X\t") {
        return false;
    }
    let has_dictionary = flags & 0x20 != 0;
    method & 0x0f == 8 && u16::from_be_bytes([method, flags]) % 31 == 0 && !has_dictionary
}

/// Inflates a zlib stream; refuses one that gets too large.
pub(super) fn inflate(bytes: &[u8]) -> Result<Vec<u8>, LidarError> {
    read_bounded(ZlibDecoder::new(bytes))
}

fn read_bounded(reader: impl Read) -> Result<Vec<u8>, LidarError> {
    let mut inflated = Vec::new();
    reader
        .take(MAX_INFLATED_BYTES + 1)
        .read_to_end(&mut inflated)
        .map_err(|error| LidarError::BadCompression { reason: error.to_string() })?;
    if inflated.len() as u64 > MAX_INFLATED_BYTES {
        return Err(LidarError::FileTooLarge { max_bytes: MAX_INFLATED_BYTES });
    }
    Ok(inflated)
}

/// Returns whether the bytes begin as a gzip file (RFC 1952).
pub(super) fn is_gzip(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x1f, 0x8b])
}

/// Inflates a gzip file; refuses one that gets too large.
pub(super) fn gunzip(bytes: &[u8]) -> Result<Vec<u8>, LidarError> {
    read_bounded(MultiGzDecoder::new(bytes))
}

/// Reads a gzip file: Roborock's RRMap from its cloud, or Valetudo's JSON.
pub(super) fn read_gzip(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let inflated = gunzip(bytes)?;
    match inflated.as_slice() {
        [b'{', ..] => valetudo::read(&inflated),
        map if roborock::is(map) => roborock::read(map),
        _ => Err(LidarError::UnknownFormat),
    }
}

/// Reads a zlib stream: a 3irobotix map, a Dreame map without its base64, or the JSON that Valetudo publishes
/// by MQTT.
pub(super) fn read_zlib(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let inflated = inflate(bytes)?;
    match inflated.as_slice() {
        json if is_json(json) => valetudo::read(json),
        map if viomi::is(map) => viomi::read(map),
        map if dreame::is(map) => dreame::read(map),
        _ => Err(LidarError::UnknownFormat),
    }
}

/// Returns whether an inflated zlib stream is Valetudo's JSON, and not a robot's map, whose number may begin with the same
/// character.
pub(super) fn is_json(inflated: &[u8]) -> bool {
    inflated.starts_with(b"{") && !viomi::is(inflated) && !dreame::is(inflated)
}

/// Reads base64 of a zlib stream: a Dreame map, or the JSON that Valetudo published by MQTT at the start of 2021
/// (Hypfer/ICantBelieveItsNotValetudo, issue 45 and pull request 46).
pub(super) fn read_text(text: &[u8]) -> Result<LidarMap, LidarError> {
    let inflated = dreame::decode(text)?;
    if is_json(&inflated) { valetudo::read(&inflated) } else { dreame::read(&inflated) }
}

/// Returns Valetudo's JSON of a text that [`read_text`] reads; `None` for other texts.
pub(super) fn json_in_text(text: &[u8]) -> Option<Vec<u8>> {
    let inflated = is_text(text).then(|| dreame::decode(text))?;
    inflated.ok().filter(|inflated| is_json(inflated))
}

/// Reads little-endian numbers; returns `None` for a number past the end.
#[derive(Clone, Copy)]
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn array<const N: usize>(&self, at: usize) -> Option<[u8; N]> {
        self.0.get(at..)?.first_chunk::<N>().copied()
    }

    fn u8(&self, at: usize) -> Option<u8> {
        self.0.get(at).copied()
    }

    fn u16(&self, at: usize) -> Option<u16> {
        self.array(at).map(u16::from_le_bytes)
    }

    fn i16(&self, at: usize) -> Option<i16> {
        self.array(at).map(i16::from_le_bytes)
    }

    fn u32(&self, at: usize) -> Option<u32> {
        self.array(at).map(u32::from_le_bytes)
    }

    fn i32(&self, at: usize) -> Option<i32> {
        self.array(at).map(i32::from_le_bytes)
    }

    fn f32(&self, at: usize) -> Option<f64> {
        self.array(at).map(f32::from_le_bytes).map(f64::from)
    }
}

/// Rounds to whole centimetres, halves upwards, like Valetudo.
fn round_cm(value: f64) -> f64 {
    (value + 0.5).floor()
}

/// Returns the direction between two points, y down, in degrees clockwise from the top; `None` if equal.
fn heading_deg(from: [f64; 2], to: [f64; 2]) -> Option<f64> {
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    (dx != 0.0 || dy != 0.0).then(|| (dy.atan2(dx).to_degrees().round() + 450.0) % 360.0)
}
