//! A plan as DXF (R12, which every CAD program reads), in metres and in the plan's upright frame.

use super::masonry;
use super::model::{Opening, OpeningKind, Plan, by_filming, strip};
use super::symbols::strokes;
use crate::rooms::outline::Outline;
use std::fmt::{Display, Write};

/// Layers and their colours, by AutoCAD's numbers.
const LAYERS: [(&str, u8); 10] = [
    ("WALLS", 7),
    ("WALL_LINES", 8),
    ("WALLS_UNFILMED", 253),
    ("WALL_LINES_UNFILMED", 254),
    ("DOORS", 30),
    ("WINDOWS", 5),
    ("ROOMS", 3),
    ("ROOM_NAMES", 7),
    ("FURNITURE", 9),
    ("NOTES", 8),
];
/// Height of letters.
const TEXT_M: f64 = 0.18;
/// Distance between lines of notes.
const LINE_M: f64 = 1.6 * TEXT_M;
/// Number of lines below the drawing: an empty one and the notes.
const LINES_BELOW: f64 = 4.0;
/// Width of the view on opening as a multiple of its height, and its size as a multiple of the drawing's.
const VIEW_ASPECT: f64 = 1.5;
const VIEW_MARGIN: f64 = 1.1;
/// Maximum letters of a name.
const LONGEST: usize = 60;
/// Longest text of R12, in characters, and those of one escaped letter.
const MAX_LENGTH: usize = 255;
const CODE_LENGTH: usize = 7;

/// Returns the plan as an ASCII DXF.
pub fn plan_dxf(plan: &Plan) -> String {
    let mut out = Dxf(String::new());
    let (low, high) = plan.bounds_m();
    out.pair(
        999,
        format!(
            "Floor plan in metres. The LiDAR map's frame is turned by {:.3} degrees about its origin.",
            plan.turn_deg()
        ),
    );
    out.section("HEADER");
    for (name, code, value) in [("$ACADVER", 1, "AC1009"), ("$INSUNITS", 70, "6"), ("$MEASUREMENT", 70, "1")]
    {
        out.pair(9, name);
        out.pair(code, value);
    }
    for (name, corner) in [("$EXTMIN", low), ("$EXTMAX", high)] {
        out.pair(9, name);
        out.point(corner);
    }
    out.pair(0, "ENDSEC");
    out.section("TABLES");
    view(low, high, &mut out);
    out.pair(0, "TABLE");
    out.pair(2, "LAYER");
    out.pair(70, LAYERS.len());
    for (name, color) in LAYERS {
        out.pair(0, "LAYER");
        out.pair(2, name);
        out.pair(70, 0);
        out.pair(62, color);
        out.pair(6, "CONTINUOUS");
    }
    out.pair(0, "ENDTAB");
    out.pair(0, "ENDSEC");
    out.section("ENTITIES");
    entities(plan, &mut out);
    notes(plan, low, &mut out);
    out.pair(0, "ENDSEC");
    out.pair(0, "EOF");
    out.0
}

/// Writes the view on opening: the drawing and the notes below it. Without it, programs show the surroundings of the origin, and
/// a home may lie tens of metres from that of its robot's map.
fn view(low: [f64; 2], high: [f64; 2], out: &mut Dxf) {
    let low = [low[0], low[1] - LINES_BELOW * LINE_M];
    let [width_m, height_m] = [0, 1].map(|axis| high[axis] - low[axis]);
    out.pair(0, "TABLE");
    out.pair(2, "VPORT");
    out.pair(70, 1);
    out.pair(0, "VPORT");
    out.pair(2, "*ACTIVE");
    out.pair(70, 0);
    let middle = [0, 1].map(|axis| (low[axis] + high[axis]) / 2.0);
    // Corners on the screen, middle, origin and steps of the snap and of the grid.
    let points = [[0.0; 2], [1.0; 2], middle, [0.0; 2], [0.5; 2], [0.5; 2]];
    for (code, [x, y]) in (10..).zip(points) {
        out.pair(code, round(x));
        out.pair(code + 10, round(y));
    }
    // Seen from above, at the origin.
    for (code, z) in [(16, 1), (17, 0)] {
        out.pair(code, 0);
        out.pair(code + 10, 0);
        out.pair(code + 20, z);
    }
    out.pair(40, round(VIEW_MARGIN * height_m.max(width_m / VIEW_ASPECT)));
    out.pair(41, VIEW_ASPECT);
    // The usual values of lens, clipping, turns and modes.
    let usual = [50, 0, 0, 0, 0, 0, 1000, 1, 3, 0, 0, 0, 0];
    let codes = [42, 43, 44, 50, 51, 71, 72, 73, 74, 75, 76, 77, 78];
    codes.into_iter().zip(usual).for_each(|(code, value)| out.pair(code, value));
    out.pair(0, "ENDTAB");
}

fn entities(plan: &Plan, out: &mut Dxf) {
    out.outlines("WALLS", &masonry::without(&plan.masonry, &plan.unfilmed_masonry));
    out.outlines("WALLS_UNFILMED", &plan.unfilmed_masonry);
    let (filmed, unfilmed) = by_filming(&plan.walls);
    filmed.iter().for_each(|wall| out.line("WALL_LINES", wall.from_m, wall.to_m));
    unfilmed.iter().for_each(|wall| out.line("WALL_LINES_UNFILMED", wall.from_m, wall.to_m));
    for opening in &plan.openings {
        draw_opening(opening, out);
    }
    for room in &plan.rooms {
        out.outlines("ROOMS", std::slice::from_ref(&room.outline));
        let [x, y] = room.label_at_m;
        out.text("ROOM_NAMES", [x, y], &room.title());
        out.text("ROOM_NAMES", [x, y - LINE_M], &format!("{:.1} m2", room.area_m2));
    }
    for stroke in plan.furniture.iter().flat_map(strokes) {
        out.polyline("FURNITURE", &stroke.points_m, stroke.is_closed);
    }
}

/// Writes the title, the unit and the frame below the drawing. Programs drop comments when they save a file, and some of them
/// ignore the variable of the unit, which is newer than R12.
fn notes(plan: &Plan, [left, bottom]: [f64; 2], out: &mut Dxf) {
    let turn_deg = 0.0 - plan.turn_deg();
    let lines = [
        plan.title(),
        "Units: metres".to_owned(),
        format!("Turn by {turn_deg:.3} degrees about 0,0 for the LiDAR map's frame"),
    ];
    for (number, line) in (2..).zip(&lines) {
        out.entity("TEXT", "NOTES");
        out.point([left, bottom - LINE_M * f64::from(number)]);
        out.pair(40, TEXT_M);
        out.pair(1, encoded(line));
    }
}

fn draw_opening(opening: &Opening, out: &mut Dxf) {
    if opening.kind == OpeningKind::Window {
        out.polyline("WINDOWS", &opening.corners_m(), true);
        out.polyline("WINDOWS", &strip(opening.from_m, opening.to_m, 0.3 * opening.thickness_m), true);
        return;
    }
    out.polyline("DOORS", &opening.corners_m(), true);
    let Some(swing) = opening.swing else { return };
    out.line("DOORS", swing.hinge_m, swing.open_m);
    let angle = |p: [f64; 2]| (p[1] - swing.hinge_m[1]).atan2(p[0] - swing.hinge_m[0]).to_degrees();
    let (open_deg, closed_deg) = (angle(swing.open_m), angle(swing.closed_m));
    // Arcs run counter-clockwise.
    let turns_left = (closed_deg - open_deg).rem_euclid(360.0) < 180.0;
    let (from_deg, to_deg) = if turns_left { (open_deg, closed_deg) } else { (closed_deg, open_deg) };
    out.entity("ARC", "DOORS");
    out.point(swing.hinge_m);
    out.pair(40, round(opening.width_m()));
    out.pair(50, round(from_deg.rem_euclid(360.0)));
    out.pair(51, round(to_deg.rem_euclid(360.0)));
}

/// A file of pairs: a code and a value, a line each.
struct Dxf(String);

impl Dxf {
    fn pair(&mut self, code: u16, value: impl Display) {
        // Writing into a string cannot fail.
        let _ = write!(self.0, "{code}\n{value}\n");
    }

    fn section(&mut self, name: &str) {
        self.pair(0, "SECTION");
        self.pair(2, name);
    }

    fn entity(&mut self, kind: &str, layer: &str) {
        self.pair(0, kind);
        self.pair(8, layer);
    }

    fn point(&mut self, [x, y]: [f64; 2]) {
        self.pair(10, round(x));
        self.pair(20, round(y));
        self.pair(30, 0.0);
    }

    fn line(&mut self, layer: &str, from: [f64; 2], to: [f64; 2]) {
        self.entity("LINE", layer);
        self.point(from);
        self.pair(11, round(to[0]));
        self.pair(21, round(to[1]));
        self.pair(31, 0.0);
    }

    fn polyline(&mut self, layer: &str, points: &[[f64; 2]], is_closed: bool) {
        self.entity("POLYLINE", layer);
        self.pair(66, 1);
        self.pair(70, u8::from(is_closed));
        self.point([0.0; 2]);
        for point in points {
            self.entity("VERTEX", layer);
            self.point(*point);
        }
        self.entity("SEQEND", layer);
    }

    fn outlines(&mut self, layer: &str, outlines: &[Outline]) {
        for outline in outlines {
            self.polyline(layer, &outline.ring_m, true);
            outline.holes_m.iter().for_each(|hole| self.polyline(layer, hole, true));
        }
    }

    fn text(&mut self, layer: &str, at: [f64; 2], words: &str) {
        self.entity("TEXT", layer);
        self.point(at);
        self.pair(40, TEXT_M);
        self.pair(1, encoded(words));
        // Centred: the second point is the one that counts.
        self.pair(72, 1);
        self.pair(11, round(at[0]));
        self.pair(21, round(at[1]));
        self.pair(31, 0.0);
    }
}

/// Returns a line of ASCII: other letters are escaped, control characters left out. Readers take a caret as the first half of
/// a control character, and `%%` and `\U+` as the beginnings of codes; three percent signs are one.
fn encoded(words: &str) -> String {
    let letters: Vec<char> = words.chars().filter(|letter| !letter.is_control()).take(LONGEST).collect();
    let mut out = String::new();
    for (at, letter) in letters.iter().enumerate() {
        if out.len() + CODE_LENGTH > MAX_LENGTH {
            break;
        }
        let is_beside = |other: char| letters.get(at + 1) == Some(&other) || out.ends_with(other);
        match letter {
            '^' => out.push_str("^ "),
            '%' if is_beside('%') => out.push_str("%%%"),
            '\\' if letters[at + 1..].starts_with(&['U', '+']) => out.push_str("\\U+005C"),
            ' '..='~' => out.push(*letter),
            // R12 has code points of four digits.
            letter if u32::from(*letter) <= 0xffff => {
                let _ = write!(out, "\\U+{:04X}", u32::from(*letter));
            }
            _ => out.push('?'),
        }
    }
    out
}

/// Rounds to a tenth of a millimetre.
fn round(metres: f64) -> f64 {
    // Adding zero makes -0 and 0 equal.
    (metres * 1e4).round() / 1e4 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_one_line_of_ascii() {
        assert_eq!(encoded("K\u{fc}che\n0\nEOF"), "K\\U+00FCche0EOF");
        assert_eq!(encoded("\u{1f6cf}"), "?");
        // As ezdxf reads them, these are the names.
        assert_eq!(encoded("^_^ 100%%d 50%"), "^ _^  100%%%%%%d 50%");
        assert_eq!(encoded("a\\U+0041 c:\\x"), "a\\U+005CU+0041 c:\\x");
        assert_eq!(encoded(&"\u{6f22}".repeat(60)).len(), 252);
    }
}
