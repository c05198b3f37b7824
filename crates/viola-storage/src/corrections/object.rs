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
        Ok(ObjectCorrection {
            class: change.class.unwrap_or(before.class),
            name: change.name.clone().unwrap_or(before.name),
            centre_m: change.centre_m.unwrap_or(before.centre_m),
            size_m: change.size_m.unwrap_or(before.size_m),
            yaw_rad: change.yaw_rad.unwrap_or(before.yaw_rad),
            pinned: change.pinned.unwrap_or(before.pinned),
            hidden: change.hidden.unwrap_or(before.hidden),
            // An object is pinned as it is seen at that time.
            seen: seen.filter(|_| is_pinned_now).unwrap_or(before.seen),
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
