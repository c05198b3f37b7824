//! Joins fragments of one object.

use super::cells::Cells;
use super::fit::UprightBox;
use super::fragment::Fragment;
use super::hidden::{APPLIANCE_M, WORKTOP_M, is_front};
use super::kind::{confusable, is_appliance, is_solid, is_storage, kind};
use viola_geometry::progress::{self, Cancelled, Progress};
use viola_geometry::taxonomy::Class;

/// Minimum cells of a fragment; smaller ones are noise.
const MIN_CELLS: usize = 5;
/// A fragment with this fraction of its cells in a larger one's box is a part of it.
const INSIDE_FRACTION: f64 = 0.6;
/// Margin of the box in that test.
const GROW_M: f64 = 0.06;
/// A fragment with this fraction of its cells adjacent to a larger one is a part of it; a fifth is enough for
/// a fragment that is not a plausible object.
const TOUCH_FRACTION: f64 = 0.25;
/// Maximum gap between fragments of one class that form one object of plausible size.
const GAP_M: f64 = 0.25;
/// The boards of a wall shelf hang this far apart, and so do the spots of a lamp.
const BOARDS_M: f64 = 0.4;

/// Width of a sink or a stove in a worktop.
const BUILT_IN_M: f64 = 1.0;

struct Part {
    fragment: Fragment,
    places: Vec<[f64; 3]>,
    bounds: UprightBox,
}

/// Joins smaller fragments to larger ones until nothing changes.
pub fn join(
    fragments: Vec<Fragment>,
    cells: &Cells,
    progress: &dyn Progress,
) -> Result<Vec<Fragment>, Cancelled> {
    let part = |fragment: Fragment| {
        let places = cells.centres(&fragment.cells);
        let bounds = cells.fit_box(&places)?;
        Some(Part { fragment, places, bounds })
    };
    let large = fragments.into_iter().filter(|f| f.cells.len() >= MIN_CELLS);
    let mut parts: Vec<Part> = large.filter_map(part).collect();
    // The front and the top of an appliance find each other before the units beside take them.
    let mut is_first = true;
    loop {
        let before = parts.len();
        let mut kept: Vec<Part> = Vec::new();
        parts.sort_by(|a, b| {
            let size = b.fragment.cells.len().cmp(&a.fragment.cells.len());
            size.then(a.fragment.cells[0].cmp(&b.fragment.cells[0]))
        });
        for small in parts {
            progress::check(progress)?;
            // The same class first: a stool's leg belongs to the stool, however large the sofa beside it.
            let same = |large: &Part| large.fragment.class == small.fragment.class;
            let is_host = |large: &Part| belongs(large, &small, cells);
            let may_find = !is_first || is_appliance(small.fragment.class);
            let host = kept.iter().position(|large| may_find && same(large) && is_host(large));
            let other = || kept.iter().position(|large| !is_first && !same(large) && is_host(large));
            let host = host.or_else(other);
            match host {
                Some(at) => {
                    let host = &mut kept[at];
                    host.fragment.join(small.fragment);
                    host.places.extend(small.places);
                    if let Some(bounds) = cells.fit_box(&host.places) {
                        host.bounds = bounds;
                    }
                }
                None => kept.push(small),
            }
        }
        parts = kept;
        if parts.len() < before {
            continue;
        }
        if is_first {
            is_first = false;
        } else {
            return Ok(parts.into_iter().map(|part| part.fragment).collect());
        }
    }
}

/// Returns whether the smaller part belongs to the larger one.
fn belongs(large: &Part, small: &Part, cells: &Cells) -> bool {
    let (a, b) = (large.fragment.class, small.fragment.class);
    let is_guest = b == Class::Pillow && matches!(a, Class::Bed | Class::Sofa | Class::Chair);
    if !is_guest && !confusable(a, b) || are_separate_units(large, small) || are_far_apart(large, small) {
        return false;
    }
    let contact = Contact::of(large, small, cells);
    if is_guest {
        return contact.inside >= INSIDE_FRACTION || contact.beside >= TOUCH_FRACTION;
    }
    let alone = fit_alone(small);
    let is_plausible = || plausible(large, small, cells);
    // A plausible object by itself, like a stool before a sofa, needs a longer common border.
    let ease = if a == b || alone < 0.5 { 0.2 } else { 1.0 };
    let grown_together = is_solid(a) && is_solid(b) && contact.beside >= ease * TOUCH_FRACTION;
    let is_of_top = || is_top(a) && is_top(b) && (a != b || alone < 0.9) && one_top(large, small, cells);
    if contact.is_within([a, b], ease) || grown_together || is_of_top() {
        return is_plausible();
    }
    a == b && is_plausible() && is_gap_closed(large, small, cells)
}

fn is_worktop(part: &Part) -> bool {
    part.fragment.class == Class::Counter && part.bounds.bottom_m() > WORKTOP_M
}

/// Returns whether the parts are a worktop and storage below it, or storage of which one is a unit.
fn are_separate_units(large: &Part, small: &Part) -> bool {
    let (a, b) = (large.fragment.class, small.fragment.class);
    let is_unit = large.fragment.is_unit || small.fragment.is_unit;
    // A worktop lies on units and is none of them.
    is_storage(b) && is_worktop(large)
        || is_storage(a) && is_worktop(small)
        || is_storage(a) && is_storage(b) && is_unit
}

/// Returns whether the boxes are so far apart that the parts are unrelated.
fn are_far_apart(large: &Part, small: &Part) -> bool {
    let between = (large.bounds.centre_m[0] - small.bounds.centre_m[0])
        .hypot(large.bounds.centre_m[1] - small.bounds.centre_m[1]);
    let reach = |part: &Part| part.bounds.size_m[0].hypot(part.bounds.size_m[1]) / 2.0;
    between > reach(large) + reach(small) + BOARDS_M
}

/// Fractions of the smaller part's cells.
struct Contact {
    /// In the box of the larger part.
    inside: f64,
    /// Adjacent to cells of the larger part.
    beside: f64,
}

impl Contact {
    fn of(large: &Part, small: &Part, cells: &Cells) -> Contact {
        let count = small.places.len() as f64;
        let touches =
            |cell: &u32| cells.around(*cell).any(|other| large.fragment.cells.binary_search(&other).is_ok());
        Contact {
            inside: small.places.iter().filter(|p| large.bounds.holds(p, GROW_M)).count() as f64 / count,
            beside: small.fragment.cells.iter().filter(|cell| touches(cell)).count() as f64 / count,
        }
    }

    /// Returns whether the smaller part of these classes lies within the larger one and is a part of it.
    fn is_within(&self, [a, b]: [Class; 2], ease: f64) -> bool {
        // Storage overlapping storage is one object: nothing else fits inside a wardrobe.
        let stored = is_storage(a) && is_storage(b);
        // Appliances are built into rows of units.
        let built_in =
            (is_appliance(b) || b == Class::Sink) && (is_storage(a) || a == Class::Counter) && ease == 1.0;
        self.inside >= INSIDE_FRACTION && !built_in && (ease < 1.0 || stored || self.beside >= TOUCH_FRACTION)
    }
}

/// Returns how well a part by itself fits its class's size.
fn fit_alone(part: &Part) -> f64 {
    let class = part.fragment.class;
    let [long_m, short_m, _] = part.bounds.size_m;
    let short_m = if is_front(&part.bounds, class) { APPLIANCE_M } else { short_m };
    kind(class).map_or(0.0, |kind| kind.fit(long_m, short_m, part.bounds.top_m()))
}

/// Returns whether the gap between two parts of one class is one within an object.
fn is_gap_closed(large: &Part, small: &Part, cells: &Cells) -> bool {
    let class = large.fragment.class;
    if stack_gap_m(class).is_some_and(|gap_m| stacked(large, small, gap_m)) {
        return true;
    }
    if is_worktop(large) && is_worktop(small) {
        return in_line(large, small, cells) && gap(large, small, BUILT_IN_M).is_some();
    }
    if is_appliance(class) {
        // No wall is inside an appliance, whatever a patch of it is called.
        return gap(large, small, BOARDS_M).is_some();
    }
    let gap_m = if matches!(class, Class::Shelf | Class::Lamp) { BOARDS_M } else { GAP_M };
    gap(large, small, gap_m).is_some_and(|(p, q)| is_open(&p, &q, cells))
}

/// Returns the box around both parts.
fn union(large: &Part, small: &Part, cells: &Cells) -> Option<UprightBox> {
    let both: Vec<[f64; 3]> = large.places.iter().chain(&small.places).copied().collect();
    cells.fit_box(&both)
}

/// Returns whether both together fit the class's size about as well as the larger one alone.
fn plausible(large: &Part, small: &Part, cells: &Cells) -> bool {
    let Some(kind) = kind(large.fragment.class) else { return false };
    let Some(union) = union(large, small, cells) else { return false };
    let fit = |bounds: &UprightBox| kind.fit(bounds.size_m[0], bounds.size_m[1], bounds.top_m());
    fit(&union) >= 0.9 * fit(&large.bounds)
}

fn is_top(class: Class) -> bool {
    matches!(class, Class::Table | Class::Desk)
}

/// Returns whether both are parts of one table: their tops touch at one height and make one rectangle.
fn one_top(large: &Part, small: &Part, cells: &Cells) -> bool {
    const STEP_M: f64 = 0.05;
    const TOUCH_M: f64 = 0.13;
    /// Largest area of both in one rectangle, as a multiple of their own.
    const MAX_UNION_RATIO: f64 = 1.2;
    if (large.bounds.top_m() - small.bounds.top_m()).abs() > STEP_M || gap(large, small, TOUCH_M).is_none() {
        return false;
    }
    let own_m2 = large.bounds.area_m2() + small.bounds.area_m2();
    union(large, small, cells).is_some_and(|union| union.area_m2() <= MAX_UNION_RATIO * own_m2)
}

/// Returns how far apart the parts of an object may be, one above the other: a lamp's shade and foot, a toilet and its
/// plate on the wall.
fn stack_gap_m(class: Class) -> Option<f64> {
    match class {
        Class::Lamp => Some(1.6),
        Class::Toilet => Some(0.7),
        _ => None,
    }
}

/// Returns whether one part is above or below the other.
fn stacked(large: &Part, small: &Part, gap_m: f64) -> bool {
    const BESIDE_M: f64 = 0.15;
    let [x, y, _] = small.bounds.centre_m;
    let [along, across] = large.bounds.local(x, y);
    let is_over = along.abs() <= large.bounds.size_m[0] / 2.0 + BESIDE_M
        && across.abs() <= large.bounds.size_m[1] / 2.0 + BESIDE_M;
    let off_m =
        (small.bounds.bottom_m() - large.bounds.top_m()).max(large.bounds.bottom_m() - small.bounds.top_m());
    is_over && off_m <= gap_m
}

/// Returns whether both worktops are as deep together as the deeper one.
fn in_line(large: &Part, small: &Part, cells: &Cells) -> bool {
    const DEEPER_M: f64 = 0.1;
    let deep_m = large.bounds.size_m[1].max(small.bounds.size_m[1]);
    union(large, small, cells).is_some_and(|union| union.size_m[1] <= deep_m + DEEPER_M)
}

/// Returns the parts' nearest cells; none if they are further apart than `gap_m`.
fn gap(large: &Part, small: &Part, gap_m: f64) -> Option<([f64; 3], [f64; 3])> {
    let mut nearest = (gap_m * gap_m, None);
    for p in small.places.iter().filter(|p| large.bounds.holds(p, gap_m)) {
        for q in &large.places {
            let apart = (0..3).map(|axis| (p[axis] - q[axis]).powi(2)).sum::<f64>();
            if apart < nearest.0 {
                nearest = (apart, Some((*p, *q)));
            }
        }
    }
    nearest.1
}

/// Returns whether no wall is between two places.
fn is_open(p: &[f64; 3], q: &[f64; 3], cells: &Cells) -> bool {
    let at = |t: f64| [0, 1, 2].map(|axis| p[axis] + t * (q[axis] - p[axis]));
    let class = |t: f64| cells.at(&at(t)).and_then(|cell| cells.class(cell));
    ![0.25, 0.5, 0.75].into_iter().any(|t| class(t) == Some(Class::Wall))
}
