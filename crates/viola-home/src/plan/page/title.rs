//! The title block: what the page is, its scale, a scale bar and the axes of the LiDAR map.

use super::{INK, LINE_MM, Page, QUIET, THIN_MM, TITLE_MM, UNFILMED_WALL, shortened, text_width_mm};
use crate::plan::model::Plan;
use crate::svg::escape;
use std::fmt::Write;

const LEFT_MM: f64 = 10.0;
/// Size of the title's letters, and the width of the narrowest ones as a fraction of it.
const TITLE_LETTERS_MM: f64 = 4.4;
const NARROWEST: f64 = 0.25;
/// Size of the letters at the scale bar.
const BAR_LETTERS_MM: f64 = 2.4;
/// Width of the axes and their caption at the right edge of the page, with the space before them.
const AXES_MM: f64 = 36.0;
/// Longest scale bar, and where it begins on wide pages, as a fraction of their width.
const BAR_MM: f64 = 50.0;
const BAR_BEGINS: f64 = 0.45;

pub(super) fn draw(plan: &Plan, page: &Page, out: &mut String) {
    let top = page.height_mm - TITLE_MM;
    let right = page.width_mm - LEFT_MM;
    let _ = writeln!(
        out,
        "<path d=\"M{LEFT_MM} {top:.2}H{right:.2}\" stroke=\"{INK}\" stroke-width=\"{LINE_MM}\"/>"
    );
    // The sum of no numbers is -0.
    let area_m2 = plan.rooms.iter().map(|room| room.area_m2).sum::<f64>() + 0.0;
    let rooms = (0..plan.rooms.len()).filter(|at| !plan.is_further_part(*at)).count();
    let plural = if rooms == 1 { "" } else { "s" };
    let heading = escape(&heading(&plan.title(), page.width_mm - LEFT_MM - AXES_MM));
    text(out, [LEFT_MM, top + 6.5], TITLE_LETTERS_MM, INK, "start", true, &heading);
    let facts = format!("{rooms} room{plural}, {area_m2:.1} m\u{b2}");
    text(out, [LEFT_MM, top + 11.5], 2.8, QUIET, "start", false, &facts);
    let scale = format!("Scale 1:{:.0}, measures in metres", page.scale);
    text(out, [LEFT_MM, top + 15.8], 2.4, QUIET, "start", false, &scale);
    if !plan.unfilmed_masonry.is_empty() {
        legend([LEFT_MM, top + 20.1], out);
    }
    bar(page, top + 9.0, out);
    axes(plan, [right - 12.0, top + 12.5], out);
}

/// A sample of the walls that are in the LiDAR map only, and its meaning.
fn legend([x, y]: [f64; 2], out: &mut String) {
    let _ = writeln!(
        out,
        "<rect x=\"{x:.2}\" y=\"{:.2}\" width=\"4\" height=\"1.8\" fill=\"{UNFILMED_WALL}\" stroke=\"{INK}\" stroke-width=\"{THIN_MM}\"/>",
        y - 1.8
    );
    text(out, [x + 5.2, y], 2.4, QUIET, "start", false, "not filmed: by the LiDAR map only");
}

/// Returns the part of a title for which there is room.
fn heading(title: &str, width_mm: f64) -> String {
    let fits = |words: &String| text_width_mm(words, TITLE_LETTERS_MM, true) <= width_mm;
    let letters = title.chars().count().min((width_mm / (NARROWEST * TITLE_LETTERS_MM)) as usize);
    (1..=letters).rev().map(|longest| shortened(title, longest)).find(fits).unwrap_or_default()
}

fn text(out: &mut String, at: [f64; 2], size: f64, ink: &str, anchor: &str, is_bold: bool, words: &str) {
    let weight = if is_bold { " font-weight=\"600\"" } else { "" };
    let _ = writeln!(
        out,
        "<text x=\"{:.2}\" y=\"{:.2}\" font-size=\"{size}\" fill=\"{ink}\" text-anchor=\"{anchor}\"{weight}>{words}</text>",
        at[0], at[1]
    );
}

/// A bar of round metres in four parts, left of the axes.
fn bar(page: &Page, y: f64, out: &mut String) {
    let round = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0];
    let length_m = round.into_iter().rfind(|m| page.mm(*m) <= BAR_MM).unwrap_or(0.5);
    let part = page.mm(length_m) / 4.0;
    let last = format!("{length_m} m");
    let beyond_mm = text_width_mm(&last, BAR_LETTERS_MM, false) / 2.0;
    let x = (BAR_BEGINS * page.width_mm).min(page.width_mm - AXES_MM - beyond_mm - 4.0 * part);
    for i in 0..4 {
        let fill = if i % 2 == 0 { INK } else { "#ffffff" };
        let _ = writeln!(
            out,
            "<rect x=\"{:.2}\" y=\"{y:.2}\" width=\"{part:.2}\" height=\"1.4\" fill=\"{fill}\" stroke=\"{INK}\" stroke-width=\"{THIN_MM}\"/>",
            x + f64::from(i) * part
        );
    }
    let half = (length_m / 2.0).to_string();
    for (i, words) in [(0.0, "0"), (2.0, half.as_str()), (4.0, last.as_str())] {
        text(out, [x + i * part, y + 4.4], BAR_LETTERS_MM, QUIET, "middle", false, words);
    }
}

/// Arrows along the axes of the LiDAR map: its y is what robots call up, not north.
fn axes(plan: &Plan, [x, y]: [f64; 2], out: &mut String) {
    const LENGTH_MM: f64 = 8.0;
    let turn = -plan.map_from_plan.yaw_rad;
    let caption = "map axes";
    for (words, angle) in [("x", turn), ("y", turn + std::f64::consts::FRAC_PI_2)] {
        let along = [angle.cos(), -angle.sin()];
        let tip = [x + LENGTH_MM * along[0], y + LENGTH_MM * along[1]];
        let side =
            |by: f64| [tip[0] - 1.8 * along[0] - by * along[1], tip[1] - 1.8 * along[1] + by * along[0]];
        let (a, b) = (side(0.7), side(-0.7));
        let _ = writeln!(
            out,
            "<path d=\"M{x:.2} {y:.2}L{:.2} {:.2}\" stroke=\"{INK}\" stroke-width=\"{LINE_MM}\"/>\
             <path d=\"M{:.2} {:.2}L{:.2} {:.2}L{:.2} {:.2}Z\" fill=\"{INK}\"/>",
            tip[0], tip[1], tip[0], tip[1], a[0], a[1], b[0], b[1]
        );
        text(
            out,
            [tip[0] + 1.8 * along[0], tip[1] + 1.8 * along[1] + 0.8],
            2.4,
            QUIET,
            "middle",
            false,
            words,
        );
    }
    let width = text_width_mm(caption, 2.2, false);
    text(out, [x - width / 2.0 - 2.0, y + 1.0], 2.2, QUIET, "middle", false, caption);
}
