//! Decoding in this process, one sample at a time.

use super::decoder::{Decoder, Failure, Planes};
use super::plan::{self, Run};
use super::track::Track;
use super::{VideoError, region};
use crate::container::Region;
use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::Arc;

/// Result of a step.
pub enum Step {
    /// A sample was decoded, and no frame is due yet.
    Working,
    Frame(usize, Planes),
    Done,
}

/// The wanted frames, in order. Holds only the pictures that wait for one shown before them.
pub struct Inside {
    region: Region,
    track: Arc<Track>,
    runs: VecDeque<Run>,
    active: Option<Active>,
}

impl Inside {
    pub fn open(region: Region, track: Arc<Track>, wanted: &[usize]) -> Result<Inside, VideoError> {
        let runs = plan::plan(&region, &track, wanted)?.into();
        Ok(Inside { region, track, runs, active: None })
    }

    /// Returns the next frame, or `None` after the last one.
    pub fn next(&mut self) -> Result<Option<(usize, Planes)>, VideoError> {
        loop {
            match self.step()? {
                Step::Working => {}
                Step::Frame(number, planes) => return Ok(Some((number, planes))),
                Step::Done => return Ok(None),
            }
        }
    }

    /// Decodes one more sample, or returns a frame that is due.
    pub fn step(&mut self) -> Result<Step, VideoError> {
        let Some(active) = &mut self.active else {
            let Some(run) = self.runs.pop_front() else { return Ok(Step::Done) };
            self.active = Some(Active::begin(run, &self.track)?);
            return Ok(Step::Working);
        };
        if let Some((number, planes)) = active.due() {
            return Ok(Step::Frame(number, planes));
        }
        if active.wanted.is_empty() {
            self.active = None;
        } else {
            active.advance(&self.region, &self.track)?;
        }
        Ok(Step::Working)
    }
}

/// A run that is being decoded.
struct Active {
    decoder: Decoder,
    /// Samples for the decoder, in order, and the number that it got.
    samples: Vec<usize>,
    fed: usize,
    /// The samples in the output order of their pictures, and the number of pictures so far.
    order: Vec<usize>,
    came: usize,
    finished: bool,
    /// Number of the wanted frame of a sample.
    numbers: HashMap<usize, usize>,
    /// Wanted frames that are not returned yet, ascending.
    wanted: VecDeque<usize>,
    /// Those of them that are decoded.
    decoded: BTreeMap<usize, Planes>,
}

impl Active {
    fn begin(run: Run, track: &Track) -> Result<Active, VideoError> {
        let samples = run.samples(track);
        let mut order = samples.clone();
        if Decoder::in_order_of_showing(track.codec) {
            order.sort_by_key(|sample| track.samples[*sample].shown_at);
        }
        let numbers = run.wanted.iter().map(|number| (track.shown[*number], *number)).collect();
        Ok(Active {
            decoder: Decoder::new(track).map_err(|failure| failed(failure, run.start))?,
            samples,
            fed: 0,
            order,
            came: 0,
            finished: false,
            numbers,
            wanted: run.wanted.into(),
            decoded: BTreeMap::new(),
        })
    }

    fn due(&mut self) -> Option<(usize, Planes)> {
        let planes = self.decoded.remove(self.wanted.front()?)?;
        Some((self.wanted.pop_front()?, planes))
    }

    fn advance(&mut self, region: &Region, track: &Track) -> Result<(), VideoError> {
        let Some(&sample) = self.samples.get(self.fed) else { return self.finish(track) };
        let found = track.samples[sample];
        let bytes = region::read(region, found.offset, found.bytes as usize)?;
        let picture = track.codec.picture(&bytes, track.length_bytes, &track.sps);
        let picture = picture.map_err(|cause| self.damaged(cause))?;
        let planes = self.decoder.feed(&picture.units).map_err(|failure| failed(failure, sample))?;
        self.fed += 1;
        planes.into_iter().try_for_each(|planes| self.take(planes, track))
    }

    fn finish(&mut self, track: &Track) -> Result<(), VideoError> {
        if self.finished {
            return Err(self.damaged("a wanted frame did not come out"));
        }
        let planes = self.decoder.finish().map_err(|failure| failed(failure, self.at()))?;
        self.finished = true;
        // If one were missing, all later ones would get wrong numbers.
        if self.came + planes.len() != self.order.len() {
            return Err(self.damaged("a picture did not come out"));
        }
        planes.into_iter().try_for_each(|planes| self.take(planes, track))
    }

    fn take(&mut self, planes: Planes, track: &Track) -> Result<(), VideoError> {
        let format = track.format;
        if !planes.are(format) {
            return Err(self.damaged("a picture is not of the track's size"));
        }
        let Some(sample) = self.order.get(self.came) else {
            return Err(self.damaged("more pictures came out than went in"));
        };
        self.came += 1;
        if let Some(&number) = self.numbers.get(sample) {
            self.decoded.insert(number, planes);
        }
        Ok(())
    }

    /// Returns the sample that the decoder got last.
    fn at(&self) -> usize {
        self.samples.get(self.fed.saturating_sub(1)).copied().unwrap_or(0)
    }

    fn damaged(&self, cause: &str) -> VideoError {
        VideoError::Damaged { sample: self.at(), cause: cause.to_owned() }
    }
}

fn failed(failure: Failure, sample: usize) -> VideoError {
    match failure {
        Failure::Refused(cause) => VideoError::Damaged { sample, cause },
        Failure::Broke => VideoError::DecoderBroke { sample },
    }
}
