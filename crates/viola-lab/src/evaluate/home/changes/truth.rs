//! True changes between two visits, as far as the clips of both visits can tell them.

use super::super::MIN_EXTENT_M;
use super::super::matching::Thing;
use super::super::simulated::{MIN_POINTS, along};
use crate::simulate::{ClipParams, Home, HomeObject, Survey, View};
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};
use std::ops::Range;
use viola_geometry::taxonomy::Class;
use viola_geometry::{Pinhole, Point3, Pose2, Pose3};
use viola_home::{MIN_MOVE_M, is_furniture};

/// Side of the cells of a surface.
const CELL_M: f64 = 0.05;
/// Every so many pixels, along both axes, are used.
const STRIDE: usize = 3;
/// A place was looked at if the view measured a surface there or behind it.
const BEFORE_M: f64 = 0.1;
/// Minimum fraction of an object's surface whose place is looked at in the other visit.
const MIN_LOOKED_AT: f64 = 0.5;

type Cell = [i32; 3];

/// The noise-free views of the clips of a visit.
pub struct Visit {
    camera: Pinhole,
    range_m: f64,
    views: Vec<(View, Pose3)>,
    /// Surface of each piece that the views show, by the piece's number and the class: what stands on a piece is a
    /// part of it.
    seen: FxHashMap<(u16, Class), FxHashSet<Cell>>,
}

impl Visit {
    pub fn of(home: &Home, survey: &Survey, numbers: Range<u64>, params: &ClipParams) -> Visit {
        let of_clip = |number: u64| -> Vec<(View, Pose3)> {
            let clip = home.clip(survey, number, params);
            let poses = clip.truth.home_from_camera.iter().enumerate();
            poses.map(|(index, pose)| (clip.true_view(index), *pose)).collect()
        };
        let views: Vec<(View, Pose3)> = numbers.into_par_iter().flat_map_iter(of_clip).collect();
        let mut visit = Visit {
            camera: params.sensor.depth_camera(),
            range_m: params.sensor.range_m(),
            views,
            seen: FxHashMap::default(),
        };
        visit.seen = visit.surfaces(home);
        visit
    }

    fn surfaces(&self, home: &Home) -> FxHashMap<(u16, Class), FxHashSet<Cell>> {
        let mut seen: FxHashMap<(u16, Class), FxHashSet<Cell>> = FxHashMap::default();
        for (view, home_from_camera) in &self.views {
            let pixels = (0..view.height)
                .step_by(STRIDE)
                .flat_map(|y| (0..view.width).step_by(STRIDE).map(move |x| (x, y)));
            for (x, y) in pixels {
                let depth_m = f64::from(view.depth_m[y * view.width + x]);
                if depth_m > self.range_m {
                    continue;
                }
                let (class, piece) = home.scene().label(view.solid[y * view.width + x] as usize);
                if piece > 0 {
                    let at = home_from_camera * self.camera.unproject(x as f64, y as f64, depth_m);
                    let cell = [at.x, at.y, at.z].map(|c| (c / CELL_M).floor() as i32);
                    seen.entry((piece, class)).or_default().insert(cell);
                }
            }
        }
        seen
    }

    /// Returns the cells of a piece that the visit shows; none if they are too few to find it.
    fn shown(&self, piece: &HomeObject) -> Option<Vec<Point3>> {
        self.places(piece.instance, piece.class)
    }

    /// Returns what the visit shows of the other classes of a piece, such as the television on a cabinet.
    fn shown_on(&self, piece: &HomeObject, map_from_home: &Pose2) -> Vec<Thing> {
        let others = Class::ALL.iter().filter(|class| **class != piece.class);
        let of_class = |class: &Class| {
            let places = self.places(piece.instance, *class)?;
            Some(Thing { class: *class, ..thing(piece, &places, map_from_home) })
        };
        others.filter_map(of_class).collect()
    }

    fn places(&self, piece: u16, class: Class) -> Option<Vec<Point3>> {
        let cells = self.seen.get(&(piece, class)).filter(|cells| cells.len() >= MIN_POINTS)?;
        let mut cells: Vec<Cell> = cells.iter().copied().collect();
        cells.sort_unstable();
        Some(
            cells.into_iter().map(|cell| Point3::from(cell.map(|c| (f64::from(c) + 0.5) * CELL_M))).collect(),
        )
    }

    /// Returns whether the visit looked at most of these places.
    fn looks_at(&self, places: &[Point3]) -> bool {
        let is_looked_at =
            |place: &&Point3| self.views.iter().any(|(view, pose)| self.view_reaches(view, pose, place));
        let count = places.iter().filter(is_looked_at).count();
        count as f64 >= MIN_LOOKED_AT * places.len() as f64
    }

    fn view_reaches(&self, view: &View, home_from_camera: &Pose3, place: &Point3) -> bool {
        let at = home_from_camera.inverse() * place;
        if at.z < 0.1 || at.z > self.range_m {
            return false;
        }
        let Some(pixel) = self.camera.project(&at) else { return false };
        if pixel.x < 0.0 || pixel.y < 0.0 {
            return false;
        }
        let (x, y) = (pixel.x.round() as usize, pixel.y.round() as usize);
        x < view.width && y < view.height && f64::from(view.depth_m[y * view.width + x]) > at.z - BEFORE_M
    }
}

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
        let places = visits[day].shown(piece)?;
        Some(Shown {
            thing: thing(piece, &places, map_from_home),
            is_looked_at: visits[1 - day].looks_at(&places),
        })
    };
    let mut changes = TrueChanges::default();
    for piece in &pieces[0] {
        let Some(now) = partner[0].get(&piece.instance) else {
            changes.push(shown(0, piece), None);
            changes.open.extend(visits[0].shown_on(piece, map_from_home));
            continue;
        };
        let later = &pieces[1][usize::from(*now) - 1];
        if apart_m(piece, later) > 0.0 || piece.yaw_rad != later.yaw_rad {
            changes.open.extend(visits[0].shown_on(piece, map_from_home));
            changes.open.extend(visits[1].shown_on(later, map_from_home));
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
        changes.open.extend(visits[1].shown_on(piece, map_from_home));
    }
    changes
}

/// Returns the furniture that the clips of a visit show, as boxes of what they saw, in the map.
pub fn shown_things(home: &Home, visit: &Visit, map_from_home: &Pose2) -> Vec<Thing> {
    let pieces = home.objects_alone();
    let shown = pieces
        .iter()
        .filter_map(|piece| Some(thing(piece, &visit.shown(piece)?, map_from_home)).filter(is_large));
    shown.collect()
}

fn is_large(thing: &Thing) -> bool {
    is_furniture(thing.class) && thing.bounds.size_m.iter().any(|side| *side > MIN_EXTENT_M)
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
