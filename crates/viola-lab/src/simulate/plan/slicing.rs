//! Layouts by slicing a rectangle: freely, or along a corridor.

use super::programme::{Wish, wishes};
use super::{Cell, Rect, RoomKind, snap};
use crate::simulate::rng::Rng;

/// Maximum number of layouts drawn; the one with the lowest cost is kept.
const DRAWS: usize = 400;

pub(super) fn layout(rng: &mut Rng) -> Vec<Cell> {
    let rooms = rng.pick([1, 2, 3, 3, 4, 4, 5, 5, 5, 6, 6, 6, 7, 7, 8, 8, 9, 10, 11, 12]);
    let mut list = wishes(rooms, rng);
    if rooms >= 4 && rng.chance(0.35) {
        let area_m2 = list.iter().map(|wish| wish.area_m2).sum::<f64>() * rng.between(0.06, 0.14);
        list.push(Wish { kind: None, area_m2 });
    }
    let has_corridor = list.iter().any(|wish| wish.kind == Some(RoomKind::Corridor));
    let along_corridor = has_corridor && rng.chance(0.75);
    let mut best: Option<(f64, Vec<(Wish, Rect)>)> = None;
    for attempt in 0..DRAWS {
        if best.as_ref().is_some_and(|(least, _)| *least == 0.0) {
            break;
        }
        // Fall back to free layouts: some lists do not fit along a corridor.
        let draw =
            if along_corridor && attempt < DRAWS / 2 { corridor(&list, rng) } else { free(&list, rng) };
        let cost: f64 = draw.iter().map(|(wish, rect)| misfit(wish, rect)).sum();
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, draw));
        }
    }
    let transpose = rng.chance(0.5);
    let cells = best.into_iter().flat_map(|(_, draw)| draw);
    cells
        .filter_map(|(wish, rect)| {
            let swap = |p: [f64; 2]| if transpose { [p[1], p[0]] } else { p };
            let outline = Rect { min: swap(rect.min), max: swap(rect.max) };
            wish.kind.map(|kind| Cell { kind, outline, unit: None })
        })
        .collect()
}

/// Returns the cost of a rectangle as a room; 0 if it is usable.
fn misfit(wish: &Wish, rect: &Rect) -> f64 {
    let (short, long) = (rect.size(0).min(rect.size(1)), rect.size(0).max(rect.size(1)));
    let narrow = (wish.min_side_m() - short).max(0.0) * 10.0;
    let slim = if matches!(wish.kind, Some(RoomKind::Corridor) | None) { 7.0 } else { 1.9 };
    narrow + (long / short - slim).max(0.0)
}

/// Slices one rectangle into all rooms.
fn free(list: &[Wish], rng: &mut Rng) -> Vec<(Wish, Rect)> {
    let area: f64 = list.iter().map(|wish| wish.area_m2).sum();
    let width = snap((area * rng.between(1.0, 1.9)).sqrt());
    let rect = Rect { min: [0.0, 0.0], max: [width, snap(area / width)] };
    let mut list = list.to_vec();
    rng.shuffle(&mut list);
    // Slicing leaves the first of the list in a corner, the only place for the outside.
    list.sort_by_key(|wish| wish.kind.is_some());
    let mut out = vec![];
    slice(&list, rect, rng, &mut out);
    out
}

/// Returns a corridor with rooms on both sides, and sometimes a room across its end.
fn corridor(list: &[Wish], rng: &mut Rng) -> Vec<(Wish, Rect)> {
    let width = snap(rng.between(1.2, 1.7));
    let (way, mut rest): (Vec<Wish>, Vec<Wish>) =
        list.iter().partition(|wish| wish.kind == Some(RoomKind::Corridor));
    rng.shuffle(&mut rest);
    let end =
        rng.chance(0.6).then(|| rest.iter().position(|wish| wish.kind == Some(RoomKind::Living))).flatten();
    let end = end.map(|index| rest.remove(index));
    rest.sort_by_key(|wish| wish.kind.is_some());
    let area: f64 = rest.iter().map(|wish| wish.area_m2).sum();
    let depths = rng.between(5.8, 8.6);
    let length = snap((area / depths).max(2.4));
    let mut first = vec![];
    let mut second = vec![];
    let (mut sum_first, mut sum_second) = (0.0, 0.0);
    for wish in rest {
        let (side, sum) = if sum_first <= sum_second {
            (&mut first, &mut sum_first)
        } else {
            (&mut second, &mut sum_second)
        };
        side.push(wish);
        *sum += wish.area_m2;
    }
    let low = snap(sum_first / length);
    let high = snap(low + width + (sum_second / length).max(1.6));
    let mut out = vec![];
    slice(&first, Rect { min: [0.0, 0.0], max: [length, low] }, rng, &mut out);
    slice(&second, Rect { min: [0.0, low + width], max: [length, high] }, rng, &mut out);
    out.extend(way.first().map(|&wish| (wish, Rect { min: [0.0, low], max: [length, low + width] })));
    if let Some(wish) = end {
        let reach = snap((wish.area_m2 / high).max(2.8));
        out.push((wish, Rect { min: [length, 0.0], max: [length + reach, high] }));
    }
    // Sums of 5 cm steps are inexact, but walls are found by equal coordinates.
    for (_, rect) in &mut out {
        *rect = Rect { min: rect.min.map(snap), max: rect.max.map(snap) };
    }
    out
}

/// Cuts `rect` recursively by area until every request has its own.
fn slice(list: &[Wish], rect: Rect, rng: &mut Rng, out: &mut Vec<(Wish, Rect)>) {
    match list {
        [] => {}
        [wish] => out.push((*wish, rect)),
        _ => {
            let total: f64 = list.iter().map(|wish| wish.area_m2).sum();
            let half = total * rng.between(0.35, 0.65);
            let mut sum = 0.0;
            let mut cut = 0;
            while cut + 1 < list.len() && (cut == 0 || sum < half) {
                sum += list[cut].area_m2;
                cut += 1;
            }
            let longer = if rect.size(0) >= rect.size(1) { 0 } else { 1 };
            let axis = if rng.chance(0.9) { longer } else { 1 - longer };
            let at = snap(rect.min[axis] + rect.size(axis) * sum / total);
            let (mut first, mut second) = (rect, rect);
            first.max[axis] = at;
            second.min[axis] = at;
            slice(&list[..cut], first, rng, out);
            slice(&list[cut..], second, rng, out);
        }
    }
}
