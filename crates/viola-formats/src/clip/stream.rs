//! Frames in the requested order.

use super::files::Files;
use super::{Clip, ClipError, Frame, Origin};
use crate::video;
use image::RgbImage;
use rayon::prelude::*;

/// Memory for the frames of one batch ...
const BATCH_BYTES: u64 = 288 << 20;
/// ... and for each of their pixels while they are decoded.
const BYTES_A_PIXEL: u64 = 6;

impl Clip {
    /// Returns the number of frames that may be in memory at a time: `most`, or fewer of large pictures.
    pub fn batch(&self, most: usize) -> usize {
        let frames = BATCH_BYTES / (self.pixels_a_frame() * BYTES_A_PIXEL).max(1);
        usize::try_from(frames).unwrap_or(most).clamp(1, most)
    }

    /// Returns the number of pixels of the largest frame, colour and depth.
    pub fn pixels_a_frame(&self) -> u64 {
        if let Origin::Files(files) = &*self.origin {
            return files.pixels_a_frame;
        }
        let pixels = |width: u32, height: u32| u64::from(width) * u64::from(height);
        let info = &self.info;
        pixels(info.color_width, info.color_height) + pixels(info.depth_width, info.depth_height)
    }
}

/// Some of a clip's frames, decoded a few at a time and by several threads.
pub struct FrameStream<'a> {
    clip: &'a Clip,
    indices: std::vec::IntoIter<usize>,
    video: VideoStream,
}

/// State of the clip's video.
enum VideoStream {
    /// No frame of it was requested yet.
    Waiting,
    Running(Box<video::Frames>),
    /// It failed; all later frames are lost.
    Failed {
        code: &'static str,
        reason: String,
        is_service_fault: bool,
    },
}

impl<'a> FrameStream<'a> {
    pub(super) fn new(clip: &'a Clip, indices: Vec<usize>) -> FrameStream<'a> {
        FrameStream { clip, indices: indices.into_iter(), video: VideoStream::Waiting }
    }

    /// Returns the next frames, at most `count`; empty at the end. A frame that cannot be decoded does not
    /// stop the later ones, except in a video: all frames after its damage are lost.
    pub fn next_batch(&mut self, count: usize) -> Vec<Result<Frame, ClipError>> {
        // The video decoder gets all wanted frames at once.
        let of_video = matches!(&*self.clip.origin, Origin::Files(files) if files.video.is_some());
        let is_first = of_video && matches!(self.video, VideoStream::Waiting);
        let wanted_after = if is_first { self.indices.as_slice().to_vec() } else { Vec::new() };
        let indices: Vec<usize> = self.indices.by_ref().take(count).collect();
        let scaled = |index: usize, frame: Result<Frame, ClipError>| {
            frame.map(|frame| self.clip.in_scale(index, frame))
        };
        match &*self.clip.origin {
            Origin::Memory(load) => indices.par_iter().map(|&index| scaled(index, Ok(load(index)))).collect(),
            Origin::Files(files) => {
                let colors: Vec<_> =
                    indices.iter().map(|&index| self.video.color(files, index, &wanted_after)).collect();
                let frame = |(&index, color): (&usize, _)| {
                    scaled(index, files.load(index, &self.clip.frames[index], color))
                };
                indices.par_iter().zip(colors).map(frame).collect()
            }
        }
    }
}

impl Clip {
    /// Returns a frame of the origin in the clip's scale.
    fn in_scale(&self, index: usize, mut frame: Frame) -> Frame {
        if self.scale != 1.0 {
            frame.header = self.frames[index].clone();
            frame.depth.depth_m.iter_mut().for_each(|depth_m| *depth_m *= self.scale as f32);
        }
        frame
    }
}

impl VideoStream {
    /// Returns the colour of a frame, if colour is a video. `wanted` are this frame and all later ones.
    fn color(
        &mut self,
        files: &Files,
        index: usize,
        wanted: &[usize],
    ) -> Option<Result<RgbImage, ClipError>> {
        let number = files.pictures[index].video_frame()?;
        if matches!(self, VideoStream::Waiting) {
            let video = files.video.as_ref()?;
            let numbers: Vec<usize> =
                wanted.iter().filter_map(|&index| files.pictures[index].video_frame()).collect();
            match video::decode(&video.region, &numbers, &video.tools) {
                Ok(frames) => *self = VideoStream::Running(Box::new(frames)),
                Err(error) => self.fail(&error),
            }
        }
        if let VideoStream::Running(frames) = self {
            match frames.next() {
                Some(Ok((got, picture))) if got == number => return Some(Ok(picture)),
                Some(Err(error)) => self.fail(&error),
                _ => return Some(Err(ClipError::VideoEnded { frame: number as u32 })),
            }
        }
        match self {
            VideoStream::Failed { code, reason, is_service_fault } => {
                let name = files.video.as_ref().map(|video| video.name.clone()).unwrap_or_default();
                let (reason, is_service_fault) = (reason.clone(), *is_service_fault);
                Some(Err(ClipError::VideoFailed { name, code, reason, is_service_fault }))
            }
            _ => None,
        }
    }

    fn fail(&mut self, error: &video::VideoError) {
        let (code, reason, is_service_fault) = (error.code(), error.to_string(), error.is_service_fault());
        *self = VideoStream::Failed { code, reason, is_service_fault };
    }
}
