//! The things in a home: pieces of furniture and appliances, made out of the fused map's labelled points.
//!
//! Labels of single voxels are noisy: cells hear their neighbours on the same surface, cells of one class that touch
//! are a fragment, fragments that look like parts of one thing are joined, and what the thing is follows from what its
//! points are called and from how large things of that class are.

mod cells;
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
use crate::taxonomy::Class;
use cells::Cells;
use fragment::Fragment;
use serde::{Deserialize, Serialize};

/// How objects are made out.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectsParams {
    /// Side of the map's voxels.
    pub voxel_m: f64,
    /// Side of the cells that points are gathered in; two voxels where those are larger.
    pub cell_m: f64,
    /// Cells of one class this many cells apart touch.
    pub reach: i64,
    /// Surface that an object must show, in square metres ...
    pub min_surface_m2: f64,
    /// ... and the length of its longest side, in metres.
    pub min_side_m: f64,
    /// Less sure is left out.
    pub min_confidence: f64,
    /// An object this far from a room still belongs to it: it stands at the wall.
    pub room_reach_m: f64,
    /// Share of an object's points that a clip must have given to be named.
    pub clip_share: f64,
    pub join: join::JoinParams,
}

impl Default for ObjectsParams {
    fn default() -> Self {
        ObjectsParams {
            voxel_m: 0.03,
            cell_m: 0.06,
            reach: 2,
            min_surface_m2: 0.12,
            min_side_m: 0.25,
            min_confidence: 0.35,
            room_reach_m: 1.0,
            clip_share: 0.05,
            join: join::JoinParams::default(),
        }
    }
}

/// A thing in a home, in the LiDAR map's frame: an upright box, and what is known of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Object {
    pub id: String,
    #[schema(value_type = String, example = "sofa")]
    pub class: Class,
    /// 0..1: how much of what is said of its points is this class, and how well its size fits.
    pub confidence: f64,
    pub centre_m: [f64; 3],
    /// Along its own x, y and z: length, width, height. The length is not the shorter of the two.
    pub size_m: [f64; 3],
    /// Of its own x axis, in [0, pi).
    pub yaw_rad: f64,
    /// Id of the room that it is in.
    pub room: Option<String>,
    /// Points of the fused map.
    pub points: usize,
    /// The clips that gave a real share of its points, by their places in the map's list.
    pub clips: Vec<u16>,
}

impl Object {
    pub fn bounds(&self) -> UprightBox {
        UprightBox { centre_m: self.centre_m, size_m: self.size_m, yaw_rad: self.yaw_rad }
    }
}

/// An object and the places in the map of its points, in rising order.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    pub object: Object,
    pub members: Vec<u32>,
}

/// The things in a home, by class and then by place.
pub fn objects(points: &[MapPoint], rooms: &[Room], params: &ObjectsParams) -> Vec<Object> {
    find_objects(points, rooms, params).into_iter().map(|found| found.object).collect()
}

/// The same with the points of each.
pub fn find_objects(points: &[MapPoint], rooms: &[Room], params: &ObjectsParams) -> Vec<Found> {
    let cells = Cells::new(points, params.cell_m.max(2.0 * params.voxel_m));
    let labels = cells.labels();
    let wall_yaw_rad = cells.wall_direction(&labels);
    let fragments = fragment::fragments(&cells, &labels, params.reach);
    let joined = join::join(fragments, &cells, wall_yaw_rad, &params.join);
    let split = joined.into_iter().flat_map(|fragment| split::split(fragment, &cells, wall_yaw_rad));
    let mut found: Vec<Found> =
        split.filter_map(|f| finish(&f, &cells, points, rooms, wall_yaw_rad, params)).collect();
    context::tell_nightstands(&mut found);
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
    found
}

/// The object that a fragment is; none when there is too little of it.
fn finish(
    fragment: &Fragment,
    cells: &Cells,
    points: &[MapPoint],
    rooms: &[Room],
    wall_yaw_rad: Option<f64>,
    params: &ObjectsParams,
) -> Option<Found> {
    let surface_m2 = fragment.cells.len() as f64 * cells.side_m * cells.side_m;
    if surface_m2 < params.min_surface_m2 {
        return None;
    }
    let mut members: Vec<u32> =
        fragment.cells.iter().flat_map(|cell| cells.points(*cell as usize)).copied().collect();
    members.sort_unstable();
    let at: Vec<[f64; 3]> =
        members.iter().map(|i| points[*i as usize].point.position_m.map(f64::from)).collect();
    let mut bounds = fit_box(&at, wall_yaw_rad, fit::BEYOND)?;
    // Points are in the middle of the surface's voxels.
    bounds.size_m = bounds.size_m.map(|side| side.max(params.voxel_m));
    let decided = fragment.decide(&bounds, fragment::flatness(fragment, cells))?;
    if decided.kind.stands && bounds.bottom_m() < decided.reaches_down_m {
        let top_m = bounds.top_m();
        bounds.size_m[2] = top_m;
        bounds.centre_m[2] = top_m / 2.0;
    }
    if decided.class == Class::Sink && bounds.size_m[2] > kind::BASIN_M {
        bounds.centre_m[2] = bounds.top_m() - kind::BASIN_M / 2.0;
        bounds.size_m[2] = kind::BASIN_M;
    }
    let longest_m = bounds.size_m.iter().copied().fold(0.0, f64::max);
    if longest_m < params.min_side_m || decided.confidence < params.min_confidence {
        return None;
    }
    let mut shares: std::collections::BTreeMap<u16, usize> = std::collections::BTreeMap::new();
    members.iter().for_each(|i| *shares.entry(points[*i as usize].clip).or_default() += 1);
    let least = (params.clip_share * members.len() as f64).max(1.0);
    let clips = shares.into_iter().filter(|(_, count)| *count as f64 >= least).map(|(clip, _)| clip);
    let object = Object {
        id: String::new(),
        class: decided.class,
        confidence: decided.confidence,
        centre_m: bounds.centre_m,
        size_m: bounds.size_m,
        yaw_rad: bounds.yaw_rad,
        room: room_at(rooms, &fit::middle(&bounds), params.room_reach_m).map(|room| room.id.clone()),
        points: members.len(),
        clips: clips.collect(),
    };
    Some(Found { object, members })
}
