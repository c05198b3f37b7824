//! Keeps objects out of each other's space.

use super::Found;
use super::fit::UprightBox;
use super::kind::confusable;
use crate::map_point::MapPoint;
use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, PI};
use viola_geometry::taxonomy::Class;

/// Largest overlap of two objects that stand on the floor, as a fraction of the smaller footprint.
const MOST_SHARED: f64 = 0.2;
/// The resolved overlap: less than the largest one, so that rounding does not matter.
const AIM: f64 = 0.18;
/// An object whose underside is below this stands on the floor.
const STANDS_BELOW_M: f64 = 0.3;
/// Fraction of an object's points that may be cut off by trimming its box.
const MOST_CUT: f64 = 0.1;
/// Two objects of which one is this far inside the other in space are one object seen twice.
const SAME_SHARE: f64 = 0.5;

/// Returns whether a box stands on the floor.
fn stands(bounds: &UprightBox) -> bool {
    bounds.bottom_m() < STANDS_BELOW_M
}

/// Returns the shared footprint as a fraction of the smaller one.
fn shared(a: &UprightBox, b: &UprightBox) -> f64 {
    let area = |bounds: &UprightBox| bounds.size_m[0] * bounds.size_m[1];
    a.shared_m2(b) / area(a).min(area(b)).max(1e-9)
}

/// Returns the shared volume as a fraction of the smaller one.
fn shared_in_space(a: &UprightBox, b: &UprightBox) -> f64 {
    let height = (a.top_m().min(b.top_m()) - a.bottom_m().max(b.bottom_m())).max(0.0);
    a.shared_m2(b) * height / a.volume_m3().min(b.volume_m3()).max(1e-9)
}

/// Returns whether one of two objects may be in the footprint of the other: a chair is pushed under a table, a worktop
/// lies on cabinets, and appliances are built into them.
fn may_share(a: Class, b: Class) -> bool {
    use Class::*;
    let within = |inner: Class, outer: Class| match inner {
        Chair => matches!(outer, Table | Desk | Counter),
        Sink => matches!(outer, Counter | Cabinet | Table),
        Stove | WashingMachine => matches!(outer, Counter | Cabinet),
        Counter => outer == Cabinet,
        _ => false,
    };
    within(a, b) || within(b, a)
}

/// Returns whether two objects cannot both be where they are.
fn conflicts(a: (Class, &UprightBox), b: (Class, &UprightBox)) -> bool {
    if may_share(a.0, b.0) {
        return false;
    }
    if stands(a.1) && stands(b.1) {
        return shared(a.1, b.1) > MOST_SHARED;
    }
    shared_in_space(a.1, b.1) > SAME_SHARE
}

/// An object whose box may be trimmed.
struct Candidate {
    found: Found,
    bounds: UprightBox,
    /// Its points.
    places: Vec<[f64; 3]>,
}

impl Candidate {
    fn in_way_of(&self, bounds: &UprightBox, other: &Candidate, others: &UprightBox) -> bool {
        conflicts((self.found.object.class, bounds), (other.found.object.class, others))
            && !self.surrounds(other, others)
            && !other.surrounds(self, bounds)
    }

    /// Returns whether this is a corner sofa around a low table: the table stands in its box, but not on its seats.
    fn surrounds(&self, inner: &Candidate, bounds: &UprightBox) -> bool {
        /// Floor between a table and the seats; seats that are labelled as a table have none.
        const AROUND_M: f64 = 0.1;
        const CELL_M: f64 = 0.1;
        if (self.found.object.class, inner.found.object.class) != (Class::Sofa, Class::Table) {
            return false;
        }
        let sides_m = [0, 1].map(|axis| bounds.size_m[axis] + 2.0 * AROUND_M);
        let cell = |at: &[f64; 3]| {
            let local = bounds.local(at[0], at[1]);
            let is_inside = (0..2).all(|axis| 2.0 * local[axis].abs() <= sides_m[axis]);
            is_inside.then(|| local.map(|m| (m / CELL_M).floor() as i32))
        };
        let seats: BTreeSet<[i32; 2]> = self.places.iter().filter_map(cell).collect();
        seats.len() as f64 * CELL_M * CELL_M <= MOST_SHARED * sides_m[0] * sides_m[1]
    }
}

/// Keeps the most confident objects. A less confident one that overlaps them is trimmed if that costs few of its
/// points. Otherwise it is left out; if it is a part of the same object, it gives its points to that object.
pub fn resolve(found: Vec<Found>, points: &[MapPoint]) -> Vec<Found> {
    let candidate = |found: Found| {
        let place = |member: &u32| points[*member as usize].point.position_m.map(f64::from);
        let places = found.members.iter().map(place).collect();
        Candidate { bounds: found.object.bounds(), places, found }
    };
    let mut candidates: Vec<Candidate> = found.into_iter().map(candidate).collect();
    candidates.sort_by(|a, b| {
        let (a, b) = (&a.found, &b.found);
        // Two objects without a common point have other first points.
        b.object.confidence.total_cmp(&a.object.confidence).then(a.members.first().cmp(&b.members.first()))
    });
    let mut kept: Vec<Candidate> = Vec::new();
    for candidate in candidates {
        match placed(&kept, &candidate) {
            Ok((hosts, bounds)) => {
                kept.iter_mut().zip(hosts).for_each(|(host, bounds)| host.bounds = bounds);
                kept.push(Candidate { bounds, ..candidate });
            }
            Err(at) => {
                let host = &mut kept[at];
                let is_part = confusable(host.found.object.class, candidate.found.object.class)
                    && shared_in_space(&host.bounds, &candidate.bounds) > SAME_SHARE;
                if is_part {
                    host.places.extend(candidate.places);
                    host.found.members.extend(candidate.found.members);
                    host.found.members.sort_unstable();
                    host.found.object.points = host.found.members.len();
                }
            }
        }
    }
    let finished = |Candidate { mut found, bounds, .. }: Candidate| {
        let object = &mut found.object;
        (object.centre_m, object.size_m) = (bounds.centre_m, bounds.size_m);
        // The length of a trimmed box may have become less than its width.
        if object.size_m[0] < object.size_m[1] {
            object.size_m.swap(0, 1);
            object.yaw_rad = (object.yaw_rad + FRAC_PI_2) % PI;
        }
        found
    };
    kept.into_iter().map(finished).collect()
}

/// Returns the boxes of the kept objects and of the candidate, trimmed so that none conflict; the number of the kept
/// object that is in the way if that is not possible.
fn placed(kept: &[Candidate], candidate: &Candidate) -> Result<(Vec<UprightBox>, UprightBox), usize> {
    let mut hosts: Vec<UprightBox> = kept.iter().map(|host| host.bounds).collect();
    let mut bounds = candidate.bounds;
    let in_way =
        |host: &Candidate, at: &UprightBox, bounds: &UprightBox| host.in_way_of(at, candidate, bounds);
    let mut changed = Vec::new();
    for (i, host) in kept.iter().enumerate() {
        if !in_way(host, &hosts[i], &bounds) {
            continue;
        }
        let of_candidate = trimmed(&candidate.places, &bounds, &hosts[i]);
        let of_host = trimmed(&host.places, &hosts[i], &bounds);
        match (of_candidate, of_host) {
            (Some((lost, smaller)), other) if other.is_none_or(|(others, _)| lost <= others) => {
                bounds = smaller
            }
            (_, Some((_, smaller))) => {
                hosts[i] = smaller;
                changed.push(i);
            }
            _ => return Err(i),
        }
    }
    // A smaller box shares more of itself with the others.
    let again = |i: usize| in_way(&kept[i], &hosts[i], &bounds);
    let between =
        |i: usize| (0..kept.len()).any(|j| j != i && kept[i].in_way_of(&hosts[i], &kept[j], &hosts[j]));
    match (0..kept.len()).find(|i| again(*i) || (changed.contains(i) && between(*i))) {
        Some(i) => Err(i),
        None => Ok((hosts, bounds)),
    }
}

/// Returns the box of an object with one side moved so that it overlaps `other` by at most [`AIM`], and the
/// fraction of the points that are outside of it then. None if more than [`MOST_CUT`] would be.
fn trimmed(places: &[[f64; 3]], of: &UprightBox, other: &UprightBox) -> Option<(f64, UprightBox)> {
    const STEP_M: f64 = 0.03;
    let sides = (0..4).filter_map(|side| {
        let axis = 1 - side % 2;
        let most = (0.5 * of.size_m[axis] / STEP_M) as usize;
        let cut = |steps: usize| {
            let mut bounds = *of;
            move_side(&mut bounds, side, -STEP_M * steps as f64);
            bounds
        };
        let bounds = (1..=most).map(cut).find(|bounds| shared(bounds, other) <= AIM)?;
        let outside = places.iter().filter(|at| !bounds.holds(at, 0.02)).count();
        let before = places.iter().filter(|at| !of.holds(at, 0.02)).count();
        let lost = outside.saturating_sub(before) as f64 / places.len().max(1) as f64;
        (lost <= MOST_CUT).then_some((lost, bounds))
    });
    sides.min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Moves one side of a box outwards. Sides 0 and 2 bound its width, 1 and 3 its length.
fn move_side(bounds: &mut UprightBox, side: usize, by_m: f64) {
    let axis = 1 - side % 2;
    let by_m = by_m.max(0.01 - bounds.size_m[axis]);
    let sign = if side == 1 || side == 2 { 1.0 } else { -1.0 };
    let (s, c) = bounds.yaw_rad.sin_cos();
    let outward = if axis == 0 { [c, s] } else { [-s, c] };
    bounds.size_m[axis] += by_m;
    for (centre, outward) in bounds.centre_m.iter_mut().zip(outward) {
        *centre += sign * outward * by_m / 2.0;
    }
}

#[cfg(test)]
mod tests {
    use super::super::Object;
    use super::*;
    use viola_reconstruct::{CloudPoint, Label};

    /// An object filled with points 10 cm apart.
    fn object(class: Class, centre_m: [f64; 3], size_m: [f64; 3], confidence: f64) -> (Found, Vec<MapPoint>) {
        let bounds = UprightBox { centre_m, size_m, yaw_rad: 0.0 };
        let count = size_m.map(|side| (side / 0.1).round() as usize);
        let place = |i: usize| {
            let at = [i % count[0], i / count[0] % count[1], i / count[0] / count[1]];
            [0, 1, 2].map(|axis| centre_m[axis] - size_m[axis] / 2.0 + (at[axis] as f64 + 0.5) * 0.1)
        };
        let point = |i: usize| {
            let position_m = place(i).map(|c| c as f32);
            let (normal, color, label) = ([0.0, 0.0, 1.0], [9; 3], Label::NONE);
            MapPoint { point: CloudPoint { position_m, normal, color, label, weight: 9 }, clip: 0 }
        };
        let points: Vec<MapPoint> = (0..count.iter().product()).map(point).collect();
        let object = Object {
            id: String::new(),
            class,
            confidence,
            centre_m: bounds.centre_m,
            size_m: bounds.size_m,
            yaw_rad: bounds.yaw_rad,
            room: None,
            points: points.len(),
            clips: vec![0],
            samples: Vec::new(),
        };
        (Found { object, members: (0..points.len() as u32).collect() }, points)
    }

    fn both_resolved(a: (Found, Vec<MapPoint>), b: (Found, Vec<MapPoint>)) -> Vec<Found> {
        let (mut points, mut second) = (a.1, b.0);
        second.members.iter_mut().for_each(|member| *member += points.len() as u32);
        points.extend(b.1);
        resolve(vec![second, a.0], &points)
    }

    #[test]
    fn only_things_that_belong_together_share_their_space() {
        use Class::*;
        let table = ([0.0, 0.0, 0.375], [1.6, 0.9, 0.75]);
        let counter = ([0.0, 0.0, 0.45], [2.4, 0.6, 0.9]);
        for (class, host, other, at, is_conflict) in [
            (Table, table, Chair, ([0.0, 0.4, 0.45], [0.5, 0.5, 0.9]), false),
            (Table, table, Sofa, ([0.0, 0.4, 0.45], [2.0, 0.9, 0.9]), true),
            (Table, table, Table, ([0.1, 0.0, 0.25], [1.0, 0.6, 0.5]), true),
            // Beside it, and a television on it.
            (Table, table, Sofa, ([0.0, 1.0, 0.45], [2.0, 0.9, 0.9]), false),
            (Table, table, Television, ([0.0, 0.0, 1.1], [1.0, 0.1, 0.6]), false),
            (Counter, counter, Sink, ([0.5, 0.0, 0.85], [0.6, 0.45, 0.2]), false),
            (Counter, counter, Stove, ([-0.5, 0.0, 0.45], [0.6, 0.58, 0.9]), false),
            (
                Counter,
                ([0.0, 0.0, 0.88], [2.4, 0.6, 0.04]),
                Cabinet,
                ([0.0, 0.0, 0.45], [2.4, 0.6, 0.9]),
                false,
            ),
            (Counter, counter, Bed, ([-0.5, 0.0, 0.45], [0.6, 0.58, 0.9]), true),
            // A wall unit above the run.
            (Counter, counter, Cabinet, ([0.0, 0.1, 1.8], [2.4, 0.35, 0.7]), false),
        ] {
            let (a, b) = (object(class, host.0, host.1, 0.9), object(other, at.0, at.1, 0.8));
            let (of_a, of_b) = (a.0.object.bounds(), b.0.object.bounds());
            let both = [conflicts((class, &of_a), (other, &of_b)), conflicts((other, &of_b), (class, &of_a))];
            assert_eq!(both, [is_conflict; 2], "{class:?} {other:?} {at:?}");
            let kept = both_resolved(a, b);
            assert_eq!(kept[0].object.class, class);
            let host = kept[0].object.bounds();
            let in_way = |f: &Found| conflicts((f.object.class, &f.object.bounds()), (class, &host));
            assert!(!kept.iter().skip(1).any(in_way));
        }
    }

    #[test]
    fn a_box_that_is_too_large_is_trimmed() {
        let bed = object(Class::Bed, [0.0, 0.0, 0.3], [2.0, 1.6, 0.6], 0.9);
        // A stray point stretches the box of the nightstand over the bed.
        let mut stand = object(Class::Cabinet, [0.9, 1.05, 0.3], [0.5, 0.4, 0.6], 0.8);
        (stand.0.object.centre_m, stand.0.object.size_m) = ([0.9, 0.85, 0.3], [0.5, 0.8, 0.6]);
        let kept = both_resolved(bed, stand);
        assert_eq!(kept.len(), 2);
        let [bed, stand] = [0, 1].map(|i| kept[i].object.bounds());
        assert!(shared(&bed, &stand) <= MOST_SHARED);
        let [top, long_m] = [stand.centre_m[1] + stand.size_m[1] / 2.0, stand.size_m[0]];
        assert!(long_m >= stand.size_m[1] && (0.4..=0.8).contains(&long_m) && top > 0.9, "{stand:?}");
    }

    /// A corner sofa without its recess.
    fn corner_sofa() -> (Found, Vec<MapPoint>) {
        let (mut found, points) = object(Class::Sofa, [0.0, 0.0, 0.4], [2.4, 2.4, 0.8], 0.6);
        let is_seat = |member: &u32| {
            let [x, y, _] = points[*member as usize].point.position_m;
            x < -0.4 || y < -0.4
        };
        found.members.retain(is_seat);
        (found, points)
    }

    #[test]
    fn a_table_may_stand_before_a_corner_sofa_but_not_on_its_seats() {
        for (centre_m, size_m, is_kept) in [
            ([0.4, 0.4, 0.2], [0.8, 0.6, 0.4], true),
            ([-0.8, 0.0, 0.2], [0.6, 0.6, 0.4], false),
            ([-0.2, 0.4, 0.2], [0.8, 0.6, 0.4], false),
        ] {
            let table = object(Class::Table, centre_m, size_m, 0.9);
            let kept = both_resolved(table, corner_sofa());
            let classes: Vec<Class> = kept.iter().map(|found| found.object.class).collect();
            assert_eq!(classes.contains(&Class::Sofa), is_kept, "{centre_m:?} {classes:?}");
        }
    }
}
