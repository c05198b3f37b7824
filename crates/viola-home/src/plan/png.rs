//! A plan as a picture.

use super::Plan;
use super::plan_svg;
use super::svg::{UNITS_PER_M, size_units};
use crate::svg::render;

/// The longer side of a picture.
const SIDE_PX: f64 = 1600.0;
/// A small home is not enlarged beyond this.
const MAX_PX_PER_M: f64 = 160.0;

/// Renders [`plan_svg`] as PNG.
pub fn plan_png(plan: &Plan) -> Vec<u8> {
    let [width, height] = size_units(plan);
    let px_per_unit = (SIDE_PX / width.max(height)).min(MAX_PX_PER_M / UNITS_PER_M);
    let picture = render(&plan_svg(plan), px_per_unit as f32);
    picture.encode_png().expect("an RGBA picture in memory always encodes")
}
