//! The page of a plan: its scale, the place of the drawing on it, and the colours and sizes of its parts.

pub(super) mod dimensions;
pub(super) mod furniture;
pub(super) mod image;
pub(super) mod labels;
pub(super) mod openings;
pub(super) mod pdf;
pub(super) mod svg;
pub(super) mod title;

use super::model::Plan;
use viola_geometry::Point2;

/// Scales of drawings, 1 to this.
const SCALES: [f64; 12] = [20.0, 25.0, 50.0, 75.0, 100.0, 150.0, 200.0, 250.0, 500.0, 1000.0, 2000.0, 5000.0];
/// The longer side of the drawing on paper, at most.
const LONGEST_MM: f64 = 260.0;
/// Space around the drawing: for dimension lines above and left of it.
const BEFORE_MM: f64 = 26.0;
const AFTER_MM: f64 = 12.0;
/// Height of the title block.
const TITLE_MM: f64 = 24.0;
/// Narrowest page: the title block needs it.
const NARROWEST_MM: f64 = 150.0;

pub(super) const INK: &str = "#20242b";
pub(super) const WALL: &str = "#2f343d";
pub(super) const QUIET: &str = "#5d6673";
pub(super) const FURNITURE: &str = "#8a929e";
/// Tints of rooms: light and distinct.
pub(super) const ROOMS: [&str; 8] =
    ["#fbf5e9", "#edf4fb", "#eef7ee", "#fbeff2", "#f3f0fb", "#ebf6f6", "#fcf2e9", "#f5f7e6"];

/// Lines, in millimetres of paper.
pub(super) const THIN_MM: f64 = 0.13;
pub(super) const LINE_MM: f64 = 0.2;

/// A page in millimetres, x right and y down.
pub(super) struct Page {
    /// The drawing is 1 to this.
    pub scale: f64,
    pub width_mm: f64,
    pub height_mm: f64,
    /// Upper left corner of the drawing in the plan's frame, and its place on the page.
    corner_m: [f64; 2],
    corner_mm: [f64; 2],
    /// Box of the drawing on the page.
    pub drawing_mm: [[f64; 2]; 2],
}

impl Page {
    pub fn of(plan: &Plan) -> Page {
        let (low, high) = plan.bounds_m();
        let size_m = [0, 1].map(|axis| (high[axis] - low[axis]).max(1.0));
        let longest_m = size_m[0].max(size_m[1]);
        let fits = |scale: &f64| longest_m * 1e3 / scale <= LONGEST_MM;
        let scale = SCALES.into_iter().find(fits).unwrap_or(SCALES[SCALES.len() - 1]);
        let [width, height] = size_m.map(|side| side * 1e3 / scale);
        let width_mm = (width + BEFORE_MM + AFTER_MM).max(NARROWEST_MM);
        let left = BEFORE_MM + (width_mm - width - BEFORE_MM - AFTER_MM) / 2.0;
        Page {
            scale,
            width_mm,
            height_mm: height + BEFORE_MM + AFTER_MM + TITLE_MM,
            corner_m: [low[0], high[1]],
            corner_mm: [left, BEFORE_MM],
            drawing_mm: [[left, BEFORE_MM], [left + width, BEFORE_MM + height]],
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

/// Returns the width of a text in letters of `size_mm`, as estimated for the font in the binary.
pub(super) fn text_width_mm(words: &str, size_mm: f64) -> f64 {
    words.chars().map(|c| if c.is_ascii() { 0.56 } else { 0.85 }).sum::<f64>() * size_mm
}

/// Returns a length in metres with two decimals.
pub(super) fn metres(length_m: f64) -> String {
    format!("{length_m:.2}")
}

pub(super) fn point([x, y]: [f64; 2]) -> Point2 {
    Point2::new(x, y)
}
