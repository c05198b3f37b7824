//! Corrections of objects.

use super::{Correction, CorrectionError, CorrectionState};
use crate::{MapObject, MapScene};
use viola_geometry::Pose2;
use viola_geometry::taxonomy::Class;
use viola_home::{ObjectCorrection, Seen};

/// A change of an object's correction: `None` keeps a field, and `Some(None)` withdraws it. The values were
/// checked.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ObjectChange {
    pub class: Option<Option<Class>>,
    pub name: Option<Option<String>>,
    pub centre_m: Option<Option<[f64; 3]>>,
    pub size_m: Option<Option<[f64; 3]>>,
    pub yaw_rad: Option<Option<f64>>,
    pub pinned: Option<bool>,
    pub hidden: Option<bool>,
}

impl Correction for ObjectCorrection {
    const KIND: &'static str = "object";
    type Target = MapObject;
    type Change = ObjectChange;

    fn target(scene: &MapScene, id: &str) -> Option<MapObject> {
        scene.objects.iter().find(|object| object.id == id).cloned()
    }

    fn key(_: &MapScene, id: &str) -> String {
        id.to_owned()
    }

    fn check(_: &MapScene, _: &str, _: &ObjectChange) -> Result<(), CorrectionError> {
        Ok(())
    }

    fn changed(
        state: &CorrectionState<ObjectCorrection>,
        change: &ObjectChange,
        _: &MapScene,
        _: i64,
    ) -> Result<ObjectCorrection, CorrectionError> {
        let seen = state.shown.as_ref().map(seen);
        let kept = state.kept.as_ref().map(|kept| kept.correction.clone());
        let before = kept.or_else(|| seen.clone().map(ObjectCorrection::of)).ok_or(CorrectionError::NoMap)?;
        let is_pinned_now = change.pinned == Some(true) && !before.pinned;
        let pinned = seen.filter(|_| is_pinned_now).map(|seen| as_pinned(seen, &before));
        Ok(ObjectCorrection {
            class: change.class.unwrap_or(before.class),
            name: change.name.clone().unwrap_or(before.name),
            centre_m: change.centre_m.unwrap_or(before.centre_m),
            size_m: change.size_m.unwrap_or(before.size_m),
            yaw_rad: change.yaw_rad.unwrap_or(before.yaw_rad),
            pinned: change.pinned.unwrap_or(before.pinned),
            hidden: change.hidden.unwrap_or(before.hidden),
            seen: pinned.unwrap_or(before.seen),
        })
    }

    fn is_empty(&self) -> bool {
        ObjectCorrection::is_empty(self)
    }

    fn move_by(&mut self, now_from_then: &Pose2) {
        ObjectCorrection::move_by(self, now_from_then);
    }
}

fn seen(object: &MapObject) -> Seen {
    Seen {
        class: object.class,
        confidence: object.confidence,
        centre_m: object.centre_m,
        size_m: object.size_m,
        yaw_rad: object.yaw_rad,
    }
}

/// Returns an object as it is pinned: as it is seen at that time, but where clips saw it. What they saw in the place from
/// which a person moved it is no other object.
fn as_pinned(seen: Seen, before: &ObjectCorrection) -> Seen {
    Seen {
        centre_m: before.centre_m.map_or(seen.centre_m, |_| before.seen.centre_m),
        size_m: before.size_m.map_or(seen.size_m, |_| before.seen.size_m),
        yaw_rad: before.yaw_rad.map_or(seen.yaw_rad, |_| before.seen.yaw_rad),
        ..seen
    }
}

#[cfg(test)]
mod tests {
    use super::super::Kept;
    use super::*;
    use jiff::Timestamp;
    use viola_geometry::LevelName;
    use viola_home::Coverage;

    fn sofa(centre_m: [f64; 3], size_m: [f64; 3]) -> MapObject {
        MapObject {
            id: "sofa-1".to_owned(),
            level: LevelName::MAIN,
            class: Class::Sofa,
            confidence: 0.8,
            centre_m,
            size_m,
            yaw_rad: 0.0,
            room: None,
            points: 100,
            clips: Vec::new(),
            last_seen: None,
            name: None,
            corrected: Vec::new(),
        }
    }

    /// Returns the correction after a change of an object as the map shows it.
    fn corrected(
        shown: MapObject,
        before: Option<ObjectCorrection>,
        change: &ObjectChange,
    ) -> ObjectCorrection {
        let kept = |correction| Kept {
            target: "sofa-1".to_owned(),
            lidar_map_revision: 1,
            correction,
            corrected_at: Timestamp::UNIX_EPOCH,
        };
        let state = CorrectionState { shown: Some(shown), kept: before.map(kept) };
        let scene =
            MapScene { rooms: Vec::new(), objects: Vec::new(), coverage: Coverage::default(), history: None };
        ObjectCorrection::changed(&state, change, &scene, 1).unwrap()
    }

    #[test]
    fn a_moved_object_that_is_pinned_is_known_where_clips_saw_it() {
        let (from_m, to_m, size_m, later_m) =
            ([1.0, 1.0, 0.4], [4.0, 2.0, 0.4], [2.0, 0.9, 0.8], [2.2, 1.0, 0.8]);
        let put = ObjectChange { centre_m: Some(Some(to_m)), ..ObjectChange::default() };
        let pin = ObjectChange { pinned: Some(true), ..ObjectChange::default() };
        let moved = corrected(sofa(from_m, size_m), None, &put);
        // The next revision shows it where it was put, and more of it.
        let pinned = corrected(sofa(to_m, later_m), Some(moved), &pin);
        assert_eq!((pinned.centre_m, pinned.seen.centre_m), (Some(to_m), from_m));
        assert_eq!(pinned.seen.size_m, later_m);
        let unmoved = corrected(sofa(to_m, later_m), None, &pin);
        assert_eq!((unmoved.centre_m, unmoved.seen.centre_m), (None, to_m));
    }
}
