//! Region of a walk, and paths in it.

use crate::simulate::clearance::largest_region;
use crate::simulate::home::Home;
use crate::simulate::plan::{Room, RoomKind};
use crate::simulate::rng::Rng;
use crate::simulate::survey::Survey;
use std::collections::VecDeque;
use viola_geometry::{Grid, Point2, Vector2};

/// Returns one room, sometimes with an adjacent one, and the cells where a person can stand.
pub(super) fn region(
    home: &Home,
    survey: &Survey,
    free: &Grid<bool>,
    rng: &mut Rng,
) -> (Grid<bool>, Vec<usize>) {
    let plan = &home.plan;
    let weights: Vec<f64> = plan.rooms.iter().map(|room| weight(room, survey)).collect();
    let mut left = rng.between(0.0, weights.iter().sum());
    let mut first = 0;
    for (index, weight) in weights.iter().enumerate() {
        if *weight > 0.0 {
            first = index;
            left -= weight;
        }
        if left <= 0.0 && *weight > 0.0 {
            break;
        }
    }
    let mut rooms = vec![first];
    let joined = |open: bool| -> Vec<usize> {
        let ways = plan.openings.iter().filter(|o| o.is_way() && open == (o.width_m > 1.3));
        ways.filter(|o| o.rooms.contains(&Some(first)))
            .flat_map(|o| o.rooms.into_iter().flatten())
            .filter(|&room| room != first && weights[room] > 0.0)
            .collect()
    };
    rooms.extend(joined(true));
    let small = plan.rooms[first].inner.area_m2() < 7.0;
    if rng.chance(if small { 0.6 } else { 0.3 }) {
        rooms.extend(rng.any(&joined(false)).copied());
    }
    rooms.sort_unstable();
    rooms.dedup();
    let mut cells = free.clone();
    for (index, cell) in cells.cells.iter_mut().enumerate() {
        let centre = free.frame.centre(index % free.frame.width, index / free.frame.width);
        *cell &= rooms.iter().any(|&room| plan.rooms[room].outline.contains(&centre));
    }
    (largest_region(&cells), rooms)
}

/// Returns the relative probability of a clip in a room; 0 if the vacuum did not map it.
fn weight(room: &Room, survey: &Survey) -> f64 {
    if survey.coverage(room) < 0.15 {
        return 0.0;
    }
    let size = room.inner.area_m2().sqrt();
    match room.kind {
        RoomKind::Corridor => 0.5,
        RoomKind::Storage | RoomKind::Bathroom => 0.4 * size,
        _ => size,
    }
}

/// Returns the shortest path over the region's cells, smoothed where it stays inside.
pub(super) fn path(region: &Grid<bool>, from: &Point2, to: &Point2) -> VecDeque<Point2> {
    let frame = region.frame;
    let cell = |point: &Point2| frame.cell(point).map(|(x, y)| y * frame.width + x);
    let (Some(start), Some(goal)) = (cell(from), cell(to)) else { return VecDeque::new() };
    let mut previous = vec![usize::MAX; frame.len()];
    let mut queue = VecDeque::from([start]);
    previous[start] = start;
    while let Some(index) = queue.pop_front() {
        if index == goal {
            break;
        }
        let (x, y) = ((index % frame.width) as i64, (index / frame.width) as i64);
        for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)] {
            let (nx, ny) = (x + dx, y + dy);
            if nx < 0 || ny < 0 || nx >= frame.width as i64 || ny >= frame.height as i64 {
                continue;
            }
            let next = ny as usize * frame.width + nx as usize;
            if region.cells[next] && previous[next] == usize::MAX {
                previous[next] = index;
                queue.push_back(next);
            }
        }
    }
    if previous[goal] == usize::MAX {
        return VecDeque::new();
    }
    let mut points = vec![];
    let mut index = goal;
    while index != start {
        points.push(frame.centre(index % frame.width, index / frame.width));
        index = previous[index];
    }
    points.push(*from);
    points.reverse();
    rounded(region, &points)
}

fn rounded(region: &Grid<bool>, points: &[Point2]) -> VecDeque<Point2> {
    let reach = 3usize;
    let smooth = |k: usize| {
        let near = &points[k.saturating_sub(reach)..(k + reach + 1).min(points.len())];
        let sum = near.iter().fold(Vector2::zeros(), |sum, p| sum + p.coords);
        let mean = Point2::from(sum / near.len() as f64);
        if region.at(&mean) == Some(true) { mean } else { points[k] }
    };
    (1..points.len()).map(smooth).collect()
}
