//! Clips of a home, as its map uses them.

use super::floor_correction::{FloorCorrection, pose_in_space, raised_pose};
use super::tile::TileKey;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};
use uuid::Uuid;
use viola_align::{Alignment, AlignmentState};
use viola_geometry::{LevelName, Point2, Pose2, Pose3};

/// A clip that may be in the map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Member {
    pub clip: Uuid,
    /// Recording time in milliseconds since 1970, if known.
    pub recorded_at_ms: Option<i64>,
    /// Hash of the recording, by its content or else by its file; orders clips whose times are unknown.
    pub sha256: String,
    /// Name of its contribution; each new alignment result has a new name.
    pub contribution: String,
    pub verdict: Verdict,
}

/// A clip's own alignment result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Verdict {
    Aligned {
        level: LevelName,
        map_from_clip: Pose2,
        covariance: Matrix3<f64>,
        probability: Option<f64>,
    },
    /// Pose chosen by a person.
    Chosen {
        level: LevelName,
        map_from_clip: Pose2,
        /// As that of a [`Mode`].
        rise_m: f64,
    },
    Ambiguous {
        alternatives: Vec<Mode>,
    },
    /// Without a pose in the map, but with a floor: other clips may place it.
    Unplaced,
}

/// A possible pose of a clip.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Mode {
    /// The level in whose LiDAR map the pose is.
    pub level: LevelName,
    pub map_from_clip: Pose2,
    /// Height of the clip frame's origin above the floor at this pose: 0 above the floor of the clip's answer.
    pub rise_m: f64,
    /// By the clip's own alignment.
    pub probability: f64,
}

/// Source of a clip's pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlacedBy {
    /// The clip's own alignment to the LiDAR map.
    Alignment,
    /// The other clips, which decided between its alternatives.
    Neighbours,
    /// A person's choice.
    Person,
}

/// A clip in the map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlacedClip {
    pub clip: Uuid,
    /// Name of its contribution.
    #[serde(rename = "share")]
    pub contribution: String,
    pub recorded_at_ms: Option<i64>,
    pub by: PlacedBy,
    pub probability: Option<f64>,
    /// The level in whose LiDAR map it is.
    #[serde(rename = "level_name", default, skip_serializing_if = "LevelName::is_main")]
    pub level: LevelName,
    /// Pose before joint refinement.
    pub alone: Pose2,
    /// Height of the clip frame's origin above the floor at that pose; see [`Mode`].
    #[serde(default, skip_serializing_if = "viola_geometry::is_zero")]
    pub rise_m: f64,
    /// Pose refined jointly with the clips that it overlaps.
    pub map_from_clip: Pose2,
    /// Height and tilt of that pose.
    #[serde(rename = "level")]
    pub floor_correction: FloorCorrection,
    /// Contributions of the clips that it was refined with.
    pub with: Vec<String>,
    pub extent: Extent,
    /// The tiles that depend on it.
    pub tiles: Vec<TileKey>,
    pub points: usize,
}

/// Bounding box of a clip's points and cameras, in the clip's frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Extent {
    pub min_m: [f64; 2],
    pub max_m: [f64; 2],
}

impl Member {
    /// Returns the canonical sort key: the content; the id only breaks ties of equal files.
    pub(super) fn order(&self) -> (Option<i64>, &str, &Uuid) {
        (self.recorded_at_ms, &self.sha256, &self.clip)
    }
}

impl Mode {
    /// Returns the pose in space.
    pub(super) fn in_space(&self) -> Pose3 {
        raised_pose(&self.map_from_clip, self.rise_m)
    }
}

impl Verdict {
    /// Returns the verdict of an alignment; `None` for one without a floor.
    pub fn of(alignment: &Alignment) -> Option<Verdict> {
        match alignment.state {
            AlignmentState::Aligned => Some(Verdict::Aligned {
                level: alignment.level,
                map_from_clip: alignment.map_from_clip?,
                covariance: Matrix3::from_fn(|r, c| alignment.covariance.map_or(0.0, |rows| rows[r][c])),
                probability: alignment.probability,
            }),
            AlignmentState::Ambiguous => Some(Verdict::Ambiguous {
                alternatives: alignment
                    .alternatives
                    .iter()
                    .map(|one| Mode {
                        level: one.level,
                        map_from_clip: one.map_from_clip,
                        rise_m: one.rise_m,
                        probability: one.probability.unwrap_or(0.0),
                    })
                    .collect(),
            }),
            AlignmentState::Failed => alignment.floor.as_ref().map(|_| Verdict::Unplaced),
        }
    }
}

impl PlacedClip {
    /// Returns its pose in space before joint refinement.
    pub fn alone_in_space(&self) -> Pose3 {
        raised_pose(&self.alone, self.rise_m)
    }

    /// Returns its pose in space.
    pub fn pose_in_space(&self) -> Pose3 {
        pose_in_space(&self.map_from_clip, &self.floor_correction)
    }
}

impl Extent {
    pub(super) fn around(points: impl Iterator<Item = [f64; 2]>) -> Extent {
        let mut extent = Extent { min_m: [f64::INFINITY; 2], max_m: [f64::NEG_INFINITY; 2] };
        for point in points {
            for (axis, c) in point.into_iter().enumerate() {
                extent.min_m[axis] = extent.min_m[axis].min(c);
                extent.max_m[axis] = extent.max_m[axis].max(c);
            }
        }
        // Without points: an empty box at the origin, which JSON can represent.
        if extent.min_m[0] > extent.max_m[0] { Extent { min_m: [0.0; 2], max_m: [0.0; 2] } } else { extent }
    }

    /// Returns the bounding box of this one in the map's frame.
    pub(super) fn in_map(&self, map_from_clip: &Pose2) -> Extent {
        let [[left, bottom], [right, top]] = [self.min_m, self.max_m];
        let corners = [[left, bottom], [right, bottom], [left, top], [right, top]];
        Extent::around(corners.into_iter().map(|[x, y]| {
            let at = map_from_clip.apply(&Point2::new(x, y));
            [at.x, at.y]
        }))
    }

    /// Returns the area that two clips may share, by their boxes in the map's frame: that of both, with a margin.
    pub(super) fn shared_m2(&self, other: &Extent) -> f64 {
        const MARGIN_M: f64 = 0.3;
        let side_m =
            |i: usize| self.max_m[i].min(other.max_m[i]) - self.min_m[i].max(other.min_m[i]) + MARGIN_M;
        side_m(0).max(0.0) * side_m(1).max(0.0)
    }
}
