//! Selection of the samples to decode for the wanted frames.
//!
//! Decoding begins at an IDR picture, or at one of HEVC's CRA pictures if no picture shown before it is
//! wanted. A file's sync samples are not enough: H.264 recovery points are sync samples too, and pictures
//! after them may still reference earlier ones.

use super::nal::Entry;
use super::track::Track;
use super::{VideoError, region};
use crate::container::Region;
use std::collections::HashMap;

/// Samples for one decoder, in decoding order, and the wanted frames among them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Run {
    pub start: usize,
    /// The last sample of a wanted frame; no wanted frame needs a later one.
    pub last: usize,
    /// True if pictures shown before the first cannot be decoded and are left out.
    pub open: bool,
    /// Numbers of frames, ascending.
    pub wanted: Vec<usize>,
}

impl Run {
    /// Returns the samples to decode, in order.
    pub fn samples(&self, track: &Track) -> Vec<usize> {
        let from = track.samples[self.start].shown_at;
        let decoded = |sample: &usize| !self.open || track.samples[*sample].shown_at >= from;
        (self.start..=self.last).filter(decoded).collect()
    }
}

/// Returns the runs for `wanted`, which is ascending and within the track. Reads the possible start samples.
pub fn plan(region: &Region, track: &Track, wanted: &[usize]) -> Result<Vec<Run>, VideoError> {
    let mut entries = Entries { region, track, known: HashMap::new(), sync: Vec::new() };
    entries.sync = (0..track.samples.len()).filter(|sample| track.samples[*sample].sync).collect();
    // ffmpeg drops pictures shown before an open first picture, and does not number them.
    let first = track.samples[0].shown_at;
    if entries.of(0)? != Entry::Closed && track.samples.iter().any(|sample| sample.shown_at < first) {
        return Err(VideoError::Unsupported { what: "a first picture that is not the first shown" });
    }
    let mut runs: Vec<Run> = Vec::new();
    for &frame in wanted {
        let sample = track.shown[frame];
        let (start, open) = entries.before(sample)?;
        match runs.last_mut() {
            // To continue is cheaper than to start again right after, with the same result.
            Some(run) if start <= run.last + 1 && (!run.open || reaches(track, run, sample)) => {
                run.last = run.last.max(sample);
                run.wanted.push(frame);
            }
            _ => runs.push(Run { start, last: sample, open, wanted: vec![frame] }),
        }
    }
    Ok(runs)
}

fn reaches(track: &Track, run: &Run, sample: usize) -> bool {
    track.samples[sample].shown_at >= track.samples[run.start].shown_at
}

struct Entries<'a> {
    region: &'a Region,
    track: &'a Track,
    known: HashMap<usize, Entry>,
    /// Sync samples, ascending.
    sync: Vec<usize>,
}

impl Entries<'_> {
    /// Returns the nearest sample from which `sample` can be decoded, and whether it is an open one.
    fn before(&mut self, sample: usize) -> Result<(usize, bool), VideoError> {
        let until = self.sync.partition_point(|sync| *sync <= sample);
        for at in (0..until).rev() {
            let start = self.sync[at];
            if self.track.samples[start].shown_at > self.track.samples[sample].shown_at
                && self.of(start)? != Entry::Closed
            {
                continue;
            }
            match self.of(start)? {
                Entry::Closed => return Ok((start, false)),
                Entry::Open => return Ok((start, true)),
                Entry::None => {}
            }
        }
        Err(VideoError::malformed("pictures before the first at which decoding can begin"))
    }

    fn of(&mut self, sample: usize) -> Result<Entry, VideoError> {
        if let Some(entry) = self.known.get(&sample) {
            return Ok(*entry);
        }
        let found = self.track.samples[sample];
        let bytes = region::read(self.region, found.offset, found.bytes as usize)?;
        let picture = self.track.codec.picture(&bytes, self.track.length_bytes, &self.track.sps);
        let entry = picture.map_err(|cause| VideoError::Damaged { sample, cause: cause.to_owned() })?.entry;
        self.known.insert(sample, entry);
        Ok(entry)
    }
}
