//! The feed of changes.

use super::answer;
use super::clip::ClipState;
use super::names::HomeId;
use jiff::Timestamp;
use uuid::Uuid;

answer! {
    /// Kind of a change:
    /// - `home`: the home was made, renamed, or removed with everything in it.
    /// - `lidar_map`: the home's LiDAR map has a new revision, or a level was removed.
    /// - `clip`: the clip is new, or its state, placement, choice or title changed, or it was removed.
    /// - `map`: the home's fused map has a new revision.
    /// - `objects`: objects of the home's fused map were added, moved or are gone; `GET .../map/changes` tells which.
    enum ChangeKind from viola_storage::ChangeKind {
        Home,
        LidarMap,
        Clip,
        Map,
        Objects,
    }
}

answer! {
    /// The newest change of a home, of its LiDAR map, of a clip, of a fused map, or of its objects.
    struct Change from viola_storage::Change {
        /// Grows with every change, not always by 1.
        #[schema(minimum = 1, example = 4711)]
        seq: i64,
        at: Timestamp,
        home: HomeId,
        kind: ChangeKind,
        /// Id of the clip, for kind `clip`.
        #[schema(example = "01a1f766-7a97-7747-9dbb-391e0eeccb64")]
        clip: Option<Uuid>,
        /// Current revision, for kinds `lidar_map`, `map` and `objects`. After the removal of a level, that of `lidar_map` is the
        /// newest of the other levels, and may be the same as before.
        revision: Option<i64>,
        /// State of the clip, for kind `clip`; null if it was removed.
        state: Option<ClipState>,
        /// True if it was removed.
        deleted: bool,
    }
}

impl From<ChangeKind> for viola_storage::ChangeKind {
    fn from(kind: ChangeKind) -> viola_storage::ChangeKind {
        match kind {
            ChangeKind::Home => viola_storage::ChangeKind::Home,
            ChangeKind::LidarMap => viola_storage::ChangeKind::LidarMap,
            ChangeKind::Clip => viola_storage::ChangeKind::Clip,
            ChangeKind::Map => viola_storage::ChangeKind::Map,
            ChangeKind::Objects => viola_storage::ChangeKind::Objects,
        }
    }
}
