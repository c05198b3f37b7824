//! A plan as SVG and as PNG: a page in millimetres.

use super::image::px_per_mm;
use super::{
    INK, LINE_MM, Page, QUIET, THIN_MM, UNFILMED_WALL, WALL, dimensions, furniture, labels, openings, tints,
    title,
};
use crate::plan::model::Plan;
use crate::rooms::outline::Outline;
use crate::svg::{FONT_FAMILY, escape, has_letters, letters_in_fonts, render};
use flate2::Crc;
use std::fmt::Write;

/// Returns the plan as a standalone SVG page. Names are escaped.
pub fn plan_svg(plan: &Plan) -> String {
    let page = Page::of(plan);
    let (width, height) = (page.width_mm, page.height_mm);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.1}mm\" height=\"{height:.1}mm\" \
         viewBox=\"0 0 {width:.1} {height:.1}\" font-family=\"{FONT_FAMILY}\" text-anchor=\"middle\" \
         stroke-linejoin=\"miter\">\n<title>{}</title>\n\
         <desc>Scale 1:{:.0}. The LiDAR map's frame is turned by {:.1} degrees on this page.</desc>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
        escape(&plan.title()),
        page.scale,
        plan.turn_deg()
    );
    // Writing into a string cannot fail.
    let _ = writeln!(out, "<g id=\"rooms\" fill-rule=\"evenodd\">");
    for (room, tint) in plan.rooms.iter().zip(tints::tints(plan)) {
        let mut path = page.ring(&room.outline.ring_m);
        room.outline.holes_m.iter().for_each(|hole| path += &page.ring(hole));
        let name = escape(&room.title());
        let _ = writeln!(out, "<path d=\"{path}\" fill=\"{tint}\"><title>{name}</title></path>");
    }
    let _ = writeln!(out, "</g>\n<g id=\"furniture\" stroke-width=\"{LINE_MM}\" stroke-linejoin=\"round\">");
    furniture::draw(plan, &page, &mut out);
    let _ = writeln!(
        out,
        "</g>\n<g id=\"walls\" fill=\"{WALL}\" stroke=\"{WALL}\" stroke-width=\"{LINE_MM}\" fill-rule=\"evenodd\">"
    );
    paths(&plan.masonry, &page, &mut out);
    if !plan.unfilmed_masonry.is_empty() {
        // Half of the line around all walls remains as their edge.
        let _ =
            writeln!(out, "</g>\n<g id=\"unfilmed-walls\" fill=\"{UNFILMED_WALL}\" fill-rule=\"evenodd\">");
        paths(&plan.unfilmed_masonry, &page, &mut out);
    }
    let _ =
        writeln!(out, "</g>\n<g id=\"openings\" stroke=\"{INK}\" stroke-width=\"{LINE_MM}\" fill=\"none\">");
    openings::draw(plan, &page, &mut out);
    let _ = writeln!(out, "</g>\n<g id=\"labels\">");
    labels::draw(plan, &page, &mut out);
    let _ = writeln!(
        out,
        "</g>\n<g id=\"dimensions\" stroke=\"{QUIET}\" stroke-width=\"{THIN_MM}\" fill=\"none\">"
    );
    dimensions::draw(plan, &page, &mut out);
    let _ = writeln!(out, "</g>\n<g id=\"title\">");
    title::draw(plan, &page, &mut out);
    out + "</g>\n</svg>\n"
}

fn paths(outlines: &[Outline], page: &Page, out: &mut String) {
    for outline in outlines {
        let mut path = page.ring(&outline.ring_m);
        outline.holes_m.iter().for_each(|hole| path += &page.ring(hole));
        let _ = writeln!(out, "<path d=\"{path}\"/>");
    }
}

/// Returns the page as PNG and PDF draw it: names have only the letters of the fonts in the binary.
pub(super) fn drawn_svg(plan: &Plan) -> String {
    let mut plan = plan.clone();
    plan.home_name = plan.home_name.as_deref().and_then(drawn);
    for room in &mut plan.rooms {
        room.name = room.name.as_deref().and_then(drawn);
        room.id = room.id.take().filter(|id| has_letters(id));
    }
    plan_svg(&plan)
}

/// Returns a name as the fonts draw it; `None` if they lack all its letters and digits.
fn drawn(name: &str) -> Option<String> {
    if has_letters(name) {
        return Some(name.to_owned());
    }
    let shown = letters_in_fonts(name);
    shown.chars().any(char::is_alphanumeric).then(|| shown.trim().to_owned())
}

/// Returns the plan as PNG, with its resolution.
pub fn plan_png(plan: &Plan) -> Vec<u8> {
    let px_per_mm = px_per_mm(&Page::of(plan));
    // The renderer takes a millimetre for 96 / 25.4 pixels.
    let picture = render(&drawn_svg(plan), (px_per_mm * 25.4 / 96.0) as f32);
    let mut png = picture.encode_png().expect("an RGBA picture in memory always encodes");
    // Without it, programs take a pixel for 1/96 of an inch.
    png.splice(HEADER_END..HEADER_END, resolution((px_per_mm * 1e3).round() as u32));
    png
}

/// End of a PNG's signature and its first chunk, which have fixed lengths.
const HEADER_END: usize = 33;

/// Returns the chunk `pHYs` (PNG, 11.3.4.3): pixels per metre along both axes.
fn resolution(px_per_m: u32) -> Vec<u8> {
    let side = px_per_m.to_be_bytes();
    let content = [&b"pHYs"[..], &side, &side, &[1]].concat();
    let mut sum = Crc::new();
    sum.update(&content);
    // The length counts neither the name nor the sum.
    [&9u32.to_be_bytes()[..], &content, &sum.sum().to_be_bytes()].concat()
}
