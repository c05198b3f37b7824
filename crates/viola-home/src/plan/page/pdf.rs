//! A plan as PDF: the elements of its SVG page, one to one, in true scale. Text is outlines, so the file
//! needs no font. It shows the names that the fonts in the binary can show, as the picture does.

use super::Page;
use super::svg::drawn_svg;
use crate::plan::model::Plan;
use crate::svg::parse;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use resvg::tiny_skia::{Path, PathSegment};
use resvg::usvg::{FillRule, Group, LineCap, LineJoin, Node, Paint, PaintOrder, Path as Element};
use std::fmt::Write as _;
use std::io::Write as _;

/// Points of PDF for each pixel of SVG, and for each millimetre.
const POINTS_PER_PX: f32 = 72.0 / 96.0;
const POINTS_PER_MM: f64 = 72.0 / 25.4;

/// Returns the page of [`drawn_svg`] as PDF 1.4, in the middle of a sheet of paper.
pub fn plan_pdf(plan: &Plan) -> Vec<u8> {
    let tree = parse(&drawn_svg(plan));
    let page = Page::of(plan);
    let [width, height] = page.sheet_mm.map(|mm| mm * POINTS_PER_MM);
    let left = (width - page.width_mm * POINTS_PER_MM) / 2.0;
    // SVG counts down from the upper edge, PDF up from the lower one.
    let top = (height + page.height_mm * POINTS_PER_MM) / 2.0;
    let mut content = format!("{POINTS_PER_PX} 0 0 -{POINTS_PER_PX} {left:.2} {top:.2} cm\n");
    draw_group(tree.root(), &mut content);
    let mut packed = ZlibEncoder::new(Vec::new(), Compression::default());
    let packed = packed.write_all(content.as_bytes()).and_then(|()| packed.finish());
    let packed = packed.expect("writing into a vector cannot fail");
    let mut stream = format!("<< /Length {} /Filter /FlateDecode >>\nstream\n", packed.len()).into_bytes();
    stream.extend_from_slice(&packed);
    stream.extend_from_slice(b"\nendstream");
    file(&[
        // Programs that print it must not scale it to the printer's margins.
        b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>".to_vec(),
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_vec(),
        format!(
            "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.2} {height:.2}] /Resources << >> /Contents 4 0 R >>"
        )
        .into_bytes(),
        stream,
        format!("<< /Title {} /Producer (viola) >>", text_string(&plan.title())).into_bytes(),
    ])
}

/// Returns a text in the encoding of documents' information: UTF-16 behind its mark, in hexadecimal digits.
fn text_string(words: &str) -> String {
    let mut digits = "FEFF".to_owned();
    for unit in words.encode_utf16() {
        let _ = write!(digits, "{unit:04X}");
    }
    format!("<{digits}>")
}

/// Returns a file of numbered objects; the first is the catalogue, the last the document's information.
fn file(objects: &[Vec<u8>]) -> Vec<u8> {
    let mut out = b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n".to_vec();
    let mut places = Vec::new();
    for (number, object) in (1..).zip(objects) {
        places.push(out.len());
        out.extend_from_slice(format!("{number} 0 obj\n").as_bytes());
        out.extend_from_slice(object);
        out.extend_from_slice(b"\nendobj\n");
    }
    let start = out.len();
    let count = objects.len() + 1;
    let mut table = format!("xref\n0 {count}\n0000000000 65535 f \n");
    // Writing into a string cannot fail.
    for place in places {
        let _ = writeln!(table, "{place:010} 00000 n ");
    }
    let _ = write!(
        table,
        "trailer\n<< /Size {count} /Root 1 0 R /Info {} 0 R >>\nstartxref\n{start}\n%%EOF\n",
        objects.len()
    );
    out.extend_from_slice(table.as_bytes());
    out
}

fn draw_group(group: &Group, out: &mut String) {
    for node in group.children() {
        match node {
            Node::Group(group) => draw_group(group, out),
            Node::Path(path) => draw_path(path, out),
            Node::Text(text) => draw_group(text.flattened(), out),
            // The page has no pictures.
            Node::Image(_) => {}
        }
    }
}

fn draw_path(element: &Element, out: &mut String) {
    let Some(path) = element.data().clone().transform(element.abs_transform()) else { return };
    if element.paint_order() == PaintOrder::StrokeAndFill {
        stroke(element, &path, out);
        fill(element, &path, out);
    } else {
        fill(element, &path, out);
        stroke(element, &path, out);
    }
}

fn fill(element: &Element, path: &Path, out: &mut String) {
    let Some(fill) = element.fill() else { return };
    let Some(color) = color(fill.paint()) else { return };
    let _ = writeln!(out, "{color} rg");
    trace(path, out);
    out.push_str(if fill.rule() == FillRule::EvenOdd { "f*\n" } else { "f\n" });
}

fn stroke(element: &Element, path: &Path, out: &mut String) {
    let Some(stroke) = element.stroke() else { return };
    let Some(color) = color(stroke.paint()) else { return };
    // The page is scaled alike along both axes.
    let transform = element.abs_transform();
    let scale = transform.sx.hypot(transform.ky);
    let cap = match stroke.linecap() {
        LineCap::Butt => 0,
        LineCap::Round => 1,
        LineCap::Square => 2,
    };
    let join = match stroke.linejoin() {
        LineJoin::Miter | LineJoin::MiterClip => 0,
        LineJoin::Round => 1,
        LineJoin::Bevel => 2,
    };
    let dashes: Vec<String> =
        stroke.dasharray().unwrap_or_default().iter().map(|dash| format!("{:.3}", dash * scale)).collect();
    let _ = writeln!(
        out,
        "{color} RG {:.3} w {cap} J {join} j [{}] 0 d",
        stroke.width().get() * scale,
        dashes.join(" ")
    );
    trace(path, out);
    out.push_str("S\n");
}

fn color(paint: &Paint) -> Option<String> {
    let Paint::Color(color) = paint else { return None };
    let [red, green, blue] = [color.red, color.green, color.blue].map(|channel| f32::from(channel) / 255.0);
    Some(format!("{red:.3} {green:.3} {blue:.3}"))
}

fn trace(path: &Path, out: &mut String) {
    let mut last = [0.0f32; 2];
    for segment in path.segments() {
        let _ = match segment {
            PathSegment::MoveTo(p) => writeln!(out, "{:.3} {:.3} m", p.x, p.y),
            PathSegment::LineTo(p) => writeln!(out, "{:.3} {:.3} l", p.x, p.y),
            PathSegment::QuadTo(control, end) => {
                // PDF has cubic curves only.
                let a = [
                    last[0] + 2.0 / 3.0 * (control.x - last[0]),
                    last[1] + 2.0 / 3.0 * (control.y - last[1]),
                ];
                let b = [end.x + 2.0 / 3.0 * (control.x - end.x), end.y + 2.0 / 3.0 * (control.y - end.y)];
                writeln!(out, "{:.3} {:.3} {:.3} {:.3} {:.3} {:.3} c", a[0], a[1], b[0], b[1], end.x, end.y)
            }
            PathSegment::CubicTo(a, b, end) => {
                writeln!(out, "{:.3} {:.3} {:.3} {:.3} {:.3} {:.3} c", a.x, a.y, b.x, b.y, end.x, end.y)
            }
            PathSegment::Close => writeln!(out, "h"),
        };
        match segment {
            PathSegment::MoveTo(p)
            | PathSegment::LineTo(p)
            | PathSegment::QuadTo(_, p)
            | PathSegment::CubicTo(_, _, p) => last = [p.x, p.y],
            PathSegment::Close => {}
        }
    }
}
