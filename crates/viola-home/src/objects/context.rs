//! Corrects classes and boxes by the objects beside.

use super::Found;
use super::fit::UprightBox;
use super::hidden::WORKTOP_M;
use crate::rooms::Room;
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Pose2};

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

/// Leaves out toilets, bathtubs and showers in a room to live or to cook in, unless another thing of a bathroom is near:
/// bins and boxes look like toilets. A toilet that is only near such a room may be in a bathroom that the robot never
/// enters, which is no room of its map.
pub fn leave_out_misplaced(found: &mut Vec<Found>, rooms: &[Room]) {
    /// Largest distance of things of one bathroom.
    const NEAR_M: f64 = 2.5;
    let classes_of = |room: &Option<String>| {
        let here = found.iter().filter(|found| found.object.room == *room);
        here.map(|found| found.object.class).collect::<Vec<Class>>()
    };
    let place = |found: &Found| found.object.bounds().centre();
    let tops: Vec<UprightBox> =
        found.iter().filter(|f| f.object.class == Class::Counter).map(|f| f.object.bounds()).collect();
    let is_in_worktop = |at: &Point2| tops.iter().any(|top| top.holds(&[at.x, at.y, top.centre_m[2]], 0.1));
    let is_of_bathroom = |found: &Found| {
        is_sanitary(found.object.class) || found.object.class == Class::Sink && !is_in_worktop(&place(found))
    };
    let has_company = |of: usize| {
        let at = place(&found[of]);
        (0..found.len())
            .any(|i| i != of && is_of_bathroom(&found[i]) && (place(&found[i]) - at).norm() < NEAR_M)
    };
    let is_inside = |of: &Found| rooms.iter().any(|room| room.contains(&place(of)));
    let is_misplaced = |i: usize| {
        let Found { object, .. } = &found[i];
        is_sanitary(object.class)
            && is_inside(&found[i])
            && classes_of(&object.room).into_iter().any(is_lived_with)
            && !has_company(i)
    };
    let kept: Vec<bool> = (0..found.len()).map(|i| !is_misplaced(i)).collect();
    let mut kept = kept.into_iter();
    found.retain(|_| kept.next().unwrap_or(true));
}

fn is_sanitary(class: Class) -> bool {
    matches!(class, Class::Toilet | Class::Bathtub | Class::Shower)
}

/// Returns whether a class stands in rooms that have no toilet.
fn is_lived_with(class: Class) -> bool {
    matches!(class, Class::Bed | Class::Sofa | Class::Counter | Class::Stove | Class::Refrigerator)
}

/// Gives cabinets under a worktop its depth: the worktop hides all of them but the fronts.
pub fn fill_under_worktops(found: &mut [Found]) {
    /// Maximum distance of a worktop from the top of its cabinets.
    const NEAR_M: f64 = 0.25;
    /// Minimum fraction of a cabinet's footprint under the worktop.
    const UNDER: f64 = 0.5;
    let tops: Vec<UprightBox> = found
        .iter()
        .filter(|found| found.object.class == Class::Counter)
        .map(|found| found.object.bounds())
        .filter(|top| top.bottom_m() > WORKTOP_M)
        .collect();
    let is_unit = |found: &&mut Found| matches!(found.object.class, Class::Cabinet | Class::Stove);
    for Found { object, .. } in found.iter_mut().filter(is_unit) {
        let unit = object.bounds();
        let area_m2 = unit.area_m2().max(1e-9);
        let is_under = |top: &&UprightBox| {
            (unit.top_m() - top.bottom_m()).abs() < NEAR_M && unit.shared_m2(top) > UNDER * area_m2
        };
        let Some(top) = tops.iter().find(is_under) else { continue };
        let of_top = Pose2::new(top.centre_m[0], top.centre_m[1], top.yaw_rad);
        let along = unit.corners().map(|[x, y]| top.local(x, y)[0]);
        let low = along.iter().copied().fold(f64::INFINITY, f64::min);
        let high = along.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let centre = of_top.apply(&Point2::new((low + high) / 2.0, 0.0));
        object.set_bounds(UprightBox {
            centre_m: [centre.x, centre.y, unit.centre_m[2]],
            size_m: [high - low, top.size_m[1], unit.size_m[2]],
            yaw_rad: top.yaw_rad,
        });
    }
}
