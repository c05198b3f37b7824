//! Eleven coarse classes for comparing labels, common to data sets and networks that divide furniture
//! differently.

use viola_geometry::taxonomy::{CLASSES, Class};

/// Names of the coarse classes.
pub const COARSE: [&str; 11] =
    ["floor", "wall", "ceiling", "bed", "sofa", "chair", "table", "cabinet", "door", "window", "other"];

const OTHER: usize = COARSE.len() - 1;

/// Returns the index of a class's coarse class in [`COARSE`]. Shelves are cabinets and curtains are windows:
/// ScanNet labels both by what fills the place.
pub fn coarse(class: Class) -> usize {
    let name = match class {
        Class::Shelf => "cabinet",
        Class::Curtain => "window",
        other => other.name(),
    };
    COARSE.iter().position(|coarse| *coarse == name).unwrap_or(OTHER)
}

/// Returns the structure of a coarse class: floor 0, wall or opening 1, ceiling 2, object 3.
pub(super) fn structure(coarse: usize) -> usize {
    match COARSE.get(coarse) {
        Some(&"floor") => 0,
        Some(&"wall" | &"door" | &"window") => 1,
        Some(&"ceiling") => 2,
        _ => 3,
    }
}

/// Returns the coarse class with the largest sum of probabilities.
pub(super) fn likeliest(probabilities: &[f32; CLASSES]) -> usize {
    let mut sums = [0f32; COARSE.len()];
    for (class, p) in Class::ALL.iter().zip(probabilities) {
        sums[coarse(*class)] += p;
    }
    (0..sums.len()).max_by(|a, b| sums[*a].total_cmp(&sums[*b]).then(b.cmp(a))).unwrap_or(OTHER)
}
