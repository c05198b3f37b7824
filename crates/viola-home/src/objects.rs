//! Detection of objects (furniture and appliances) in the fused map's labelled points.
//!
//! Labels of single voxels are noisy, so neighbouring cells of one surface vote together. Connected cells of
//! one class form a fragment, fragments of one object are joined, and the object's class follows from its
//! labels and its size.

mod cells;
mod conflict;
mod context;
pub(super) mod fit;
mod fragment;
mod hidden;
mod join;
mod kind;
mod kitchen;
mod nesting;
mod patch;
mod place;
mod split;
mod tray;

pub use fit::{UprightBox, fit_box, half_turn};
pub use kind::is_furniture;
pub use nesting::{Nesting, nesting, surrounds};
pub use place::room_of;

use super::map_point::MapPoint;
use super::rooms::Room;
use cells::Cells;
use fragment::Fragment;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use viola_geometry::progress::{Cancelled, Progress, Silent};
use viola_geometry::taxonomy::Class;
use viola_reconstruct::CloudPoint;

/// Side of the cells; at least one and a half voxels.
const CELL_M: f64 = 0.06;
/// Minimum surface of an object, in square metres.
const MIN_SURFACE_M2: f64 = 0.12;
/// The same of boards and lamps.
const MIN_SMALL_M2: f64 = 0.045;
/// Minimum length of its longest side, in metres.
const MIN_SIDE_M: f64 = 0.25;
/// Minimum confidence of an object that a network saw in pictures; it understates how often such an object is right.
const MIN_CONFIDENCE: f64 = 0.25;
/// Minimum confidence of an object by its surface alone: the best F1 score on maps of simulated clips
/// (docs/experiments.md, A home's map). About as many such objects are right as their confidence says.
const MIN_CONFIDENCE_BY_SURFACE: f64 = 0.45;
/// Minimum fraction of an object's points for a clip to be listed.
const CLIP_FRACTION: f64 = 0.05;
/// Maximum number of an object's samples.
const SAMPLES: usize = 24;

/// An object in the LiDAR map's frame: an upright box with a class.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Object {
    pub id: String,
    pub class: Class,
    /// In 0..1: from the class's mean probability, the fit of its size and the number of cells.
    pub confidence: f64,
    pub centre_m: [f64; 3],
    /// Length, width and height, along its own x, y and z. The length is at least the width.
    pub size_m: [f64; 3],
    /// Yaw of its own x axis, in [0, pi).
    pub yaw_rad: f64,
    /// Id of its room.
    pub room: Option<String>,
    /// Number of its points in the fused map.
    pub points: usize,
    /// Clips with at least 5 % of its points, by their indices in the map's list.
    pub clips: Vec<u16>,
    /// Points of its surface, evenly spread.
    #[serde(skip)]
    pub samples: Vec<Sample>,
}

/// A point of an object's surface, and the clip that saw it best, by its index in the map's list.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    pub at_m: [f32; 3],
    pub clip: u16,
}

impl Object {
    /// Returns an object without an id, a room, clips and samples.
    pub(super) fn new(class: Class, confidence: f64, bounds: &UprightBox, points: usize) -> Object {
        let UprightBox { centre_m, size_m, yaw_rad } = *bounds;
        Object {
            id: String::new(),
            class,
            confidence,
            centre_m,
            size_m,
            yaw_rad,
            room: None,
            points,
            clips: Vec::new(),
            samples: Vec::new(),
        }
    }

    pub fn bounds(&self) -> UprightBox {
        UprightBox { centre_m: self.centre_m, size_m: self.size_m, yaw_rad: self.yaw_rad }
    }

    /// Sets the box; its longer side becomes the length.
    fn set_bounds(&mut self, mut bounds: UprightBox) {
        bounds.normalise();
        (self.centre_m, self.size_m, self.yaw_rad) = (bounds.centre_m, bounds.size_m, bounds.yaw_rad);
    }
}

/// An object and the sorted indices of its points in the map.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    pub object: Object,
    pub members: Vec<u32>,
}

/// Returns the objects of a home, sorted by class, then by position. `voxel_m` is the distance of the points.
pub fn objects(points: &[MapPoint], rooms: &[Room], voxel_m: f64) -> Vec<Object> {
    find_objects(points, rooms, voxel_m).into_iter().map(|found| found.object).collect()
}

/// Returns the objects of a home with their points, in the same order.
pub fn find_objects(points: &[MapPoint], rooms: &[Room], voxel_m: f64) -> Vec<Found> {
    // It is never cancelled.
    find_objects_until(points, rooms, voxel_m, &Silent).unwrap_or_default()
}

/// The same, unless `progress` is cancelled.
pub(super) fn find_objects_until(
    points: &[MapPoint],
    rooms: &[Room],
    voxel_m: f64,
    progress: &dyn Progress,
) -> Result<Vec<Found>, Cancelled> {
    let mut cells = Cells::new(points, CELL_M.max(1.5 * voxel_m));
    let mut fragments = kitchen::kitchens(&mut cells);
    fragments.extend(fragment::fragments(&cells));
    // Split before joining, so that a row of chairs is not joined to the sofa beside it, and again after.
    let split = |fragment: Fragment| split::split(fragment, &cells);
    let apart = fragments.into_par_iter().flat_map_iter(split);
    let joined = join::join(apart.collect(), &cells, progress)?;
    let things = joined.into_par_iter().flat_map_iter(split);
    let things = things.filter(|fragment| !patch::is_of_wall(fragment, &cells));
    let mut found: Vec<Found> = things.filter_map(|f| finish(&f, &cells, points, voxel_m)).collect();
    context::tell_nightstands(&mut found);
    context::fill_under_worktops(&mut found);
    found.extend(tray::showers(points, &found, cells.wall_yaw_rad));
    let mut found = conflict::resolve(found, points, progress)?;
    for Found { object, members } in &mut found {
        object.clips = clips(members, points);
        object.room = room_of(rooms, &object.bounds()).map(|room| room.id.clone());
    }
    context::leave_out_misplaced(&mut found, rooms);
    let place = |found: &Found| found.object.centre_m;
    found.sort_by(|a, b| {
        let class = a.object.class.id().cmp(&b.object.class.id());
        let [x, y, z] = [0, 1, 2].map(|axis| place(a)[axis].total_cmp(&place(b)[axis]));
        class.then(x).then(y).then(z)
    });
    for of_class in found.chunk_by_mut(|a, b| a.object.class == b.object.class) {
        for (number, Found { object, .. }) in (1..).zip(of_class) {
            object.id = format!("{}-{number}", object.class.name());
        }
    }
    for Found { object, members } in &mut found {
        let point = |member: &u32| &points[*member as usize];
        let sample = |member| Sample { at_m: point(member).point.position_m, clip: point(member).clip };
        object.samples = members.iter().step_by(members.len().div_ceil(SAMPLES).max(1)).map(sample).collect();
    }
    Ok(found)
}

/// Returns the minimum confidence of an object with these points.
fn least_confidence(own: &[&CloudPoint]) -> f64 {
    let in_pictures = own.iter().filter(|point| point.label.views > 0).count();
    if 2 * in_pictures >= own.len() { MIN_CONFIDENCE } else { MIN_CONFIDENCE_BY_SURFACE }
}

/// Returns the clips with at least [`CLIP_FRACTION`] of an object's points.
fn clips(members: &[u32], points: &[MapPoint]) -> Vec<u16> {
    let mut counts: std::collections::BTreeMap<u16, usize> = std::collections::BTreeMap::new();
    members.iter().for_each(|i| *counts.entry(points[*i as usize].clip).or_default() += 1);
    let least = (CLIP_FRACTION * members.len() as f64).max(1.0);
    counts.into_iter().filter(|(_, count)| *count as f64 >= least).map(|(clip, _)| clip).collect()
}

/// Returns a fragment's object, without its room and its clips; none if it is too small or too uncertain.
fn finish(fragment: &Fragment, cells: &Cells, points: &[MapPoint], voxel_m: f64) -> Option<Found> {
    let surface_m2 = fragment.cells.len() as f64 * cells.side_m * cells.side_m;
    let is_small = matches!(fragment.class, Class::Shelf | Class::Lamp);
    if surface_m2 < if is_small { MIN_SMALL_M2 } else { MIN_SURFACE_M2 } {
        return None;
    }
    let mut members: Vec<u32> = fragment.cells.iter().flat_map(|cell| cells.points(*cell)).copied().collect();
    members.sort_unstable();
    let own: Vec<&CloudPoint> = members.iter().map(|i| &points[*i as usize].point).collect();
    let at: Vec<[f64; 3]> = own.iter().map(|point| point.position_m.map(f64::from)).collect();
    let mut bounds = fit_box(&at, cells.wall_yaw_rad, kind::beyond(fragment.class))?;
    // Points are at voxel centres, so a side is at least one voxel.
    bounds.size_m = bounds.size_m.map(|side| side.max(voxel_m));
    hidden::raise_tray(&mut bounds, fragment.class);
    let measured = bounds;
    hidden::deepen_front(&mut bounds, fragment, &own);
    let decided = fragment.decide(&bounds, cells)?;
    // The depth of other furniture is the measured one, unless only a front was measured.
    if !kind::is_appliance(decided.class) && measured.size_m[1] >= hidden::FRONT_M {
        bounds = measured;
    }
    hidden::complete(&mut bounds, &decided, fragment, &own, cells);
    let longest_m = bounds.size_m.iter().copied().fold(0.0, f64::max);
    if longest_m < MIN_SIDE_M || decided.confidence < least_confidence(&own) {
        return None;
    }
    let object = Object::new(decided.class, decided.confidence, &bounds, members.len());
    Some(Found { object, members })
}

#[cfg(test)]
mod tests;
