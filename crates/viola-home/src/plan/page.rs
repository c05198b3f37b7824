//! The page of a plan: its scale, the place of the drawing on it, and the colours and sizes of its parts.

pub(super) mod dimensions;
pub(super) mod furniture;
pub(super) mod image;
pub(super) mod labels;
pub(super) mod openings;
pub(super) mod pdf;
pub(super) mod svg;
mod tints;
pub(super) mod title;

use super::model::Plan;
use crate::svg::text_width;

/// Scales of drawings, 1 to this.
const SCALES: [f64; 12] = [20.0, 25.0, 50.0, 75.0, 100.0, 150.0, 200.0, 250.0, 500.0, 1000.0, 2000.0, 5000.0];
/// Sheets of paper (ISO 216): the shorter and the longer side, and the smallest scale at which the sheet is taken.
const A4: ([f64; 2], f64) = ([210.0, 297.0], 100.0);
const A3: ([f64; 2], f64) = ([297.0, 420.0], f64::INFINITY);
/// Space around the drawing: for dimension lines above and left of it.
const BEFORE_MM: f64 = 26.0;
const AFTER_MM: f64 = 12.0;
/// Height of the title block.
const TITLE_MM: f64 = 24.0;
/// Narrowest page: the title block needs it.
const NARROWEST_MM: f64 = 150.0;

pub(super) const INK: &str = "#20242b";
pub(super) const WALL: &str = "#2f343d";
/// Walls that are in the LiDAR map only.
pub(super) const UNFILMED_WALL: &str = "#b4bbc6";
pub(super) const QUIET: &str = "#5d6673";
pub(super) const FURNITURE: &str = "#8a929e";

/// Lines, in millimetres of paper.
pub(super) const THIN_MM: f64 = 0.13;
pub(super) const LINE_MM: f64 = 0.2;

/// A page in millimetres, x right and y down.
pub(super) struct Page {
    /// The drawing is 1 to this.
    pub scale: f64,
    pub width_mm: f64,
    pub height_mm: f64,
    /// Width and height of the sheet of paper on which the page is printed.
    pub sheet_mm: [f64; 2],
    /// Upper left corner of the drawing in the plan's frame, and its place on the page.
    corner_m: [f64; 2],
    corner_mm: [f64; 2],
}

impl Page {
    pub fn of(plan: &Plan) -> Page {
        let (low, high) = plan.bounds_m();
        let size_m = [0, 1].map(|axis| (high[axis] - low[axis]).max(1.0));
        let (scale, sheet_mm) = scale_and_sheet(size_m);
        let width = size_m[0] * 1e3 / scale;
        let [width_mm, height_mm] = page_mm(size_m, scale);
        let left = BEFORE_MM + (width_mm - width - BEFORE_MM - AFTER_MM) / 2.0;
        Page {
            scale,
            width_mm,
            height_mm,
            sheet_mm,
            corner_m: [low[0], high[1]],
            corner_mm: [left, BEFORE_MM],
        }
    }

    /// Returns the place on the page of a point of the plan.
    pub fn place(&self, at_m: [f64; 2]) -> [f64; 2] {
        let mm = 1e3 / self.scale;
        [
            self.corner_mm[0] + (at_m[0] - self.corner_m[0]) * mm,
            self.corner_mm[1] + (self.corner_m[1] - at_m[1]) * mm,
        ]
    }

    /// Returns the length on paper.
    pub fn mm(&self, metres: f64) -> f64 {
        metres * 1e3 / self.scale
    }

    pub fn metres(&self, mm: f64) -> f64 {
        mm * self.scale / 1e3
    }

    /// Returns a closed path through corners.
    pub fn ring(&self, corners_m: &[[f64; 2]]) -> String {
        let mut path = String::new();
        for (i, corner) in corners_m.iter().enumerate() {
            let [x, y] = self.place(*corner);
            path += &format!("{}{x:.2} {y:.2}", if i == 0 { "M" } else { "L" });
        }
        path + "Z"
    }

    /// Returns an open path through points.
    pub fn line(&self, points_m: &[[f64; 2]]) -> String {
        let mut path = self.ring(points_m);
        path.pop();
        path
    }
}

/// Returns the largest scale at which the page of a drawing fits on a sheet, and the sheet's width and height.
fn scale_and_sheet(size_m: [f64; 2]) -> (f64, [f64; 2]) {
    let fits = |(scale, sheet_mm): &(f64, [f64; 2])| {
        let page_mm = page_mm(size_m, *scale);
        (0..2).all(|axis| page_mm[axis] <= sheet_mm[axis])
    };
    let smallest = SCALES[SCALES.len() - 1];
    [A4, A3]
        .into_iter()
        .flat_map(|([short, long], smallest)| {
            let scales = SCALES.into_iter().filter(move |scale| *scale <= smallest);
            scales.flat_map(move |scale| [(scale, [short, long]), (scale, [long, short])])
        })
        .find(fits)
        .unwrap_or((smallest, page_mm(size_m, smallest)))
}

/// Returns width and height of the page of a drawing.
fn page_mm(size_m: [f64; 2], scale: f64) -> [f64; 2] {
    let [width, height] = size_m.map(|side| side * 1e3 / scale);
    [(width + BEFORE_MM + AFTER_MM).max(NARROWEST_MM), height + BEFORE_MM + AFTER_MM + TITLE_MM]
}

/// Returns a text of at most `longest` letters. A longer one ends with an ellipsis, behind its last whole word unless that would
/// take more than half.
pub(super) fn shortened(words: &str, longest: usize) -> String {
    let letters: Vec<char> = words.chars().collect();
    if letters.len() <= longest {
        return words.to_owned();
    }
    let kept = longest.saturating_sub(1);
    // A space right behind the kept letters ends a word, too.
    let space = letters[..=kept].iter().rposition(|letter| letter.is_whitespace());
    let end = space.filter(|space| 2 * space >= longest).unwrap_or(kept);
    let start: String = letters[..end].iter().collect();
    format!("{}\u{2026}", start.trim_end())
}

/// Returns the width of a text in letters of `size_mm`.
pub(super) fn text_width_mm(words: &str, size_mm: f64, is_bold: bool) -> f64 {
    text_width(words, is_bold) * size_mm
}

/// Returns a length in metres with two decimals.
pub(super) fn metres(length_m: f64) -> String {
    format!("{length_m:.2}")
}
