//! Dimension lines: the chain of rooms and the inner size of the whole home, above and left of the drawing.

use super::{Page, QUIET, metres, text_width_mm};
use crate::plan::axes::{place, span};
use crate::plan::model::Plan;
use std::fmt::Write;

/// Distances of the two lines from the drawing.
const CHAIN_MM: f64 = 6.0;
const WHOLE_MM: f64 = 13.0;
const TEXT_MM: f64 = 2.4;
/// Half of a tick.
const TICK_MM: f64 = 0.9;
/// Steps along a side at which the outermost room is looked for.
const STEP_M: f64 = 0.02;

pub(super) fn draw(plan: &Plan, page: &Page, out: &mut String) {
    let (low, high) = plan.bounds_m();
    if plan.rooms.is_empty() {
        return;
    }
    // The outer faces of outer walls are not measured.
    let inner = span(plan.rooms.iter().flat_map(|room| &room.outline.ring_m));
    for (axis, whole) in inner.into_iter().enumerate() {
        let chain = chain(plan, axis, low, high);
        for [from, to] in &chain {
            dimension(page, axis, [*from, *to], CHAIN_MM, out);
        }
        let is_told = |[from, to]: &[f64; 2]| metres(to - from) == metres(whole[1] - whole[0]);
        if !chain.iter().any(is_told) {
            dimension(page, axis, whole, WHOLE_MM, out);
        }
    }
}

/// Returns the inner widths of the rooms that are outermost at the upper (axis 0) or the left side (axis 1).
fn chain(plan: &Plan, axis: usize, low: [f64; 2], high: [f64; 2]) -> Vec<[f64; 2]> {
    let mut chain: Vec<(usize, [f64; 2])> = Vec::new();
    for (along, room) in outermost(plan, axis, low, high) {
        match chain.last_mut() {
            Some((last, span)) if *last == room && along - span[1] < 1.5 * STEP_M => span[1] = along,
            _ => chain.push((room, [along, along])),
        }
    }
    // Ends are put on the corners of the room's outline.
    let exact = |room: usize, along: f64| {
        let corners = plan.rooms[room].outline.ring_m.iter().map(|corner| corner[axis]);
        let nearest = corners.min_by(|a, b| (a - along).abs().total_cmp(&(b - along).abs())).unwrap_or(along);
        if (nearest - along).abs() < 2.0 * STEP_M { nearest } else { along }
    };
    chain
        .into_iter()
        .map(|(room, span)| span.map(|along| exact(room, along)))
        .filter(|s| s[1] - s[0] > 0.2)
        .collect()
}

/// Returns the steps along a side at which there is a room, and the outermost one.
fn outermost(plan: &Plan, axis: usize, low: [f64; 2], high: [f64; 2]) -> Vec<(f64, usize)> {
    let count = (((high[axis] - low[axis]) / STEP_M) as usize).min(20_000);
    let along = |step: usize| low[axis] + (step as f64 + 0.5) * STEP_M;
    // A step beside a coordinate.
    let step = |metres: f64| ((metres - low[axis]) / STEP_M).max(0.0) as usize;
    let mut found: Vec<Option<(f64, usize)>> = vec![None; count];
    for (number, room) in plan.rooms.iter().enumerate() {
        let ring = &room.outline.ring_m;
        for (a, b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
            let [from, to] = [a[axis].min(b[axis]), a[axis].max(b[axis])].map(step);
            for (at, found) in found.iter_mut().enumerate().take(to + 2).skip(from.saturating_sub(1)) {
                let Some(across) = crossing(a, b, axis, along(at)) else { continue };
                let reach = if axis == 0 { across } else { -across };
                if found.is_none_or(|(most, _)| reach.total_cmp(&most).is_ge()) {
                    *found = Some((reach, number));
                }
            }
        }
    }
    let found = found.into_iter().enumerate();
    found.filter_map(|(at, found)| Some((along(at), found?.1))).collect()
}

/// Returns where a side crosses a line at `along` of an axis.
fn crossing(a: &[f64; 2], b: &[f64; 2], axis: usize, along: f64) -> Option<f64> {
    ((a[axis] > along) != (b[axis] > along)).then(|| {
        let part = (along - a[axis]) / (b[axis] - a[axis]);
        a[1 - axis] + part * (b[1 - axis] - a[1 - axis])
    })
}

/// Draws a dimension line above the drawing (axis 0) or left of it (axis 1).
fn dimension(page: &Page, axis: usize, [from, to]: [f64; 2], off_mm: f64, out: &mut String) {
    let words = metres(to - from);
    let across = page.corner_mm[1 - axis] - off_mm;
    let ends = [from, to].map(|metres| place(axis, page.place([metres; 2])[axis], across));
    let [along, aside] = place(axis, "H", "V");
    let mut path = format!("M{:.2} {:.2}{along}{:.2}", ends[0][0], ends[0][1], ends[1][axis]);
    for [x, y] in ends {
        let [left, right, up, down] = [x - TICK_MM, x + TICK_MM, y - TICK_MM, y + TICK_MM];
        path += &format!("M{left:.2} {down:.2}L{right:.2} {up:.2}");
    }
    for end in ends {
        let [x, y] = place(axis, end[axis], across + 1.8);
        path += &format!("M{x:.2} {y:.2}{aside}{:.2}", across - 1.4);
    }
    let _ = writeln!(out, "<path d=\"{path}\"/>");
    if text_width_mm(&words, TEXT_MM, false) < page.mm(to - from) - 0.5 {
        let middle = (ends[0][axis] + ends[1][axis]) / 2.0;
        text(out, place(axis, middle, across - 1.0), axis == 1, &words);
    }
}

fn text(out: &mut String, [x, y]: [f64; 2], is_turned: bool, words: &str) {
    let turn = if is_turned { format!(" transform=\"rotate(-90 {x:.2} {y:.2})\"") } else { String::new() };
    let _ = writeln!(
        out,
        "<text x=\"{x:.2}\" y=\"{y:.2}\" font-size=\"{TEXT_MM}\" fill=\"{QUIET}\" stroke=\"none\"{turn}>{words}</text>"
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::model::PlanRoom;
    use crate::plan::tests::plan_of_rooms;
    use crate::rooms::outline::Outline;

    /// A large map: each room has few steps along a side.
    #[test]
    fn the_outermost_of_very_many_rooms_are_found_soon() {
        const SIDE: usize = 100;
        let room = |at: usize| {
            let [x, y] = [at % SIDE, at / SIDE].map(|place| place as f64 * 2.0);
            let ring_m = vec![[x, y], [x + 1.5, y], [x + 1.5, y + 1.5], [x, y + 1.5]];
            let outline = Outline { ring_m, holes_m: Vec::new() };
            PlanRoom { id: None, name: None, area_m2: 2.25, label_at_m: [x + 0.75, y + 0.75], outline }
        };
        let plan = plan_of_rooms((0..SIDE * SIDE).map(room).collect());
        let (low, high) = plan.bounds_m();
        let spans: Vec<[f64; 2]> =
            (0..SIDE).map(|place| [0.0, 1.5].map(|end| place as f64 * 2.0 + end)).collect();
        // The upper row, and the left column.
        for axis in 0..2 {
            let found = outermost(&plan, axis, low, high);
            let is_outermost = |room: usize| [room / SIDE == SIDE - 1, room.is_multiple_of(SIDE)][axis];
            assert!(found.iter().all(|(_, room)| is_outermost(*room)));
            // The last step may be beyond the drawing.
            assert!((75 * SIDE - 1..=75 * SIDE).contains(&found.len()), "{}", found.len());
            assert_eq!(chain(&plan, axis, low, high), spans);
        }
    }
}
