//! One clip of a home: its own alignment.

use super::content::Content;
use super::contributions::Contributions;
use crate::api::recorded_at_of_file;
use crate::cli::wrong_file::unpacked_in;
use crate::jobs::{AlignJobError, Finished, JobParams, align_opened};
use anyhow::Result;
use jiff::Timestamp;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use viola_align::{Alignment, LevelMap};
use viola_formats::clip::{Clip, ClipError};
use viola_formats::container::ContainerError;
use viola_geometry::progress::Progress;
use viola_home::{Member, Verdict};
use viola_reconstruct::Reason;

/// A clip of the home and its own alignment.
pub struct HomeClip {
    /// The argument that names it.
    pub file: String,
    /// `None` if its bytes cannot be read.
    pub content: Option<Content>,
    /// Time of recording, if the file has it.
    pub recorded_at: Option<Timestamp>,
    /// The answer of the method, or the reason why there is none.
    pub answer: Result<Alignment, Reason>,
}

impl HomeClip {
    /// Returns a clip whose bytes were not read.
    pub fn refused(path: &Path, reason: Reason) -> HomeClip {
        HomeClip { file: path.display().to_string(), content: None, recorded_at: None, answer: Err(reason) }
    }

    /// Takes the answer of another argument with the same recording.
    pub fn take_answer(&mut self, copy: HomeClip) {
        (self.recorded_at, self.answer) = (copy.recorded_at, copy.answer);
    }

    /// Adds another argument with the same recording; the lower one names the clip, whatever their order.
    pub fn add_copy(&mut self, content: Content, file: String) {
        let copy = (Some(content), file);
        if copy < (self.content.clone(), self.file.clone()) {
            (self.content, self.file) = copy;
        }
    }

    /// Returns the clip as a member of the home; `None` without a pose.
    pub fn member(&self) -> Option<Member> {
        let (content, alignment) = (self.content.as_ref()?, self.answer.as_ref().ok()?);
        Some(Member {
            clip: content.id(),
            recorded_at_ms: self.recorded_at.map(Timestamp::as_millisecond),
            sha256: content.recording(),
            contribution: content.recording(),
            verdict: Verdict::of(alignment)?,
        })
    }
}

/// Returns the reason of a clip that has no answer; without room to unpack it, with the folder that it is unpacked in.
fn reason_of(failure: &AlignJobError) -> Reason {
    let Reason { code, detail } = failure.reason();
    match failure {
        AlignJobError::Clip(ClipError::Container(ContainerError::CannotUnpack { .. })) => {
            Reason { code, detail: format!("{detail}; {}", unpacked_in()) }
        }
        _ => Reason { code, detail },
    }
}

/// Aligns clips to the home's LiDAR maps and keeps their contributions.
pub struct Aligner<'a> {
    pub levels: &'a [LevelMap<'a>],
    pub params: &'a JobParams,
    pub contributions: Contributions,
}

impl Aligner<'_> {
    /// Returns the content of a clip, or why it has none. A folder that is no clip is refused before its bytes are read: it may
    /// be that of all recordings.
    pub fn content(&self, path: &Path) -> Result<Content, Reason> {
        let open = || Clip::open_with(path, &self.params.video).map(drop);
        if path.is_dir()
            // A panic is reported by the alignment.
            && let Ok(Err(error)) = catch_unwind(AssertUnwindSafe(open))
        {
            return Err(reason_of(&AlignJobError::from(error)));
        }
        Content::of(path).map_err(|error| Reason::new("unreadable", format!("{error:#}")))
    }

    /// Aligns a clip. A clip that cannot be used is no error; a contribution that cannot be kept is one.
    pub fn align(&mut self, path: &Path, content: Content, progress: &dyn Progress) -> Result<HomeClip> {
        let tried = catch_unwind(AssertUnwindSafe(|| self.finish(path, progress)));
        let (recorded_at, answer) = match tried {
            Ok(Ok((recorded_at, finished))) => {
                self.contributions.keep(&content.recording(), &finished)?;
                (recorded_at, Ok(finished.alignment))
            }
            Ok(Err(failure)) => (None, Err(reason_of(&failure))),
            Err(_) => (None, Err(Reason::new("internal_error", "the method panicked on this clip"))),
        };
        Ok(HomeClip { file: path.display().to_string(), content: Some(content), recorded_at, answer })
    }

    fn finish(
        &self,
        path: &Path,
        progress: &dyn Progress,
    ) -> Result<(Option<Timestamp>, Finished), AlignJobError> {
        let clip = Clip::open_with(path, &self.params.video)?;
        let clip = if self.params.unknown_scale { clip.with_unknown_scale() } else { clip };
        let finished = align_opened(&clip, self.levels, &self.params.align, progress)?;
        Ok((recorded_at_of_file(clip.info()), finished))
    }
}
