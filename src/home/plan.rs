//! A home's semantic floor plan: the LiDAR map's walls, its rooms, and the furniture that the fused map shows.

mod geojson;
mod letters;
mod paper;
mod png;
mod svg;

use super::map_point::MapPoint;
use super::objects::Object;
use super::rooms::outline::{Outline, pieces, trace};
use super::rooms::space::Space;
use super::rooms::{Room, SpaceParams, close};
use crate::geometry::Grid;
use crate::lidar::LidarMap;
use crate::taxonomy::Class;

pub use geojson::plan_geojson;
pub use png::plan_png;
pub use svg::plan_svg;

/// How a plan is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanParams {
    pub space: SpaceParams,
    /// Gaps in walls up to twice this are the LiDAR's, not the home's.
    pub close_m: f64,
    /// How far outlines may be from the cells' border.
    pub tolerance_m: f64,
    /// Walls smaller than this are specks.
    pub speck_m2: f64,
    /// What the LiDAR hit this near to a piece of furniture is that piece.
    pub near_furniture_m: f64,
}

impl Default for PlanParams {
    fn default() -> Self {
        PlanParams {
            space: SpaceParams::default(),
            close_m: 0.05,
            tolerance_m: 0.045,
            speck_m2: 0.015,
            near_furniture_m: 0.06,
        }
    }
}

/// A floor plan, in metres in the LiDAR map's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    pub min_m: [f64; 2],
    pub max_m: [f64; 2],
    /// What the LiDAR hit and no furniture explains.
    pub walls: Vec<Outline>,
    /// What the LiDAR hit of furniture.
    pub obstacles: Vec<Outline>,
    pub rooms: Vec<Room>,
    /// Things with a footprint, the largest first.
    pub objects: Vec<Object>,
}

/// The plan of a home. `points` is its fused map.
pub fn plan(
    lidar: &LidarMap,
    points: &[MapPoint],
    rooms: &[Room],
    objects: &[Object],
    params: &PlanParams,
) -> Plan {
    let space = Space::new(lidar, points, &params.space);
    let furniture = objects.iter().filter(|object| !opens(object.class));
    let boxes: Vec<_> = furniture.map(Object::bounds).collect();
    let mut walls = Grid::filled(space.frame, false);
    let mut obstacles = walls.clone();
    for (at, _) in space.occupied.iter().enumerate().filter(|(_, occupied)| **occupied) {
        let centre = space.centre(at);
        let is_furniture = space.furniture[at]
            || boxes.iter().any(|b| {
                b.bottom_m() < 0.3 && b.holds(&[centre.x, centre.y, b.centre_m[2]], params.near_furniture_m)
            });
        let kind = if is_furniture { &mut obstacles } else { &mut walls };
        kind.cells[at] = true;
    }
    close(&mut walls, params.close_m);
    let least = (params.speck_m2 / (space.frame.cell_m * space.frame.cell_m)).ceil() as usize;
    let outlines = |mask: &mut Grid<bool>| {
        let (piece, count) = pieces(mask);
        let mut sizes = vec![0usize; count + 1];
        piece.iter().for_each(|piece| sizes[*piece as usize] += 1);
        for (cell, piece) in mask.cells.iter_mut().zip(piece) {
            *cell = *cell && sizes[piece as usize] >= least;
        }
        trace(mask).iter().filter_map(|outline| outline.simplified(params.tolerance_m)).collect()
    };
    let mut drawn: Vec<Object> = objects.to_vec();
    let area = |object: &Object| object.size_m[0] * object.size_m[1];
    drawn.sort_by(|a, b| area(b).total_cmp(&area(a)).then(a.id.cmp(&b.id)));
    let (mut min_m, mut max_m) = (lidar.info.min_m, lidar.info.max_m);
    for corner in rooms.iter().flat_map(|room| &room.polygon_m) {
        for axis in 0..2 {
            min_m[axis] = min_m[axis].min(corner[axis]);
            max_m[axis] = max_m[axis].max(corner[axis]);
        }
    }
    // A thing that was seen far outside, in a mirror say, must not shrink the home to a dot.
    drawn.retain(|object| {
        (0..2).all(|axis| (min_m[axis] - 0.5..max_m[axis] + 0.5).contains(&object.centre_m[axis]))
    });
    Plan {
        min_m,
        max_m,
        walls: outlines(&mut walls),
        obstacles: outlines(&mut obstacles),
        rooms: rooms.to_vec(),
        objects: drawn,
    }
}

/// Openings are drawn as parts of the walls.
pub(super) fn opens(class: Class) -> bool {
    matches!(class, Class::Door | Class::Window)
}

/// What hangs flat on a wall or covers it: too thin for a label of its own.
pub(super) fn hangs(class: Class) -> bool {
    matches!(class, Class::Mirror | Class::Picture | Class::Curtain)
}

/// `living room` for `living_room`.
pub(super) fn words(class: Class) -> String {
    class.name().replace('_', " ")
}
