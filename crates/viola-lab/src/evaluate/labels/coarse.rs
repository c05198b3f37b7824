//! The eleven classes in which labels are compared, so that data sets and networks that divide furniture
//! differently can be.

use viola_geometry::taxonomy::{CLASSES, Class};

/// Their names.
pub const COARSE: [&str; 11] =
    ["floor", "wall", "ceiling", "bed", "sofa", "chair", "table", "cabinet", "door", "window", "other"];

const OTHER: usize = COARSE.len() - 1;

/// The coarse class of a class, by its place in [`COARSE`]. Shelves count as cabinets, and what hangs before
/// windows as windows: ScanNet labels both by what fills the place.
pub fn coarse(class: Class) -> usize {
    let name = match class {
        Class::Shelf => "cabinet",
        Class::Curtain => "window",
        other => other.name(),
    };
    COARSE.iter().position(|coarse| *coarse == name).unwrap_or(OTHER)
}

/// Of a coarse class: floor 0, wall or opening 1, ceiling 2, object 3.
pub(super) fn structure(coarse: usize) -> usize {
    match COARSE.get(coarse) {
        Some(&"floor") => 0,
        Some(&"wall" | &"door" | &"window") => 1,
        Some(&"ceiling") => 2,
        _ => 3,
    }
}

/// The coarse class with the largest sum of probabilities.
pub(super) fn likeliest(probabilities: &[f32; CLASSES]) -> usize {
    let mut sums = [0f32; COARSE.len()];
    for (class, p) in Class::ALL.iter().zip(probabilities) {
        sums[coarse(*class)] += p;
    }
    (0..sums.len()).max_by(|a, b| sums[*a].total_cmp(&sums[*b]).then(b.cmp(a))).unwrap_or(OTHER)
}
