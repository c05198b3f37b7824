//! The pose before the labels: a network may take half a minute for the pictures, and rarely changes the pose.

use crate::observe::Fusion;
use crate::register::register;
use crate::within::Within;
use crate::{AlignError, AlignParams, AlignmentState, Target};
use viola_geometry::progress::{EarlyPose, Progress, Stage};

/// Reports the pose by shape alone if pictures will be labelled, the caller wants it, and it stands out.
///
/// Labels of pictures can change the pose: they tell tables from the floor, and objects belong in some of the
/// named rooms. The answer therefore does not use this pose.
pub(super) fn report(
    fusion: &Fusion,
    targets: &[&Target],
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<(), AlignError> {
    if params.label.segmenter.is_none() || !progress.wants_early_pose() {
        return Ok(());
    }
    progress.enter(Stage::Label);
    let within = Within(progress);
    let answer = register(&fusion.observe_shape(params, &within)?, targets, params, &within)?;
    if answer.state == AlignmentState::Aligned
        && let (Some(map_from_clip), Some(probability)) = (answer.map_from_clip, answer.probability)
    {
        progress.early_pose(EarlyPose { level: answer.level, map_from_clip, probability });
    }
    Ok(())
}
