//! Remarks on a clip's files.

use viola_formats::clip::{Clip, ClipInfo};
use viola_reconstruct::Reason;

/// Maximum number of pictures without a frame, as a multiple of the frames. Depth cameras may be a few times slower than
/// colour cameras, or the other way round.
const MAX_INCOMPLETE: usize = 10;

/// Returns the remarks on the files of a clip.
pub(super) fn of(clip: &Clip) -> Vec<Reason> {
    [no_color(clip), few_frames(clip.info()), few_poses(clip.info())].into_iter().flatten().collect()
}

fn no_color(clip: &Clip) -> Option<Reason> {
    let detail = "the clip has no colour pictures; it is aligned by depth alone, without a network's labels";
    (!clip.has_color()).then(|| Reason::new("no_colour", detail))
}

/// Returns a reason if nearly all pictures are in no frame: the recording, or its file, may have been cut off.
fn few_frames(info: &ClipInfo) -> Option<Reason> {
    let detail = format!(
        "{} pictures have no counterpart and were left out, and only {} frames are complete; check that the recording was \
         not cut off",
        info.skipped_incomplete, info.frames
    );
    (info.skipped_incomplete > MAX_INCOMPLETE * info.frames).then(|| Reason::new("frames_broken", detail))
}

/// Returns a reason if most frames of a clip with poses have none: the recording of the poses may have been cut off.
fn few_poses(info: &ClipInfo) -> Option<Reason> {
    let is_cut = info.frames_with_pose > 0 && 2 * info.frames_with_pose < info.frames;
    let detail =
        format!("{} of {} frames have no pose and were left out", info.skipped_without_pose, info.frames);
    is_cut.then(|| Reason::new("frames_without_pose", detail))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the codes for a clip of 10 frames.
    fn codes(color_width: u32, frames_with_pose: usize, skipped_incomplete: usize) -> Vec<String> {
        let info = ClipInfo {
            frames_with_pose,
            skipped_without_pose: 10 - frames_with_pose,
            skipped_incomplete,
            ..ClipInfo::in_memory(10, [color_width; 2], [4, 3])
        };
        let clip = Clip::from_frames(info, Vec::new(), None, |_| unreachable!());
        of(&clip).into_iter().map(|reason| reason.code).collect()
    }

    #[test]
    fn a_clip_that_lacks_most_of_a_part_has_a_reason() {
        assert_eq!(codes(4, 10, 0), Vec::<String>::new());
        assert_eq!(codes(0, 10, 0), ["no_colour"]);
        // Depth at a sixth of the rate of colour leaves five pictures for each frame.
        assert_eq!(codes(4, 10, 50), Vec::<String>::new());
        assert_eq!(codes(4, 10, 101), ["frames_broken"]);
        assert_eq!(codes(4, 4, 0), ["frames_without_pose"]);
        assert_eq!(codes(4, 0, 0), Vec::<String>::new());
    }
}
