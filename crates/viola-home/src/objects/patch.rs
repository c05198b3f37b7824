//! Patches of a wall that a network takes for furniture: the wall continues in the same plane on both sides, or on one side and above.

use super::cells::Cells;
use super::fragment::Fragment;
use viola_geometry::taxonomy::Class;

/// Largest patch, in metres: what is built into a wall with a flush front is larger.
const LARGEST_M: f64 = 0.8;
/// Minimum fraction of the cells between parts of the wall.
const MIN_INSIDE_FRACTION: f64 = 0.6;
/// Largest vertical part of an upright cell's normal.
const UPRIGHT: f32 = 0.5;

/// Returns whether a fragment is a part of a wall. Pictures, radiators and other things that are as flat are none.
pub fn is_of_wall(fragment: &Fragment, cells: &Cells) -> bool {
    let steps = (LARGEST_M / cells.side_m) as i32;
    if is_flat(fragment.class) || fragment.cells.len() > (steps * steps) as usize {
        return false;
    }
    let is_own = |cell: u32| fragment.cells.binary_search(&cell).is_ok();
    let is_wall = |cell: u32| cells.class(cell) == Some(Class::Wall);
    // The first cell beyond the fragment in a direction, in the plane of a cell, is wall. Directions are aside and up.
    let wall_goes_on = |cell: u32, normal: &[f32; 3], [aside, up]: [f64; 2]| {
        let at = cells.centre(cell);
        let level = f64::from(normal[0].hypot(normal[1])).max(1e-6);
        let [nx, ny] = [normal[0], normal[1]].map(|part| f64::from(part) / level);
        for step in 1..=steps {
            let [by_m, up_m] = [aside, up].map(|part| part * f64::from(step) * cells.side_m);
            let beside = [-1.0, 0.0, 1.0].map(|off| {
                let off_m = off * cells.side_m;
                cells.at(&[at[0] - by_m * ny + off_m * nx, at[1] + by_m * nx + off_m * ny, at[2] + up_m])
            });
            let mut others = beside.into_iter().flatten().filter(|cell| !is_own(*cell)).peekable();
            if others.peek().is_some() && !beside.into_iter().flatten().any(is_own) {
                return others.any(is_wall);
            }
        }
        false
    };
    let (mut inside, mut all) = (0usize, 0usize);
    for cell in fragment.cells.iter().copied() {
        all += 1;
        let Some(normal) = cells.normal(cell).filter(|n| n[2].abs() < UPRIGHT) else { continue };
        let [left, right] = [-1.0, 1.0].map(|aside| wall_goes_on(cell, &normal, [aside, 0.0]));
        // Corners of a room have the wall on one side only.
        inside += usize::from(left && right || (left || right) && wall_goes_on(cell, &normal, [0.0, 1.0]));
    }
    inside as f64 >= MIN_INSIDE_FRACTION * all as f64
}

/// Returns whether things of a class lie in the plane of a wall.
fn is_flat(class: Class) -> bool {
    use Class::*;
    matches!(class, Door | Window | Television | Radiator | Curtain | Mirror | Picture)
}
