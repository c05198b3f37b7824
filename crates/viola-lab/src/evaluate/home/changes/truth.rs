//! True changes between two visits, as far as the clips of both visits can tell them.

use super::super::matching::Thing;
use super::super::shown::along;
use super::super::visit::Visit;
use crate::simulate::{Home, HomeObject};
use rustc_hash::FxHashMap;
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point3, Pose2};
use viola_home::{MIN_MOVE_M, is_furniture};

/// The changes between two visits, as boxes of what the clips saw, in the map.
#[derive(Debug, Clone, Default)]
pub struct TrueChanges {
    pub added: Vec<Thing>,
    pub moved: Vec<[Thing; 2]>,
    pub gone: Vec<Thing>,
    /// Other places where something changed: the clips do not decide what, it is small, it is not furniture, or it stands
    /// on a piece that changed.
    pub open: Vec<Thing>,
}

/// Returns the true changes between two visits of a home, before and after it changed.
pub fn true_changes(days: &[Home; 2], visits: &[Visit; 2], map_from_home: &Pose2) -> TrueChanges {
    let pieces = days.each_ref().map(Home::objects_alone);
    let mut partner: [FxHashMap<u16, u16>; 2] = Default::default();
    for (then, now) in days[1].same_pieces() {
        partner[0].insert(then, now);
        partner[1].insert(now, then);
    }
    let shown = |day: usize, piece: &HomeObject| -> Option<Shown> {
        let places = visits[day].places(piece.instance, piece.class)?;
        Some(Shown {
            thing: thing(piece, &places, map_from_home),
            is_looked_at: visits[1 - day].looks_at(&places),
        })
    };
    let mut changes = TrueChanges::default();
    for piece in &pieces[0] {
        let Some(now) = partner[0].get(&piece.instance) else {
            changes.push(shown(0, piece), None);
            changes.open.extend(on_piece(&visits[0], piece, map_from_home));
            continue;
        };
        let later = &pieces[1][usize::from(*now) - 1];
        if apart_m(piece, later) > 0.0 || piece.yaw_rad != later.yaw_rad {
            changes.open.extend(on_piece(&visits[0], piece, map_from_home));
            changes.open.extend(on_piece(&visits[1], later, map_from_home));
        }
        if apart_m(piece, later) >= MIN_MOVE_M {
            changes.push(shown(0, piece), shown(1, later));
        } else if apart_m(piece, later) > 0.0 || piece.yaw_rad != later.yaw_rad {
            let both = [shown(0, piece), shown(1, later)];
            changes.open.extend(both.into_iter().flatten().map(|shown| shown.thing));
        }
    }
    for piece in pieces[1].iter().filter(|piece| !partner[1].contains_key(&piece.instance)) {
        changes.push(None, shown(1, piece));
        changes.open.extend(on_piece(&visits[1], piece, map_from_home));
    }
    changes
}

/// Returns the furniture that the clips of a visit show, as boxes of what they saw, in the map.
pub fn shown_things(home: &Home, visit: &Visit, map_from_home: &Pose2) -> Vec<Thing> {
    let pieces = home.objects_alone();
    let shown = pieces.iter().filter_map(|piece| {
        let places = visit.places(piece.instance, piece.class)?;
        Some(thing(piece, &places, map_from_home)).filter(is_large)
    });
    shown.collect()
}

/// Returns the parts of other classes of a piece that a visit shows, such as the television on a cabinet.
fn on_piece(visit: &Visit, piece: &HomeObject, map_from_home: &Pose2) -> Vec<Thing> {
    let others = Class::ALL.iter().filter(|class| **class != piece.class);
    let of_class = |class: &Class| {
        let places = visit.places(piece.instance, *class)?;
        Some(Thing { class: *class, ..thing(piece, &places, map_from_home) })
    };
    others.filter_map(of_class).collect()
}

fn is_large(thing: &Thing) -> bool {
    is_furniture(thing.class) && thing.is_large()
}

/// The part of a piece that a visit shows.
struct Shown {
    thing: Thing,
    /// True if the other visit looked at its place.
    is_looked_at: bool,
}

impl TrueChanges {
    /// Adds a piece that is in one place in the first visit, and in another one in the second.
    fn push(&mut self, then: Option<Shown>, now: Option<Shown>) {
        let counts = |shown: &Shown| is_large(&shown.thing) && shown.is_looked_at;
        match (then, now) {
            (Some(then), Some(now)) if counts(&then) && is_large(&now.thing) => {
                self.moved.push([then.thing, now.thing])
            }
            (Some(then), None) if counts(&then) => self.gone.push(then.thing),
            (None, Some(now)) if counts(&now) => self.added.push(now.thing),
            (then, now) => self.open.extend([then, now].into_iter().flatten().map(|shown| shown.thing)),
        }
    }
}

fn thing(object: &HomeObject, places: &[Point3], map_from_home: &Pose2) -> Thing {
    let in_map = |place: &Point3| {
        let at = map_from_home.apply(&place.xy());
        [at.x, at.y, place.z]
    };
    let places: Vec<[f64; 3]> = places.iter().map(in_map).collect();
    Thing { class: object.class, bounds: along(&places, object.yaw_rad + map_from_home.yaw_rad) }
}

fn apart_m(a: &HomeObject, b: &HomeObject) -> f64 {
    (0..3).map(|axis| (a.centre_m[axis] - b.centre_m[axis]).powi(2)).sum::<f64>().sqrt()
}
