//! Protocol between `viola decode-video` and its parent.
//!
//! The child gets the file as its standard input, and the region and the numbers of frames as arguments. It
//! answers with the bytes of [`GREETING`], and then messages that begin with one byte: `.` for a decoded
//! sample; `F` for a frame, with its number, width and height as little-endian words of four bytes and then
//! its pixels; `E` for a refusal, with the length of its text in two bytes; `D` at the end. The parent
//! accepts only frames of the size in the video's table.

use super::inside::{Inside, Step};
use super::track::Track;
use super::{VideoError, colour};
use crate::container::Region;
use image::RgbImage;
use std::fmt;
use std::io::{self, Read, Write};
use std::str::FromStr;
use std::sync::Arc;

const GREETING: &[u8; 8] = b"viola v1";
/// Maximum length of a refusal's text.
const MAX_TEXT_BYTES: usize = 1000;

/// A message of the child.
pub enum Message {
    Working,
    Frame(usize, RgbImage),
    Refused(String),
    Done,
}

/// Decodes frames of a region and writes them; errors of the video are written too.
pub fn serve(region: Region, wanted: &[usize], out: &mut impl Write) -> io::Result<()> {
    out.write_all(GREETING)?;
    out.flush()?;
    let refused = match write_frames(region, wanted, out) {
        Ok(()) => return out.write_all(b"D").and_then(|()| out.flush()),
        Err(End::Lost(error)) => return Err(error),
        Err(End::Refused(refused)) => refused.to_string(),
    };
    let mut length = refused.len().min(MAX_TEXT_BYTES);
    while !refused.is_char_boundary(length) {
        length -= 1;
    }
    out.write_all(b"E")?;
    out.write_all(&(length as u16).to_le_bytes())?;
    out.write_all(&refused.as_bytes()[..length])?;
    out.flush()
}

enum End {
    Refused(VideoError),
    Lost(io::Error),
}

fn write_frames(region: Region, wanted: &[usize], out: &mut impl Write) -> Result<(), End> {
    let track = Arc::new(Track::read(&region).map_err(End::Refused)?);
    let format = track.format;
    let mut inside = Inside::open(region, track, wanted).map_err(End::Refused)?;
    loop {
        match inside.step().map_err(End::Refused)? {
            Step::Working => send(out, &[b"."])?,
            Step::Frame(number, planes) => {
                let rgb = colour::to_rgb(&planes, format.colour).map_err(End::Refused)?;
                let head = [number as u32, rgb.width(), rgb.height()].map(u32::to_le_bytes);
                send(out, &[b"F", head.as_flattened(), rgb.as_raw()])?;
            }
            Step::Done => return Ok(()),
        }
    }
}

fn send(out: &mut impl Write, parts: &[&[u8]]) -> Result<(), End> {
    parts.iter().try_for_each(|part| out.write_all(part)).and_then(|()| out.flush()).map_err(End::Lost)
}

pub fn read_greeting(from: &mut impl Read) -> Result<(), VideoError> {
    let mut greeting = [0; 8];
    from.read_exact(&mut greeting).map_err(VideoError::Unreadable)?;
    if &greeting == GREETING { Ok(()) } else { Err(VideoError::ChildLied { what: "another greeting" }) }
}

/// Reads one message. A frame must be of the size that the parent knows from the video's table.
pub fn read_message(from: &mut impl Read, width: u32, height: u32) -> Result<Message, VideoError> {
    let [kind] = read(from)?;
    match kind {
        b'.' => Ok(Message::Working),
        b'D' => Ok(Message::Done),
        b'E' => {
            let length = usize::from(u16::from_le_bytes(read(from)?)).min(MAX_TEXT_BYTES);
            let mut text = vec![0; length];
            from.read_exact(&mut text).map_err(VideoError::Unreadable)?;
            Ok(Message::Refused(String::from_utf8_lossy(&text).into_owned()))
        }
        b'F' => {
            let number = u32::from_le_bytes(read(from)?);
            if [u32::from_le_bytes(read(from)?), u32::from_le_bytes(read(from)?)] != [width, height] {
                return Err(VideoError::ChildLied { what: "a frame of another size" });
            }
            let mut pixels = vec![0; 3 * width as usize * height as usize];
            from.read_exact(&mut pixels).map_err(VideoError::Unreadable)?;
            let rgb = RgbImage::from_raw(width, height, pixels);
            let rgb = rgb.ok_or(VideoError::ChildLied { what: "a frame of another size" })?;
            Ok(Message::Frame(number as usize, rgb))
        }
        _ => Err(VideoError::ChildLied { what: "an unknown message" }),
    }
}

fn read<const N: usize>(from: &mut impl Read) -> Result<[u8; N], VideoError> {
    let mut bytes = [0; N];
    from.read_exact(&mut bytes).map_err(VideoError::Unreadable)?;
    Ok(bytes)
}

/// Ascending numbers, written as ranges: `0-5,9,12-20`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NumberList(pub Vec<usize>);

impl fmt::Display for NumberList {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut rest = self.0.as_slice();
        let mut separator = "";
        while let Some(&first) = rest.first() {
            let run = rest.iter().enumerate().take_while(|(i, number)| **number == first + i).count();
            match run {
                1 => write!(out, "{separator}{first}")?,
                _ => write!(out, "{separator}{first}-{}", first + run - 1)?,
            }
            separator = ",";
            rest = &rest[run..];
        }
        Ok(())
    }
}

impl FromStr for NumberList {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const WRONG: &str = "numbers are written as ascending ranges: 0-5,9,12-20";
        let mut numbers = Vec::new();
        for part in text.split(',').filter(|part| !part.is_empty()) {
            let (first, last) = part.split_once('-').unwrap_or((part, part));
            let (first, last): (usize, usize) =
                (first.parse().map_err(|_| WRONG)?, last.parse().map_err(|_| WRONG)?);
            if first > last
                || last >= super::MAX_FRAMES
                || numbers.last().is_some_and(|before| *before >= first)
            {
                return Err(WRONG);
            }
            numbers.extend(first..=last);
        }
        Ok(NumberList(numbers))
    }
}
