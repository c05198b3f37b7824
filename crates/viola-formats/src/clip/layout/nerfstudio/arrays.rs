//! Depth as NumPy's arrays, and its unit. Nerfstudio's depth is in millimetres, but its users may set another unit beside the
//! file, and floats are usually saved in metres.

use crate::clip::ClipError;
use crate::clip::files::{DepthAt, has_ending};
use crate::clip::layout::{MILLIMETRES, Source};
use crate::clip::npy::{self, Allowed};
use crate::container::Container;

/// Number of arrays of which one must have a reading to tell their unit.
const MAX_ARRAYS: usize = 8;
/// Numbers below this are metres: depth of a home has millimetres beyond it.
const MAX_DEPTH_M: f32 = 100.0;

pub(super) fn depth_at(name: String) -> DepthAt {
    if has_ending(&name, ".npy") {
        return DepthAt::Npy(name, Allowed::IntegersAndFloats);
    }
    DepthAt::Png(name)
}

/// Returns the largest number of the first array of floats that has one, if all depth is arrays, and the number can only be
/// metres.
pub(super) fn largest_m(container: &dyn Container, sources: &[Source]) -> Result<Option<f32>, ClipError> {
    if !sources.iter().all(is_array) {
        return Ok(None);
    }
    for source in sources.iter().take(MAX_ARRAYS) {
        let DepthAt::Npy(name, _) = &source.depth else { continue };
        match npy::largest_float(container, name) {
            Ok(Some(largest)) if largest > 0.0 => return Ok((largest < MAX_DEPTH_M).then_some(largest)),
            Err(error) if error.is_service_fault() => return Err(error),
            _ => {}
        }
    }
    Ok(None)
}

/// Returns the unit in words; `is_told` if the file has it.
pub(super) fn unit(sources: &[Source], is_told: bool, in_metres: bool) -> &'static str {
    match (is_told, sources.iter().any(is_array)) {
        _ if in_metres => "metres (floats in .npy)",
        (true, false) => "integer_depth_scale (16-bit PNG)",
        (true, true) => "integer_depth_scale (.npy)",
        (false, false) => MILLIMETRES,
        (false, true) => "millimetres (.npy)",
    }
}

fn is_array(source: &Source) -> bool {
    matches!(source.depth, DepthAt::Npy(..))
}
