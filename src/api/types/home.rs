//! A home.

use super::answer;
use super::home_map::MapState;
use super::names::{HomeId, LevelName};
use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;
use viola_storage::ClipState;

/// A home, which has LiDAR maps and clips.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub(in crate::api) struct Home {
    id: HomeId,
    /// For people.
    #[schema(example = "Flat 3, Elm Street")]
    name: Option<String>,
    /// Revision of the current LiDAR map, null before the first one.
    #[schema(example = 2)]
    lidar_map_revision: Option<i64>,
    #[schema(example = 3)]
    clips: i64,
    clips_by_state: ClipCounts,
    /// The part of each level's LiDAR map that the clips have seen; empty before the first fused map.
    coverage: Vec<LevelCoverage>,
    /// State of the newest fused map, as in `GET .../map`. Merges that fail do not move `updated_at`.
    map_state: MapState,
    /// The reasons for which a person should look at the home; empty if there are none.
    needs_attention: Vec<Attention>,
    #[schema(example = "2026-03-14T15:09:26.535Z")]
    created_at: Timestamp,
    /// Time of the newest change of the home or of anything in it: LiDAR map, clips, fused map.
    updated_at: Timestamp,
}

/// Number of clips in each state.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[schema(example = json!({"uploaded": 0, "queued": 0, "aligning": 1, "aligned": 2, "ambiguous": 0, "failed": 0}))]
pub(in crate::api) struct ClipCounts {
    uploaded: i64,
    queued: i64,
    aligning: i64,
    aligned: i64,
    ambiguous: i64,
    failed: i64,
}

answer! {
    /// The part of a level's LiDAR map that the clips have seen.
    struct LevelCoverage from viola_storage::LevelCoverage {
        level: LevelName,
        /// Fraction of the occupied points that the fused map explains.
        #[schema(minimum = 0, maximum = 1, example = 0.62)]
        seen: f64,
        /// Fraction of the free area over which the fused map has the floor or an object on it.
        #[schema(minimum = 0, maximum = 1, example = 0.71)]
        floor_seen: f64,
    }
}

/// A reason for which a person should look at a home:
/// - `waiting`: clips wait for the home's first LiDAR map, or their jobs were cancelled. Send the map, or align them again.
/// - `service_fault`: clips are queued with the reason `storage_fault`, `system_fault` or `worker_lost`. The service tries
///   again by itself, for a day; if it lasts, read the log of the service.
/// - `ambiguous`: clips have no certain pose. Choose one of their alternatives, or film more of the room.
/// - `failed`: clips have no pose. Their reasons say why; correct the cause, or film again.
/// - `map_failing`: the fused map could not be made at least twice in a row. Read the log of the service.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(in crate::api) enum Attention {
    Waiting,
    ServiceFault,
    Ambiguous,
    Failed,
    MapFailing,
}

impl From<viola_storage::Home> for Home {
    fn from(home: viola_storage::Home) -> Home {
        let count = |state: ClipState| {
            let states = ClipState::ALL.iter().zip(home.clips);
            states.filter(|(each, _)| **each == state).map(|(_, count)| count).sum::<i64>()
        };
        let needs = [
            (count(ClipState::Uploaded) > 0, Attention::Waiting),
            (home.clips_after_fault > 0, Attention::ServiceFault),
            (count(ClipState::Ambiguous) > 0, Attention::Ambiguous),
            (count(ClipState::Failed) > 0, Attention::Failed),
            (home.map_state == viola_storage::MapState::Failing, Attention::MapFailing),
        ];
        Home {
            lidar_map_revision: home.lidar_map_revision,
            clips: home.clips.iter().sum(),
            clips_by_state: ClipCounts {
                uploaded: count(ClipState::Uploaded),
                queued: count(ClipState::Queued),
                aligning: count(ClipState::Aligning),
                aligned: count(ClipState::Aligned),
                ambiguous: count(ClipState::Ambiguous),
                failed: count(ClipState::Failed),
            },
            needs_attention: needs.into_iter().filter(|(is_so, _)| *is_so).map(|(_, need)| need).collect(),
            map_state: home.map_state.into(),
            id: home.id.into(),
            name: home.name,
            coverage: home.coverage.into_iter().map(LevelCoverage::from).collect(),
            created_at: home.created_at,
            updated_at: home.updated_at,
        }
    }
}
