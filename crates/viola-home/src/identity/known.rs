//! An object that had an id, as the next revision recognises it.

use super::super::assemble::LookedThrough;
use super::super::objects::{Object, UprightBox};
use super::evidence;
use super::evidence::KnownPoint;
use serde::{Deserialize, Serialize};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Pose2};

/// Distance from which an object counts as moved: boxes shift by a few centimetres with every clip.
pub const MIN_MOVE_M: f64 = 0.25;

/// An object that had an id, where it was found last. Corrections of people do not change it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KnownObject {
    pub id: String,
    pub class: Class,
    pub centre_m: [f64; 3],
    pub size_m: [f64; 3],
    pub yaw_rad: f64,
    /// Number of revisions since it was found, of those that rebuilt its place; 0 if the last revision has it.
    pub missing: u32,
    /// Points of its surface.
    #[serde(default)]
    pub points: Vec<KnownPoint>,
    /// True if clips looked through its place before it was seen there: it was added to the home.
    #[serde(default)]
    pub is_new: bool,
    /// True if clips looked through its place after it was seen there, and it is not found: it is gone.
    #[serde(default)]
    pub is_gone: bool,
    /// Number of times that it was found in a slightly different place, after clips looked through the earlier one.
    #[serde(default)]
    pub moves: u32,
    /// The place from which its next move is measured, if it is not the last one: small steps add up to a move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moves_from: Option<KnownPlace>,
}

/// An earlier place of an object, and points of its surface there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KnownPlace {
    pub centre_m: [f64; 3],
    pub points: Vec<KnownPoint>,
}

impl KnownObject {
    /// Returns an object that the last revision has.
    pub fn found(id: String, class: Class, bounds: &UprightBox) -> KnownObject {
        let UprightBox { centre_m, size_m, yaw_rad } = *bounds;
        KnownObject {
            id,
            class,
            centre_m,
            size_m,
            yaw_rad,
            missing: 0,
            points: Vec::new(),
            is_new: false,
            is_gone: false,
            moves: 0,
            moves_from: None,
        }
    }

    /// Returns an object of the next revision, which was found before as `last` if at all.
    pub(super) fn next(object: &Object, last: Option<&KnownObject>, looked: &LookedThrough) -> KnownObject {
        let found = KnownObject::found(object.id.clone(), object.class, &object.bounds());
        let points = evidence::points_of(object, looked);
        let Some(last) = last else {
            return KnownObject {
                is_new: evidence::was_empty(&object.bounds(), &points, looked),
                points,
                ..found
            };
        };
        let last_place = || KnownPlace { centre_m: last.centre_m, points: last.points.clone() };
        let from = last.moves_from.clone().unwrap_or_else(last_place);
        let apart_m =
            (0..3).map(|axis| (from.centre_m[axis] - found.centre_m[axis]).powi(2)).sum::<f64>().sqrt();
        let is_apart = apart_m >= MIN_MOVE_M;
        let has_moved = is_apart && evidence::is_pushed(&from.points, &points, looked);
        // An object that was gone came back, unless no clip of the map looked through its place: that clip was deleted.
        let came_back =
            last.is_gone && evidence::is_empty(&last.bounds(), &last.points, looked).unwrap_or(true);
        KnownObject {
            points,
            is_new: last.is_new || came_back,
            moves: last.moves.saturating_add(u32::from(has_moved)),
            // An object that is apart and was not pushed was seen better. Points of deleted clips are not kept.
            moves_from: Some(from).filter(|from| !is_apart && evidence::is_of_map(&from.points, looked)),
            ..found
        }
    }

    /// Returns whether an object in its place is only what is left of it: its place is empty since, and no later clip
    /// sees what is found there.
    pub(super) fn is_left_over(&self, object: &Object, looked: &LookedThrough) -> bool {
        evidence::is_empty(&self.bounds(), &self.points, looked).unwrap_or(self.is_gone)
            && !evidence::is_seen_later(&self.points, &evidence::points_of(object, looked))
    }

    /// Returns whether it is gone, and later clips see an object in its place.
    pub(super) fn is_replaced_by(&self, object: &Object, looked: &LookedThrough) -> bool {
        self.is_gone && evidence::is_seen_later(&self.points, &evidence::points_of(object, looked))
    }

    /// Counts a revision in which it is not found, if the revision could have shown it.
    pub(super) fn miss(&mut self, looked: &LookedThrough) {
        let [x, y, _] = self.centre_m;
        let is_remade = self.bounds().corners().into_iter().chain([[x, y]]).any(|at| looked.is_remade(at));
        // Otherwise the points of a deleted clip would stay until somebody films their place again.
        let is_counted = is_remade || !evidence::is_of_map(&self.points, looked);
        self.missing = self.missing.saturating_add(u32::from(is_counted)).max(1);
        self.moves_from = None;
        // The clip that looked through its place may be deleted since.
        self.is_gone = evidence::is_empty(&self.bounds(), &self.points, looked).unwrap_or(self.is_gone);
    }

    pub fn bounds(&self) -> UprightBox {
        UprightBox { centre_m: self.centre_m, size_m: self.size_m, yaw_rad: self.yaw_rad }
    }

    /// Brings its places into another frame.
    pub(super) fn move_by(&mut self, now_from_then: &Pose2) {
        let moved = self.bounds().moved(now_from_then);
        (self.centre_m, self.yaw_rad) = (moved.centre_m, moved.yaw_rad);
        move_points(&mut self.points, now_from_then);
        if let Some(from) = &mut self.moves_from {
            let at = now_from_then.apply(&Point2::new(from.centre_m[0], from.centre_m[1]));
            [from.centre_m[0], from.centre_m[1]] = [at.x, at.y];
            move_points(&mut from.points, now_from_then);
        }
    }
}

fn move_points(points: &mut [KnownPoint], now_from_then: &Pose2) {
    for KnownPoint([x, y, _], _) in points {
        let at = now_from_then.apply(&Point2::new(f64::from(*x), f64::from(*y)));
        (*x, *y) = (at.x as f32, at.y as f32);
    }
}
