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
mod join;
mod kind;
mod split;

pub use fit::{UprightBox, fit_box};
pub use kind::is_furniture;

use super::map_point::MapPoint;
use super::rooms::{Room, room_at};
use cells::Cells;
use fragment::Fragment;
use serde::{Deserialize, Serialize};
use viola_geometry::taxonomy::Class;

/// Side of the cells; at least one and a half voxels.
const CELL_M: f64 = 0.06;

/// Maximum gap between connected cells of a class: less than an inner wall with its adjacent cells.
const REACH_M: f64 = 0.13;
/// Minimum surface of an object, in square metres.
const MIN_SURFACE_M2: f64 = 0.12;
/// Minimum length of its longest side, in metres.
const MIN_SIDE_M: f64 = 0.25;
/// Minimum confidence of an object that a network saw in pictures; it understates how often such an object is right.
const MIN_CONFIDENCE: f64 = 0.25;
/// Minimum confidence of an object by its surface alone: the best F1 score on maps of simulated clips
/// (docs/experiments.md, A home's map). About as many such objects are right as their confidence says.
const MIN_CONFIDENCE_BY_SURFACE: f64 = 0.45;
/// A counter whose underside is above this is a worktop; the fraction of its points that its box leaves out below, and its
/// usual thickness.
const WORKTOP_M: f64 = 0.6;
const WORKTOP_BEYOND: f64 = 0.1;
const WORKTOP_THICK_M: f64 = 0.04;
/// An object this far from a room belongs to it: objects stand at walls.
const ROOM_REACH_M: f64 = 1.0;
/// Minimum fraction of an object's points for a clip to be listed.
const CLIP_SHARE: f64 = 0.05;
/// Maximum number of an object's samples.
const SAMPLES: usize = 24;

/// Parameters of the object detection.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectsParams {
    /// Side of the map's voxels.
    pub voxel_m: f64,
}

impl Default for ObjectsParams {
    fn default() -> Self {
        ObjectsParams { voxel_m: 0.03 }
    }
}

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
    pub fn bounds(&self) -> UprightBox {
        UprightBox { centre_m: self.centre_m, size_m: self.size_m, yaw_rad: self.yaw_rad }
    }
}

/// An object and the sorted indices of its points in the map.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    pub object: Object,
    pub members: Vec<u32>,
}

/// Returns the objects of a home, sorted by class, then by position.
pub fn objects(points: &[MapPoint], rooms: &[Room], params: &ObjectsParams) -> Vec<Object> {
    find_objects(points, rooms, params).into_iter().map(|found| found.object).collect()
}

/// Returns the objects of a home with their points, in the same order.
pub fn find_objects(points: &[MapPoint], rooms: &[Room], params: &ObjectsParams) -> Vec<Found> {
    let cells = Cells::new(points, CELL_M.max(1.5 * params.voxel_m));
    let labels = cells.labels();
    let wall_yaw_rad = cells.wall_direction(&labels);
    let reach = ((REACH_M / cells.side_m) as i64).max(1);
    let fragments = fragment::fragments(&cells, &labels, reach);
    // Split before joining, so that a row of chairs is not joined to the sofa beside it, and again after.
    let apart = fragments.into_iter().flat_map(|fragment| split::split(fragment, &cells, wall_yaw_rad));
    let joined = join::join(apart.collect(), &cells, &labels, wall_yaw_rad);
    let split = joined.into_iter().flat_map(|fragment| split::split(fragment, &cells, wall_yaw_rad));
    let mut found: Vec<Found> =
        split.filter_map(|f| finish(&f, &cells, points, rooms, wall_yaw_rad, params)).collect();
    context::tell_nightstands(&mut found);
    context::fill_under_worktops(&mut found);
    let mut found = conflict::resolve(found, points);
    let place = |found: &Found| found.object.centre_m;
    found.sort_by(|a, b| {
        let class = a.object.class.id().cmp(&b.object.class.id());
        let [x, y, z] = [0, 1, 2].map(|axis| place(a)[axis].total_cmp(&place(b)[axis]));
        class.then(x).then(y).then(z)
    });
    let mut number = (None, 0);
    for Found { object, .. } in &mut found {
        number =
            if number.0 == Some(object.class) { (number.0, number.1 + 1) } else { (Some(object.class), 1) };
        object.id = format!("{}-{}", object.class.name(), number.1);
    }
    for Found { object, members } in &mut found {
        let point = |member: &u32| &points[*member as usize];
        let sample = |member| Sample { at_m: point(member).point.position_m, clip: point(member).clip };
        object.samples = members.iter().step_by(members.len().div_ceil(SAMPLES).max(1)).map(sample).collect();
    }
    found
}

/// Returns the minimum confidence of an object with these points.
fn least_confidence(members: &[u32], points: &[MapPoint]) -> f64 {
    let in_pictures = members.iter().filter(|i| points[**i as usize].point.label.views > 0).count();
    if 2 * in_pictures >= members.len() { MIN_CONFIDENCE } else { MIN_CONFIDENCE_BY_SURFACE }
}

/// Returns a fragment's object; none if it is too small or too uncertain.
fn finish(
    fragment: &Fragment,
    cells: &Cells,
    points: &[MapPoint],
    rooms: &[Room],
    wall_yaw_rad: Option<f64>,
    params: &ObjectsParams,
) -> Option<Found> {
    let surface_m2 = fragment.cells.len() as f64 * cells.side_m * cells.side_m;
    if surface_m2 < MIN_SURFACE_M2 {
        return None;
    }
    let mut members: Vec<u32> =
        fragment.cells.iter().flat_map(|cell| cells.points(*cell as usize)).copied().collect();
    members.sort_unstable();
    let at: Vec<[f64; 3]> =
        members.iter().map(|i| points[*i as usize].point.position_m.map(f64::from)).collect();
    let mut bounds = fit_box(&at, wall_yaw_rad, fit::BEYOND)?;
    // Points are at voxel centres, so a side is at least one voxel.
    bounds.size_m = bounds.size_m.map(|side| side.max(params.voxel_m));
    let decided = fragment.decide(&bounds, fragment::flatness(fragment, cells), cells)?;
    if decided.kind.stands && bounds.bottom_m() < decided.reaches_down_m {
        let top_m = bounds.top_m();
        bounds.size_m[2] = top_m;
        bounds.centre_m[2] = top_m / 2.0;
    }
    if decided.class == Class::Sink && bounds.size_m[2] > kind::BASIN_M {
        bounds.centre_m[2] = bounds.top_m() - kind::BASIN_M / 2.0;
        bounds.size_m[2] = kind::BASIN_M;
    }
    if decided.class == Class::Counter && bounds.bottom_m() > WORKTOP_M {
        // Other points are of things on it and of fronts below.
        let is_level = |i: &&u32| points[**i as usize].point.normal[2] > 0.8;
        let heights =
            members.iter().filter(is_level).map(|i| f64::from(points[*i as usize].point.position_m[2]));
        let [top_m, _] = fit::span(heights, 0.5);
        if top_m > 0.0 {
            let low_m = fit::span(at.iter().map(|p| p[2]), WORKTOP_BEYOND)[0].min(top_m - WORKTOP_THICK_M);
            (bounds.centre_m[2], bounds.size_m[2]) = ((low_m + top_m) / 2.0, top_m - low_m);
        }
    }
    let longest_m = bounds.size_m.iter().copied().fold(0.0, f64::max);
    if longest_m < MIN_SIDE_M || decided.confidence < least_confidence(&members, points) {
        return None;
    }
    let mut shares: std::collections::BTreeMap<u16, usize> = std::collections::BTreeMap::new();
    members.iter().for_each(|i| *shares.entry(points[*i as usize].clip).or_default() += 1);
    let least = (CLIP_SHARE * members.len() as f64).max(1.0);
    let clips = shares.into_iter().filter(|(_, count)| *count as f64 >= least).map(|(clip, _)| clip);
    let object = Object {
        id: String::new(),
        class: decided.class,
        confidence: decided.confidence,
        centre_m: bounds.centre_m,
        size_m: bounds.size_m,
        yaw_rad: bounds.yaw_rad,
        room: room_at(rooms, &fit::middle(&bounds), ROOM_REACH_M).map(|room| room.id.clone()),
        points: members.len(),
        clips: clips.collect(),
        samples: Vec::new(),
    };
    Some(Found { object, members })
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_reconstruct::{CloudPoint, Label};

    /// Points on a box's surface, 3 cm apart, without its underside.
    fn surface(class: Class, low: [f64; 3], high: [f64; 3], clip: u16) -> Vec<MapPoint> {
        let count = [0, 1, 2].map(|axis| ((high[axis] - low[axis]) / 0.03).round() as usize + 1);
        let mut points = Vec::new();
        for i in 0..count[0] {
            for j in 0..count[1] {
                for k in 0..count[2] {
                    let at = [i, j, k];
                    let normal = if k + 1 == count[2] {
                        [0.0, 0.0, 1.0]
                    } else if i == 0 || i + 1 == count[0] {
                        [if i == 0 { -1.0 } else { 1.0 }, 0.0, 0.0]
                    } else if j == 0 || j + 1 == count[1] {
                        [0.0, if j == 0 { -1.0 } else { 1.0 }, 0.0]
                    } else {
                        continue;
                    };
                    let place = |axis: usize| (low[axis] + at[axis] as f64 * 0.03) as f32;
                    let point = CloudPoint {
                        position_m: [place(0), place(1), place(2)],
                        normal,
                        color: [0; 3],
                        label: Label::new(class, 0.8, 4),
                        weight: 100,
                    };
                    points.push(MapPoint { point, clip });
                }
            }
        }
        points
    }

    fn found(points: &[MapPoint]) -> Vec<Object> {
        objects(points, &[], &ObjectsParams::default())
    }

    #[test]
    fn a_bed_is_a_bed_with_its_box_and_clips() {
        let mut points = surface(Class::Bed, [1.0, 1.0, 0.1], [2.6, 3.0, 0.5], 0);
        points.extend(surface(Class::Pillow, [1.2, 2.5, 0.5], [1.8, 2.9, 0.62], 3));
        // A patch with the label of a confusable class.
        points.iter_mut().filter(|p| p.point.position_m[1] < 1.4).for_each(|p| {
            p.point.label = Label::new(Class::Sofa, 0.6, 4);
        });
        let objects = found(&points);
        assert_eq!(objects.len(), 1, "{objects:?}");
        let bed = &objects[0];
        assert_eq!((bed.class, bed.id.as_str(), bed.clips.as_slice()), (Class::Bed, "bed-1", &[0, 3][..]));
        let want = UprightBox {
            centre_m: [1.8, 2.0, 0.28],
            size_m: [2.0, 1.6, 0.56],
            yaw_rad: std::f64::consts::FRAC_PI_2,
        };
        assert!(bed.bounds().iou(&want) > 0.8, "{bed:?}");
        // The box extends to the floor although nothing was seen below.
        assert!(bed.bounds().bottom_m().abs() < 1e-9);
        assert!(bed.confidence > 0.5);
    }

    /// Shapes are more often mistaken for furniture than pictures.
    #[test]
    fn doubtful_objects_need_pictures() {
        let with = |probability: f32, views: u16| {
            let mut points = surface(Class::Sofa, [1.0, 1.0, 0.1], [3.0, 1.9, 0.8], 0);
            points.iter_mut().for_each(|p| p.point.label = Label::new(Class::Sofa, probability, views));
            found(&points).first().map(|sofa| sofa.confidence)
        };
        assert_eq!([with(0.2, 4), with(0.4, 0)], [None, None]);
        let [in_pictures, sure] = [with(0.4, 4), with(0.8, 0)].map(Option::unwrap);
        assert!((0.3..0.4).contains(&in_pictures) && (0.7..0.8).contains(&sure), "{in_pictures} {sure}");
    }

    #[test]
    fn chairs_side_by_side_are_several() {
        let mut points = Vec::new();
        for i in 0..3 {
            let x = f64::from(i) * 0.63;
            points.extend(surface(Class::Chair, [x, 0.0, 0.42], [x + 0.48, 0.45, 0.46], 0));
            points.extend(surface(Class::Chair, [x, 0.42, 0.46], [x + 0.48, 0.45, 0.9], 0));
        }
        let chairs = found(&points);
        assert_eq!(chairs.iter().filter(|o| o.class == Class::Chair).count(), 3, "{chairs:?}");
    }

    #[test]
    fn a_kitchen_has_units_below_and_above() {
        let mut points = surface(Class::Cabinet, [0.0, 0.0, 0.06], [2.0, 0.6, 0.9], 0);
        points.extend(surface(Class::Cabinet, [0.0, 0.3, 1.4], [2.0, 0.6, 2.1], 0));
        // A part of the wall between them, mislabelled as cabinet.
        points.extend(surface(Class::Cabinet, [0.6, 0.6, 0.9], [1.0, 0.63, 1.4], 0));
        let units = found(&points);
        assert_eq!(units.len(), 2, "{units:?}");
        assert!(units.iter().any(|unit| unit.bounds().bottom_m() > 1.0));
    }

    #[test]
    fn a_worktop_around_a_corner_is_two() {
        let mut points = surface(Class::Counter, [0.0, 0.0, 0.86], [3.0, 0.6, 0.9], 0);
        points.extend(surface(Class::Counter, [0.0, 0.6, 0.86], [0.6, 2.6, 0.9], 0));
        points.extend(surface(Class::Wall, [0.0, -0.1, 0.0], [3.0, 0.0, 2.4], 0));
        let tops = found(&points);
        assert_eq!(tops.len(), 2, "{tops:?}");
        // The fronts of units below one of them, whose tops are hidden.
        points.extend(surface(Class::Cabinet, [1.0, 0.57, 0.06], [3.0, 0.6, 0.86], 0));
        let units = found(&points);
        let unit = units.iter().find(|object| object.class == Class::Cabinet).expect("the units are found");
        assert!((unit.size_m[1] - 0.6).abs() < 0.1 && units.len() == 3, "{units:?}");
        assert!(tops.iter().all(|top| top.size_m[1] < 0.75), "{tops:?}");
    }

    #[test]
    fn a_small_table_at_a_bed_is_a_nightstand() {
        let mut points = surface(Class::Bed, [0.0, 0.0, 0.1], [1.6, 2.0, 0.5], 0);
        points.extend(surface(Class::Table, [1.75, 1.5, 0.05], [2.2, 1.95, 0.6], 0));
        points.extend(surface(Class::Table, [4.75, 1.5, 0.05], [5.2, 1.95, 0.6], 0));
        let classes: Vec<Class> = found(&points).iter().map(|o| o.class).collect();
        assert_eq!(classes, [Class::Bed, Class::Table, Class::Cabinet]);
    }

    #[test]
    fn structure_specks_and_people_are_no_objects() {
        let mut points = surface(Class::Wall, [0.0, 0.0, 0.0], [3.0, 0.1, 2.4], 0);
        points.extend(surface(Class::Chair, [1.0, 1.0, 0.4], [1.1, 1.1, 0.45], 0));
        points.extend(surface(Class::Person, [2.0, 1.0, 0.1], [2.4, 1.3, 1.7], 0));
        points.extend(surface(Class::Floor, [0.0, 0.0, 0.0], [3.0, 3.0, 0.02], 0));
        assert_eq!(found(&points), []);
        assert_eq!(found(&[]), []);
    }

    #[test]
    fn places_beyond_any_home_are_left_out() {
        let mut points = surface(Class::Sofa, [1.0, 1.0, 0.1], [3.0, 1.9, 0.8], 0);
        let far = MapPoint { clip: 0, ..points[0] };
        for x in [f32::MAX, -f32::MAX, 1e9] {
            let mut far = far;
            far.point.position_m[0] = x;
            points.push(far);
        }
        assert_eq!(found(&points).len(), 1);
    }
}
