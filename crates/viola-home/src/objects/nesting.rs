//! Pairs of objects of which one may be in the footprint of the other.

use super::fit::UprightBox;
use std::collections::BTreeSet;
use viola_geometry::taxonomy::Class;

/// Largest overlap of two objects that stand on the floor, as a fraction of the smaller footprint, and of the place around an
/// object with what surrounds it.
pub(super) const MAX_SHARED_FRACTION: f64 = 0.2;

/// Relation of an object to the one in whose footprint it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Nesting {
    /// Below its top: a chair at a table, drawers of a desk.
    Below,
    /// The worktop of its cabinets.
    Top,
    /// A part of it: a sink in a counter, an appliance between cabinets.
    BuiltIn,
    /// On it, or on the wall above it: a television.
    On,
}

/// Returns how an object may be in the footprint of another one; `None` if it may not.
pub fn nesting(inner: (Class, &UprightBox), outer: (Class, &UprightBox)) -> Option<Nesting> {
    use Class::*;
    let is_above = || inner.1.top_m() > outer.1.bottom_m();
    match (inner.0, outer.0) {
        (Chair, Table | Desk | Counter) => Some(Nesting::Below),
        // A cabinet as large as the table is the table seen twice.
        (Cabinet | Box, Table | Desk) => {
            let is_below = inner.1.top_m() < outer.1.top_m() && 2.0 * inner.1.area_m2() <= outer.1.area_m2();
            is_below.then_some(Nesting::Below)
        }
        // Cabinets that hang above a worktop are none of its parts.
        (Counter, Cabinet) => is_above().then_some(Nesting::Top),
        (Sink, Counter | Cabinet | Table) => is_above().then_some(Nesting::BuiltIn),
        (Stove | WashingMachine | Refrigerator, Counter | Cabinet) => is_above().then_some(Nesting::BuiltIn),
        (Sink, Desk) | (Stove, Table | Desk) => is_above().then_some(Nesting::On),
        (Television, Cabinet | Shelf | Table | Desk | Counter) => is_above().then_some(Nesting::On),
        _ => None,
    }
}

/// Returns whether an object is around a recess in which another one stands, such as a corner sofa around a low table: the table
/// stands in its box, but not on its seats. `places` are points of the object, `own` and `inner` the two boxes.
pub fn surrounds(places: &[[f64; 3]], own: &UprightBox, inner: &UprightBox) -> bool {
    /// Floor between a table and the seats; seats that are labelled as a table have none.
    const AROUND_M: f64 = 0.1;
    /// Minimum ratio of the footprints.
    const LARGER: f64 = 2.0;
    /// Minimum fraction of the own footprint that was measured. An object of which only the front was measured has
    /// no points in its middle either.
    const MEASURED: f64 = 0.4;
    let [long_m, short_m] = [0, 1].map(|axis| inner.size_m[axis] + 2.0 * AROUND_M);
    own.area_m2() >= LARGER * inner.area_m2()
        && measured_m2(places, own, 0.0) >= MEASURED * own.area_m2()
        && measured_m2(places, inner, AROUND_M) <= MAX_SHARED_FRACTION * long_m * short_m
}

/// Returns the area that points cover in the footprint of a box that is grown by `by_m` on all sides.
fn measured_m2(places: &[[f64; 3]], bounds: &UprightBox, by_m: f64) -> f64 {
    const CELL_M: f64 = 0.1;
    let cell = |at: &[f64; 3]| {
        let local = bounds.local(at[0], at[1]);
        let is_inside = (0..2).all(|axis| local[axis].abs() <= bounds.size_m[axis] / 2.0 + by_m);
        is_inside.then(|| local.map(|m| (m / CELL_M).floor() as i32))
    };
    let cells: BTreeSet<[i32; 2]> = places.iter().filter_map(cell).collect();
    cells.len() as f64 * CELL_M * CELL_M
}
