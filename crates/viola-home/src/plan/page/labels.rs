//! Names, areas and sizes of rooms, where they cover as little furniture and swings of doors as possible.

use super::{INK, Page, QUIET, metres, shortened};
use crate::plan::axes::{sample, span};
use crate::plan::model::{Plan, PlanRoom};
use crate::rooms::bands::Bands;
use crate::svg::{escape, text_width};
use std::fmt::Write;
use viola_geometry::Point2;

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
    let drawn = drawn(plan);
    for room in &plan.rooms {
        let (lines, at_m) = placed(room, &drawn, page);
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
    let [width_m, depth_m] = span(&room.outline.ring_m).map(|[low, high]| high - low);
    let line =
        |words: String, part: f64, is_name: bool| Line { words, size_mm: NAME_MM * shrink * part, is_name };
    let mut lines =
        vec![line(name(room), 1.0, true), line(format!("{:.1} m\u{b2}", room.area_m2), 0.8, false)];
    // Width and depth say something of rectangles only.
    if room.area_m2 > 0.9 * width_m * depth_m {
        lines.push(line(format!("{} \u{d7} {} m", metres(width_m), metres(depth_m)), 0.65, false));
    }
    lines
}

fn height_mm(lines: &[Line]) -> f64 {
    lines.iter().map(|line| 1.3 * line.size_mm).sum()
}

/// Returns the lines of a room and their middle: the largest letters that fit, where they cover least.
fn placed(room: &PlanRoom, drawn: &[[[f64; 2]; 2]], page: &Page) -> (Vec<Line>, [f64; 2]) {
    let smallest = SHRINK[SHRINK.len() - 1];
    let mut lines = lines(room, smallest);
    // As multiples of the letters' sizes: a text is laid out once for all of them.
    let widths: Vec<f64> = lines.iter().map(|line| text_width(&line.words, line.is_name)).collect();
    let bands = Bands::new(&room.outline.ring_m, &room.outline.holes_m);
    let place = |lines: &[Line]| {
        let widths_mm = lines.iter().zip(&widths).map(|(line, width)| width * line.size_mm);
        let half_m = [widths_mm.fold(0.0, f64::max) / 2.0, height_mm(lines) / 2.0].map(|mm| page.metres(mm));
        best_place(room, &bands, half_m, drawn)
    };
    for shrink in SHRINK.into_iter().filter(|shrink| *shrink > smallest) {
        let larger = self::lines(room, shrink);
        if let Some(at) = place(&larger) {
            return (larger, at);
        }
    }
    // The name alone is drawn at any rate.
    loop {
        let at = place(&lines);
        if at.is_some() || lines.len() == 1 {
            return (lines, at.unwrap_or(room.label_at_m));
        }
        lines.pop();
    }
}

/// Returns the boxes around the furniture and the swings of doors.
fn drawn(plan: &Plan) -> Vec<[[f64; 2]; 2]> {
    let furniture = plan.furniture.iter().map(|piece| span(piece.corners_m()));
    let swings = plan.openings.iter().filter_map(|opening| opening.swing);
    furniture.chain(swings.map(|swing| span([swing.hinge_m, swing.open_m, swing.closed_m]))).collect()
}

/// Returns the place of a box within a room where it covers least furniture and swings of doors, near the room's middle.
fn best_place(room: &PlanRoom, bands: &Bands, half_m: [f64; 2], drawn: &[[[f64; 2]; 2]]) -> Option<[f64; 2]> {
    let is_inside = |p: [f64; 2]| {
        let steps = [-1.0, -0.5, 0.0, 0.5, 1.0];
        steps.iter().all(|i| {
            [-1.0, 0.0, 1.0]
                .iter()
                .all(|j| bands.contains(&Point2::new(p[0] + i * half_m[0], p[1] + j * half_m[1])))
        })
    };
    let covered = |p: [f64; 2]| {
        let covered_m2 = drawn.iter().map(|span| {
            let overlap = |axis: usize| {
                let [low, high] = span[axis];
                (high.min(p[axis] + half_m[axis]) - low.max(p[axis] - half_m[axis])).max(0.0)
            };
            overlap(0) * overlap(1)
        });
        covered_m2.sum::<f64>() / (4.0 * half_m[0] * half_m[1])
    };
    let around = span(&room.outline.ring_m);
    let mut best: Option<(f64, [f64; 2])> = None;
    for i in 0..PLACES * PLACES {
        let p = sample(around, PLACES, i);
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
