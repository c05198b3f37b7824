//! ffmpeg as the decoding process.
//!
//! ffmpeg demuxes independently of our parser. Its pictures are counted in presentation order, as
//! [`super::VideoInfo`] numbers them. It writes YUV4MPEG2, whose header has the size of the pictures, so that
//! another size is detected. The colours are converted here, as for the other decoder, so that the pixels are
//! the same.

use super::child::{Child, Say};
use super::decoder::{Planes, Samples, little_endian};
use super::limits::Limits;
use super::parameters::Format;
use super::protocol::Message;
use super::track::Track;
use super::{Codec, VideoError, colour};
use crate::container::Region;
use std::io::Read;
use std::path::Path;
use std::process::Command;

/// Headers of YUV4MPEG2 have about a hundred bytes.
const MAX_HEAD_BYTES: usize = 400;

/// Starts ffmpeg for the wanted frames.
pub fn start(
    program: &Path,
    region: &Region,
    track: &Track,
    wanted: &[usize],
    limits: &Limits,
) -> Result<Child, VideoError> {
    let end = region.offset.saturating_add(region.bytes);
    let codec = match track.codec {
        Codec::H264 => "h264",
        Codec::Hevc => "hevc",
    };
    let last = wanted.last().copied().unwrap_or(0);
    let mut command = Command::new(program);
    // Only this file, only this container, only this decoder; the first damage ends it.
    command.args(["-nostdin", "-v", "error", "-xerror", "-protocol_whitelist", "file,subfile"]);
    command.args(["-err_detect", "explode", "-noautorotate", "-threads", "2", "-f", "mov", "-c:v", codec]);
    command.args(["-i", &format!("subfile,,start,{},end,{end},,:/dev/fd/0", region.offset)]);
    command.args(["-map", "0:V:0", "-fps_mode", "passthrough", "-frames:v", &(last + 1).to_string()]);
    command.args(["-strict", "-1", "-f", "yuv4mpegpipe", "pipe:1"]);
    let format = track.format;
    let wanted = wanted.to_vec();
    Child::start(command, region, limits, track.samples.len(), move |from, say| {
        if let Err(error) = listen(from, format, &wanted, say) {
            say(Err(error));
        }
    })
}

fn listen(from: &mut dyn Read, format: Format, wanted: &[usize], say: Say) -> Result<(), VideoError> {
    const LIED: VideoError = VideoError::ChildLied { what: "pictures of another kind" };
    let head = line(from)?;
    let mut words = head.split(' ');
    let sized = |letter: char, size: u32| head.split(' ').any(|word| word == format!("{letter}{size}"));
    let chroma = head.split(' ').find(|word| word.starts_with('C')).unwrap_or("C420");
    let of_kind = match format.bits {
        8 => chroma.starts_with("C420") && !chroma.starts_with("C420p1"),
        _ => chroma == "C420p10",
    };
    if words.next() != Some("YUV4MPEG2")
        || !sized('W', format.width)
        || !sized('H', format.height)
        || !of_kind
    {
        return Err(LIED);
    }
    let mut due = wanted.iter().copied().peekable();
    let mut number = 0;
    while due.peek().is_some() {
        if line(from)?.split(' ').next() != Some("FRAME") {
            return Err(LIED);
        }
        let planes = read_planes(from, format)?;
        let message = match due.next_if_eq(&number) {
            Some(number) => Message::Frame(number, colour::to_rgb(&planes, format.colour)?),
            None => Message::Working,
        };
        if !say(Ok(message)) {
            return Ok(());
        }
        number += 1;
    }
    say(Ok(Message::Done));
    Ok(())
}

fn read_planes(from: &mut dyn Read, format: Format) -> Result<Planes, VideoError> {
    let Format { width, height, bits, .. } = format;
    let luma = width as usize * height as usize;
    let sample = if bits > 8 { 2 } else { 1 };
    let mut plane = |samples: usize| {
        let mut bytes = vec![0; samples * sample];
        from.read_exact(&mut bytes).map_err(VideoError::Unreadable).map(|()| bytes)
    };
    let planes = [plane(luma)?, plane(luma / 4)?, plane(luma / 4)?];
    let samples = match bits {
        8 => Samples::Bytes(planes),
        _ => Samples::Words(planes.map(|plane| little_endian(&plane))),
    };
    Ok(Planes { width, height, bits, samples })
}

fn line(from: &mut dyn Read) -> Result<String, VideoError> {
    let mut line = Vec::new();
    loop {
        let mut byte = [0];
        from.read_exact(&mut byte).map_err(VideoError::Unreadable)?;
        match byte[0] {
            b'\n' => return Ok(String::from_utf8_lossy(&line).into_owned()),
            _ if line.len() == MAX_HEAD_BYTES => {
                return Err(VideoError::ChildLied { what: "a line without end" });
            }
            byte => line.push(byte),
        }
    }
}
