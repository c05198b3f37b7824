//! Changes of a correction. In each field `None` keeps it and `Some(None)` withdraws it.

use viola_geometry::taxonomy::Class;
use viola_home::{ObjectCorrection, Seen};

/// A change of an object's correction. The values were checked.
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

/// A change of a room's correction. The values were checked.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RoomChange {
    pub name: Option<Option<String>>,
    /// Ids of the rooms that become one with it.
    pub merge_with: Option<Option<Vec<String>>>,
    /// Two points of the line that divides it.
    pub split_by: Option<Option<[[f64; 2]; 2]>>,
}

impl ObjectChange {
    /// Returns a correction after the change. An object is pinned as it was `seen` then.
    pub(super) fn apply(&self, before: ObjectCorrection, seen: Option<Seen>) -> ObjectCorrection {
        let is_pinned_now = self.pinned == Some(true) && !before.pinned;
        ObjectCorrection {
            class: self.class.unwrap_or(before.class),
            name: self.name.clone().unwrap_or(before.name),
            centre_m: self.centre_m.unwrap_or(before.centre_m),
            size_m: self.size_m.unwrap_or(before.size_m),
            yaw_rad: self.yaw_rad.unwrap_or(before.yaw_rad),
            pinned: self.pinned.unwrap_or(before.pinned),
            hidden: self.hidden.unwrap_or(before.hidden),
            seen: seen.filter(|_| is_pinned_now).unwrap_or(before.seen),
        }
    }
}
