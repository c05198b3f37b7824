//! The wanted frames, from any of the decoders.

use super::child::Child;
use super::inside::Inside;
use super::track::Track;
use super::{Tools, VideoError, colour, ffmpeg, region};
use crate::container::Region;
use image::RgbImage;
use std::sync::Arc;

/// Frames in the order of their numbers, each once; see [`super::decode`]. After an error there are no more.
/// Dropping it ends the decoding process.
pub struct Frames {
    region: Region,
    track: Arc<Track>,
    tools: Tools,
    wanted: Vec<usize>,
    given: usize,
    source: Source,
}

enum Source {
    Inside(Box<Inside>),
    Viola(Child),
    Ffmpeg(Child),
    Ended,
}

impl Frames {
    pub(super) fn open(
        region: Region,
        track: Track,
        wanted: &[usize],
        tools: &Tools,
    ) -> Result<Frames, VideoError> {
        let (wanted, tools) = (wanted.to_vec(), tools.clone());
        let mut frames =
            Frames { region, track: Arc::new(track), tools, wanted, given: 0, source: Source::Ended };
        if !frames.wanted.is_empty() {
            frames.source = frames.first()?;
        }
        Ok(frames)
    }

    fn first(&self) -> Result<Source, VideoError> {
        let Some(program) = &self.tools.ffmpeg else { return self.pure() };
        match ffmpeg::start(program, &self.region, &self.track, &self.wanted, &self.tools.limits) {
            Ok(child) => Ok(Source::Ffmpeg(child)),
            Err(_) => self.pure(),
        }
    }

    /// Returns the pure-Rust decoder for the remaining frames.
    fn pure(&self) -> Result<Source, VideoError> {
        let wanted = &self.wanted[self.given..];
        if let Some(program) = &self.tools.viola {
            let child = Child::viola(program, &self.region, &self.track, wanted, &self.tools.limits)?;
            return Ok(Source::Viola(child));
        }
        let inside = Inside::open(region::clone(&self.region)?, self.track.clone(), wanted)?;
        Ok(Source::Inside(Box::new(inside)))
    }

    fn advance(&mut self) -> Result<Option<(usize, RgbImage)>, VideoError> {
        let due = self.wanted.get(self.given).copied();
        let found = match &mut self.source {
            Source::Ended => return Ok(None),
            Source::Inside(inside) => match inside.next()? {
                Some((number, planes)) => Some((number, colour::to_rgb(&planes, self.track.format.colour)?)),
                None => None,
            },
            Source::Viola(child) | Source::Ffmpeg(child) => match due {
                Some(_) => child.next()?,
                None => None,
            },
        };
        match found {
            Some((number, _)) if Some(number) != due => Err(VideoError::ChildLied { what: "another frame" }),
            None if due.is_some() => Err(VideoError::ChildLied { what: "fewer frames than asked for" }),
            found => Ok(found),
        }
    }
}

impl Iterator for Frames {
    type Item = Result<(usize, RgbImage), VideoError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let error = match self.advance() {
                Ok(Some(frame)) => {
                    self.given += 1;
                    return Some(Ok(frame));
                }
                Ok(None) => {
                    self.source = Source::Ended;
                    return None;
                }
                Err(error) => error,
            };
            let was_ffmpeg = matches!(self.source, Source::Ffmpeg(_));
            self.source = Source::Ended;
            if !was_ffmpeg {
                return Some(Err(error));
            }
            // ffmpeg failed; the other decoder continues, or returns the error.
            match self.pure() {
                Ok(source) => self.source = source,
                Err(error) => return Some(Err(error)),
            }
        }
    }
}
