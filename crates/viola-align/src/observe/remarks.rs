//! Remarks on a clip's files.

use viola_formats::clip::Clip;
use viola_reconstruct::Reason;

/// Returns the remarks on the files of a clip.
pub(super) fn of(clip: &Clip) -> Vec<Reason> {
    no_color(clip).into_iter().chain(few_poses(clip)).collect()
}

fn no_color(clip: &Clip) -> Option<Reason> {
    let detail = "the clip has no colour pictures; it is aligned by depth alone, without a network's labels";
    (!clip.has_color()).then(|| Reason::new("no_colour", detail))
}

/// Returns a reason if most frames of a clip with poses have none: the recording of the poses may have been cut off.
fn few_poses(clip: &Clip) -> Option<Reason> {
    let info = clip.info();
    let is_cut = info.frames_with_pose > 0 && 2 * info.frames_with_pose < info.frames;
    let detail =
        format!("{} of {} frames have no pose and were left out", info.skipped_without_pose, info.frames);
    is_cut.then(|| Reason::new("frames_without_pose", detail))
}
