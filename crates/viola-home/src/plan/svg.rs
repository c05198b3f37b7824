//! A plan as SVG.

use super::paper::{self, FOOT_M, MARGIN_M};
use super::{Plan, hangs, opens};
use crate::rooms::outline::Outline;
use crate::svg::{FONT_FAMILY, escape, hex};
use std::fmt::Write;

/// SVG units per metre.
const UNITS_PER_M: f64 = 100.0;
/// Longer side of the picture.
const SIDE_PX: f64 = 1600.0;
/// A small home is not enlarged beyond this.
const MAX_PX_PER_M: f64 = 160.0;
/// Least height of capitals in the picture.
const MIN_CAPITALS_PX: f64 = 9.0;

/// Returns the plan as a standalone SVG, y up, with text elements. Names are escaped.
pub fn plan_svg(plan: &Plan) -> String {
    let [width, height] = size_units(plan);
    let drawing = Drawing { corner_m: [plan.min_m[0] - MARGIN_M, plan.max_m[1] + MARGIN_M] };
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" \
         font-family=\"{FONT_FAMILY}\" text-anchor=\"middle\">\n\
         <title>Floor plan</title>\n<rect width=\"100%\" height=\"100%\" fill=\"{}\"/>\n",
        hex(paper::PAPER)
    );
    // Writing into a string cannot fail.
    let _ = writeln!(out, "<g id=\"rooms\">");
    for (place, room) in plan.rooms.iter().enumerate() {
        let outline = Outline { ring_m: room.polygon_m.clone(), holes_m: room.holes_m.clone() };
        let name = escape(room.name.as_deref().unwrap_or(&room.id));
        let fill = hex(paper::tint(place));
        let path = drawing.path(&outline);
        let _ = writeln!(
            out,
            "<path d=\"{path}\" fill=\"{fill}\" fill-rule=\"evenodd\"><title>{name}</title></path>"
        );
    }
    let fill = hex(paper::OBSTACLE);
    let _ = writeln!(out, "</g>\n<g id=\"obstacles\" fill=\"{fill}\" fill-rule=\"evenodd\">");
    for outline in &plan.obstacles {
        let _ = writeln!(out, "<path d=\"{}\"/>", drawing.path(outline));
    }
    let _ = writeln!(out, "</g>\n<g id=\"objects\" stroke-width=\"2\" stroke-linejoin=\"round\">");
    let flat = |class| opens(class) || hangs(class);
    for object in plan.objects.iter().filter(|object| !flat(object.class)) {
        drawing.object(&mut out, object, object.bounds().corners(), 0.62);
    }
    let ink = hex(paper::WALL);
    let _ = writeln!(
        out,
        "</g>\n<g id=\"walls\" fill=\"{ink}\" stroke=\"{ink}\" stroke-width=\"2\" fill-rule=\"evenodd\">"
    );
    for outline in &plan.walls {
        let _ = writeln!(out, "<path d=\"{}\"/>", drawing.path(outline));
    }
    let _ = writeln!(out, "</g>\n<g id=\"openings\" stroke-width=\"1.5\" stroke-linejoin=\"round\">");
    for object in plan.objects.iter().filter(|object| flat(object.class)) {
        let mut bounds = object.bounds();
        bounds.size_m[1] = bounds.size_m[1].clamp(0.06, 0.14);
        drawing.object(&mut out, object, bounds.corners(), 0.35);
    }
    let _ = writeln!(out, "</g>\n<g id=\"labels\" dominant-baseline=\"central\">");
    let least = MIN_CAPITALS_PX / px_per_unit(plan);
    for label in paper::labels(plan) {
        let [x, y] = drawing.place(&label.at_m);
        // Capitals are about seven tenths of a font's size.
        let size = (label.height_m * UNITS_PER_M).max(least) / 0.7;
        let weight = if label.bold { " font-weight=\"600\"" } else { "" };
        let _ = writeln!(
            out,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size:.1}\" fill=\"{}\"{weight}>{}</text>",
            hex(label.ink),
            escape(&label.words)
        );
    }
    let bar_m = paper::bar_m(plan);
    let (left, y) = (MARGIN_M * UNITS_PER_M, height - 0.55 * FOOT_M * UNITS_PER_M);
    let (middle, right) = (left + bar_m * UNITS_PER_M / 2.0, left + bar_m * UNITS_PER_M);
    let _ = writeln!(
        out,
        "</g>\n<g id=\"scale\"><path d=\"M{left:.1} {y:.1}H{right:.1}M{left:.1} {0:.1}V{1:.1}M{middle:.1} \
         {0:.1}V{1:.1}M{right:.1} {0:.1}V{1:.1}\" stroke=\"{2}\" stroke-width=\"2.5\" fill=\"none\"/>\
         <text x=\"{3:.1}\" y=\"{y:.1}\" font-size=\"16\" text-anchor=\"start\" \
         dominant-baseline=\"central\">{bar_m} m</text></g>\n</svg>",
        y - 6.0,
        y + 6.0,
        hex(paper::TEXT),
        right + 12.0
    );
    out
}

/// Width and height of the drawing.
fn size_units(plan: &Plan) -> [f64; 2] {
    let [width_m, height_m] = [0, 1].map(|axis| plan.max_m[axis] - plan.min_m[axis] + 2.0 * MARGIN_M);
    [width_m * UNITS_PER_M, (height_m + FOOT_M) * UNITS_PER_M]
}

/// Returns the scale of the drawing as a picture.
pub fn px_per_unit(plan: &Plan) -> f64 {
    let [width, height] = size_units(plan);
    (SIDE_PX / width.max(height)).min(MAX_PX_PER_M / UNITS_PER_M)
}

struct Drawing {
    /// Upper-left corner.
    corner_m: [f64; 2],
}

impl Drawing {
    fn place(&self, at_m: &[f64; 2]) -> [f64; 2] {
        [(at_m[0] - self.corner_m[0]) * UNITS_PER_M, (self.corner_m[1] - at_m[1]) * UNITS_PER_M]
    }

    fn path(&self, outline: &Outline) -> String {
        let mut path = String::new();
        for ring in std::iter::once(&outline.ring_m).chain(&outline.holes_m) {
            self.ring(&mut path, ring);
        }
        path
    }

    fn ring(&self, path: &mut String, ring: &[[f64; 2]]) {
        for (i, corner) in ring.iter().enumerate() {
            let [x, y] = self.place(corner);
            let _ = write!(path, "{}{x:.1} {y:.1}", if i == 0 { "M" } else { "L" });
        }
        path.push('Z');
    }

    fn object(&self, out: &mut String, object: &super::Object, corners: [[f64; 2]; 4], light: f64) {
        let mut path = String::new();
        self.ring(&mut path, &corners);
        let color = object.class.color();
        let _ = writeln!(
            out,
            "<path d=\"{path}\" class=\"{}\" fill=\"{}\" fill-opacity=\"0.9\" stroke=\"{}\"><title>{}</title></path>",
            object.class.name(),
            hex(paper::lighter(color, light)),
            hex(paper::darker(color, 0.25)),
            escape(&object.id)
        );
    }
}
