//! `map.json`: the clips of a home with their poses, and the contents of its map.

use super::clip::HomeClip;
use super::content::Content;
use jiff::Timestamp;
use serde::Serialize;
use uuid::Uuid;
use viola_formats::lidar::LidarInfo;
use viola_geometry::{LevelName, Pose2};
use viola_home::{Coverage, HomeMapInfo, PlacedBy};
use viola_reconstruct::Reason;
use viola_storage::{ClipState, MapClip, reasons_of_placement};

/// Contents of `map.json`.
#[derive(Debug, Serialize)]
pub struct MapDocument {
    /// First the clips in the map, in its order: points name a clip by its index here. Then the others.
    pub clips: Vec<ClipDocument>,
    /// Contents of all levels.
    pub info: HomeMapInfo,
    /// Of the level `main`, or of the first by name.
    pub coverage: Coverage,
    pub lidar: LidarInfo,
    /// By the levels' names.
    pub levels: Vec<LevelDocument>,
}

/// One level in `map.json`.
#[derive(Debug, Serialize)]
pub struct LevelDocument {
    pub level: LevelName,
    pub info: HomeMapInfo,
    pub coverage: Coverage,
    pub lidar: LidarInfo,
}

/// A clip in `map.json`. Fields that the API has too have its names and meanings.
#[derive(Debug, Serialize)]
pub struct ClipDocument {
    /// Id of the clip, a function of its content; null if the file cannot be read, and for a folder that is no clip.
    pub clip: Option<Uuid>,
    /// The argument that names it; of several arguments with the same recording the one with the lowest `sha256`, and of those
    /// the first in byte order.
    pub file: String,
    pub sha256: Option<String>,
    pub state: ClipState,
    /// The level in whose LiDAR map the pose is.
    pub level: Option<LevelName>,
    /// Pose in the map, else that of the clip's own alignment; null if it has none.
    pub map_from_clip: Option<Pose2>,
    /// Height of the clip frame's origin above the floor in the map, in metres: not 0 if the others placed the clip above another
    /// floor than that of its own answer.
    pub rise_m: f64,
    /// Probability that the pose is right to 10 degrees and 0.3 m, 0..1: by all clips together if the clip is in the map, as in
    /// the service's map. `state` is by the clip alone, unless the others decided.
    pub probability: Option<f64>,
    /// Metres per unit of the clip's depth, if the unit was unknown; null if it is metres.
    pub scale: Option<f64>,
    /// Source of the pose in the map; null if the clip is not in the map.
    pub by: Option<PlacedBy>,
    pub recorded_at: Option<Timestamp>,
    /// Points that the clip contributed to the map.
    pub points: usize,
    /// Distance by which the refinement moved the clip in the map, and angle by which it turned it.
    pub moved_m: Option<f64>,
    pub moved_deg: Option<f64>,
    pub reasons: Vec<Reason>,
}

impl ClipDocument {
    /// Returns the document of a clip; `placed` is the clip in the map, if it is there.
    pub fn new(clip: &HomeClip, placed: Option<&MapClip>) -> ClipDocument {
        let by = placed.map(|placed| placed.by);
        let own = clip.answer.as_ref().ok();
        let state = match own.map(|alignment| alignment.state) {
            Some(_) if by.is_some() => ClipState::Aligned,
            Some(state) => state.into(),
            None => ClipState::Failed,
        };
        let own_reasons = || match &clip.answer {
            Ok(alignment) => alignment.reasons.clone(),
            Err(reason) => vec![reason.clone()],
        };
        ClipDocument {
            clip: clip.content.as_ref().map(Content::id),
            file: clip.file.clone(),
            sha256: clip.content.as_ref().map(Content::sha256),
            state,
            level: match placed {
                Some(placed) => Some(placed.level),
                None => own.map(|alignment| alignment.level),
            },
            map_from_clip: match placed {
                Some(placed) => Some(placed.map_from_clip),
                None => own.and_then(|alignment| alignment.map_from_clip),
            },
            rise_m: placed.map_or(0.0, |placed| placed.rise_m),
            probability: match placed {
                Some(placed) => placed.probability,
                None => own.and_then(|alignment| alignment.probability),
            },
            scale: own.and_then(|alignment| alignment.scale),
            by,
            recorded_at: clip.recorded_at,
            points: placed.map_or(0, |placed| placed.points),
            moved_m: placed.map(|placed| placed.moved_m),
            moved_deg: placed.map(|placed| placed.moved_deg),
            reasons: reasons_of_placement(by).unwrap_or_else(own_reasons),
        }
    }
}

/// Returns whether every clip has a pose, of its own alignment or by the others.
pub fn all_have_poses(clips: &[ClipDocument]) -> bool {
    clips.iter().all(|clip| clip.map_from_clip.is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_align::{Alignment, AlignmentState};

    fn clip(state: AlignmentState) -> HomeClip {
        let answer = Alignment {
            state,
            probability: Some(0.4),
            map_from_clip: (state != AlignmentState::Failed).then_some(Pose2::new(1.0, 2.0, 0.5)),
            reasons: vec![Reason::new("own", "the clip's own reason")],
            ..Alignment::failed()
        };
        HomeClip { file: "a.zip".to_owned(), content: None, recorded_at: None, answer: Ok(answer) }
    }

    fn placed(by: PlacedBy) -> MapClip {
        MapClip {
            clip: Uuid::nil(),
            level: LevelName::MAIN,
            map_from_clip: Pose2::new(3.0, 4.0, 0.0),
            rise_m: 0.0,
            by,
            probability: Some(0.9),
            recorded_at: None,
            points: 7,
            moved_m: 0.1,
            moved_deg: 0.2,
        }
    }

    #[test]
    fn a_clip_in_the_map_has_the_maps_pose_and_state() {
        use AlignmentState::{Aligned, Ambiguous, Failed};
        use PlacedBy::{Alignment, Neighbours};
        for (own, by, state, x_m, probability, reason) in [
            (Aligned, Some(Alignment), ClipState::Aligned, Some(3.0), 0.9, "own"),
            (Ambiguous, Some(Neighbours), ClipState::Aligned, Some(3.0), 0.9, "decided_by_neighbours"),
            (Ambiguous, None, ClipState::Ambiguous, Some(1.0), 0.4, "own"),
            (Failed, Some(Neighbours), ClipState::Aligned, Some(3.0), 0.9, "decided_by_neighbours"),
            (Failed, None, ClipState::Failed, None, 0.4, "own"),
        ] {
            let document = ClipDocument::new(&clip(own), by.map(placed).as_ref());
            let pose = document.map_from_clip.map(|pose| pose.x_m);
            assert_eq!((document.state, pose), (state, x_m), "{own:?} {by:?}");
            assert_eq!((document.by, document.probability), (by, Some(probability)), "{own:?} {by:?}");
            assert_eq!(document.reasons[0].code, reason, "{own:?} {by:?}");
            // The exit code of `viola map`: a clip that the others place has a pose too.
            assert_eq!(all_have_poses(&[document]), x_m.is_some(), "{own:?} {by:?}");
        }
    }
}
