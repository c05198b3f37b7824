//! A home.

use super::answer;
use super::names::HomeId;
use jiff::Timestamp;

answer! {
    /// A home, which has a LiDAR map and clips.
    struct Home from crate::storage::Home {
        id: HomeId,
        /// For people.
        #[schema(example = "Flat 3, Elm Street")]
        name: Option<String>,
        /// Revision of the current LiDAR map, null before the first one.
        #[schema(example = 2)]
        lidar_map_revision: Option<i64>,
        #[schema(example = 3)]
        clips: i64,
        #[schema(example = "2026-03-14T15:09:26.535Z")]
        created_at: Timestamp,
        /// Time of the newest change of the home or of anything in it: LiDAR map, clips, fused map.
        updated_at: Timestamp,
    }
}
