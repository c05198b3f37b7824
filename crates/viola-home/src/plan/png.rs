//! A plan as a picture.

use super::Plan;
use super::plan_svg;
use super::svg::px_per_unit;
use crate::svg::render;

/// Renders [`plan_svg`] as PNG.
pub fn plan_png(plan: &Plan) -> Vec<u8> {
    let picture = render(&plan_svg(plan), px_per_unit(plan) as f32);
    picture.encode_png().expect("an RGBA picture in memory always encodes")
}
