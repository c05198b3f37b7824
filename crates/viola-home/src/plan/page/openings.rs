//! Symbols of doors, passages and windows.

use super::{LINE_MM, Page, QUIET, THIN_MM};
use crate::plan::model::{Opening, OpeningKind, Plan, strip};
use crate::svg::escape;
use std::fmt::Write;

pub(super) fn draw(plan: &Plan, page: &Page, out: &mut String) {
    for opening in &plan.openings {
        let id = escape(&opening.id);
        let _ = writeln!(out, "<g id=\"{id}\">");
        match opening.kind {
            OpeningKind::Door => door(opening, page, out),
            OpeningKind::Passage => passage(opening, page, out),
            OpeningKind::Window => window(opening, page, out),
        }
        let _ = writeln!(out, "</g>");
    }
}

/// The leaf at a right angle and the arc of its end, or only a threshold if no leaf was seen.
fn door(opening: &Opening, page: &Page, out: &mut String) {
    threshold(opening, page, out);
    let Some(swing) = opening.swing else { return };
    let [hinge, open, closed] = [swing.hinge_m, swing.open_m, swing.closed_m].map(|p| page.place(p));
    let radius = (open[0] - hinge[0]).hypot(open[1] - hinge[1]);
    let turn = (open[0] - hinge[0]) * (closed[1] - hinge[1]) - (open[1] - hinge[1]) * (closed[0] - hinge[0]);
    let _ = writeln!(
        out,
        "<path d=\"M{:.2} {:.2}L{:.2} {:.2}\" stroke-width=\"{:.2}\"/>\
         <path d=\"M{:.2} {:.2}A{radius:.2} {radius:.2} 0 0 {} {:.2} {:.2}\" stroke-width=\"{THIN_MM}\"/>",
        hinge[0],
        hinge[1],
        open[0],
        open[1],
        2.0 * LINE_MM,
        open[0],
        open[1],
        u8::from(turn > 0.0),
        closed[0],
        closed[1]
    );
}

/// The lines of both faces across a doorway.
fn threshold(opening: &Opening, page: &Page, out: &mut String) {
    let corners = opening.corners_m();
    let _ = writeln!(
        out,
        "<path d=\"{}\" fill=\"#ffffff\" stroke=\"none\"/><path d=\"{}{}\" stroke=\"{QUIET}\" stroke-width=\"{THIN_MM}\"/>",
        page.ring(&corners),
        page.line(&corners[..2]),
        page.line(&corners[2..])
    );
}

/// Dashed lines of the faces.
fn passage(opening: &Opening, page: &Page, out: &mut String) {
    let corners = opening.corners_m();
    let _ = writeln!(
        out,
        "<path d=\"{}{}\" stroke=\"{QUIET}\" stroke-width=\"{THIN_MM}\" stroke-dasharray=\"1.2 0.8\"/>",
        page.line(&corners[..2]),
        page.line(&corners[2..])
    );
}

/// A bright strip of the wall with the pane as a double line.
fn window(opening: &Opening, page: &Page, out: &mut String) {
    let pane = strip(opening.from_m, opening.to_m, opening.thickness_m * 0.3);
    let _ = writeln!(
        out,
        "<path d=\"{}\" fill=\"#ffffff\"/><path d=\"{}\" fill=\"#d7e9f7\" stroke-width=\"{THIN_MM}\"/>",
        page.ring(&opening.corners_m()),
        page.ring(&pane)
    );
}
