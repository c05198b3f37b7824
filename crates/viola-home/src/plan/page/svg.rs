//! A plan as SVG and as PNG: a page in millimetres.

use super::image::px_per_mm;
use super::{
    INK, LINE_MM, Page, QUIET, ROOMS, THIN_MM, WALL, dimensions, furniture, labels, openings, title,
};
use crate::plan::model::Plan;
use crate::svg::{FONT_FAMILY, escape, has_letters, render};
use std::fmt::Write;

/// Returns the plan as a standalone SVG page. Names are escaped.
pub fn plan_svg(plan: &Plan) -> String {
    let page = Page::of(plan);
    let (width, height) = (page.width_mm, page.height_mm);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.1}mm\" height=\"{height:.1}mm\" \
         viewBox=\"0 0 {width:.1} {height:.1}\" font-family=\"{FONT_FAMILY}\" text-anchor=\"middle\" \
         stroke-linejoin=\"miter\">\n<title>Floor plan</title>\n\
         <desc>Scale 1:{:.0}. The LiDAR map's frame is turned by {:.1} degrees on this page.</desc>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
        page.scale,
        -plan.map_from_plan.yaw_rad.to_degrees()
    );
    // Writing into a string cannot fail.
    let _ = writeln!(out, "<g id=\"rooms\" fill-rule=\"evenodd\">");
    for (place, room) in plan.rooms.iter().enumerate() {
        let mut path = page.ring(&room.outline.ring_m);
        room.outline.holes_m.iter().for_each(|hole| path += &page.ring(hole));
        let name = escape(&room.title());
        let _ = writeln!(
            out,
            "<path d=\"{path}\" fill=\"{}\"><title>{name}</title></path>",
            ROOMS[place % ROOMS.len()]
        );
    }
    let _ = writeln!(out, "</g>\n<g id=\"furniture\" stroke-width=\"{LINE_MM}\" stroke-linejoin=\"round\">");
    furniture::draw(plan, &page, &mut out);
    let _ = writeln!(
        out,
        "</g>\n<g id=\"walls\" fill=\"{WALL}\" stroke=\"{WALL}\" stroke-width=\"{LINE_MM}\" fill-rule=\"evenodd\">"
    );
    for outline in &plan.masonry {
        let mut path = page.ring(&outline.ring_m);
        outline.holes_m.iter().for_each(|hole| path += &page.ring(hole));
        let _ = writeln!(out, "<path d=\"{path}\"/>");
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

/// Returns the page as PNG and PDF draw it: a room whose name has a letter that the fonts in the binary lack is drawn like
/// one without a name.
pub(super) fn drawn_svg(plan: &Plan) -> String {
    let mut plan = plan.clone();
    for room in &mut plan.rooms {
        room.name = room.name.take().filter(|name| has_letters(name));
        room.id = room.id.take().filter(|id| has_letters(id));
    }
    plan_svg(&plan)
}

/// Returns the plan as PNG.
pub fn plan_png(plan: &Plan) -> Vec<u8> {
    let page = Page::of(plan);
    // The renderer takes a millimetre for 96 / 25.4 pixels.
    let picture = render(&drawn_svg(plan), (px_per_mm(&page) * 25.4 / 96.0) as f32);
    picture.encode_png().expect("an RGBA picture in memory always encodes")
}
