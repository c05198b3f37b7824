//! Corrects classes by the objects beside.

use super::Found;
use viola_geometry::taxonomy::Class;

/// Reclassifies small tables at a bed as cabinets: networks hardly distinguish nightstands from tables.
pub fn tell_nightstands(found: &mut [Found]) {
    /// Maximum length of a nightstand; its top is about as high as a bed.
    const LONGEST_M: f64 = 0.65;
    const HEIGHT_M: std::ops::Range<f64> = 0.35..0.85;
    const BESIDE_M: f64 = 0.35;
    let beds: Vec<_> =
        found.iter().filter(|f| f.object.class == Class::Bed).map(|f| f.object.bounds()).collect();
    for Found { object, .. } in found.iter_mut().filter(|f| f.object.class == Class::Table) {
        let bounds = object.bounds();
        let is_small = bounds.size_m[0] <= LONGEST_M && HEIGHT_M.contains(&bounds.top_m());
        let at_bed = |bed: &super::UprightBox| {
            bounds.corners().iter().any(|[x, y]| bed.holds(&[*x, *y, bed.centre_m[2]], BESIDE_M))
        };
        if is_small && beds.iter().any(at_bed) {
            object.class = Class::Cabinet;
        }
    }
}
