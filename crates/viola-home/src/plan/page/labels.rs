//! Names, areas and sizes of rooms, where they cover as little furniture and swings of doors as possible.

use super::{INK, Page, QUIET, metres, point, shortened};
use crate::plan::model::{Plan, PlanRoom};
use crate::rooms::bands::Bands;
use crate::svg::{escape, text_width};
use std::fmt::Write;

/// Maximum letters of a drawn name.
const LONGEST: usize = 28;
/// Size of a name's letters; small rooms get smaller ones.
const NAME_MM: f64 = 3.4;
const SHRINK: [f64; 4] = [1.0, 0.82, 0.66, 0.5];
/// Places that are tried along each side of a room.
const PLACES: usize = 20;

struct Line {
    words: String,
    size_mm: f64,
    is_name: bool,
}

pub(super) fn draw(plan: &Plan, page: &Page, out: &mut String) {
    for room in &plan.rooms {
        let (lines, at_m) = placed(room, plan, page);
        let [x, mut y] = page.place(at_m);
        y -= height_mm(&lines) / 2.0;
        for line in &lines {
            y += 1.3 * line.size_mm;
            let (ink, weight) = if line.is_name { (INK, " font-weight=\"600\"") } else { (QUIET, "") };
            // The halo keeps letters readable on furniture.
            let _ = writeln!(
                out,
                "<text x=\"{x:.2}\" y=\"{:.2}\" font-size=\"{:.2}\" fill=\"{ink}\"{weight} stroke=\"#ffffff\" \
                 stroke-width=\"{:.2}\" paint-order=\"stroke\" stroke-linejoin=\"round\">{}</text>",
                y - 0.25 * line.size_mm,
                line.size_mm,
                0.3 * line.size_mm,
                escape(&line.words)
            );
        }
    }
}

fn name(room: &PlanRoom) -> String {
    let shown: String = room.title().chars().filter(|letter| !letter.is_control()).collect();
    shortened(shown.trim(), LONGEST)
}

fn lines(room: &PlanRoom, shrink: f64) -> Vec<Line> {
    let size = |axis: usize| {
        let along = room.outline.ring_m.iter().map(|corner| corner[axis]);
        let (low, high) =
            along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)));
        high - low
    };
    let line =
        |words: String, part: f64, is_name: bool| Line { words, size_mm: NAME_MM * shrink * part, is_name };
    let mut lines =
        vec![line(name(room), 1.0, true), line(format!("{:.1} m\u{b2}", room.area_m2), 0.8, false)];
    // Width and depth say something of rectangles only.
    if room.area_m2 > 0.9 * size(0) * size(1) {
        lines.push(line(format!("{} \u{d7} {} m", metres(size(0)), metres(size(1))), 0.65, false));
    }
    lines
}

fn height_mm(lines: &[Line]) -> f64 {
    lines.iter().map(|line| 1.3 * line.size_mm).sum()
}

/// Returns the lines of a room and their middle: the largest letters that fit, where they cover least.
fn placed(room: &PlanRoom, plan: &Plan, page: &Page) -> (Vec<Line>, [f64; 2]) {
    let mut last = (lines(room, SHRINK[SHRINK.len() - 1]), room.label_at_m);
    // As multiples of the letters' sizes: a text is laid out once for all of them.
    let widths: Vec<f64> = last.0.iter().map(|line| text_width(&line.words, line.is_name)).collect();
    let bands = Bands::new(&room.outline.ring_m, &room.outline.holes_m);
    for shrink in SHRINK {
        let mut lines = lines(room, shrink);
        while !lines.is_empty() {
            let widths_mm = lines.iter().zip(&widths).map(|(line, width)| width * line.size_mm);
            let half_m =
                [widths_mm.fold(0.0, f64::max) / 2.0, height_mm(&lines) / 2.0].map(|mm| page.metres(mm));
            if let Some(at) = best_place(room, &bands, half_m, plan) {
                return (lines, at);
            }
            if shrink > SHRINK[SHRINK.len() - 1] || lines.len() == 1 {
                break;
            }
            lines.pop();
            last = (vec![], room.label_at_m);
        }
        if last.0.is_empty() {
            last.0 = self::lines(room, shrink);
            last.0.truncate(1);
        }
    }
    last
}

/// Returns corners of the furniture and of the swings of doors.
fn drawn(plan: &Plan) -> Vec<Vec<[f64; 2]>> {
    let furniture = plan.furniture.iter().map(|piece| piece.corners_m().to_vec());
    let swings = plan.openings.iter().filter_map(|opening| opening.swing);
    furniture.chain(swings.map(|swing| vec![swing.hinge_m, swing.open_m, swing.closed_m])).collect()
}

/// Returns the place of a box within a room where it covers least furniture and swings of doors, near the room's middle.
fn best_place(room: &PlanRoom, bands: &Bands, half_m: [f64; 2], plan: &Plan) -> Option<[f64; 2]> {
    let ring = &room.outline.ring_m;
    let bound = |axis: usize, pick: fn(f64, f64) -> f64, start: f64| {
        ring.iter().map(|corner| corner[axis]).fold(start, pick)
    };
    let low = [0, 1].map(|axis| bound(axis, f64::min, f64::INFINITY));
    let high = [0, 1].map(|axis| bound(axis, f64::max, f64::NEG_INFINITY));
    let is_inside = |p: [f64; 2]| {
        let steps = [-1.0, -0.5, 0.0, 0.5, 1.0];
        steps.iter().all(|i| {
            [-1.0, 0.0, 1.0]
                .iter()
                .all(|j| bands.contains(&point([p[0] + i * half_m[0], p[1] + j * half_m[1]])))
        })
    };
    let drawn = drawn(plan);
    let covered = |p: [f64; 2]| {
        let covered_m2 = drawn.iter().map(|corners| {
            let overlap = |axis: usize| {
                let along = || corners.iter().map(|corner| corner[axis]);
                let low = along().fold(f64::INFINITY, f64::min).max(p[axis] - half_m[axis]);
                let high = along().fold(f64::NEG_INFINITY, f64::max).min(p[axis] + half_m[axis]);
                (high - low).max(0.0)
            };
            overlap(0) * overlap(1)
        });
        covered_m2.sum::<f64>() / (4.0 * half_m[0] * half_m[1])
    };
    let mut best: Option<(f64, [f64; 2])> = None;
    for i in 0..PLACES * PLACES {
        let at = [i % PLACES, i / PLACES];
        let p =
            [0, 1].map(|axis| low[axis] + (at[axis] as f64 + 0.5) / PLACES as f64 * (high[axis] - low[axis]));
        if !is_inside(p) {
            continue;
        }
        let away_m = (p[0] - room.label_at_m[0]).hypot(p[1] - room.label_at_m[1]);
        let cost = 3.0 * covered(p) + 0.15 * away_m;
        if best.is_none_or(|(least, _)| cost < least - 1e-9) {
            best = Some((cost, p));
        }
    }
    best.map(|(_, p)| p)
}
