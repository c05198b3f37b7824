//! Symbols of furniture on the page.

use super::{FURNITURE, Page};
use crate::plan::model::Plan;
use crate::plan::symbols::strokes;
use crate::svg::escape;
use std::fmt::Write;

pub(super) fn draw(plan: &Plan, page: &Page, out: &mut String) {
    for piece in &plan.furniture {
        let (id, class) = (escape(&piece.id), piece.class.name());
        let _ = writeln!(out, "<g class=\"{class}\" stroke=\"{FURNITURE}\"><title>{id}</title>");
        for stroke in strokes(piece) {
            let path =
                if stroke.is_closed { page.ring(&stroke.points_m) } else { page.line(&stroke.points_m) };
            let fill = if stroke.is_filled { "#ffffff" } else { "none" };
            let _ = writeln!(out, "<path d=\"{path}\" fill=\"{fill}\"/>");
        }
        let _ = writeln!(out, "</g>");
    }
}
