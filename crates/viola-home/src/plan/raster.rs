//! Surface and rooms in the cells of the LiDAR map's raster.

use super::evidence::{LOWEST_M, height, is_tall, is_wall_surface};
use crate::map_point::MapPoint;
use crate::rooms::Room;
use crate::rooms::space::Space;
use viola_geometry::Point2;

/// Maximum height of floor.
const FLOOR_M: f64 = 0.15;
/// Maximum height of level surfaces of furniture, and minimum height of ceilings.
const FURNITURE_M: f64 = 1.5;
const CEILING_M: f64 = 1.9;
/// Minimum vertical part of the normal of a level surface.
const LEVEL: f64 = 0.7;

/// Returns whether a point is on a surface that no wall crosses: floor, furniture from above, ceiling.
pub(super) fn is_level(point: &MapPoint) -> bool {
    let (z, up) = (f64::from(point.point.position_m[2]), f64::from(point.point.normal[2]));
    (z < FURNITURE_M && up > LEVEL) || (z > CEILING_M && up < -LEVEL)
}

/// Returns the cells with level surface, and those with floor.
pub(super) fn level_cells(space: &Space, points: &[MapPoint]) -> (Vec<bool>, Vec<bool>) {
    let (mut level, mut floor) = (vec![false; space.frame.len()], vec![false; space.frame.len()]);
    for point in points.iter().filter(|point| is_level(point)) {
        let [x, y, z] = point.point.position_m.map(f64::from);
        if let Some(cell) = space.index(&Point2::new(x, y)) {
            level[cell] = true;
            floor[cell] |= z < FLOOR_M;
        }
    }
    (level, floor)
}

/// Returns the cells with wall up to the ceiling.
pub(super) fn tall_cells(space: &Space, points: &[MapPoint]) -> Vec<bool> {
    let mut bits = vec![0u32; space.frame.len()];
    for point in points.iter().filter(|point| is_wall_surface(point)) {
        let [x, y, z] = point.point.position_m.map(f64::from);
        if let Some(cell) = space.index(&Point2::new(x, y)).filter(|_| z >= LOWEST_M) {
            bits[cell] |= height(z);
        }
    }
    bits.into_iter().map(is_tall).collect()
}

/// Returns the room of each cell, from 1.
pub(super) fn owners(space: &Space, rooms: &[Room]) -> Vec<u32> {
    let mut owner = vec![0u32; space.frame.len()];
    for (number, room) in (1..).zip(rooms) {
        let bound = |axis: usize, pick: fn(f64, f64) -> f64, start: f64| {
            room.polygon_m.iter().map(|corner| corner[axis]).fold(start, pick)
        };
        let index = |metres: f64, axis: usize, most: usize| {
            (((metres - space.frame.origin_m[axis]) / space.frame.cell_m).max(0.0) as usize).min(most)
        };
        let (width, height) = (space.frame.width, space.frame.height);
        let left = index(bound(0, f64::min, f64::INFINITY), 0, width - 1);
        let right = index(bound(0, f64::max, f64::NEG_INFINITY), 0, width - 1);
        let bottom = index(bound(1, f64::min, f64::INFINITY), 1, height - 1);
        let top = index(bound(1, f64::max, f64::NEG_INFINITY), 1, height - 1);
        for y in bottom..=top {
            for x in left..=right {
                let at = y * width + x;
                if owner[at] == 0 && room.contains(&space.centre(at)) {
                    owner[at] = number;
                }
            }
        }
    }
    owner
}
