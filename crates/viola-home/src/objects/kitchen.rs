//! Worktops and the units below them. A worktop is level surface at one height: what is called otherwise in the middle of it
//! belongs to it, and it tells which units stand in one run.

use super::cells::Cells;
use super::fit::{BEYOND, span};
use super::fragment::Fragment;
use super::kind::{is_appliance, is_storage};
use super::split::run_of_each;
use std::ops::Range;
use viola_geometry::taxonomy::Class;

/// Heights of worktops, in metres.
const HEIGHTS_M: Range<f64> = 0.75..1.1;
/// Minimum vertical part of a level cell's normal.
const LEVEL: f32 = 0.8;
/// Minimum fraction of a worktop's cells that are called counter, or sink or stove in it; things on it are not.
const MIN_CALLED_FRACTION: f64 = 0.25;
/// Minimum fraction of those that are called counter.
const MIN_COUNTER_FRACTION: f64 = 0.25;
/// Minimum area and depth of a run.
const MIN_AREA_M2: f64 = 0.2;
const MIN_DEPTH_M: f64 = 0.3;
/// A run is longer than a kitchen island is wide.
const MAX_DEPTH_M: f64 = 1.3;
/// Fronts stand out this far from below a worktop.
const OUT_M: f64 = 0.1;

/// Largest height of a worktop's edge.
const EDGE_M: f64 = 0.15;

/// A straight worktop in the frame of the walls.
struct Run {
    cells: Vec<u32>,
    /// Ranges along both axes.
    sides_m: [[f64; 2]; 2],
    top_m: f64,
}

/// Returns the worktops and their units, and takes their cells out.
pub fn kitchens(cells: &mut Cells) -> Vec<Fragment> {
    let fragments = worktops_and_units(cells);
    for cell in fragments.iter().flat_map(|fragment| &fragment.cells) {
        cells.take_out(*cell);
    }
    fragments
}

fn worktops_and_units(cells: &Cells) -> Vec<Fragment> {
    let Some((sin, cos)) = cells.wall_yaw_rad.map(f64::sin_cos) else { return Vec::new() };
    let turned = |[x, y, _]: [f64; 3]| [cos * x + sin * y, cos * y - sin * x];
    let mut runs: Vec<Run> = Vec::new();
    for worktop in worktops(cells) {
        runs.extend(straight(worktop, cells, &turned));
    }
    if runs.is_empty() {
        return Vec::new();
    }
    let below = |at: &[f64; 3], run: &Run, by_m: f64| {
        let place = turned(*at);
        let is_beside = (0..2).any(|axis| {
            place[axis] < run.sides_m[axis][0] - by_m || place[axis] > run.sides_m[axis][1] + by_m
        });
        !is_beside && at[2] < run.top_m + cells.side_m
    };
    // Fronts below the worktop of each run, of units or of a bar.
    let mut units: Vec<[Vec<u32>; 2]> = vec![Default::default(); runs.len()];
    let mut is_top = vec![false; cells.len()];
    runs.iter().flat_map(|run| &run.cells).for_each(|cell| is_top[*cell as usize] = true);
    for cell in cells.all().filter(|cell| !is_top[*cell as usize]) {
        let is_front = |class: &Class| is_storage(*class) || *class == Class::Counter;
        let Some(class) = cells.class(cell).filter(is_front) else { continue };
        let at = cells.centre(cell);
        let under = |by_m: f64| runs.iter().position(|run| below(&at, run, by_m));
        if let Some(run) = under(0.0).or_else(|| under(OUT_M)) {
            units[run][usize::from(class == Class::Counter)].push(cell);
        }
    }
    let is_built_in =
        |cell: &u32| cells.class(*cell).is_some_and(|class| class == Class::Sink || is_appliance(class));
    let mut fragments = Vec::new();
    for (run, [fronts, called_counter]) in runs.into_iter().zip(units) {
        let mut top: Vec<u32> = run.cells.into_iter().filter(|cell| !is_built_in(cell)).collect();
        let is_bar = called_counter.len() > fronts.len();
        let is_edge = |cell: &u32| cells.centre(*cell)[2] > run.top_m - EDGE_M;
        top.extend(called_counter.into_iter().filter(|cell| is_bar || is_edge(cell)));
        if is_bar {
            top.extend(fronts.iter().copied());
        }
        fragments.push(Fragment::new(top, cells));
        if !is_bar && !fronts.is_empty() {
            fragments.push(Fragment { is_unit: true, ..Fragment::new(fronts, cells) });
        }
    }
    fragments
}

/// Returns the connected level cells at the height of each worktop.
fn worktops(cells: &Cells) -> Vec<Vec<u32>> {
    let is_level = |cell: u32| {
        HEIGHTS_M.contains(&cells.centre(cell)[2]) && cells.normal(cell).is_some_and(|n| n[2] > LEVEL)
    };
    let mut is_taken = vec![false; cells.len()];
    let mut found = Vec::new();
    for seed in cells.all() {
        if is_taken[seed as usize] || cells.class(seed) != Some(Class::Counter) || !is_level(seed) {
            continue;
        }
        let height_m = cells.centre(seed)[2];
        is_taken[seed as usize] = true;
        let (mut members, mut open) = (Vec::new(), vec![seed]);
        while let Some(cell) = open.pop() {
            members.push(cell);
            for next in cells.around(cell) {
                let off_m = (cells.centre(next)[2] - height_m).abs();
                if !is_taken[next as usize] && off_m < 1.5 * cells.side_m && is_level(next) {
                    is_taken[next as usize] = true;
                    open.push(next);
                }
            }
        }
        let called = |classes: &[Class]| {
            let is_one = |cell: &&u32| cells.class(**cell).is_some_and(|class| classes.contains(&class));
            members.iter().filter(is_one).count() as f64
        };
        let all = called(&[Class::Counter, Class::Sink, Class::Stove]);
        let is_called =
            all >= MIN_CALLED_FRACTION * members.len() as f64 && all >= called(&[Class::Table, Class::Desk]);
        if is_called && called(&[Class::Counter]) >= MIN_COUNTER_FRACTION * all {
            found.push(members);
        }
    }
    found
}

/// Returns the straight runs of a worktop; what is too small for a run is left out.
fn straight(worktop: Vec<u32>, cells: &Cells, turned: &dyn Fn([f64; 3]) -> [f64; 2]) -> Vec<Run> {
    let places: Vec<[f64; 2]> = worktop.iter().map(|cell| turned(cells.centre(*cell))).collect();
    let run_of = run_of_each(&places);
    let count = run_of.iter().copied().max().map_or(0, |most| most + 1);
    let run = |number: usize| {
        let members: Vec<usize> = (0..places.len()).filter(|i| run_of[*i] == number).collect();
        let side = |axis: usize| {
            let [low, high] = span(members.iter().map(|i| places[*i][axis]), BEYOND);
            [low - cells.side_m / 2.0, high + cells.side_m / 2.0]
        };
        let sides_m = [side(0), side(1)];
        let [x_m, y_m] = sides_m.map(|[low, high]| high - low);
        let is_run = x_m * y_m >= MIN_AREA_M2 && (MIN_DEPTH_M..MAX_DEPTH_M).contains(&x_m.min(y_m));
        let own: Vec<u32> = members.iter().map(|i| worktop[*i]).collect();
        let [top_m, _] = span(own.iter().map(|cell| cells.centre(*cell)[2]), 0.5);
        is_run.then_some(Run { cells: own, sides_m, top_m })
    };
    (0..count).filter_map(run).collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::{classes, found, surface};
    use super::*;
    use crate::map_point::MapPoint;

    /// A worktop with the fronts of its units, along x or y, and walls behind.
    fn run(points: &mut Vec<MapPoint>, low: [f64; 2], high: [f64; 2], front: [[f64; 2]; 2]) {
        points.extend(surface(Class::Counter, [low[0], low[1], 0.86], [high[0], high[1], 0.9], 0));
        let [a, b] = front;
        points.extend(surface(Class::Cabinet, [a[0], a[1], 0.06], [b[0], b[1], 0.83], 0));
    }

    #[test]
    fn a_kitchen_in_a_u_is_three_worktops_and_three_rows_of_units() {
        let mut points = surface(Class::Wall, [-0.1, -0.1, 0.0], [3.1, 0.0, 2.4], 0);
        run(&mut points, [0.0, 0.0], [3.0, 0.6], [[0.6, 0.57], [2.4, 0.6]]);
        run(&mut points, [0.0, 0.6], [0.6, 2.4], [[0.57, 0.6], [0.6, 2.4]]);
        run(&mut points, [2.4, 0.6], [3.0, 2.4], [[2.4, 0.6], [2.43, 2.4]]);
        let want =
            [Class::Cabinet, Class::Cabinet, Class::Cabinet, Class::Counter, Class::Counter, Class::Counter];
        assert_eq!(classes(&found(&points)), want);
        // A part of a worktop that is called otherwise does not divide it.
        for point in &mut points {
            let [x, y, z] = point.point.position_m;
            if (1.2..1.6).contains(&x) && y < 0.6 && z > 0.84 && z < 0.95 {
                point.point.label = viola_reconstruct::Label::new(Class::Box, 0.8, 4);
            }
        }
        assert_eq!(classes(&found(&points)), want);
    }

    #[test]
    fn a_sink_is_no_part_of_its_worktop() {
        let mut points = surface(Class::Wall, [-0.1, -0.1, 0.0], [3.1, 0.0, 2.4], 0);
        run(&mut points, [0.0, 0.0], [3.0, 0.6], [[0.0, 0.57], [3.0, 0.6]]);
        for point in &mut points {
            let [x, y, z] = point.point.position_m;
            if (1.2..1.9).contains(&x) && (0.06..0.54).contains(&y) && z > 0.84 && z < 0.95 {
                point.point.label = viola_reconstruct::Label::new(Class::Sink, 0.8, 4);
            }
        }
        let kitchen = found(&points);
        assert_eq!(classes(&kitchen), [Class::Cabinet, Class::Counter, Class::Sink]);
        assert!((kitchen[1].size_m[0] - 3.0).abs() < 0.15, "{:?}", kitchen[1]);
    }

    /// No picture showed them, so the form decides.
    #[test]
    fn units_of_which_only_the_fronts_were_seen_are_as_deep_as_their_worktop() {
        let mut points = surface(Class::Wall, [-0.1, -0.1, 0.0], [3.1, 0.0, 2.4], 0);
        run(&mut points, [0.0, 0.0], [3.0, 0.6], [[0.0, 0.57], [3.0, 0.6]]);
        for point in &mut points {
            let class = point.point.label.class;
            point.point.label = viola_reconstruct::Label::new(class, 0.7, 0);
        }
        let kitchen = found(&points);
        assert_eq!(classes(&kitchen), [Class::Cabinet, Class::Counter]);
        let [long_m, deep_m, high_m] = kitchen[0].size_m;
        assert!((long_m - 3.0).abs() < 0.15 && (deep_m - 0.6).abs() < 0.1 && high_m > 0.7, "{kitchen:?}");
    }

    #[test]
    fn a_bar_reaches_the_floor() {
        let mut points = surface(Class::Wall, [-0.1, -0.1, 0.0], [3.1, 0.0, 2.4], 0);
        points.extend(surface(Class::Counter, [0.5, 2.0, 0.3], [2.5, 2.5, 1.05], 0));
        let bar = found(&points);
        assert_eq!(bar.len(), 1, "{bar:?}");
        assert_eq!(bar[0].class, Class::Counter);
        assert!(bar[0].bounds().bottom_m().abs() < 1e-9 && (bar[0].size_m[2] - 1.05).abs() < 0.05, "{bar:?}");
    }

    #[test]
    fn desks_and_sideboards_are_no_worktops() {
        let mut points = surface(Class::Wall, [-0.1, -0.1, 0.0], [5.1, 0.0, 2.4], 0);
        points.extend(surface(Class::Desk, [0.0, 0.0, 0.76], [1.4, 0.7, 0.8], 0));
        points.extend(surface(Class::Cabinet, [2.0, 0.0, 0.06], [4.0, 0.45, 0.85], 0));
        // A small part of each is called counter.
        for point in &mut points {
            let [x, y, z] = point.point.position_m;
            if ((0.0..0.3).contains(&x) || (2.0..2.2).contains(&x)) && y > 0.03 && z > 0.7 && z < 0.95 {
                point.point.label = viola_reconstruct::Label::new(Class::Counter, 0.6, 4);
            }
        }
        let objects = found(&points);
        let long_m = |class: Class| objects.iter().find(|o| o.class == class).map_or(0.0, |o| o.size_m[0]);
        assert!(long_m(Class::Desk) > 1.0 && long_m(Class::Cabinet) > 1.7, "{objects:?}");
        assert!(long_m(Class::Counter) < 0.8, "{objects:?}");
    }
}
