//! Surface and rooms in the cells of the LiDAR map's raster.

use super::axes::span;
use super::evidence::{LOWEST_M, height, is_tall};
use crate::map_point::MapPoint;
use crate::rooms::Room;
use crate::rooms::bands::Bands;
use crate::rooms::space::Space;
use std::f64::consts::FRAC_PI_4;
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Vector2};

/// Maximum height of floor.
const FLOOR_M: f64 = 0.15;
/// Maximum height of level surfaces of furniture, and minimum height of ceilings.
const FURNITURE_M: f64 = 1.5;
const CEILING_M: f64 = 1.9;
/// Minimum vertical part of the normal of a level surface.
const LEVEL: f64 = 0.7;
/// Minimum heights of a cell with a window, and of one with a curtain.
const WINDOW_HEIGHTS: u32 = 2;
const CURTAIN_HEIGHTS: u32 = 4;
/// Tangent of 22.5 degrees, half of the width of a direction.
const HALF_DIRECTION: f32 = std::f32::consts::SQRT_2 - 1.0;
/// Cosine of the largest angle between a wall's normal and the middle of a direction of its surface: 50 degrees, so that
/// noise of 27 degrees is allowed and the walls at its corners are excluded.
const SAME_DIRECTION: f64 = 0.643;

/// Returns whether a fused point is on an upright surface of any class.
pub(super) fn is_upright(point: &MapPoint) -> bool {
    f64::from(point.point.normal[2]).abs() < 0.4
}

/// Returns whether a fused point is on a wall, or on something flat on it.
pub(super) fn is_wall_surface(point: &MapPoint) -> bool {
    is_upright(point) && matches!(point.point.label.class, Class::Wall | Class::Picture | Class::Mirror)
}

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

/// Returns the cells with wall up to the ceiling, and the directions of each cell's upright surface of any class.
pub(super) fn upright_cells(space: &Space, points: &[MapPoint]) -> (Vec<bool>, Vec<u8>) {
    let (mut heights, mut directions) = (vec![0u32; space.frame.len()], vec![0u8; space.frame.len()]);
    for point in points.iter().filter(|point| is_upright(point)) {
        let [x, y, z] = point.point.position_m.map(f64::from);
        if z < LOWEST_M {
            continue;
        }
        if let Some(cell) = space.index(&Point2::new(x, y)) {
            directions[cell] |= direction(point.point.normal);
            if is_wall_surface(point) {
                heights[cell] |= height(z);
            }
        }
    }
    (heights.into_iter().map(is_tall).collect(), directions)
}

/// Returns the cells with a window, or with a curtain, which hangs before one.
pub(super) fn glass_cells(space: &Space, points: &[MapPoint]) -> Vec<bool> {
    let mut heights = vec![[0u32; 2]; space.frame.len()];
    for point in points.iter().filter(|point| is_upright(point)) {
        let kind = match point.point.label.class {
            Class::Window => 0,
            Class::Curtain => 1,
            _ => continue,
        };
        let [x, y, z] = point.point.position_m.map(f64::from);
        if let Some(at) = space.index(&Point2::new(x, y)).filter(|_| z >= LOWEST_M) {
            heights[at][kind] |= height(z);
        }
    }
    let is_glass = |[window, curtain]: [u32; 2]| {
        window.count_ones() >= WINDOW_HEIGHTS || curtain.count_ones() >= CURTAIN_HEIGHTS
    };
    heights.into_iter().map(is_glass).collect()
}

/// Returns the bit of a normal's direction. The four directions are 45 degrees wide, around 0, 45, 90 and 135 degrees;
/// opposite normals have the same one.
fn direction([x, y, _]: [f32; 3]) -> u8 {
    if y.abs() <= HALF_DIRECTION * x.abs() {
        1
    } else if x.abs() <= HALF_DIRECTION * y.abs() {
        1 << 2
    } else if x * y > 0.0 {
        1 << 1
    } else {
        1 << 3
    }
}

/// Returns the bits of the directions that surface of a wall may have, whose normal is given in the map's frame.
pub(super) fn directions_of(normal: &Vector2) -> u8 {
    let is_near = |direction: &u8| {
        let (sin, cos) = (f64::from(*direction) * FRAC_PI_4).sin_cos();
        (normal.x * cos + normal.y * sin).abs() > SAME_DIRECTION
    };
    (0..4u8).filter(is_near).fold(0, |bits, direction| bits | (1u8 << direction))
}

/// Returns the room of each cell, from 1.
pub(super) fn owners(space: &Space, rooms: &[Room]) -> Vec<u32> {
    let mut owner = vec![0u32; space.frame.len()];
    for (number, room) in (1..).zip(rooms) {
        let (frame, span) = (&space.frame, span(&room.polygon_m));
        let count = [frame.width, frame.height];
        let [columns, rows] = [0, 1].map(|axis| {
            let cell = |metres: f64| ((metres - frame.origin_m[axis]) / frame.cell_m).max(0.0) as usize;
            let [low, high] = span[axis].map(|metres| cell(metres).min(count[axis] - 1));
            low..=high
        });
        let bands = Bands::new(&room.polygon_m, &room.holes_m);
        for y in rows {
            for x in columns.clone() {
                let at = y * frame.width + x;
                if owner[at] == 0 && bands.contains(&space.centre(at)) {
                    owner[at] = number;
                }
            }
        }
    }
    owner
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surface_has_the_direction_of_its_wall_and_not_of_the_walls_at_its_corners() {
        let unit = |degrees: i32| f64::from(degrees).to_radians().sin_cos();
        for of_wall in (-180..180).step_by(5) {
            let (sin, cos) = unit(of_wall);
            let directions = directions_of(&Vector2::new(cos, sin));
            for (off, is_of_wall) in [
                (-27, true),
                (0, true),
                (27, true),
                (153, true),
                (180, true),
                (207, true),
                (75, false),
                (90, false),
                (105, false),
                (270, false),
            ] {
                let (sin, cos) = unit(of_wall + off);
                let direction = direction([cos as f32, sin as f32, 0.0]);
                assert_eq!(directions & direction != 0, is_of_wall, "{of_wall} {off}");
            }
        }
    }
}
